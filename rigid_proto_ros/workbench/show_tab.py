# SPDX-License-Identifier: MIT
"""The tab of switches: what is drawn beside the body, light or dark, and the page for a class."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import viser

from ..picture import style

SEE_INTO, CENTRE_OF_MASS = "See into the body", "Centre of mass"

PARTS: dict[str, tuple[str, ...]] = {
    CENTRE_OF_MASS: (CENTRE_OF_MASS,),
    "Principal axes": (style.PRINCIPAL_AXES,),
    "Body axes": (style.BODY_AXES,),
    "Inertia ellipsoid": (style.INERTIA_ELLIPSOID,),
    "Box of equal inertia": (style.INERTIA_BOX,),
    "Bounding box": (style.BOUNDING_BOX,),
    "String": (style.STRING, style.HAND),
    "Line of the string": (style.STRING_LINE,),
    "Forces": (style.LOADS,),
    "Angular momentum L": (style.MOMENTUM,),
    "Angular velocity ω": (style.OMEGA,),
    "Ghost": (style.GHOST_MESH,),
    "Path of the COM": (style.COM_TRAIL,),
    "Path of a point": (style.TRAIL,),
}
"""Parts of the picture by the name of their switch."""

AT_FIRST = ("String", "Forces", "Angular momentum L", "Ghost")


class ShowTab:
    """switch(part, shown) shows a part; see_into(on), dark(on) and for_class(on) do what they say. on_shown(name) is
    told of what is switched on.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        switch: Callable[[str, bool], None],
        see_into: Callable[[bool], None],
        dark: Callable[[bool], None],
        for_class: Callable[[bool], None],
        centre: Callable[[], None],
        on_shown: Callable[[str], None],
    ) -> None:
        self._switch = switch
        self._switches: dict[str, Any] = {}
        with tabs.add_tab("Show"):
            self._class: Any = gui.add_checkbox(
                "Class mode", False, hint="Picture, lesson and three buttons, in large letters; F11 fills the screen"
            )
            self._dark: Any = gui.add_checkbox("Dark", False)
            centred = gui.add_button("Centre on the body")
            self._switches[SEE_INTO] = gui.add_checkbox(SEE_INTO, False)
            for name in PARTS:
                self._switches[name] = gui.add_checkbox(name, name in AT_FIRST)

        for name, box in self._switches.items():

            @box.on_update
            async def _(_: viser.GuiEvent[Any], name: str = name, box: Any = box) -> None:
                self._set(name, box.value, see_into)
                if box.value:
                    on_shown(name)

        @self._dark.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            dark(self._dark.value)

        @self._class.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            for_class(self._class.value)

        @centred.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            centre()

    def _set(self, name: str, shown: bool, see_into: Callable[[bool], None]) -> None:
        if name == SEE_INTO:
            see_into(shown)
        for part in PARTS.get(name, ()):
            self._switch(part, shown)

    def show_for(self, parts: Iterable[str]) -> None:
        """Switch on what a scene needs, by parts or names of switches, and off what it doesn't."""
        wanted = set(parts)
        for name, box in self._switches.items():
            shown = name in AT_FIRST or name in wanted or bool(wanted.intersection(PARTS.get(name, ())))
            if box.value != shown:
                box.value = shown
