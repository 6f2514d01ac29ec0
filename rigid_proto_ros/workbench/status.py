# SPDX-License-Identifier: MIT
"""What the body is doing and what went wrong, in plain words."""

from __future__ import annotations

import time
from collections.abc import Mapping

import viser

from ..scene.scenario import Scenario

SHOWN_S = 8.0
"""[s] That a trouble is shown: long enough to be read."""

SLOW = 0.1
"""Share of a second of real time that may be lost before it is worth a word: eyes don't see less."""

EXACT = ("auto", "free_body")


def motion_words(scenario: Scenario, tracks: Mapping[str, str], loads: int) -> str:
    """What the body does: tracks: the last status of each, as observers hear them; loads: how many act."""
    setup = scenario.setup
    motion = tracks.get("motion", "")
    if motion == "paused":
        return "paused"
    string = tracks.get("string", "")
    if loads:
        words = "a force acts" if loads == 1 else f"{loads} forces act"
    elif string in ("taut", "slack"):
        words = "string attached" if string == "taut" else "string slack"
    elif motion == "sleeping":
        return "at rest"
    elif setup.linear_damping or setup.angular_damping:
        words = "slowing down"
    elif setup.gravity.any():
        words = "free fall"
    else:
        words = "free rotation, exact" if setup.integrator.name in EXACT else "free rotation"
    if setup.integrator.name not in EXACT:
        words += f", {setup.integrator.name}"
    return words if setup.gyroscopic else f"{words}, without ω × Iω"


class Announcements:
    """What is said to all browsers. busy: what takes time, and since when; trouble: what goes wrong just now."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._busy = self._trouble = ""
        self._since_s = self._until_s = 0.0
        self._lost_s = 0.0

    def say(self, text: str) -> None:
        """A line in the corner of all browsers."""
        for client in self._server.get_clients().values():
            client.add_notification("Workbench", text, auto_close_seconds=10.0)

    def busy(self, doing: str) -> None:
        """The page is busy with this, or no longer."""
        if doing != self._busy:
            self._busy, self._since_s = doing, time.monotonic()

    def trouble(self, text: str) -> None:
        """Something that goes wrong for a while."""
        self._trouble, self._until_s = text, time.monotonic() + SHOWN_S

    def lost(self, real_time_lost_s: float) -> None:
        """How much real time the simulation has given up so far."""
        since, self._lost_s = real_time_lost_s - self._lost_s, real_time_lost_s
        if since > SLOW:
            self.trouble(f"this computer is too slow: {since:.2g} s behind in the last second")

    @property
    def text(self) -> str:
        """For the bar: empty while all is well and nothing takes time."""
        now_s = time.monotonic()
        if self._busy and now_s - self._since_s > 0.3:
            return f"{self._busy} … {now_s - self._since_s:.0f} s"
        return f"⚠ {self._trouble}" if self._trouble and now_s < self._until_s else ""
