# SPDX-License-Identifier: MIT
"""The simulation: commands in, motion out.

Simulated time is an integer number of nanoseconds. Commands cut it into segments (simulation/flight.py); within one,
commands are constant and an integrator advances the body. ``advance`` is the whole story.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from heapq import heappop, heappush
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.rotation import cross, dot, length, times, transposed_times
from ..base.vectors import Numbers, Vector
from ..motion.integrators import check_supported
from ..motion.integrators.integrator import STRING
from ..motion.integrators.series_steps import degree_of_motion, fastest_swing
from ..motion.loads import TORQUE_WORLD, Load, load_of_bytes
from ..motion.problem import MAX_SPEED, PROBLEM, VARIABLES
from ..motion.state import State, angular_momentum, shift_com
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
    MoveString,
    Pending,
    ReleaseString,
    SetState,
    ThrusterCommand,
    TieString,
    Waiting,
    WrenchCommand,
    order_of,
    slot_name,
)
from .flight_arrays import APPLY, CUT, END_ALL, END_DUE, FINISH, TIMEOUTS, ActingLoad, FlightArrays
from .observer import (
    AccuracyFloor,
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
from .setup import (
    Setup,
    check_command,
    check_load_supported,
    check_rates,
    check_start,
    check_thrust,
    load_row,
    needs_of,
)
from .string_control import StringControl
from .thrusters import ThrusterControl

_UNTIL_REPLACED_NS = fl.NEVER >> 1


FLOOR_PERIOD_NS = 50_000_000
"""[ns, simulated] How often observers are told how far the motion is held to its accuracy."""


class Simulation:
    """One body under commands.

    Not for several threads: one owner submits and advances. ``time_ns`` and ``state`` are those last asked for.
    ``refused`` counts refusals by reason; ``failure`` says why the motion stopped, or is empty. ``listed``: the place
    of the command that acts at this moment in its list, if it is an entry of one. ``logs_timeouts``: a held wrench that
    times out is an event. ``setup_of``: gives the setup that a change leads to which doesn't bring its own.
    """

    time_ns: int

    def __init__(self, setup: Setup, observer: Observer | None = None) -> None:
        self.setup = setup
        self.follower: Callable[[Command, int, Listed | None], None] | None = None
        self.events = EventLog()
        self.refused: Counter[str] = Counter()
        self._arrivals = 0
        self.listed: Listed | None = None
        self.logs_timeouts = True
        self.setup_of: Callable[[Change], Setup] = _no_change
        check_start(setup)
        self._arrays = FlightArrays(setup)
        self._told_string: StringState | None = None
        self.watch(observer or Observer())
        self._start_over()

    # Who watches

    def watch(self, observer: Observer) -> None:
        """Tell this observer from now on, and no other."""
        self.observer = observer
        self._wants_loads = not observer.takes.isdisjoint((Applied, LoadBegan, LoadEnded))
        self._told_floor, self._next_floor_ns = "", 0

    def introduce(self, observer: Observer) -> None:
        """Tell an observer that comes in flight about the body, what acts on it and the string."""
        observer.on(BodyChanged(self.time_ns, self.setup))
        for acting in self.acting:
            shown = shown_load(acting.shown_kind, acting.load, self.setup.body)
            observer.on(LoadBegan(self.time_ns, acting.load_id, shown))
        observer.on(self._string_as_tied())

    def announce(self) -> None:
        """Tell the observer about the body as it is now."""
        self.observer.on(BodyChanged(self.time_ns, self.setup))

    def notify_floor(self, at_end: bool = False) -> None:
        """Tell the observer what holds the motion to less than its accuracy, where that changed: from time to time, and
        at the end of a run or of its watch.
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
        """Tell the observer about the string, where it changed since it was last told."""
        if self.string is self._told_string:
            return
        self._told_string = self.string
        if StringChanged in self.observer.takes:
            self.observer.on(self._string_as_tied())

    def log(self, kind: str, content: dict[str, Any]) -> None:
        """Log an event; one that doesn't touch the motion, such as a pause, is logged by whoever causes it."""
        if self.observer.wants(Logged):
            self.observer.on(Logged(self.time_ns, self.events.append(self.time_ns, kind, content)))
        else:
            self.events.note(self.time_ns, (kind, content))

    # The way of a command

    def submit(
        self,
        command: Command,
        at_ns: int | None = None,
        listed: Listed | None = None,
        checked: tuple[bytes, Setup] | None = None,
    ) -> int:
        """Take a command to act at ``at_ns``, or now when that is None or past; returns the time it will act.

        listed: its place, when it is an entry of a list. checked: what ``check_command`` gave, and the setup that it
        was given, where that isn't the present one: a change before it in its list may allow what that doesn't.
        Raises CommandRefused for what can be checked now; what can't (a ray) is checked when it acts, and counted.
        """
        when_ns = self.time_ns if at_ns is None or at_ns < self.time_ns else at_ns
        row, setup = (check_command(command, self.setup), self.setup) if checked is None else checked
        self._arrivals += 1
        pending = Pending(when_ns, command, order_of(command, listed, self._arrivals), listed)
        if row and isinstance(command, WrenchCommand):
            pending.set_load(command, row, setup)
        self._push(pending)
        if self.follower is not None:
            self.follower(command, when_ns, listed)
        return when_ns

    def _push(self, pending: Pending) -> None:
        heappush(self._pending, (pending.time_ns, pending.order, pending))

    def refuse(self, error: CommandRefused, count: int = 1) -> None:
        """Count a refusal, of so many commands at once, and tell the observer."""
        self.refused[error.reason] += count
        self.observer.on(Refused(self.time_ns, error.reason, str(error)))

    def check_change(self, new: Setup) -> None:
        """Raises CommandRefused (``integrator``) when the new setup's integrator doesn't support what acts, or will."""
        # A string that is to be tied at time 0 will be, at the next reset, though it was let go since.
        tied = new.string.attached or (self.string is not None and not self.setup.string.attached)
        check_supported(new.integrator, needs_of(new, (acting.load for acting in self.acting), tied))
        knot = new.string.attach if new.string.attach != self.setup.string.attach else self._string.attach
        check_rates(new, knot if tied else None)

    def reset(self, setup: Setup | None = None) -> None:
        """Time 0, the initial state (of a new setup, if given), no held wrench, no pulses, nothing scheduled; counters
        stay.
        """
        self._arrays.call(END_ALL)
        self._notify([])
        self.notify_floor(at_end=True)
        self.observer.on(Reset())
        self.events.reset()
        before = self.setup
        self.setup = setup or self.setup
        self._start_over()
        self.log("reset", {})
        if self.setup is not before:
            self._tell_of_mesh(before)
            self.announce()

    # The story

    def advance(self, until_ns: int) -> State:
        """Take the body to ``until_ns`` and return its state there, before what acts at that very time.

        Running away (|x|, |v| or |ω| past 1e100) stops at the last good state and sets ``failure``.
        """
        if until_ns < self.time_ns:
            raise ValueError(f"simulated time doesn't run backwards: {self.time_ns} to {until_ns} ns")
        arrays = self._arrays
        while True:
            # 1. Commands that are nothing but loads are handed to the compiled flight.
            event_ns, due = self._hand_over(until_ns)
            # 2. From event to event, up to the time asked for or to an event that takes more than arithmetic.
            if not arrays.fly(event_ns):
                return self._stop_in_last_good_state(due)
            if due or self._wants_loads or arrays.integers[TIMEOUTS]:
                self._notify(due)
            self.time_ns = event_ns
            self.state = state = State(event_ns, arrays.row.copy())
            if event_ns == until_ns:
                return state
            # 3. That event is applied; with what acts now a new segment begins.
            self._act()

    def _hand_over(self, until_ns: int) -> tuple[int, Sequence[Pending]]:
        """Until when the compiled flight needs nobody, and the commands that it applies on the way."""
        tied, pending = self._string.tied, self._pending
        if tied is not None and tied.release_ns is not None:
            until_ns = min(until_ns, tied.release_ns)
        if self.thrusters.due_ns < until_ns:
            until_ns = self.thrusters.due_ns
        if not pending or pending[0][0] >= until_ns:
            return until_ns, ()
        setup = self.setup
        due: list[Pending] = []
        while pending:
            entry = pending[0]
            if entry[0] >= until_ns:
                break
            first = entry[-1]
            if first.resolved_for is not setup and not self._is_ready(first):
                until_ns = first.time_ns
                # All commands of one instant act together.
                while due and due[-1].time_ns == until_ns:
                    self._push(due.pop())
                break
            heappop(pending)
            due.append(first)
        self._arrays.put(due)
        return until_ns, due

    def _is_ready(self, pending: Pending) -> bool:
        """Whether nothing but arithmetic is left to do when the command acts."""
        if not isinstance(pending.command, WrenchCommand):
            # The clock of thrusters at work is no matter of the compiled flight.
            return isinstance(pending.command, ClearWrench) and self.thrusters.due_ns == fl.NEVER
        try:
            return self._still_holds(pending, pending.command)
        except CommandRefused:
            return False  # refused when it acts, and not before

    def _notify(self, due: Sequence[Pending]) -> None:
        """Log the commands that acted, and tell the observer what began and ended."""
        observer, arrays = self.observer, self._arrays
        if not (self._wants_loads or observer.wants(Logged) or arrays.integers[TIMEOUTS]):
            for pending in due:
                self.events.note(pending.time_ns, pending.command)
            return
        first = arrays.first_due
        for number, (now_ns, what, load_id, row) in enumerate(arrays.last_events()):
            self.time_ns = now_ns
            if what in (fl.ENDED, fl.TIMED_OUT):
                observer.on(LoadEnded(now_ns, load_id))
                if what == fl.TIMED_OUT and self.logs_timeouts:
                    self.log("timeout", {"slot": slot_name(row)})
                continue
            pending = due[row - first]
            command = pending.command
            if what == fl.DONE:
                self._log_command(command)
                continue
            load = load_of_bytes(pending.row) if pending.row else None
            if load is None or not isinstance(command, WrenchCommand):
                continue
            if what == fl.APPLIED:
                observer.on(Applied(now_ns, command, load, self.setup.body, arrays.attitude_at(number)))
            else:
                kind = "impulse" if pending.kind == IMPULSE else command.kind
                self._notify_load(load_id, kind, load)

    def _log_command(self, command: Command) -> None:
        # A change that waited in a queue would keep its whole setup, mesh included.
        if self.observer.wants(Logged) or isinstance(command, Change):
            self.log(command.kind, dict(command.content))
        else:
            self.events.note(self.time_ns, command)

    # What happens at an event that takes more than arithmetic

    def _act(self) -> None:
        """Everything that ends or begins now; a new segment if anything did."""
        arrays, now_ns = self._arrays, self.time_ns
        changed = bool(arrays.call(END_DUE))
        self._notify([])
        changed |= self._string.end_due(now_ns)
        if self.thrusters.due_ns <= now_ns:
            loads, timed_out = self.thrusters.end_due(now_ns, self.setup.wrench_timeout_ns)
            if timed_out and self.logs_timeouts:
                self.log("timeout", {"thrusters": True})
            self._thrust(loads)
            changed = True
        while self._pending and self._pending[0][0] == now_ns:
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
            arrays.tie(self._string.tied)
            arrays.call(CUT)
            self._notify_string()

    def _apply(self, pending: Pending) -> None:
        command = pending.command
        if isinstance(command, WrenchCommand | ClearWrench):
            if isinstance(command, WrenchCommand) and not self._still_holds(pending, command):
                pending.set_load(command, load_row(command, self.setup, self.state), self.setup)
            self._arrays.put([pending])
            self._arrays.call(APPLY)
            self._notify([pending])
            if isinstance(command, ClearWrench):
                self.thrusters.clear()
            self.state = self._arrays.state
            return
        if isinstance(command, ThrusterCommand):
            check_thrust(command.forces, self.setup)
            self._thrust(self.thrusters.command(command.forces, self.time_ns, self.setup.wrench_timeout_ns))
        elif isinstance(command, Change):
            self._change(command.apply() if command.apply else self.setup_of(command))
        elif isinstance(command, SetState):
            self._arrays.row[:] = self.state.moved(command.values).row
            self.state = self._arrays.state
        elif isinstance(command, TieString):
            self._string.tie_at(command, self.setup, self.state)
        elif isinstance(command, MoveString):
            check_supported(self.setup.integrator, frozenset({STRING}))
            self._string.move(command, self.setup, self.state)
        elif isinstance(command, ReleaseString):
            self._string.release()
        self._log_command(command)

    def _thrust(self, loads: list[tuple[int, Load]]) -> None:
        """Let thrusters, by number, push like this until they are told otherwise."""
        arrays, rows = self._arrays, []
        for number, load in loads:
            row = Pending(self.time_ns, ClearWrench(), duration_ns=_UNTIL_REPLACED_NS, row=load.packed)
            row.kind, row.slot = HELD_WRENCH if load.is_zero else PULSE, -1 - number
            rows.append(row)
        arrays.put(rows)
        arrays.call(APPLY)
        if not self._wants_loads:
            return
        for now_ns, what, load_id, row_number in arrays.last_events():
            if what == fl.ENDED:
                self.observer.on(LoadEnded(now_ns, load_id))
            elif what == fl.BEGAN:
                self._notify_load(load_id, "thruster", loads[row_number - arrays.first_due][1])

    def _still_holds(self, pending: Pending, command: WrenchCommand) -> bool:
        """Whether the load resolved at submission holds now: it doesn't if it was a ray, or the mesh has changed since.

        Raises CommandRefused when the body or the integrator that there is now can't take it.
        """
        setup, before = self.setup, pending.resolved_for
        if before is setup:
            return True
        if before is None or before.surface is not setup.surface:
            return False
        load = load_of_bytes(pending.row)
        if before.body is not setup.body:
            load.check_magnitude(setup.body)
        check_load_supported(command, load, setup)
        pending.resolved_for = setup
        return True

    def _change(self, new: Setup) -> None:
        """Take another setup in flight. The same mesh at the same size stays where it is, so a COM that moves within it
        takes position and velocity along; another mesh or size keeps the COM and its motion.
        """
        self.check_change(new)
        old, self.setup = self.setup, new
        moved = new.body.center_of_mass - old.body.center_of_mass
        if new.geometry == old.geometry and moved.any():
            shift_com(self._arrays.row, *moved.tolist())
            self.state = self._arrays.state
        self._arrays.take(new)
        self._string.change(old, new, self.state)
        self.thrusters.change(new.wrench_timeout_ns, self.time_ns)
        self._tell_of_mesh(old)
        self.announce()

    def _tell_of_mesh(self, before: Setup) -> None:
        surface = self.setup.surface
        if surface is not before.surface and surface is not None:
            name = str(self.setup.geometry[0])
            self.observer.on(MeshChanged(self.time_ns, surface.vertices, surface.triangles, name))

    # The beginning and a bad end

    def _start_over(self) -> None:
        self._pending: list[Waiting] = []
        self.listed = None
        self.failure = ""
        self.time_ns = 0
        self.state = State(0, self.setup.initial.copy())
        self._string = StringControl(self.setup, self.state)
        self.thrusters = ThrusterControl(self.setup.thrusters)
        self._arrays.start_over(self.setup, self._string.tied)
        self._told_string = None
        self._told_floor, self._next_floor_ns = "", 0
        self._notify_string()

    def _stop_in_last_good_state(self, due: Sequence[Pending]) -> State:
        """The motion failed on the way; of these commands those that hadn't acted yet go on waiting."""
        arrays = self._arrays
        acted = len(due) - arrays.waiting
        for pending in due[acted:]:
            self._push(pending)
        self._notify(due[:acted])
        self.time_ns, self.state = arrays.time_ns, arrays.state
        when = f"{int(self.flight.committed_ns) * 1e-9:.9g} s"
        self.failure = f"the motion passed {MAX_SPEED:g}, was not finite or too fast for any step after {when}"
        if self.string is not None and self.string.bilateral and self.string.rest_length:
            self.failure += "; a string that pushes has no direction where its knot meets its free end"
        arrays.call(FINISH)
        return self.state

    # What can be read off it, at the time it was last advanced to

    @property
    def acting(self) -> list[ActingLoad]:
        """The loads that act now: in the order in which they began."""
        return list(self._arrays.acting())

    @property
    def flight(self) -> np.record:
        """All that the compiled flight knows (simulation/flight.py), to be read."""
        return self._arrays.flight

    @property
    def steps(self) -> int:
        """Steps committed since start or reset; sampling takes none."""
        return int(self.flight.steps_before + fl.steps_of_segment(self.flight))

    @property
    def force_evaluations(self) -> int:
        """Evaluations of the equations of motion in those steps."""
        in_segment = fl.evaluations_of_segment(self.flight, self._arrays.methods)
        return int(self.flight.evaluations_before + in_segment)

    @property
    def choice(self) -> str:
        """Which method advances the body now, and why."""
        flight = self.flight
        degree = int(flight.degree)
        return self._arrays.integrator.methods[int(flight.method)].choice.format(
            step_s=int(flight.step_ns) * 1e-9,
            degree=degree,
            degree_of_motion=degree_of_motion(degree),
            swing=fastest_swing(flight.problem),
        )

    @property
    def accuracy_floor(self) -> str:
        """Why, since start or reset, rounding and not the accuracy asked for has set what the motion errs; empty where
        it hasn't, or nothing adapts to the accuracy.
        """
        return fl.floor_text(self.floors)

    @property
    def floors(self) -> list[float]:
        """The same by kind (flight.FLOOR_KINDS), 0 where it hasn't."""
        if not self.setup.integrator.chooses and self.setup.integrator.name != "free_body":
            return [0.0] * fl.FLOOR_KINDS
        floors = self.flight.floors.copy()
        fl.note_floors(self.flight, self._arrays.methods, floors)
        return [float(floor) for floor in floors]

    @property
    def too_coarse(self) -> str:
        """Why the fixed step says nothing here, |ω|h or ω_s h being beyond the integrator's limit; empty
        when it does.
        """
        setup = self.setup
        limit, h = setup.integrator.stability_limit, setup.step_ns * 1e-9
        spin = length(self.state.angular_velocity_body) * h
        string = self.string
        swing = string.frequency * h if string else 0.0
        if spin > limit:
            return f"{setup.integrator.name}: |w| step = {spin:.3g}, good up to {limit:g}"
        if swing > limit:
            return f"{setup.integrator.name}: string frequency times step = {swing:.3g}, good up to {limit:g}"
        return ""

    @property
    def string(self) -> StringState | None:
        """The string as it is tied, or None."""
        return self._string.tied

    @property
    def attach(self) -> Vector:
        """Where the next target ties the string, in mesh coordinates."""
        return self._string.attach

    @property
    def hand_work(self) -> float:
        """What the hand at the string's free end has worked since start or reset [J]."""
        return float(self.flight.work_before + self.flight.work)

    @property
    def string_heat(self) -> float:
        """What the string's damper has turned to heat since start or reset [J]."""
        return float(self.flight.lost_before + self.flight.lost)

    @property
    def potential_energy(self) -> float:
        """−m g·x, and the string's [J]."""
        setup = self.setup
        # Read once: another thread may let it go meanwhile.
        string = self.string
        energy = -setup.body.mass * dot(setup.gravity, self.state.position)
        return energy + (string.potential_energy(setup.body, self.state) if string else 0.0)

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
        # Torques, and moments of forces, stand behind the forces.
        if self.string is not None or self.flight.sums[TORQUE_WORLD:].any():
            return 0.0
        if self.setup.angular_damping or not self.setup.gyroscopic:
            return 0.0
        start = np.array(angular_momentum(self.flight.start, self.setup.body.inertia.ravel()))
        moved, size = self.angular_momentum - start, length(start)
        return length(moved) / size if size > 0.0 else 0.0

    @property
    def at_rest(self) -> bool:
        """Nothing moves, acts or is about to."""
        still = not (self.state.row[7:].any() or self.setup.gravity.any())
        return still and not self.acting and self.string is None and not self._pending

    def accelerations(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the COM (3,) [m/s²] and angular (3,) [rad/s²], both in world axes, now."""
        linear, angular = self._accelerations()
        return linear, times(self.state.rotation, angular)

    def specific_force(self, point: Numbers) -> np.ndarray:
        """What an accelerometer at ``point`` (3,) [m, body axes from the COM] shows now (3,) [m/s², body axes]:
        Rᵀ(a − g) + ω' × r + ω × (ω × r).
        """
        linear, angular = self._accelerations()
        w = self.state.angular_velocity_body
        own = transposed_times(self.state.rotation, linear - self.setup.gravity)
        shown: np.ndarray = own + cross(angular, point) + cross(w, cross(w, point))
        return shown

    def _accelerations(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the COM (3,) [m/s², world] and angular (3,) [rad/s², body axes], now."""
        six = np.array(fl.accelerations_now(self.flight, np.zeros(1, PROBLEM), np.zeros(VARIABLES)))
        return six[:3], six[3:]


def _no_change(command: Change) -> Setup:
    raise InputError(command.kind, command.content, "a change with a setup of its own: there are no parameters here")
