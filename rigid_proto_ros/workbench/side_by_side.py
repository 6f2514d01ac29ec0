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
from ..picture.style import BODY_COLOUR, GHOST_COLOUR, css
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
            hint="An L-bracket and its ghost, started alike: one with its own tensor, one with its bounding box's",
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

    def show(
        self, now_s: float, scenario: Scenario, state: State, ghost: np.ndarray | None, began_ns: int | None
    ) -> None:
        """The body's state and its ghost's (13,), None for none, which began where the body was at ``began_ns``; that
        is None for a future that a rewind left.
        """
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
        body_name, ghost_name = names(scenario, began_ns is None)
        legend = f"{_mark(BODY_COLOUR)} {body_name} &emsp; {_mark(GHOST_COLOUR)} {ghost_name}"
        self._legend.content = f'<div style="padding:0.3em 0.9em 0;font-size:0.9em">{legend}</div>'
        now, most = math.degrees(self.angle), math.degrees(self._most)
        what = compared(scenario, state.time_ns, began_ns)
        self._sentence.content = f"{what}: **{now:.0f}° apart**, at most {most:.0f}° so far."


def names(scenario: Scenario, left: bool) -> tuple[str, str]:
    """What body and ghost are called; ``left``: the ghost is a future that a rewind left."""
    if left:
        return "now", "previous motion"
    own, other = str(scenario.parameters.inertia_model), str(scenario.parameters.ghost.inertia_model)
    integrator = str(scenario.parameters.ghost.integrator)
    if integrator and not other:
        return str(scenario.parameters.integrator), integrator
    return f"body: {TITLES.get(own, own)}", f"ghost: {TITLES.get(other, other)}"


def compared(scenario: Scenario, time_ns: int, began_ns: int | None) -> str:
    """In what alone body and ghost differ, and for how long; began_ns as SideBySide.show has it."""
    if began_ns is None:
        return f"The same body from the same state, under different commands. At {time_ns * 1e-9:.1f} s"
    ghost = scenario.parameters.ghost
    if ghost.integrator and not ghost.inertia_model:
        differs = "only the integrator differs"
    elif scenario.parameters.inertia_model_com == "solid":
        differs = "with the same mass; only the tensor differs"
    else:
        differs = "with the same mass; tensor and COM differ"
    if began_ns == 0:
        return f"Started alike, {differs}. After {time_ns * 1e-9:.1f} s"
    return f"Alike at {began_ns * 1e-9:.1f} s, {differs}. {(time_ns - began_ns) * 1e-9:.1f} s later"


def _mark(colour: tuple[int, int, int]) -> str:
    box = "display:inline-block;width:1em;height:1em;border:1px solid #777;vertical-align:-0.1em"
    return f'<span style="{box};background:{css(colour)}"></span>'
