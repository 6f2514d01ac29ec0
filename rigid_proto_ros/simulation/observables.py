# SPDX-License-Identifier: MIT
"""What can be read off a running simulation: energies, momentum, what an accelerometer shows, what the
motion has cost.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..base.rotation import cross, dot, length, times, transposed_times
from ..base.vectors import Numbers, Vector
from ..motion.integrators.series_steps import degree_of_motion, fastest_swing
from ..motion.loads import TORQUE_WORLD
from ..motion.problem import PROBLEM
from ..motion.state import State, angular_momentum
from ..motion.string import StringState
from ..motion.variables import VARIABLES
from . import flight as fl
from .commands import Waiting
from .flight_arrays import ActingLoad, FlightArrays
from .setup import Setup
from .string_control import StringControl
from .thrusters import ThrusterControl

FLOORS = (
    "rounding of 32 units in the last place a step, in steps that short, comes to {:.2g} a second",
    "rounding of the string's length, which its stiffness multiplies, comes to {:.2g} a second",
    "rounding of the spin turns the attitude by up to {:.2g} rad a second",
    "rounding of a slender tensor given in axes other than its own turns the attitude by up to {:.2g} rad a second",
    "rounding of a position far from the world's origin is {:.2g} of the body's size",
)
"""In the order of flight.FLOOR_KINDS."""


def floor_text(floors: Iterable[float]) -> str:
    """What floors of a flight, by kind, say; empty where there are none."""
    return "; ".join(text.format(floor) for text, floor in zip(FLOORS, floors, strict=True) if floor)


class Observables:
    """The readings of a Simulation at the time it was last advanced to; none of them changes it."""

    setup: Setup
    state: State
    time_ns: int
    _pending: list[Waiting]
    _string: StringControl
    _arrays: FlightArrays
    thrusters: ThrusterControl

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
        return floor_text(self.floors)

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
    def has_pending(self) -> bool:
        """Commands wait for their time."""
        return bool(self._pending)

    @property
    def at_rest(self) -> bool:
        """Nothing moves, acts or is about to."""
        still = not (self.state.row[7:].any() or self.setup.gravity.any())
        return still and not self._arrays.acts and self.string is None and not self.has_pending

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
