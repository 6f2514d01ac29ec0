# SPDX-License-Identifier: MIT
"""The simulation: commands in, motion out.

Simulated time is an integer number of nanoseconds. Commands cut it into segments (core/segment.py); within one, commands are
constant and an integrator carries the body. ``advance`` is the whole story.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import Protocol

import numpy as np

from .acting import NEVER, Acting, ActingLoads
from .commands import (
    Change,
    ClearWrench,
    Command,
    Listed,
    MoveString,
    Pending,
    ReleaseString,
    TieString,
    WrenchCommand,
    order_key,
)
from .errors import CommandRefused, InputError
from .event_log import EventLog
from .integrators import check_carried
from .integrators.integrator import ANGULAR_DAMPING, NO_GYROSCOPIC_TERM, STRING, needs_of_load
from .loads import Load, apply_impulse, cross, settle
from .narrator import Narrator, snapshot
from .observer import BodySnapshot, Observer
from .problem import problem_of_segment
from .readings import Readings
from .segment import IntegrationFailed, Segment
from .setup import Setup
from .state import State
from .string_control import StringControl


class Follower(Protocol):
    """Whoever takes the same commands at the same times, such as a ghost."""

    def submit(self, command: Command, when_ns: int, listed: Listed | None = None) -> None: ...


class Simulation(Readings):
    """One body under commands; what can be read off it is in readings.py.

    Not for several threads: one owner submits and advances. ``time_ns`` and ``state`` are those last asked for.
    ``refused`` counts refusals by reason; ``failure`` says why the motion stopped, or is empty. ``listed``: the place of the
    command that acts at this moment in its list, if it is an entry of one.
    """

    def __init__(self, setup: Setup, observer: Observer | None = None) -> None:
        self.setup = setup
        self.observer = observer or Observer()
        self._narrator = Narrator(self.observer)
        self.follower: Follower | None = None
        self.events = EventLog()
        self.refused: Counter[str] = Counter()
        self._arrivals = 0
        self.listed: Listed | None = None
        self._load_ids = 0
        check_carried(setup.integrator, needs_of(setup, (), setup.string.attached))
        self._start_over()

    # Who watches

    def watch(self, observer: Observer) -> None:
        """Tell this observer from now on, and no other."""
        self.observer = observer
        self._narrator.watch_for(observer)

    def introduce(self, observer: Observer) -> None:
        """Tell an observer that comes in flight about the body, what acts on it and the string."""
        Narrator(observer).introduce(self)

    def announce(self) -> None:
        """Tell the observer about the body as it is now."""
        self._narrator.body(self)

    def tell_status(self, paused: bool = False) -> None:
        """Tell the observer what the body is doing, where that changed since it was last told."""
        self._narrator.status(self, paused)

    def snapshot(self, setup: Setup | None = None) -> BodySnapshot:
        """The body as an observer is told of it; of another setup, when one is given."""
        return snapshot(setup or self.setup)

    def log(self, kind: str, content: dict) -> None:
        """Log an event; one that doesn't touch the motion, such as a pause, is logged by whoever brings it about."""
        self.observer.event(self.time_ns, self.events.append(self.time_ns, kind, content))

    # The way of a command

    def submit(
        self,
        command: Command,
        at_ns: int | None = None,
        listed: Listed | None = None,
        judged: tuple[Load | None, Setup] | None = None,
    ) -> int:
        """Take a command to act at ``at_ns``, or now when that is None or past; returns the time it will act.

        listed: its place, when it is an entry of a list. judged: what ``judge`` gave, and the setup that it was given, where
        that isn't the present one: a change before it in its list may allow what the present setup doesn't. Raises
        CommandRefused for what can be judged now; what can't (a ray) is judged when it acts, and counted.
        """
        when_ns = self.time_ns if at_ns is None else max(at_ns, self.time_ns)
        load, setup = (judge(command, self.setup), self.setup) if judged is None else judged
        self._arrivals += 1
        pending = Pending(when_ns, command)
        if load is not None and command.frame.point[0] != "ray":
            pending.load, pending.settled_for = load, setup
        # Arrival decides only between messages that are equal to the byte.
        heapq.heappush(self._pending, (when_ns, order_key(command, listed), self._arrivals, pending, listed))
        if self.follower is not None:
            self.follower.submit(command, when_ns, listed)
        return when_ns

    def refuse(self, error: CommandRefused, count: int = 1) -> None:
        """Count a refusal, of so many commands at once, and tell the observer."""
        self.refused[error.reason] += count
        self.observer.refused(self.time_ns, error.reason, str(error))

    def check_change(self, new: Setup) -> None:
        """Raises CommandRefused (``integrator``) when the new setup's integrator can't carry what acts, or will."""
        # A string that is to be tied at time 0 will be, at the next reset, though it was let go since.
        tied = new.string.attached or (self.string is not None and not self.setup.string.attached)
        check_carried(new.integrator, needs_of(new, (acting.load for acting in self.acting), tied))

    def reset(self, setup: Setup | None = None) -> None:
        """Time 0, the initial state (of a new setup, if given), no held wrench, no pulses, nothing scheduled; counters
        stay.
        """
        self._tell_ended(self.acting.end_all())
        self.observer.reset()
        self.events.reset()
        replaced = setup is not None and setup is not self.setup
        self.setup = setup or self.setup
        self._start_over()
        self.log("reset", {})
        if replaced:
            self.announce()

    # The story

    def advance(self, until_ns: int) -> State:
        """Carry the body to ``until_ns`` and return its state there, before what acts at that very time.

        Running away (|x|, |v| or |ω| past 1e100) stops at the last good state and sets ``failure``.
        """
        if until_ns < self.time_ns:
            raise ValueError(f"simulated time doesn't run backwards: {self.time_ns} to {until_ns} ns")
        try:
            # 1. Until the next command event: full steps, then one shorter step that ends exactly there.
            while (event_ns := self._next_event_ns()) < until_ns:
                self._segment.advance(event_ns)
                # 2. Commands act; with new loads a new segment begins.
                self._act(event_ns, self._segment.look(event_ns))
            # 3. Full steps up to the time asked for, and a look at it that leaves no trace.
            self._segment.advance(until_ns)
            self.state = self._segment.look(until_ns)
            self.time_ns = until_ns
        except IntegrationFailed as failed:
            self._stop_in_last_good_state(failed)
        return self.state

    # What happens at an event

    def _next_event_ns(self) -> int:
        event_ns = self.acting.next_end_ns
        if self._pending:
            event_ns = min(event_ns, self._pending[0][0])
        if self._string.tied is not None:
            event_ns = min(event_ns, self._string.next_event_ns(self._segment.start_ns, NEVER))
        return event_ns

    def _act(self, now_ns: int, state: State) -> None:
        """Everything that ends or begins at ``now_ns``; a new segment if anything did."""
        self.time_ns, self.state = now_ns, state
        changed = self._tell_ended(self.acting.end_due(now_ns))
        changed |= self._string.end_due(now_ns)
        while self._pending and self._pending[0][0] == now_ns:
            *_, pending, self.listed = heapq.heappop(self._pending)
            try:
                self._apply(pending)
                changed = True
            except CommandRefused as refusal:
                self.refuse(refusal)
            except InputError as error:
                self.refuse(CommandRefused("schedule", error.field, error.received, error.accepted))
        self.listed = None
        if changed:
            self._segment.cut(now_ns)
            self._finish_segment()

    def _apply(self, pending: Pending) -> None:
        command = pending.command
        if isinstance(command, WrenchCommand):
            self._begin_load(command, self._load_of(pending))
        elif isinstance(command, ClearWrench):
            self._tell_ended(self.acting.end_all())
        elif isinstance(command, Change):
            self._change(command.apply())
        elif isinstance(command, TieString):
            self._string.tie_at(command, self.setup, self.state)
        elif isinstance(command, MoveString):
            check_carried(self.setup.integrator, frozenset({STRING}))
            self._string.move(command, self.setup, self.state)
        elif isinstance(command, ReleaseString):
            self._string.release()
        # A change is told at once: waiting in a queue it would keep its whole setup, mesh included.
        if self.observer.hears_events() or isinstance(command, Change):
            self.log(command.kind, command.content)
        else:
            self.events.note(self.time_ns, command)

    def _load_of(self, pending: Pending) -> Load:
        """The load settled at submission, or settled anew when it was a ray or the mesh has changed since."""
        setup, before = self.setup, pending.settled_for
        if before is setup:
            return pending.load
        if before is not None and before.surface is setup.surface:
            if before.body is not setup.body:
                pending.load.check_magnitude(setup.body)
            _check_load_carried(pending.command, pending.load, setup)
            return pending.load
        return _settled(pending.command, setup, self.state)

    def _begin_load(self, command: WrenchCommand, load: Load) -> None:
        self._load_ids += 1
        now_ns, load_id = self.time_ns, self._load_ids
        self.observer.applied(now_ns, command, load, self.setup.body)
        if command.frame.impulse:
            self.state = apply_impulse(load, self.setup.body, self.state)
            self._narrator.load_began(self, load_id, "impulse", load)
            return
        if command.held:
            self._tell_ended(self.acting.end_held())
            if load.is_zero:
                return
            self.acting.hold(Acting(load, now_ns, self._end_of_held(now_ns), load_id))
        else:
            duration_s = command.frame.duration_s
            duration_ns = self.setup.poke_duration_ns if duration_s is None else round(duration_s * 1e9)
            self.acting.add(Acting(load, now_ns, now_ns + duration_ns, load_id))
        self._narrator.load_began(self, load_id, command.kind, load)

    def _end_of_held(self, begin_ns: int) -> int:
        timeout_ns = self.setup.wrench_timeout_ns
        return max(begin_ns + timeout_ns, self.time_ns) if timeout_ns else NEVER

    def _tell_ended(self, ended: list[Acting]) -> bool:
        for acting in ended:
            self.observer.load_ended(self.time_ns, acting.load_id)
        return bool(ended)

    def _change(self, new: Setup) -> None:
        """Take another setup in flight. The same mesh at the same size stays where it is, so a COM that moves within it
        takes position and velocity along; another mesh or size keeps the COM and its motion.
        """
        self.check_change(new)
        old, self.setup = self.setup, new
        moved = new.body.center_of_mass - old.body.center_of_mass
        if new.geometry == old.geometry and moved.any():
            R = self.state.rotation
            shift = (R * moved).sum(axis=1)
            row = self.state.row.copy()
            row[0:3] += shift
            row[7:10] += cross(self.state.angular_velocity, shift)
            self.state = replace(self.state, row=row)
        if self.acting.held is not None:
            self.acting.hold_until(self._end_of_held(self.acting.held.begin_ns))
        self._string.change(old, new, self.state)
        if new.surface is not old.surface and new.surface is not None:
            self.observer.mesh_changed(self.time_ns, new.surface.vertices, new.surface.triangles, str(new.geometry[0]))
        self.announce()

    # Segments

    def _new_segment(self, start: State) -> Segment:
        setup = self.setup
        problem = problem_of_segment(setup.problem, setup.body, self.acting.sum(setup.body), start, self.string)
        return Segment(start, problem, setup.integrator, setup.step_ns, setup.accuracy)

    def _finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        self._finished_steps += self._segment.steps
        self._finished_evaluations += self._segment.evaluations
        self._finished_work += self._segment.hand_work
        self._finished_heat += self._segment.heat
        self._segment = self._new_segment(self.state)
        self._narrator.string(self)

    def _start_over(self) -> None:
        self._pending: list[tuple] = []
        self.listed = None
        self.acting = ActingLoads()
        self._finished_steps = 0
        self._finished_evaluations = 0
        self._finished_work = 0.0
        self._finished_heat = 0.0
        self.failure = ""
        self.time_ns = 0
        self.state = State(0, self.setup.initial.copy())
        self._string = StringControl(self.setup, self.state)
        self._segment = self._new_segment(self.state)
        self._narrator.start_over()
        self._narrator.string(self)

    def _stop_in_last_good_state(self, failed: IntegrationFailed) -> None:
        if np.isfinite(failed.last_good.row).all() and failed.last_good.time_ns >= self.time_ns:
            self.state = failed.last_good
        self.time_ns = self.state.time_ns
        self.failure = str(failed)
        self._finish_segment()


