# SPDX-License-Identifier: MIT
"""The bar that stays in sight: time, what the body is doing, play, step, reset and speed; and the keys."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import viser

from .controls import Controls
from .flight import Flight
from .page_style import MARK

SPEEDS = {"1/100": 0.01, "1/20": 0.05, "1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "5": 5.0}
"""Simulated seconds per second, as the bar names them."""

PAUSE, PLAY, STEP, RESET = "Pause", "Play", "Step", "Reset"

BACK_S = 1.0
"""[s] That backspace goes back, each time it is pressed."""


class TimeBar:
    """Shared by all pages."""

    def __init__(self, gui: viser.GuiApi, controls: Controls, flight: Flight) -> None:
        self._flight = flight
        with gui.add_folder("Time"):
            self._line = gui.add_html("")
            play = gui.add_button_group("Simulation", (PAUSE, STEP, RESET))
            speed = gui.add_dropdown(
                "Speed", tuple(SPEEDS), initial_value="1", hint="Simulated seconds per second (real_time_factor)"
            )
        self._play: Any = play

        @play.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await {STEP: self.step, RESET: self.reset}.get(play.value, self.play_or_pause)()

        def shown(values: Any) -> str:
            return next((name for name, f in SPEEDS.items() if f == values["real_time_factor"]), speed.value)

        controls.bind(speed, shown, lambda name: {"real_time_factor": SPEEDS[name]})

    async def play_or_pause(self) -> None:
        """Pause or go on; from the past that is looked at, go on from there."""
        if self._flight.moment_ns is not None:
            await self._flight.go_on_from_here()
        else:
            self._flight.pause(not self._flight.paused)

    async def step(self) -> None:
        """One publication period on; pauses first."""
        flight = self._flight
        if flight.moment_ns is not None:
            flight.look_back(-self._period_s)
        elif flight.paused:
            flight.step()
        else:
            flight.pause(True)

    async def step_back(self) -> None:
        """One publication period back."""
        self._flight.look_back(self._period_s)

    async def reset(self) -> None:
        """Time 0."""
        self._flight.reset()

    @property
    def _period_s(self) -> float:
        return max(0.005, 1.0 / float(self._flight.scenario.parameters.publish_rate))

    def show(self, time_s: float, what: str) -> None:
        """The time that is shown, and what the body is doing."""
        flight = self._flight
        label = PLAY if flight.paused or flight.moment_ns is not None else PAUSE
        if self._play.options[0] != label:
            self._play.options = (label, STEP, RESET)
        content = f'<div class="{MARK}"><b>{time_s:.2f} s</b> <span>{what}</span></div>'
        if self._line.content != content:
            self._line.content = content


def add_keys(gui: viser.GuiApi, bar: TimeBar, flight: Flight, centre: Callable[[], None]) -> None:
    """Give all pages the keys, as viser's commands: Ctrl-K lists them. Browsers send no key that is typed into an
    input. Letters W A S D Q E move viser's camera and are left to it.
    """

    async def back() -> None:
        flight.look_back(BACK_S)

    async def now() -> None:
        flight.look_at_present()

    async def centred() -> None:
        centre()

    keys: tuple[tuple[Any, str, Callable[[], Awaitable[None]]], ...] = (
        ("space", "Pause or resume; after rewinding, continue from there", bar.play_or_pause),
        ("arrowright", "One step forward; pauses first", bar.step),
        ("arrowleft", "One step back", bar.step_back),
        ("backspace", f"Rewind {BACK_S:g} s", back),
        ("N", "Return to now after rewinding", now),
        ("R", "Reset", bar.reset),
        ("C", "Centre on the body", centred),
    )
    for hotkey, does, act in keys:

        @gui.add_command(does, hotkey=hotkey).on_trigger
        async def _(_: Any, act: Callable[[], Awaitable[None]] = act) -> None:
            await act()
