# SPDX-License-Identifier: MIT
"""The simulation: commands in, motion out.

Simulated time is an integer number of nanoseconds. Commands divide it into segments (simulation/flight.py); within a
segment loads are constant and an integrator advances the body. ``advance`` is the main algorithm.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from heapq import heappop, heappush
from operator import itemgetter
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.rotation import cross, dot, length, times, transposed_times
from ..base.vectors import FloatArray, Numbers, Vector, Vector3, vector
from ..motion.body import rotor_rate
from ..motion.integrators.series_steps import degree_of_motion, fastest_swing
from ..motion.integrators.stepping import method_of
from ..motion.loads import TORQUE_WORLD, Load, load_of_bytes
from ..motion.problem import MAX_SPEED
from ..motion.state import State, angular_momentum
from ..motion.string import StringState
from . import flight as fl
from .commands import (
    HELD_WRENCH,
    IMPULSE,
    PULSE,
    Change,
    ClearWrench,
    Command,
    Listed,
    Pending,
    Row,
    ThrusterCommand,
    Waiting,
    WrenchCommand,
    order_of,
    row_of,
    slot_name,
)
from .effects import APPLY, CUT, END_ALL, END_DUE, FINISH, FLY
from .flight_arrays import NOTEWORTHY, NOW_NS, ActingLoad, FlightArrays
from .observer import (
    AccuracyFloor,
    Acted,
    Applied,
    BodyChanged,
    EventLog,
    LoadBegan,
    LoadEnded,
    Logged,
    MeshChanged,
    Observer,
    Refused,
    Reset,
    StringChanged,
    shown_load,
)
from .quantities import state_of
from .setup import Setup, check_command, check_thrust
from .thrusters import ThrusterControl

_UNTIL_REPLACED_NS = fl.NEVER >> 1
_RESET: tuple[str, dict[str, Any]] = ("reset", {})


_time_of = itemgetter(0)
"""Of a row of commands."""

TIMEOUTS = frozenset({"slot", "thrusters", "string"})
"""What may time out: the held wrench of a slot, thrusters, the string."""

FLOOR_PERIOD_NS = 50_000_000
"""[ns, simulated] Interval at which observers are notified of error floors."""


class Simulation:
    """Simulation of one body under commands.

    Not thread-safe but for ``state``: a single owner submits and advances. ``time_ns`` is that of the last advance.
    ``refused`` counts refusals by reason, ``refusals`` has the text of the last one of each; ``failure`` says why the
    motion stopped, or is empty. ``listed``: place in its list of the command being applied, if it is an entry of one.
    ``logged_timeouts``: of which things a timeout is logged, by the keys of its event.
    """

    time_ns: int
    _acted_ns: int

    def __init__(self, setup: Setup, observer: Observer | None = None) -> None:
        self.setup = setup
        # Without an observer nobody asks for its hash, and it costs several times what a command does.
        self.events = EventLog(chained=observer is not None)
        self.refused: dict[str, int] = defaultdict(int)
        self.refusals: dict[str, str] = {}
        self._arrivals = 0
        self.listed: Listed | None = None
        self.logged_timeouts: Collection[str] = TIMEOUTS
        self._arrays = FlightArrays()
        self.thrusters = ThrusterControl(setup.thrusters)
        self.watch(observer or Observer())
        self._start_over()

    # Observers

    def watch(self, observer: Observer) -> None:
        """Notify this observer from now on, and no other."""
        self.observer = observer
        self._wants_loads = not observer.takes.isdisjoint((Applied, LoadBegan, LoadEnded))
        self._told_floor, self._next_floor_ns = "", 0
        self._told_string = self._arrays.string_bytes

    def introduce(self, observer: Observer) -> None:
        """Notify an observer that joins a running simulation of the body, the active loads and the string."""
        observer.on(self._body())
        for acting in self.acting:
            shown = shown_load(acting.shown_kind, acting.load, self.setup.body)
            observer.on(LoadBegan(self.time_ns, acting.load_id, shown))
        observer.on(self._string_as_tied())

    def announce(self) -> None:
        """Notify the observer of the current body."""
        self.observer.on(self._body())

    def _body(self) -> BodyChanged:
        return BodyChanged(self.time_ns, self.setup, self._rotor_at(self.time_ns))

    def notify_floor(self, at_end: bool = False) -> None:
        """Notify the observer of the error floors if they have changed: every FLOOR_PERIOD_NS, and at the end of a run
        or of the observation.
        """
        due = at_end or self.time_ns >= self._next_floor_ns
        if not due or AccuracyFloor not in self.observer.takes:
            return
        self._next_floor_ns = self.time_ns + FLOOR_PERIOD_NS
        floor = self.accuracy_floor
        if floor != self._told_floor:
            self._told_floor = floor
            self.observer.on(AccuracyFloor(self.time_ns, floor))

    def _notify_load(self, load_id: int, kind: str, load: Load) -> None:
        if LoadBegan in self.observer.takes:
            self.observer.on(LoadBegan(self.time_ns, load_id, shown_load(kind, load, self.setup.body)))

    def _string_as_tied(self) -> StringChanged:
        tied = self.string
        return StringChanged(self.time_ns, tied, None if tied is None else tied.arm(self.setup.body))

    def _notify_string(self) -> None:
        """Notify the observer of the string if it has changed since the last notification."""
        if StringChanged not in self.observer.takes:
            return
        told, self._told_string = self._told_string, self._arrays.string_bytes
        if told != self._told_string:
            self.observer.on(self._string_as_tied())

    def log(self, kind: str, content: dict[str, Any]) -> None:
        """Log an event. One that doesn't affect the motion, such as a pause, is logged by the code that causes it."""
        if self.observer.wants(Logged):
            self.observer.on(Logged(self.time_ns, self.events.append(self.time_ns, kind, content)))
        else:
            self.events.note(self.time_ns, (kind, content))

    # Submission of commands

    def submit(
        self,
        command: Command,
        at_ns: int | None = None,
        listed: Listed | None = None,
        check: bool = True,
    ) -> int:
        """Schedule a command for ``at_ns``, or for now if that is None or past; returns the time at which it will act.

        listed: its place, if it is an entry of a list. Raises CommandRefused for what the present body and integrator
        can't take. Checked when it acts, and a refusal counted then: a ray, a command behind a change of parameters
        that may permit it, and one without ``check``.
        """
        when_ns = self.time_ns if at_ns is None or at_ns < self.time_ns else at_ns
        row = b""
        if check:
            try:
                row = check_command(command, self.setup)
            except CommandRefused:
                if not self.change_waits(when_ns):
                    raise
        self._arrivals += 1
        order = order_of(command, listed, self._arrivals)
        pending = Pending(when_ns, command, order, listed, row, self.setup.surface if row else False)
        heappush(self._pending, (when_ns, order, pending))
        return when_ns

    def change_waits(self, until_ns: int) -> bool:
        """Whether a change of parameters is scheduled for ``until_ns`` or before."""
        return any(time_ns <= until_ns and isinstance(p.command, Change) for time_ns, _, p in self._pending)

    def _push(self, pending: Pending) -> None:
        heappush(self._pending, (pending.time_ns, pending.order, pending))

    def refuse(self, error: CommandRefused, count: int = 1) -> None:
        """Count the refusal of ``count`` commands and notify the observer."""
        self.refused[error.reason] += count
        self.refusals[error.reason] = text = str(error)
        self.observer.on(Refused(self.time_ns, error.reason, text))

    def check_change(self, new: Setup) -> None:
        """Raises CommandRefused (``integrator``) when the new setup can't take over the present motion: its integrator
        can't handle current or future loads or rates.
        """
        self._arrays.check_change(self.setup, new)

    def reset(self, setup: Setup | None = None) -> None:
        """Restart at time 0 in the initial state (of a new setup, if given), without active loads and scheduled
        commands; counters are kept.
        """
        before, new = self.setup, setup or self.setup
        if not self.observer.takes:
            self._reset_untold(new)
            return
        if self._wants_loads:
            self._arrays.call(END_ALL, 0)
            self._notify([])
        self.notify_floor(at_end=True)
        self.setup = new
        # A run begins with its mesh, of which a recording says so at once.
        self._tell_of_mesh(before)
        self.observer.on(Reset())
        self.events.reset()
        self._start_over()
        self.log("reset", {})
        if new is not before:
            self.announce()

    def _reset_untold(self, setup: Setup) -> None:
        """The reset of a simulation without an observer, of which nobody is told."""
        self.setup = setup
        self.events.reset()
        self._start_over()
        self.events.note(0, _RESET)

    def fly(self, setup: Setup, commands: Iterable[Command], until_ns: int) -> bool:
        """``reset``, ``submit`` of commands of one list and ``advance`` in one, with the same bits: quicker, because no
        command waits. Returns False, with nothing flown, for what takes those three: a simulation whose events are told
        or chained, a motion that fails, and commands other than wrenches and pokes whose point is known and which act
        before the end.
        """
        if self.observer.takes or self.events.chained:
            return False
        self._reset_untold(setup)
        rows = list[Row]()
        try:
            for command in commands:
                row = check_command(command, setup)
                if not row or command.stamp_ns >= until_ns:
                    return False
                rows.append((command.stamp_ns, command.duration_ns, command.flight_kind, command.slot, row))
        except CommandRefused:
            return False
        if len(rows) > 1:
            rows.sort(key=_time_of)  # stable: equal times act in the order of the list
        arrays = self._arrays
        arrays.put(rows)
        if arrays.call(FLY, until_ns) != fl.REACHED:
            self._reset_untold(setup)
            return False
        self.time_ns = until_ns
        return True

    # Main loop

    def advance(self, until_ns: int) -> State:
        """Advance the body to ``until_ns`` and return its state there, before events at that same time are applied.

        A motion that diverges (|x|, |v| or |ω| above 1e100) stops at the last good state, where it stays until a reset,
        and sets ``failure``.
        """
        if self.failure:
            return self.state
        if until_ns < self.time_ns:
            raise ValueError(f"simulated time doesn't run backwards: {self.time_ns} to {until_ns} ns")
        arrays = self._arrays
        while True:
            # 1. Commands that are plain loads are passed to the compiled flight.
            event_ns, due = self._hand_over(until_ns)
            # 2. The flight advances from event to event, up to until_ns or to an event that needs Python code.
            if arrays.call(FLY, event_ns) != fl.REACHED:
                return self._stop_in_last_good_state(due)
            if due or self._wants_loads or arrays.integers[NOTEWORTHY]:
                self._notify(due)
            self.time_ns = event_ns
            if event_ns == until_ns:
                return self.state
            # 3. That event is applied, and a new segment begins with the loads active now.
            self._act()

    def _hand_over(self, until_ns: int) -> tuple[int, Sequence[Pending]]:
        """Time until which the compiled flight can advance on its own, and the commands that it applies on the way."""
        pending = self._pending
        if self.thrusters.due_ns < until_ns:
            until_ns = self.thrusters.due_ns
        if not pending or pending[0][0] >= until_ns:
            return until_ns, ()
        surface, due = self.setup.surface, list[Pending]()
        while pending and pending[0][0] < until_ns:
            first = pending[0][-1]
            if first.resolved_on is not surface and not self._is_plain_clear(first.command):
                until_ns = first.time_ns
                # All commands with the same time are applied together.
                while due and due[-1].time_ns == until_ns:
                    self._push(due.pop())
                break
            heappop(pending)
            due.append(first)
        self._arrays.put(map(row_of, due))
        return until_ns, due

    def _is_plain_clear(self, command: Command) -> bool:
        # A clear also switches off thrusters that push, which the compiled flight doesn't know.
        return isinstance(command, ClearWrench) and not self.thrusters.pushing

    def _notify(self, due: Sequence[Pending]) -> None:
        """Log the commands that were applied, and notify the observer of the loads that began and ended."""
        observer, arrays = self.observer, self._arrays
        if not (self._wants_loads or arrays.integers[NOTEWORTHY] or observer.wants(Logged)):
            self._note(due)
            return
        first = arrays.first_due
        for number, (now_ns, what, load_id, row) in enumerate(arrays.last_events()):
            self.time_ns = now_ns
            if what == fl.RELEASED:
                self._notify_string()
                self._log_timeout("string", True)
                continue
            if what in (fl.ENDED, fl.TIMED_OUT):
                observer.on(LoadEnded(now_ns, load_id))
                if what == fl.TIMED_OUT:
                    self._log_timeout("slot", slot_name(row))
                continue
            pending = due[row - first]
            command = pending.command
            if what == fl.DONE:
                self._log_command(command)
            elif what in (fl.TOO_LARGE, fl.UNSUPPORTED):
                self.refuse(arrays.refusal_of(pending, self.setup))
            elif not isinstance(command, WrenchCommand):
                continue
            elif what == fl.APPLIED:
                observer.on(
                    Applied(now_ns, command, load_of_bytes(pending.row), self.setup.body, arrays.attitude_at(number))
                )
            else:
                kind = "impulse" if command.flight_kind == IMPULSE else command.kind
                self._notify_load(load_id, kind, load_of_bytes(pending.row))

    def _note(self, due: Sequence[Pending]) -> None:
        """Note commands that were applied, whose lines nobody wants."""
        for pending in due:
            self.events.note(pending.time_ns, pending.command)
        if Acted in self.observer.takes:
            for pending in due:
                self.observer.on(Acted(pending.time_ns, pending.command))

    def _log_timeout(self, of: str, which: object) -> None:
        if of in self.logged_timeouts:
            self.log("timeout", {of: which})

    def _log_command(self, command: Command) -> None:
        # A noted change would keep its whole setup in memory, mesh included.
        if self.observer.wants(Logged) or isinstance(command, Change):
            self.log(command.kind, dict(command.content))
        else:
            self.events.note(self.time_ns, command)
        if Acted in self.observer.takes:
            self.observer.on(Acted(self.time_ns, command))

    # Events that need Python code

    def act(self) -> bool:
        """Apply the commands that are due now, without waiting for time to go on; returns whether there were any."""
        due = not self.failure and self._is_due
        if due:
            self._act()
        return due

    def leap(self, by_ns: int) -> None:
        """Go on ``by_ns`` later with the same state: no motion in between. What is due by then ends, and commands that
        are due by then act at the end, in the order of their times.
        """
        if self.failure:
            return
        self.log("jump", {"by_ns": by_ns})
        self.time_ns += by_ns
        self._arrays.leap(self.time_ns)
        due = []
        while self._pending and self._pending[0][0] <= self.time_ns:
            due.append(heappop(self._pending)[-1])
        for place, pending in enumerate(due):
            pending.time_ns, pending.order = self.time_ns, (-1, place, 0, 0)
            self._push(pending)
        self._acted_ns = self.time_ns
        if self._end_due():
            self._arrays.call(CUT, 0)
            self._notify_string()

    @property
    def next_event_ns(self) -> int:
        """When the next command acts, or load or string ends [ns]; fl.NEVER where none is known to."""
        command_ns = self._pending[0][0] if self._pending else fl.NEVER
        return min(command_ns, self.thrusters.due_ns, self._arrays.next_end_ns)

    def drop_commands(self) -> None:
        """Drop the commands that wait."""
        self._pending.clear()

    @property
    def _is_due(self) -> bool:
        """Whether a command is to act now."""
        return bool(self._pending) and self._pending[0][0] == self.time_ns

    def _act(self) -> None:
        """Apply everything that ends or begins now, and begin a new segment if anything did."""
        arrays, now_ns, changed = self._arrays, self.time_ns, False
        # Commands of one instant act one behind the other, however they come: what they let end ends behind them.
        if not (self._acted_ns == now_ns and self._is_due):
            changed = self._end_due()
        self._acted_ns = now_ns
        while self._is_due:
            pending = heappop(self._pending)[-1]
            self.listed = pending.listed
            try:
                self._apply(pending)
                changed = True
            except CommandRefused as refusal:
                self.refuse(refusal)
            except InputError as error:
                self.refuse(CommandRefused("schedule", error.field, error.received, error.accepted))
        self.listed = None
        if changed:
            arrays.call(CUT, 0)
            self._notify_string()

    def _end_due(self) -> bool:
        """End the loads that end now, by their duration or a timeout; returns whether there were any."""
        ended = bool(self._arrays.call(END_DUE, 0))
        self._notify([])
        if self.thrusters.due_ns <= self.time_ns:
            loads, timed_out = self.thrusters.end_due(self.time_ns, self._timeout_ns)
            if timed_out:
                self._log_timeout("thrusters", True)
            self._thrust(loads)
            ended = True
        return ended

    def _apply(self, pending: Pending) -> None:
        command, arrays = pending.command, self._arrays
        if isinstance(command, ThrusterCommand):
            check_thrust(command.forces, self.setup)
            self._thrust(self.thrusters.command(command.forces, self.time_ns, self._timeout_ns))
            self._log_command(command)
        elif isinstance(command, Change):
            self._change(command.apply())
            self._log_command(command)
        else:
            arrays.apply(pending, self.setup)
            if isinstance(command, WrenchCommand | ClearWrench):
                self._notify([pending])
                if isinstance(command, ClearWrench):
                    self.thrusters.clear()
            else:
                self._log_command(command)

    @property
    def _timeout_ns(self) -> int:
        """Time [ns] after which held wrenches and thrusters end; 0 for never."""
        return int(self.flight.timeout_ns)

    def _thrust(self, loads: list[tuple[int, Load]]) -> None:
        """Apply loads of thrusters, by number, until they are replaced."""
        arrays, rows = self._arrays, list[Row]()
        for number, load in loads:
            kind = HELD_WRENCH if load.is_zero else PULSE
            rows.append((self.time_ns, _UNTIL_REPLACED_NS, kind, -1 - number, load.packed))
        arrays.put(rows)
        arrays.call(APPLY, 0)
        if not self._wants_loads:
            return
        for now_ns, what, load_id, row_number in arrays.last_events():
            if what == fl.ENDED:
                self.observer.on(LoadEnded(now_ns, load_id))
            elif what == fl.BEGAN:
                self._notify_load(load_id, "thruster", loads[row_number - arrays.first_due][1])

    def _change(self, new: Setup) -> None:
        """Switch to another setup in flight."""
        old = self.setup
        self._arrays.change(old, new)
        self.setup = new
        self.thrusters.change(self._timeout_ns, self.time_ns)
        # The string's arm depends on the body, though it may be tied as before.
        self._told_string = self._told_string and b"on another body"
        self._tell_of_mesh(old)
        self.announce()

    def _tell_of_mesh(self, before: Setup) -> None:
        surface = self.setup.surface
        if surface is not before.surface:
            vertices, triangles = (None, None) if surface is None else (surface.vertices, surface.triangles)
            self.observer.on(MeshChanged(self.time_ns, vertices, triangles, self.setup.mesh_sha256))

    # Start and failure

    def _start_over(self) -> None:
        self._pending: list[Waiting] = []
        self.listed = None
        self.failure = ""
        self.time_ns, self._acted_ns = 0, -1
        if self.setup.thrusters or self.thrusters.pushes:
            self.thrusters = ThrusterControl(self.setup.thrusters)
        self._arrays.start_over(self.setup)
        self._told_string = b""
        self._told_floor, self._next_floor_ns = "", 0
        self._notify_string()

    def _stop_in_last_good_state(self, due: Sequence[Pending]) -> State:
        """Stop after a failure of the motion; commands in ``due`` that haven't been applied stay pending."""
        arrays = self._arrays
        acted = len(due) - arrays.waiting
        for pending in due[acted:]:
            self._push(pending)
        self._notify(due[:acted])
        self.time_ns = arrays.time_ns
        when = f"{int(self.flight.committed_ns) * 1e-9:.9g} s"
        self.failure = f"the motion passed {MAX_SPEED:g}, was not finite or too fast for any step after {when}"
        if self.string is not None and self.string.bilateral and self.string.rest_length:
            self.failure += "; a string that pushes has no direction where its knot meets its free end"
        arrays.call(FINISH, 0)
        return self.state

    # Observables at the time of the last advance

    @property
    def state(self) -> State:
        """The state, an object of the caller's own; another thread may ask for it, and gets that of one time."""
        arrays = self._arrays
        while True:
            now_ns, row = arrays.integers[NOW_NS], arrays.row.copy()
            if arrays.integers[NOW_NS] == now_ns:
                return State(now_ns, row)

    @property
    def acting(self) -> list[ActingLoad]:
        """The active loads, in the order in which they began."""
        return list(self._arrays.acting())

    @property
    def flight(self) -> np.record:
        """The record of the compiled flight (simulation/flight.py), for reading only."""
        return self._arrays.flight

    @property
    def memory(self) -> bytes:
        """A copy of the flight's record, and of the rows of its active loads (LOAD_ROW) behind it."""
        return self._arrays.memory

    @property
    def steps(self) -> int:
        """Steps committed since start or reset; sampling adds none."""
        return int(self.flight.steps_before + fl.steps_of_segment(self.flight))

    @property
    def force_evaluations(self) -> int:
        """Evaluations of the equations of motion in the committed steps."""
        in_segment = fl.evaluations_of_segment(self.flight)
        return int(self.flight.evaluations_before + in_segment)

    @property
    def choice(self) -> str:
        """The method that advances the body now, and the reason for it."""
        flight = self.flight
        degree = int(flight.degree)
        return method_of(int(flight.method)).choice.format(
            step_s=int(flight.step_ns) * 1e-9,
            degree=degree,
            degree_of_motion=degree_of_motion(degree),
            swing=fastest_swing(flight.problem),
        )

    @property
    def accuracy_floor(self) -> str:
        """Message if rounding, and not the requested accuracy, has limited the motion's error since start or reset;
        empty if it hasn't, or if the integrator has no accuracy.
        """
        return fl.floor_text(self.floors)

    @property
    def floors(self) -> list[float]:
        """Error floors by kind (flight.FLOOR_KINDS); 0 where rounding isn't the limit."""
        return [float(floor) for floor in self._arrays.floors()]

    @property
    def too_coarse(self) -> str:
        """Message if the fixed step is too long, with |ω|h, ω_s h of a string or a flywheel's rate times h above the
        integrator's limit; empty otherwise.
        """
        setup = self.setup
        limit, h = setup.integrator.stability_limit, int(self.flight.step_ns) * 1e-9
        spin = length(self.state.angular_velocity_body) * h
        string = self.string
        swing = string.frequency * h if string else 0.0
        rotor = rotor_rate(setup.body.row, self._rotor_at(self.time_ns)) * h
        if rotor > limit:
            return f"{setup.integrator.name}: rate of the flywheel times step = {rotor:.3g}, good up to {limit:g}"
        if spin > limit:
            return f"{setup.integrator.name}: |w| step = {spin:.3g}, good up to {limit:g}"
        if swing > limit:
            return f"{setup.integrator.name}: string frequency times step = {swing:.3g}, good up to {limit:g}"
        return ""

    @property
    def string(self) -> StringState | None:
        """State of the tied string, or None."""
        return self._arrays.string

    @property
    def attach(self) -> Vector:
        """Where the next target ties the string, in mesh coordinates."""
        return vector(self.flight.string_attach.tolist())

    @property
    def hand_work(self) -> float:
        """Work done by the hand at the string's free end since start or reset [J]."""
        return float(self.flight.work_before + self.flight.work)

    @property
    def string_heat(self) -> float:
        """Energy dissipated in the string's damper since start or reset [J]."""
        return float(self.flight.lost_before + self.flight.lost)

    @property
    def potential_energy(self) -> float:
        """−m g·x plus the energy of the string [J]."""
        setup, string = self.setup, self.string
        energy = -setup.body.mass * dot(setup.gravity, self.state.position)
        return energy + (string.potential_energy(setup.body, self.state) if string else 0.0)

    def fill_state(self, row: FloatArray) -> None:
        """Fill a state row (STATE,), see simulation/quantities.py, with the present state and what is in force."""
        state_of(self.setup.scene, self.flight, row)

    @property
    def kinetic_energy(self) -> float:
        """½ m|v|² + ½ ωᵀIω [J]."""
        return self.state.kinetic_energy(self.setup.body.mass, self.setup.body.inertia)

    @property
    def angular_momentum(self) -> Vector3:
        """R (I ω + h) about the COM (3,) [N m s, world]."""
        return self.state.angular_momentum(self.setup.body.inertia, self.rotor_momentum)

    @property
    def rotor_momentum(self) -> Vector3:
        """h of the flywheel (3,) [N m s, body axes]."""
        return np.array(self._rotor_at(self.time_ns))

    def _rotor_at(self, time_ns: int) -> Vector:
        return fl.rotor_momentum(self.flight, time_ns)

    @property
    def angular_momentum_drift(self) -> float:
        """|L − L₀|/|L₀| since the current segment began; 0 while a torque may act on the body, or without spin."""
        # The entries after the forces are torques and moments of forces.
        if self.string is not None or self.flight.sums[TORQUE_WORLD:].any():
            return 0.0
        if self.setup.scene.angular_damping or not self.setup.scene.gyroscopic:
            return 0.0
        rotor = np.array(self._rotor_at(int(self.flight.start_ns)))
        start = np.array(angular_momentum(self.flight.start, self.setup.body.inertia.ravel(), rotor))
        moved, size = self.angular_momentum - start, length(start)
        return length(moved) / size if size > 0.0 else 0.0

    @property
    def at_rest(self) -> bool:
        """Whether nothing moves, no load acts and no command is pending."""
        still = not (self.state.row[7:].any() or self.setup.gravity.any())
        return still and not (self.flight.acting or self.flight.tied or self._pending)

    def accelerations(self) -> tuple[Vector3, Vector3]:
        """Current acceleration of the COM (3,) [m/s²] and angular acceleration (3,) [rad/s²], both in world axes."""
        linear, angular = self._accelerations()
        return linear, times(self.state.rotation, angular)

    def specific_force(self, point: Numbers) -> Vector3:
        """Specific force (3,) [m/s², body axes] at ``point`` r (3,) [m, body axes from the COM], as an accelerometer
        shows it: Rᵀ(a − g) + ω' × r + ω × (ω × r).
        """
        linear, angular = self._accelerations()
        w = self.state.angular_velocity_body
        own = transposed_times(self.state.rotation, linear - self.setup.gravity)
        shown: Vector3 = own + cross(angular, point) + cross(w, cross(w, point))
        return shown

    def _accelerations(self) -> tuple[Vector3, Vector3]:
        """Current acceleration of the COM (3,) [m/s², world] and angular acceleration (3,) [rad/s², body axes]."""
        six = self._arrays.accelerations()
        return six[:3], six[3:]
