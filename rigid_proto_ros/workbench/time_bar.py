# SPDX-License-Identifier: MIT
"""The bar that stays in sight: time, what the body is doing, play, step, reset and speed; and what is said to all."""

from __future__ import annotations

import time
from typing import Any

import viser

from ..scene.scenario import Scenario
from .controls import Controls
from .flight import Flight
from .server import MARK

SPEEDS = {"1/100": 0.01, "1/20": 0.05, "1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "5": 5.0}
"""Simulated seconds per second, as the bar names them."""

PAUSE, PLAY, STEP, RESET = "Pause", "Play", "Step", "Reset"

SOON_S = 0.3
"""[s] What takes no longer isn't said to be waited for."""


class TimeBar:
    """Shared by all pages."""

    def __init__(self, gui: viser.GuiApi, controls: Controls, flight: Flight) -> None:
        self._flight = flight
        with gui.add_folder("Time"):
            self._line = gui.add_html("")
            play = gui.add_button_group("Simulation", (PAUSE, STEP, RESET))
            self.speed = gui.add_dropdown(
                "Speed", tuple(SPEEDS), initial_value="1", hint="Simulated seconds per second (real_time_factor)"
            )
        self._play: Any = play

        @play.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            if play.value == RESET:
                flight.reset()
            elif play.value == STEP:
                flight.look_at_present()
                if flight.paused:
                    flight.step()
                else:
                    flight.pause(True)
            else:
                await self.play_or_pause()

        def shown(values: Any) -> str:
            return next((name for name, f in SPEEDS.items() if f == values["real_time_factor"]), self.speed.value)

        controls.bind(self.speed, shown, lambda name: {"real_time_factor": SPEEDS[name]})
        does = "Pause or resume; after rewinding, continue from there"

        # Browsers send no key that is typed into an input.
        @gui.add_command(does, hotkey="space").on_trigger
        async def _(_: Any) -> None:
            await self.play_or_pause()

    async def play_or_pause(self) -> None:
        """Pause or go on; from the past that is looked at, go on from there."""
        if self._flight.moment_ns is not None:
            await self._flight.go_on_from_here()
        else:
            self._flight.pause(not self._flight.paused)

    def show(self, time_s: float, what: str) -> None:
        """The time that is shown, and what the body is doing."""
        flight = self._flight
        label = PLAY if flight.paused or flight.moment_ns is not None else PAUSE
        if self._play.options[0] != label:
            self._play.options = (label, STEP, RESET)
        content = f'<div class="{MARK}"><b>{time_s:.2f} s</b> <span>{what}</span></div>'
        if self._line.content != content:
            self._line.content = content


def motion_words(scenario: Scenario, loads: int, tied: bool, at_rest: bool, paused: bool) -> str:
    """What the body does. loads: how many act; tied: to a string."""
    setup = scenario.setup
    if paused:
        return "paused"
    if loads:
        words = "a force acts" if loads == 1 else f"{loads} forces act"
    elif tied:
        words = "string attached"
    elif at_rest:
        words = "at rest"
    elif setup.gravity.any():
        words = "free fall"
    else:
        words = "free rotation"
        if setup.integrator.name in ("auto", "free_body") and not (setup.linear_damping or setup.angular_damping):
            words += ", exact"
    return words if setup.gyroscopic else f"{words}, without ω × Iω"


class Announcements:
    """What is said to all browsers."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._busy = ""
        self._since_s = 0.0

    def say(self, text: str) -> None:
        """A line in the corner of all browsers."""
        for client in self._server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=10.0)

    def busy(self, doing: str) -> None:
        """The page is busy with this, or, where it is empty, no longer."""
        if doing != self._busy:
            self._busy, self._since_s = doing, time.monotonic()

    @property
    def waited_for(self) -> str:
        """What takes time, and for how long it has; empty for nothing."""
        since_s = time.monotonic() - self._since_s
        return f"{self._busy} … {since_s:.0f} s" if self._busy and since_s > SOON_S else ""
