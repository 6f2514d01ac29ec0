# SPDX-License-Identifier: MIT
"""The tab of switches: what is drawn beside the body."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import viser

from .controls import parse_numbers
from .scene_view import HINTS, SWITCHES, SceneView
from .status import Announcements


class ShowTab:
    """One switch for each of SWITCHES. ``show`` does what a click on them does, for lessons and keys. on_shown(name) is
    told of what is switched on."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        view: SceneView,
        announcements: Announcements,
        on_shown: Callable[[str], None],
    ) -> None:
        self._switches: dict[str, Any] = {}
        with tabs.add_tab("Show"):
            for name, shown in SWITCHES.items():
                self._switches[name] = switch = gui.add_checkbox(name, shown, hint=HINTS.get(name))

                @switch.on_update
                async def _(_: viser.GuiEvent[Any], name: str = name, switch: Any = switch) -> None:
                    view.switch(name, switch.value)
                    if switch.value:
                        on_shown(name)

            point = gui.add_text(
                "Point of the path", "", hint="x y z in mesh coordinates; empty: the vertex farthest from the COM"
            )
            follow = gui.add_checkbox(
                "Keep the body in view", True, hint="The camera follows it; the grid shows the distance covered"
            )
            centre = gui.add_button("Centre on the body")

        @point.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            numbers = parse_numbers(point.value, 3)
            if point.value.strip() and numbers is None:
                announcements.say(f"Point of the path: {point.value[:40]!r}; accepted: three numbers, or nothing")
            else:
                view.trails.point = None if numbers is None else np.array(numbers)

        @follow.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            view.follows = follow.value

        @centre.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            view.centre()

    def show(self, changes: Mapping[str, bool]) -> None:
        """Turn switches on or off, by name."""
        for name, shown in changes.items():
            self._switches[name].value = shown
