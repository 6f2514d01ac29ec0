# SPDX-License-Identifier: MIT
"""The simulation: commands in, motion out.

Simulated time is an integer number of nanoseconds. Commands cut it into segments (core/segment.py); within one, commands are
constant and an integrator carries the body. ``advance`` is the whole story.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from .accelerations import specific_force
from .commands import (
    Change,
    ClearWrench,
    Command,
    MoveString,
    Pending,
    ReleaseString,
    TieString,
    WrenchCommand,
)
from .errors import CommandRefused, InputError
from .event_log import EventLog
from .integrators import check_carried
from .integrators.integrator import ANGULAR_DAMPING, NO_GYROSCOPIC_TERM, STRING, needs_of_load
from .loads import Load, LoadSum, apply_impulse, cross, settle
from .observer import BodySnapshot, Observer, ShownLoad, ShownString, listens
from .problem import make_problem
from .segment import IntegrationFailed, Segment
from .setup import Setup
from .state import State
from .string import Tied
from .string_control import StringControl

NEVER = 1 << 63
"""Later than any simulated time [ns]."""

EFFORT_PERIOD_NS = 50_000_000
"""[ns, simulated] How often observers are told what the motion has cost."""


@dataclass
class _Acting:
    """A load that acts from begin_ns until end_ns."""

    load: Load
    begin_ns: int
    end_ns: int
    load_id: int


class Follower(Protocol):
    """Whoever takes the same commands at the same times, such as a ghost."""

    def submit(self, command: Command, when_ns: int) -> None: ...


class Simulation:
    """One body under commands.

    Not for several threads: one owner submits and advances. ``time_ns`` and ``state`` are those last asked for.
    ``refused`` counts refusals by reason; ``failure`` says why the motion stopped, or is empty.
    """

    def __init__(self, setup: Setup, observer: Observer | None = None) -> None:
        self.setup = setup
        self.watch(observer or Observer())
        self.follower: Follower | None = None
        self.events = EventLog()
        self.refused: Counter[str] = Counter()
        self._arrivals = 0
        self._load_ids = 0
        self._held: _Acting | None = None
        check_carried(setup.integrator, _needs(setup, (), setup.string.attached))
        self._start_over()

    def watch(self, observer: Observer) -> None:
        """Tell this observer from now on, and no other."""
        self.observer = observer
        self._shows_loads = listens(observer, "load_began")
        self._shows_status = listens(observer, "status")
        self._told: dict[str, str] = {}

    # What a caller may ask

    @property
    def steps(self) -> int:
        """Steps committed since start or reset; looking takes none."""
        return self._finished_steps + self._segment.steps

    @property
    def force_evaluations(self) -> int:
        """Evaluations of the equations of motion in those steps."""
        return self._finished_evaluations + self._segment.evaluations

    @property
    def choice(self) -> str:
        """Which method carries the body now, and why."""
        return self._segment.stepper.choice

    @property
    def floor_binds(self) -> bool:
        """Rounding, not the accuracy asked for, limits some step of the present segment."""
        return self._segment.stepper.floor_binds

    @property
    def too_coarse(self) -> str:
        """Why the fixed step says nothing here, |ω|h or ω_s h being beyond the integrator's limit; empty when it does."""
        setup = self.setup
        limit, h = setup.integrator.stability_limit, setup.step_ns * 1e-9
        spin = float((self.state.angular_velocity_body**2).sum()) ** 0.5 * h
        swing = self.string.frequency * h if self.string else 0.0
        if spin > limit:
            return f"{setup.integrator.name}: |w| step = {spin:.3g}, good up to {limit:g}"
        if swing > limit and not setup.integrator.stiff:
            return f"{setup.integrator.name}: string frequency times step = {swing:.3g}, good up to {limit:g}"
        return ""

    @property
    def string(self) -> Tied | None:
        """The string as it is tied, or None."""
        return self._string.tied

    @property
    def hand_work(self) -> float:
        """What the hand at the string's free end has worked since start or reset [J]."""
        return self._finished_work + self._segment.hand_work

    @property
    def string_heat(self) -> float:
        """What the string's damper has turned to heat since start or reset [J]."""
        return self._finished_heat + self._segment.heat

    @property
    def potential_energy(self) -> float:
        """−m g·x, and the string's [J]."""
        setup = self.setup
        energy = -setup.body.mass * float((setup.gravity * self.state.position).sum())
        return energy + (self.string.potential_energy(setup.body, self.state) if self.string else 0.0)

    @property
    def kinetic_energy(self) -> float:
        """½ m|v|² + ½ ωᵀIω [J]."""
        return self.state.kinetic_energy(self.setup.body.mass, self.setup.body.inertia)

    @property
    def angular_momentum(self) -> np.ndarray:
        """R I ω about the COM (3,) [N m s, world]."""
        return self.state.angular_momentum(self.setup.body.inertia)

    @property
    def angular_momentum_drift(self) -> float:
        """|L − L₀|/|L₀| since the present segment began; 0 while something turns the body, or without spin."""
        loads = self._load_sum()
        turned = self.string is not None or loads.torque_world.any() or loads.torque_body.any() or loads.moment.any()
        if turned or self.setup.angular_damping or not self.setup.gyroscopic:
            return 0.0
        start = self._segment.start.angular_momentum(self.setup.body.inertia)
        moved, size = self.angular_momentum - start, float((start * start).sum()) ** 0.5
        return float((moved * moved).sum()) ** 0.5 / size if size > 0.0 else 0.0

    def specific_force(self, point) -> np.ndarray:
        """What an accelerometer at ``point`` (3,) [m, body axes from the COM] shows now (3,) [m/s², body axes]."""
        return specific_force(self.setup, self._load_sum(), self.string, self.state, point)

    @property
    def has_pending(self) -> bool:
        """Commands wait for their time."""
        return bool(self._pending)

    @property
    def at_rest(self) -> bool:
        """Nothing moves, acts or is about to."""
        row = self.state.row
        still = not (row[7:].any() or self.setup.gravity.any())
        free = self._held is None and self.string is None and not self._pulses
        return still and free and not self._pending

    def check_change(self, new: Setup) -> None:
        """Raises CommandRefused (``integrator``) when the new setup's integrator can't carry what acts, or will."""
        tied = self.string is not None if new.string.attached == self.setup.string.attached else new.string.attached
        check_carried(new.integrator, _needs(new, (acting.load for acting in self._acting()), tied))

    # The way of a command

    def submit(self, command: Command, at_ns: int | None = None) -> int:
        """Take a command to act at ``at_ns``, or now when that is None or past; returns the time it will act.

        Raises CommandRefused for what can be judged now; what can't (a ray) is judged when it acts, and counted.
        """
        when_ns = self.time_ns if at_ns is None else max(at_ns, self.time_ns)
        load = None
        if isinstance(command, WrenchCommand):
            load = self._settled(command, None)
        elif isinstance(command, MoveString):
            check_carried(self.setup.integrator, frozenset({STRING}))
        self._arrivals += 1
        pending = Pending(when_ns, command)
        if load is not None and command.frame.point[0] != "ray":
            pending.load, pending.settled_for = load, (self.setup.body, self.setup.surface)
        # Time, rank, message: arrival decides only between messages that are equal to the byte.
        heapq.heappush(self._pending, (when_ns, command.rank, command.message, self._arrivals, pending))
        if self.follower is not None:
            self.follower.submit(command, when_ns)
        return when_ns

    def refuse(self, error: CommandRefused) -> None:
        """Count a refusal and tell the observer."""
        self.refused[error.reason] += 1
        self.observer.refused(self.time_ns, error.reason, str(error))

    def log(self, kind: str, content: dict) -> str:
        """Append an event that doesn't touch the motion, such as a pause; returns its line."""
        line = self.events.append(self.time_ns, kind, content)
        self.observer.event(self.time_ns, line)
        return line

    def reset(self, setup: Setup | None = None) -> None:
        """Time 0, the initial state (of a new setup, if given), no held wrench, no pulses, nothing scheduled; counters
        stay.
        """
        for acting in self._acting():
            self.observer.load_ended(self.time_ns, acting.load_id)
        self.observer.reset()
        self.events.reset()
        replaced = setup is not None and setup is not self.setup
        self.setup = setup or self.setup
        self._start_over()
        self.log("reset", {})
        if replaced:
            self.announce()

    def announce(self) -> None:
        """Tell the observer about the body as it is now."""
        self.observer.body_changed(self.time_ns, self.snapshot())

    def introduce(self, observer: Observer) -> None:
        """Tell an observer that comes in flight about the body, what acts on it and the string."""
        observer.body_changed(self.time_ns, self.snapshot())
        if listens(observer, "load_began"):
            for acting in self._acting():
                kind = "wrench" if acting is self._held else "poke"
                observer.load_began(self.time_ns, acting.load_id, self._shown(kind, acting.load))
        if self.string is not None:
            observer.string_changed(self.time_ns, self._shown_string(self.string))

    def tell_status(self, paused: bool = False) -> None:
        """Tell the observer what the body is doing, where that changed since it was last told."""
        if not self._shows_status:
            return
        motion = "paused" if paused else "sleeping" if self.at_rest else "flying"
        tracks = {"motion": motion, "method": self.choice}
        if self.string is not None:
            slack = not self.string.bilateral and self.string.stretch(self.setup.body, self.state) < 0.0
            tracks["string"] = "slack" if slack else "taut"
        elif "string" in self._told:
            tracks["string"] = "loose"
        for track, value in tracks.items():
            if self._told.get(track) != value:
                self._told[track] = value
                self.observer.status(self.time_ns, track, value)
        if self.time_ns >= self._next_effort_ns:
            self._next_effort_ns = self.time_ns + EFFORT_PERIOD_NS
            self.observer.effort(self.time_ns, self.steps, self.force_evaluations)

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
        event_ns = self._pending[0][0] if self._pending else NEVER
        for acting in self._acting():
            event_ns = min(event_ns, acting.end_ns)
        return min(event_ns, self._string.next_event_ns(self._segment.start.time_ns, NEVER))

    def _acting(self) -> list[_Acting]:
        return [*([self._held] if self._held else []), *self._pulses]

    def _act(self, now_ns: int, state: State) -> None:
        """Everything that ends or begins at ``now_ns``; a new segment if anything did."""
        self.time_ns, self.state = now_ns, state
        changed = self._end_loads(lambda acting: acting.end_ns <= now_ns)
        changed |= self._string.end_due(now_ns)
        while self._pending and self._pending[0][0] == now_ns:
            pending = heapq.heappop(self._pending)[-1]
            try:
                self._apply(pending)
                changed = True
            except CommandRefused as refusal:
                self.refuse(refusal)
            except InputError as error:
                self.refuse(CommandRefused("schedule", error.field, error.received, error.accepted))
        if changed:
            self._segment.cut(now_ns)
            self._finish_segment()

    def _apply(self, pending: Pending) -> None:
        command = pending.command
        if isinstance(command, WrenchCommand):
            self._begin_load(command, self._load_of(pending))
        elif isinstance(command, ClearWrench):
            self._end_loads(lambda acting: True)
        elif isinstance(command, Change):
            self._change(command.apply())
        elif isinstance(command, TieString):
            self._string.tie_at(command, self.setup, self.state)
        elif isinstance(command, MoveString):
            check_carried(self.setup.integrator, frozenset({STRING}))
            self._string.move(command, self.setup, self.state)
        elif isinstance(command, ReleaseString):
            self._string.release()
        self.log(command.kind, command.content)

    def _load_of(self, pending: Pending) -> Load:
        """The load settled at submission, or settled anew when it was a ray or the mesh has changed since."""
        if pending.load is not None and pending.settled_for[1] is self.setup.surface:
            if pending.settled_for[0] is not self.setup.body:
                pending.load.check_magnitude(self.setup.body)
            self._check_carried(pending.command, pending.load)
            return pending.load
        return self._settled(pending.command, self.state)

    def _settled(self, command: WrenchCommand, state: State | None) -> Load:
        setup = self.setup
        load = settle(command.frame, command.force, command.torque, setup.body, setup.surface, setup.contacts, state)
        load.check_magnitude(setup.body)
        self._check_carried(command, load)
        return load

    def _check_carried(self, command: WrenchCommand, load: Load) -> None:
        # An impulse acts at once: the integrator never sees it.
        if not command.frame.impulse:
            check_carried(self.setup.integrator, needs_of_load(load))

    def _begin_load(self, command: WrenchCommand, load: Load) -> None:
        self._load_ids += 1
        self.observer.applied(self.time_ns, command, load, self.setup.body)
        if command.frame.impulse:
            self.state = apply_impulse(load, self.setup.body, self.state)
            if self._shows_loads:
                self.observer.load_began(self.time_ns, self._load_ids, self._shown("impulse", load))
            return
        if command.held:
            self._end_loads(lambda acting: acting is self._held)
            if not load.is_zero:
                self._held = _Acting(load, self.time_ns, NEVER, self._load_ids)
                self._set_held_end()
        else:
            duration_s = command.frame.duration_s
            duration_ns = self.setup.poke_duration_ns if duration_s is None else round(duration_s * 1e9)
            self._pulses.append(_Acting(load, self.time_ns, self.time_ns + duration_ns, self._load_ids))
        if self._shows_loads and not (load.is_zero and command.held):
            self.observer.load_began(self.time_ns, self._load_ids, self._shown(command.kind, load))

    def _set_held_end(self) -> None:
        held, timeout_ns = self._held, self.setup.wrench_timeout_ns
        if held is not None:
            held.end_ns = max(held.begin_ns + timeout_ns, self.time_ns) if timeout_ns else NEVER

    def _end_loads(self, ends) -> bool:
        ended = [acting for acting in self._acting() if ends(acting)]
        for acting in ended:
            self.observer.load_ended(self.time_ns, acting.load_id)
            if acting is self._held:
                self._held = None
            else:
                self._pulses.remove(acting)
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
        self._set_held_end()
        self._string.change(old, new, self.state)
        if new.surface is not old.surface and new.surface is not None:
            self.observer.mesh_changed(self.time_ns, new.surface.vertices, new.surface.triangles, str(new.geometry[0]))
        self.announce()

    # Segments

    def _new_segment(self, start: State) -> Segment:
        setup = self.setup
        problem = make_problem(
            setup.body,
            self._load_sum(),
            setup.gravity,
            setup.linear_damping,
            setup.angular_damping,
            setup.gyroscopic,
            start,
            self.string,
            setup.length,
        )
        return Segment(start, problem, setup.integrator, setup.step_ns, setup.accuracy)

    def _finish_segment(self) -> None:
        """Keep the segment's counts and begin another from the present state."""
        self._finished_steps += self._segment.steps
        self._finished_evaluations += self._segment.evaluations
        self._finished_work += self._segment.hand_work
        self._finished_heat += self._segment.heat
        self._segment = self._new_segment(self.state)
        self._tell_string()

    def _load_sum(self) -> LoadSum:
        """All loads that act, summed afresh in their canonical order."""
        loads = LoadSum()
        for acting in self._acting():
            loads.add(acting.load, self.setup.body)
        return loads

    def _start_over(self) -> None:
        self._told = {}
        self._pending: list[tuple] = []
        self._held = None
        self._pulses: list[_Acting] = []
        self._finished_steps = 0
        self._finished_evaluations = 0
        self._finished_work = 0.0
        self._finished_heat = 0.0
        self.failure = ""
        self.time_ns = 0
        self.state = State(0, self.setup.initial.copy())
        self._string = StringControl(self.setup, self.state)
        self._segment = self._new_segment(self.state)
        self._next_effort_ns = 0
        self._told_string: Tied | None = None
        self._tell_string()

    def _stop_in_last_good_state(self, failed: IntegrationFailed) -> None:
        if np.isfinite(failed.last_good.row).all() and failed.last_good.time_ns >= self.time_ns:
            self.state = failed.last_good
        self.time_ns = self.state.time_ns
        self.failure = str(failed)
        self._finish_segment()

    # What observers are told

    def _shown(self, kind: str, load: Load) -> ShownLoad:
        body = self.setup.body
        axes = "world" if load.axes == "world" else "body"
        force = np.asarray(load.force) if axes == "world" else load.force_body(body, self.state)
        return ShownLoad(kind, axes, load.arm(body), force, np.asarray(load.torque))

    def _tell_string(self) -> None:
        tied = self.string
        if tied is self._told_string:
            return
        self._told_string = tied
        if not listens(self.observer, "string_changed"):
            return
        self.observer.string_changed(self.time_ns, None if tied is None else self._shown_string(tied))

    def _shown_string(self, tied: Tied) -> ShownString:
        arm = np.asarray(tied.arm(self.setup.body))
        ends = (tied.origin, tied.target, tied.begin_ns, tied.end_ns)
        return ShownString(arm, *ends, tied.stiffness, tied.damping, tied.rest_length, tied.bilateral)

    def snapshot(self, setup: Setup | None = None) -> BodySnapshot:
        """The body as an observer is told of it; of another setup, when one is given."""
        setup = setup or self.setup
        body = setup.body
        return BodySnapshot(
            body.mass,
            body.center_of_mass,
            body.inertia,
            body.scale,
            setup.gravity,
            setup.inertia_model,
            setup.integrator.name,
            setup.gyroscopic,
        )


def _needs(setup: Setup, loads: Iterable[Load], tied: bool) -> frozenset[str]:
    """What the scene asks of its integrator."""
    needs = set().union(*(needs_of_load(load) for load in loads))
    if not setup.gyroscopic:
        needs.add(NO_GYROSCOPIC_TERM)
    if setup.angular_damping:
        needs.add(ANGULAR_DAMPING)
    if tied:
        needs.add(STRING)
    return frozenset(needs)
