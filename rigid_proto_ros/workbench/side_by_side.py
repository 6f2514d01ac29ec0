# SPDX-License-Identifier: MIT
"""Body and ghost compared at the head of the page: which is which, since when they go their own ways, and
how far apart they are.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import viser

from ..motion.state import State
from ..rerun_view.appearance import BODY_COLOUR, GHOST_COLOUR, css
from ..scene.scenario import Scenario
from ..simulation.quantities import attitude_angle
from .tensors import TITLES

SHOWN_S = 0.2
"""[s] Between two numbers: faster ones can't be read."""

START = "True tensor against its box's"


class SideBySide:
    """The button that releases a body and its ghost alike, and what is said of the two. start() does it."""

    def __init__(self, gui: viser.GuiApi, start: Callable[[], Awaitable[None]]) -> None:
        button = gui.add_button(
            START,
            hint="An L-bracket and its ghost, released alike: one with its own tensor, one with its bounding box's",
        )
        self._legend = gui.add_html("", visible=False)
        self._sentence = gui.add_markdown("", visible=False)
        self._due_s = self._most = 0.0
        self.angle: float | None = None

        @button.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await start()

    @property
    def sentence(self) -> str:
        """What is said of the two, empty without a ghost."""
        return self._sentence.content if self._sentence.visible else ""

    def restart(self) -> None:
        """Both begin anew."""
        self._most = self._due_s = 0.0

    def show(self, now_s: float, scenario: Scenario, state: State, ghost: np.ndarray | None, left: bool) -> None:
        """The body's state and its ghost's (13,), None for none; ``left``: the ghost is a future that a rewind left."""
        shown = ghost is not None
        for handle in (self._legend, self._sentence):
            if handle.visible != shown:
                handle.visible = shown
        if ghost is None:
            self.angle = None
            self._most = 0.0
            return
        self.angle = float(attitude_angle(np.array(state.orientation_xyzw), ghost[3:7]))
        self._most = max(self._most, self.angle)
        if now_s < self._due_s:
            return
        self._due_s = now_s + SHOWN_S
        body_name, ghost_name, what = names(scenario, left)
        legend = f"{_mark(BODY_COLOUR)} {body_name} &emsp; {_mark(GHOST_COLOUR)} {ghost_name}"
        self._legend.content = f'<div style="padding:0.3em 0.9em 0;font-size:0.9em">{legend}</div>'
        now, most = math.degrees(self.angle), math.degrees(self._most)
        self._sentence.content = (
            f"{what} After {state.time_ns * 1e-9:.1f} s: **{now:.0f}° apart**, at most {most:.0f}° so far."
        )


def names(scenario: Scenario, left: bool) -> tuple[str, str, str]:
    """What body and ghost are called, and in what alone they differ."""
    if left:
        return "now", "previous motion", "The same body from the same state, under different commands."
    own, other = str(scenario.parameters.inertia_model), str(scenario.parameters.ghost.inertia_model)
    integrator = str(scenario.parameters.ghost.integrator)
    if integrator and not other:
        return str(scenario.parameters.integrator), integrator, "Released alike; only the integrator differs."
    alike = "only the tensor differs" if scenario.parameters.inertia_model_com == "solid" else "tensor and COM differ"
    return (
        f"body: {TITLES.get(own, own)}",
        f"ghost: {TITLES.get(other, other)}",
        f"Released alike, with one mass; {alike}.",
    )


def _mark(colour: tuple[int, int, int]) -> str:
    box = "display:inline-block;width:1em;height:1em;border:1px solid #777;vertical-align:-0.1em"
    return f'<span style="{box};background:{css(colour)}"></span>'
