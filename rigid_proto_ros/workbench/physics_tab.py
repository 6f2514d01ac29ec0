# SPDX-License-Identifier: MIT
"""The tab of forces: poke and string, gravity and damping, the start, integrators and the ghost."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import viser

from ..motion.integrators import INTEGRATORS
from .controls import TYPING_S, Controls, log_slider, on_slider, parse_numbers
from .flight import Flight
from .pointer import POKE, PUSH, Tools

GRABBED, COM = "Grabbed point", "Centre of mass"

GRAVITIES = {"off": [0.0, 0.0, 0.0], "Earth's": [0.0, 0.0, -9.81], "Moon's": [0.0, 0.0, -1.62]}

FORCE_DECADES = 2.0
"""Of the force's slider, up and down from the force that suits the body."""

STRONGEST = 1e12
"""[N] More comes from a slip of the finger."""


class PhysicsTab:
    """All of it is parameters, but the tools of the pointer."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        controls: Controls,
        tools: Tools,
        flight: Flight,
        say: Callable[[str], None],
    ) -> None:
        self._gui = gui
        self._controls = controls
        self._tools = tools
        self._flight = flight
        self._say = say
        with tabs.add_tab("Forces"):
            self._poke_folder()
            self._string_folder()
            self._start_folder()
            self._surroundings()

    def _start_folder(self) -> None:
        with self._gui.add_folder("Start, at the next reset"):
            self._controls.numbers("initial.position", "Initial position [m]", 3)
            self._controls.numbers("initial.orientation_xyzw", "Initial attitude x y z w", 4)
            self._controls.numbers("initial.angular_velocity", "Initial spin [rad/s]", 3)
            self._controls.numbers("initial.linear_velocity", "Initial velocity [m/s]", 3)

    def show_force(self) -> None:
        """The poke's force, as it is now, in both of its inputs."""
        force = self._tools.force
        # "2." means what is in force, so it may stay as it is typed.
        if parse_numbers(self._force.value, 1) != [force]:
            self._force.value = f"{force:.4g}"
        place = on_slider(abs(force / self._tools.usual_force), FORCE_DECADES)
        if self._slider.value != place:
            self._slider.value = place

    def _poke_folder(self) -> None:
        gui, tools = self._gui, self._tools
        with gui.add_folder("Poke (click)"):
            click = gui.add_dropdown(
                "Click", (POKE, PUSH), initial_value=POKE, hint="What a click does; shift-click does the other"
            )
            self._force: Any = gui.add_text("Force [N]", "1", hint="Force of a poke; its duration is the next input")
            suits = "Times a force that suits the body's mass and size"
            self._slider: Any = log_slider(gui, "Force ×", FORCE_DECADES, suits)
            self._controls.numbers("poke_duration", "Duration [s]")

        @click.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            tools.click = click.value

        def take(force: float) -> None:
            tools.force = float(f"{force:.9g}")
            self.show_force()

        def complain(text: str) -> None:
            if self._force.value == text:  # else somebody is still typing
                self._say(f"Force: got {text[:40]!r}; accepted: a number, up to {STRONGEST:g} N")
                self.show_force()

        @self._force.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return
            numbers = parse_numbers(self._force.value, 1)
            if numbers is not None and abs(numbers[0]) <= STRONGEST:
                take(numbers[0])
            else:
                asyncio.get_running_loop().call_later(TYPING_S, complain, self._force.value)

        @self._slider.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                take(float(f"{tools.usual_force * 10.0 ** self._slider.value[0]:.3g}"))

    def _string_folder(self) -> None:
        gui, tools, controls = self._gui, self._tools, self._controls
        with gui.add_folder("String (drag)"):
            at = gui.add_dropdown(
                "Pull at", (GRABBED, COM), initial_value=GRABBED, hint="Where the string is tied when you drag"
            )
            hint = "Frequency of the effective mass (string.frequency)"
            strength = gui.add_slider("Strength [rad/s]", 1.0, 40.0, 0.5, tools.frequency, hint=hint)
            hint = "Light and heavy bodies then respond alike"
            scaled = gui.add_checkbox("Same feel for any mass", True, hint=hint)
            controls.numbers("string.stiffness", "Stiffness [N/m]")
            controls.numbers("string.damping_ratio", "Damping ratio")
            controls.numbers("string.rest_length", "Rest length [m]")
            controls.checkbox("string.bilateral", "Pushes too")
            controls.checkbox("string.attached", "Tied from the start")
            controls.numbers("string.attach", "Tied at x y z", 3)
            controls.numbers("string.timeout", "Released after [s]")

        @at.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            tools.at_com = at.value == COM

        for handle in (strength, scaled):

            @handle.on_update
            async def _(event: viser.GuiEvent[Any]) -> None:
                if event.client is not None:
                    tools.frequency = float(strength.value) if scaled.value else 0.0
                    self._flight.set({"string.frequency": tools.frequency})

    def _surroundings(self) -> None:
        gui, controls = self._gui, self._controls
        with gui.add_folder("Physics"):
            controls.checkbox("gyroscopic", "Gyroscopic term ω × Iω")
            controls.numbers("gravity", "Gravity [m/s²]", 3)
            gravity = gui.add_button_group("Gravity is", tuple(GRAVITIES))
            controls.numbers("linear_damping", "Linear damping [N s/m]")
            controls.numbers("angular_damping", "Angular damping [N m s]")
            controls.choice("integrator", "Integrator", tuple(INTEGRATORS))
            controls.numbers("step", "Step [s]")
            controls.numbers("accuracy", "Accuracy [1/s]")
        with gui.add_folder("Ghost beside it", expand_by_default=False):
            controls.choice("ghost.inertia_model", "Its tensor")
            controls.choice("ghost.integrator", "Its integrator")

        @gravity.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            self._flight.set({"gravity": GRAVITIES[gravity.value]})