def judge(command: Command, setup: Setup) -> Load | None:
    """The load of a command as far as it can be settled before it acts, None for what is none; raises CommandRefused for what a
    body of this setup can't take.
    """
    if isinstance(command, WrenchCommand):
        return _settled(command, setup, None)
    if isinstance(command, MoveString):
        check_carried(setup.integrator, frozenset({STRING}))
    return None


def _settled(command: WrenchCommand, setup: Setup, state: State | None) -> Load:
    load = settle(command.frame, command.force, command.torque, setup.body, setup.surface, setup.contacts, state)
    load.check_magnitude(setup.body)
    _check_load_carried(command, load, setup)
    return load


def _check_load_carried(command: WrenchCommand, load: Load, setup: Setup) -> None:
    # An impulse acts at once: the integrator never sees it.
    if not command.frame.impulse:
        check_carried(setup.integrator, needs_of_load(load))


def needs_of(setup: Setup, loads: Iterable[Load], tied: bool) -> frozenset[str]:
    """What the scene asks of its integrator."""
    needs = set().union(*(needs_of_load(load) for load in loads))
    if not setup.gyroscopic:
        needs.add(NO_GYROSCOPIC_TERM)
    if setup.angular_damping:
        needs.add(ANGULAR_DAMPING)
    if tied:
        needs.add(STRING)
    return frozenset(needs)
