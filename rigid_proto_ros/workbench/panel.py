# SPDX-License-Identifier: MIT
"""The panel beside the picture: time, pointer, string and physics. All inputs are shared: every page shows the same."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

import viser

from ..motion.integrators import INTEGRATORS
from .controls import TYPING_S, Controls, log_slider, on_slider, parse_numbers
from .node_control import NodeControl
from .past_view import PastView
from .pointer import POKE, PUSH, Tools
from .situation import SituationControl
from .status import Announcements

SPEEDS = {"1/100": 0.01, "1/20": 0.05, "1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "5": 5.0}
"""Simulated seconds per second, as the panel names them."""

GRABBED, COM = "Grabbed point", "Centre of mass"
PAUSE, GO_ON, STEP, RESET = "Pause", "Go on", "Step", "Reset"
EARTH = [0.0, 0.0, -9.81]

FORCE_DECADES = 2.0
"""Of the force's slider, up and down from the force that suits the body."""

STRONGEST = 1e12
"""[N] More comes from a slip of the finger."""

HELP = """
**Drag** the body: a string ties it to the pointer. **Click**: poke along the view; **shift-click**: push inward.
Beside it, drag to turn the view; wheel or two fingers zoom. **?** lists the keys.
"""


class Panel:
    """Play and physics: the tabs that need nothing but parameters, services and the pointer's tools."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        controls: Controls,
        tools: Tools,
        node: NodeControl,
        past_view: PastView,
        situations: SituationControl,
        announcements: Announcements,
    ) -> None:
        self._gui = gui
        self._controls = controls
        self._tools = tools
        self._node = node
        self._past_view = past_view
        self._situations = situations
        self._announcements = announcements
        self.play_tab = tabs.add_tab("Play")
        with self.play_tab:
            self._gui.add_markdown(HELP, order=-2.0)
            self._time_folder()
            self._start_folder()
            self._poke_folder()
            self._string_folder()
        with tabs.add_tab("Physics"):
            self._physics()

    def show_state(self, paused: bool) -> None:
        """Whether simulated time stands still."""
        text = "The simulation is paused." if paused else ""
        if self._running.content != text:
            self._running.content = text

    def show_force(self) -> None:
        """The poke's force, as it is now, in all its inputs."""
        force = self._tools.force
        times = force / self._tools.usual_force
        for box, text in ((self._force, f"{force:.4g}"), (self._times, f"{times:.4g}")):
            # "2." means what is in force, so it may stay as it is typed.
            if parse_numbers(box.value, 1) != parse_numbers(text, 1):
                box.value = text
        place = on_slider(abs(times), FORCE_DECADES)
        if self._slider.value != place:
            self._slider.value = place

    # Play

    def _time_folder(self) -> None:
        gui, node, past_view = self._gui, self._node, self._past_view
        with gui.add_folder("Time"):
            buttons = gui.add_button_group("Simulation", (PAUSE, GO_ON, STEP, RESET), hint="~/pause, ~/step, ~/reset")
            self._running = gui.add_markdown("")
            speed = gui.add_dropdown(
                "Speed", tuple(SPEEDS), initial_value="1", hint="Simulated seconds per second (real_time_factor)"
            )

        @buttons.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            pressed = buttons.value
            if past_view.moment_ns is not None and pressed == GO_ON:
                await self._situations.go_on_from_here()
            elif past_view.moment_ns is not None and pressed == STEP:
                past_view.step(-1)
            elif pressed in (PAUSE, GO_ON):
                node.pause(pressed == PAUSE)
            elif pressed == RESET:
                past_view.reset()
            else:
                node.call("step")

        def shown(values: Mapping[str, Any]) -> str:
            return next((name for name, factor in SPEEDS.items() if factor == values["real_time_factor"]), speed.value)

        self._controls.bind(speed, shown, lambda name: {"real_time_factor": SPEEDS[name]})

    def _start_folder(self) -> None:
        with self._gui.add_folder("Start, at the next reset"):
            self._controls.vector("initial.position", "Initial position [m]", 3)
            self._controls.vector("initial.orientation_xyzw", "Initial attitude x y z w", 4)
            self._controls.vector("initial.angular_velocity", "Initial spin [rad/s]", 3)
            self._controls.vector("initial.linear_velocity", "Initial velocity [m/s]", 3)

    def _poke_folder(self) -> None:
        gui, tools = self._gui, self._tools
        with gui.add_folder("Poke (click)"):
            click = gui.add_dropdown(
                "Click", (POKE, PUSH), initial_value=POKE, hint="What a click does; shift-click does the other"
            )
            self._force: Any = gui.add_text("Force [N]", "1", hint="Force of a poke; its duration is the next input")
            suits = "Times a force that suits the body's mass and size"
            times: Any = gui.add_text("Force ×", "1", hint=suits)
            slider: Any = log_slider(gui, FORCE_DECADES, suits)
            self._times, self._slider = times, slider
            self._controls.number("poke_duration", "Duration [s]")

        @click.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            tools.click = click.value

        def take(force: float) -> None:
            tools.force = float(f"{force:.9g}")
            self.show_force()

        def typed(box: viser.GuiInputHandle[Any], unit: Callable[[], float]) -> None:
            def complain(text: str) -> None:
                if box.value == text:  # else somebody is still typing
                    self._announcements.say(
                        f"{box.label}: got {text[:40]!r}; accepted: a number, up to {STRONGEST:g} N"
                    )
                    self.show_force()

            @box.on_update
            async def _(event: viser.GuiEvent[Any]) -> None:
                if event.client is None:
                    return
                numbers = parse_numbers(box.value, 1)
                if numbers is not None and abs(numbers[0] * unit()) <= STRONGEST:
                    take(numbers[0] * unit())
                else:
                    asyncio.get_running_loop().call_later(TYPING_S, complain, box.value)

        typed(self._force, lambda: 1.0)
        typed(times, lambda: tools.usual_force)

        @slider.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                take(float(f"{tools.usual_force * 10.0 ** slider.value[0]:.3g}"))

    def _string_folder(self) -> None:
        gui, tools, controls = self._gui, self._tools, self._controls
        with gui.add_folder("String (drag)"):
            at = gui.add_dropdown(
                "Pull at", (GRABBED, COM), initial_value=GRABBED, hint="Where the string is tied when you drag"
            )
            strength = gui.add_slider(
                "Strength [rad/s]",
                1.0,
                40.0,
                0.5,
                tools.frequency,
                hint="Frequency of the effective mass (string.frequency)",
            )
            scaled = gui.add_checkbox(
                "Scaled by effective mass", True, hint="Light and heavy bodies then respond alike"
            )
            controls.number("string.stiffness", "Stiffness [N/m]")
            controls.slider("string.damping_ratio", "Damping ratio", 0.0, 2.0, 0.05)
            controls.number("string.rest_length", "Rest length [m]")
            controls.checkbox("string.bilateral", "Pushes too")
            controls.checkbox("string.attached", "Tied from the start")
            controls.vector("string.attach", "Tied at x y z", 3)
            controls.number("string.timeout", "Released after [s]")

        def take() -> None:
            tools.frequency = float(strength.value) if scaled.value else 0.0
            self._node.set({"string.frequency": tools.frequency})

        @at.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            tools.at_com = at.value == COM

        for handle in (strength, scaled):

            @handle.on_update
            async def _(event: viser.GuiEvent[Any]) -> None:
                if event.client is not None:
                    take()

    # Physics

    def _physics(self) -> None:
        gui, controls = self._gui, self._controls
        controls.checkbox("gyroscopic", "Gyroscopic term ω × Iω")
        controls.vector("gravity", "Gravity [m/s²]", 3)
        gravity = gui.add_button_group("Gravity is", ("off", "Earth's", "Moon's"))
        controls.number("linear_damping", "Linear damping [N s/m]")
        controls.number("angular_damping", "Angular damping [N m s]")
        controls.choice("integrator", "Integrator", tuple(INTEGRATORS))
        controls.number("step", "Step [s]")
        controls.number("accuracy", "Accuracy [1/s]")
        with gui.add_folder("Ghost beside it", expand_by_default=False):
            controls.choice("ghost.inertia_model", "Its tensor")
            controls.choice("ghost.integrator", "Its integrator")

        @gravity.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            down = {"off": [0.0, 0.0, 0.0], "Earth's": EARTH, "Moon's": [0.0, 0.0, -1.62]}
            self._node.set({"gravity": down[gravity.value]})
