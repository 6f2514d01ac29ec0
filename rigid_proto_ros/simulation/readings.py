# SPDX-License-Identifier: MIT
"""What can be read off a running simulation: energies, momentum, what an accelerometer shows, what the
motion has cost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..motion.loads import LoadSum
from ..motion.state import State
from ..motion.string import Tied
from .accelerations import specific_force
from .accuracy_floor import accuracy_floor
from .flight_arrays import Acting, FlightArrays
from .segment import Segment
from .setup import Setup
from .string_control import StringControl

FEWEST_EVALUATIONS = 20_000
"""In a segment, from which on they are judged: the first tiny steps of a transient say nothing about those after it."""
MOST_EVALUATIONS_A_SECOND = {True: 2e5, False: 5e6}
"""That the clock leaves time for: for methods that choose their steps, a series or an implicit stage
each, and for fixed steps.
"""


class Readings:
    """The readings of a Simulation at the time it was last advanced to; none of them changes it."""

    setup: Setup
    state: State
    _pending: list
    _string: StringControl
    _arrays: FlightArrays

    @property
    def acting(self) -> list[Acting]:
        """The loads that act now: in the order in which they began."""
        return list(self._arrays.acting())

    @property
    def _segment(self) -> Segment:
        return Segment(self._arrays)

    @property
    def steps(self) -> int:
        """Steps committed since start or reset; sampling takes none."""
        return self._arrays.steps

    @property
    def force_evaluations(self) -> int:
        """Evaluations of the equations of motion in those steps."""
        return self._arrays.evaluations

    @property
    def choice(self) -> str:
        """Which method advances the body now, and why."""
        return self._segment.choice

    @property
    def floor_binds(self) -> bool:
        """Rounding, not the accuracy asked for, limits some step of the present segment."""
        return self._segment.floor_binds

    @property
    def accuracy_floor(self) -> str:
        """Why rounding, and not the accuracy asked for, limits the present segment; empty when it doesn't
        or nothing adapts to it.
        """
        setup, segment = self.setup, self._segment
        if setup.integrator.name not in ("auto", "free_body"):
            return ""
        elapsed = (self.state.time_ns - segment.start.time_ns) * 1e-9
        return accuracy_floor(setup, self.state, segment.floor_binds, segment.evaluates_once, elapsed)

    @property
    def too_coarse(self) -> str:
        """Why the fixed step says nothing here, |ω|h or ω_s h being beyond the integrator's limit; empty
        when it does.
        """
        setup = self.setup
        limit, h = setup.integrator.stability_limit, setup.step_ns * 1e-9
        spin = float((self.state.angular_velocity_body**2).sum()) ** 0.5 * h
        string = self.string
        swing = string.frequency * h if string else 0.0
        if spin > limit:
            return f"{setup.integrator.name}: |w| step = {spin:.3g}, good up to {limit:g}"
        if swing > limit and not setup.integrator.stiff:
            return f"{setup.integrator.name}: string frequency times step = {swing:.3g}, good up to {limit:g}"
        return ""

    @property
    def too_slow(self) -> str:
        """That the present segment takes more computing than the clock leaves time for; empty when it doesn't."""
        segment = self._segment
        elapsed = (self.state.time_ns - segment.start.time_ns) * 1e-9
        evaluations = segment.evaluations
        most = MOST_EVALUATIONS_A_SECOND[self.setup.integrator.chooses]
        if evaluations < FEWEST_EVALUATIONS or evaluations < most * elapsed:
            return ""
        return f"{self.choice}: {segment.steps / elapsed:.2g} steps for a second of the motion, slower than real time"

    @property
    def string(self) -> Tied | None:
        """The string as it is tied, or None."""
        return self._string.tied

    @property
    def hand_work(self) -> float:
        """What the hand at the string's free end has worked since start or reset [J]."""
        return self._arrays.hand_work

    @property
    def string_heat(self) -> float:
        """What the string's damper has turned to heat since start or reset [J]."""
        return self._arrays.heat

    @property
    def potential_energy(self) -> float:
        """−m g·x, and the string's [J]."""
        setup = self.setup
        # Read once: another thread may let it go meanwhile.
        string = self.string
        energy = -setup.body.mass * float((setup.gravity * self.state.position).sum())
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
        loads = self._load_sum()
        turned = self.string is not None or loads.torque_world.any() or loads.torque_body.any() or loads.moment.any()
        if turned or self.setup.angular_damping or not self.setup.gyroscopic:
            return 0.0
        start = self._segment.start.angular_momentum(self.setup.body.inertia)
        moved, size = self.angular_momentum - start, float((start * start).sum()) ** 0.5
        return float((moved * moved).sum()) ** 0.5 / size if size > 0.0 else 0.0

    @property
    def has_pending(self) -> bool:
        """Commands wait for their time."""
        return bool(self._pending)

    @property
    def at_rest(self) -> bool:
        """Nothing moves, acts or is about to."""
        still = not (self.state.row[7:].any() or self.setup.gravity.any())
        return still and not self._arrays.acts and self.string is None and not self.has_pending

    def specific_force(self, point: Sequence[float]) -> np.ndarray:
        """What an accelerometer at ``point`` (3,) [m, body axes from the COM] shows now (3,) [m/s², body axes]."""
        return specific_force(self.setup, self._load_sum(), self.string, self.state, point)

    def _load_sum(self) -> LoadSum:
        return LoadSum(self._arrays.sums)
