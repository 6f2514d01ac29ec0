# SPDX-License-Identifier: MIT
"""Commands as they arrive, from topics or from a page: counted, given their time, and submitted to the simulation."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import CommandRefused
from ..scene.scenario import check_inertia, nanoseconds
from ..simulation.commands import Change, Command
from .schedule import LONG_TEXT, BackgroundThread, ScheduleMessage

if TYPE_CHECKING:
    from .simulation_loop import SimulationLoop

TOPICS = ("wrench", "thrusters", "poke", "string", "inertia", "schedule")
"""What received messages are counted by."""

COUNTED_BY = {
    "wrench": "wrench",
    "thrusters": "thrusters",
    "poke": "poke",
    "string_target": "string",
    "string_attach": "string",
    "inertia": "inertia",
}
"""The counter of each kind of command; all others come by the schedule."""

DAY_NS = 24 * 3600 * 1_000_000_000


class CommandReceiver:
    """All on the physics thread.

    received counts every command by topic, refused ones included, ``late`` and ``wall_stamp`` stamps that mean now;
    refusals are the simulation's.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self.received: Counter[str] = Counter()
        self.late = 0
        self.wall_stamp = 0
        self._loop = loop
        self._schedules = 0
        self._background = BackgroundThread()

    def receive(self, topic: str, command: Callable[[], Command]) -> None:
        """Count a command and submit it, to act at its stamp read as that of a message; raises CommandRefused, counted,
        for what can be checked now.

        The loop catches up first, so that now is the tick's own time. topic: one of TOPICS. command() gives it, or
        raises CommandRefused.
        """
        loop = self._loop
        loop.catch_up()
        try:
            sent = command()
            if isinstance(sent, Change) and sent.kind == "inertia":
                check_inertia(loop.scenario, sent.content)
            loop.simulation.submit(sent, self._when(sent.stamp_ns))
        except CommandRefused as refusal:
            loop.simulation.refuse(refusal)
            raise
        finally:
            # Last: a command that counts as received counts as late or refused too, if it is.
            self.received[topic] += 1
        if sent.kind in ("wrench", "thrusters"):
            loop.request_step()

    def receive_schedule(self, text: Callable[[], str]) -> ScheduleMessage:
        """Take an entry or a list of entries as YAML, now or once what it needs is loaded and compiled
        (``submit_finished``); what is wrong with it is counted then. text() gives it, or raises CommandRefused.
        """
        loop = self._loop
        loop.catch_up()
        scenario = loop.scenario
        self._schedules += 1
        schedule = ScheduleMessage(self._schedules)
        quick = self._background.is_empty
        schedule.decode(text)
        if quick and len(schedule.text) <= LONG_TEXT:
            schedule.read(scenario)
            quick = not schedule.is_slow
        else:
            quick = False
        if quick:
            schedule.check(scenario, loop.setup_of)
            self._submit_schedule(schedule)
            return schedule

        def work() -> None:
            if not schedule.commands:
                schedule.read(scenario)
            schedule.check(scenario, loop.setup_of)

        self._background.give(schedule, work)
        return schedule

    @property
    def in_progress(self) -> bool:
        """Whether a message of the schedule is still worked out in the background."""
        return not self._background.is_empty

    def submit_finished(self) -> None:
        """Submit the messages of the schedule that have been worked out meanwhile."""
        for number, schedule in enumerate(self._background.finished()):
            if number == 0:
                self._loop.catch_up()
            self._submit_schedule(schedule)

    def _submit_schedule(self, schedule: ScheduleMessage) -> None:
        """Submit all of a message's entries, or refuse them all."""
        simulation = self._loop.simulation
        try:
            if schedule.refusal is not None:
                raise schedule.refusal
            times = [self._effective(entry.command.stamp_ns, listed=True) for entry in schedule.entries]
        except CommandRefused as refusal:
            schedule.refusal = refusal
            simulation.refuse(refusal, schedule.count)
        else:
            for counter in ("late", "wall_stamp"):
                entries = {
                    entry.command.entry
                    for entry, (_, counted) in zip(schedule.entries, times, strict=True)
                    if counted == counter
                }
                self._count_stamps(counter, len(entries))
            for entry, (when_ns, _) in zip(schedule.entries, times, strict=True):
                simulation.submit(entry.command, when_ns, entry.listed, entry.checked)
        self.received["schedule"] += schedule.count
        schedule.is_submitted = True

    # When they act

    def _when(self, stamp_ns: int) -> int:
        when_ns, counter = self._effective(stamp_ns)
        self._count_stamps(counter, 1)
        return when_ns

    def _effective(self, stamp_ns: int, listed: bool = False) -> tuple[int, str]:
        horizon_ns = nanoseconds(self._loop.scenario.parameters.schedule_horizon)
        offset_ns = 0 if listed else self._loop.stamps.offset_ns
        return effective_time(stamp_ns, self._loop.simulation.time_ns, time.time_ns(), horizon_ns, offset_ns)

    def _count_stamps(self, counter: str, count: int) -> None:
        if counter == "late":
            self.late += count
        elif counter == "wall_stamp" and count:
            first, self.wall_stamp = self.wall_stamp == 0, self.wall_stamp + count
            if first:
                self._loop.endpoints.warn(
                    "a command is stamped with the system's clock: it acts now, and so do later ones; "
                    "stamps of commands are simulated time"
                )


def effective_time(stamp_ns: int, now_ns: int, wall_ns: int, horizon_ns: int, offset_ns: int = 0) -> tuple[int, str]:
    """Simulated time [ns] at which a command with this stamp acts, and the counter it goes to, if any.

    Zero or past means now (past: ``late``); one up to the horizon ahead acts at exactly that time; one within a day of
    the system clock comes from a tool that stamps by it: it means now (``wall_stamp``). Raises CommandRefused
    (``stamp``). offset_ns: how far stamps are ahead of simulated time.
    """
    if stamp_ns == 0:
        return now_ns, ""
    time_ns = stamp_ns - offset_ns
    if time_ns <= now_ns:
        return now_ns, "late" if time_ns < now_ns else ""
    if time_ns <= now_ns + horizon_ns:
        return time_ns, ""
    if abs(stamp_ns - wall_ns) <= DAY_NS:
        return now_ns, "wall_stamp"
    raise CommandRefused(
        "stamp",
        "header.stamp",
        f"{stamp_ns / 1e9:.9g} s",
        f"0, or time up to {horizon_ns / 1e9:g} s (schedule_horizon) after {(now_ns + offset_ns) / 1e9:.9g} s",
    )
