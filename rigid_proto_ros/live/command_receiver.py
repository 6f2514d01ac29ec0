# SPDX-License-Identifier: MIT
"""Reception of commands from topics or from a page: counts them, resolves their stamps, submits them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..base.errors import CommandRefused, InputError
from ..scene.scenario import Scenario
from ..scene.script import Schedule, expand_schedule, read_schedule
from ..simulation.commands import Change, Command, Listed, nanoseconds

if TYPE_CHECKING:
    from .simulation_loop import SimulationLoop

TOPICS = ("wrench", "thrusters", "poke", "string", "inertia", "schedule")
"""Topics whose received messages are counted."""

Submission = tuple[Command, int, Listed | None, Scenario]
"""Arguments of ``ScenarioRun.take``."""

DAY_NS = 24 * 3600 * 1_000_000_000


class CommandReceiver:
    """Receives commands on the physics thread.

    received: number of commands by topic, including refused ones. late, wall_stamp: commands whose stamp is past, or of
    the system clock, and which therefore act now. The simulation counts refusals.
    """

    def __init__(self, loop: SimulationLoop) -> None:
        self.received: Counter[str] = Counter()
        self.late = 0
        self.wall_stamp = 0
        self._loop = loop
        self._schedules = 0

    @property
    def step_requested(self) -> bool:
        """Whether a step must follow before another command is taken."""
        return self._loop.step_requested

    def receive(self, topic: str, command: Callable[[], Command]) -> None:
        """Count a command and submit it to act at its message stamp. Raises CommandRefused, counted, if a check that is
        possible now fails.

        The loop catches up first, so that now is the tick's present; while paused, a command for now acts at once.
        topic: one of TOPICS. command(): returns the command, or raises CommandRefused.
        """
        loop = self._loop
        loop.catch_up()
        try:
            sent = command()
            when_ns, counter = self._effective(sent.stamp_ns, loop.simulation.time_ns, loop.stamps.offset_ns)
            self._count(counter, 1)
            scenario = None
            if isinstance(sent, Change):
                ((_, scenario),) = loop.check([sent])
            loop.take(sent, when_ns, at_hand=scenario)
        except CommandRefused as refusal:
            loop.simulation.refuse(refusal)
            raise
        finally:
            self.received[topic] += 1
            if topic in ("wrench", "thrusters"):
                loop.request_step()

    def receive_schedule(self, text: Callable[[], str]) -> None:
        """Take one script entry or a list of entries, as YAML; a list is accepted or refused as a whole. Raises
        CommandRefused, counted once per entry. Loads the meshes that entries name. text(): returns the YAML, or raises
        CommandRefused.

        A list may start with a reset; with ``more``, time is then held at 0 until the next list.
        """
        loop = self._loop
        loop.catch_up()
        self._schedules += 1
        count, more = 1, None
        try:
            listed = read_schedule(text())
            count, more = listed.sent, listed.more if listed.is_list else None
            taken, counted = self._planned(listed)
        except InputError as error:
            reason = error.reason if isinstance(error, CommandRefused) else "schedule"
            refusal = CommandRefused(reason, error.field, error.received, error.accepted)
            loop.simulation.refuse(refusal, count)
            raise refusal from None
        else:
            if listed.reset:
                loop.reset()
                loop.hold()
            for counter, entries in counted.items():
                self._count(counter, len(entries))
            for submission in taken:
                loop.take(*submission)
        finally:
            self.received["schedule"] += count
            if more is not None:
                loop.hold_on(more)

    def _planned(self, listed: Schedule) -> tuple[list[Submission], dict[str, set[int]]]:
        """The checked commands, ordered by time and then by position in the list; and the set of entries per counter,
        since one entry may expand to several commands. Raises InputError.
        """
        taken: list[Submission] = []
        counted: dict[str, set[int]] = {}
        commands = expand_schedule(listed)
        now_ns = 0 if listed.reset else self._loop.simulation.time_ns
        order = sorted(range(len(commands)), key=lambda k: commands[k].stamp_ns)
        in_order = self._loop.check((commands[k] for k in order), anew=listed.reset)
        for k, (command, scenario) in zip(order, in_order, strict=True):
            when_ns, counter = self._effective(command.stamp_ns, now_ns)
            counted.setdefault(counter, set()).add(command.entry)
            taken.append((command, when_ns, (self._schedules, k) if listed.is_list else None, scenario))
        return taken, counted

    def _effective(self, stamp_ns: int, now_ns: int, offset_ns: int = 0) -> tuple[int, str]:
        """Simulated time [ns] at which a command with this stamp acts, and the counter to increment, if any.

        A zero or past stamp means now (past: ``late``). A stamp up to the horizon ahead acts at exactly that time. A
        stamp within a day of the system clock comes from a tool that uses that clock and means now (``wall_stamp``).
        Raises CommandRefused (``stamp``) for others. offset_ns: stamp minus simulated time.
        """
        time_ns = stamp_ns - offset_ns
        if stamp_ns == 0:
            return now_ns, ""
        if time_ns <= now_ns:
            return now_ns, "late" if time_ns < now_ns else ""
        horizon_ns = nanoseconds(self._loop.scenario.parameters.schedule_horizon)
        if time_ns <= now_ns + horizon_ns:
            return time_ns, ""
        if abs(stamp_ns - time.time_ns()) <= DAY_NS:
            return now_ns, "wall_stamp"
        accepted = (
            f"0, or time up to {horizon_ns / 1e9:g} s (schedule_horizon) after {(now_ns + offset_ns) / 1e9:.9g} s"
        )
        raise CommandRefused("stamp", "header.stamp", f"{stamp_ns / 1e9:.9g} s", accepted)

    def _count(self, counter: str, count: int) -> None:
        if counter == "late":
            self.late += count
        elif counter == "wall_stamp" and count:
            if self.wall_stamp == 0:
                self._loop.endpoints.warn(
                    "a command is stamped with the system's clock: it acts now, and so do later ones; "
                    "stamps of commands are simulated time"
                )
            self.wall_stamp += count
