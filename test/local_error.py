# SPDX-License-Identifier: MIT
"""Steps as an integrator committed them, each judged against the exact flow from its own start.

The flow is that of the segment's own variables (motion/problem.py), so nothing is lost by converting to world coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpmath import mp, mpf
from reference_motion import angle_between, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from rigid_proto_ros.motion.integrators.series_steps import floor_of_step, heavier, scales
from rigid_proto_ros.motion.integrators.string_law import PULLS, law_of
from rigid_proto_ros.simulation.flight import steps_of_segment
from rigid_proto_ros.simulation.simulation import Simulation


@dataclass(frozen=True)
class CommittedStep:
    """Problem (SIZE,) of its segment, variables before and after, times from the segment's start [ns], and the error
    rate [1/s] that the integrator had reported by then as set by rounding, not by the accuracy; 0 for none.
    """

    problem: np.record
    before: np.ndarray
    after: np.ndarray
    begin_ns: int
    end_ns: int
    floor_rate: float

    @property
    def length(self) -> float:
        return (self.end_ns - self.begin_ns) * 1e-9

    @property
    def floor(self) -> float:
        """What rounding may err in this step by itself."""
        p, ends = self.problem, ((self.before, self.begin_ns), (self.after, self.end_ns))
        begin, end = (scales(y, p, time_ns * 1e-9) for y, time_ns in ends)
        pulls = p.has_string and any(law_of(y, p) == PULLS for y, _ in ends)
        return floor_of_step(self.before, p, heavier(end, begin)[0], pulls, self.length)


def committed_steps(
    simulation: Simulation, until_ns: int, wanted: int, rng: np.random.Generator
) -> list[CommittedStep]:
    """Up to ``wanted`` single steps that the simulation committed on its way to ``until_ns``, spread over the flight."""
    found: list[CommittedStep] = []
    times = np.sort(rng.integers(0, until_ns, wanted))
    for start_ns in times:
        if start_ns <= simulation.time_ns:
            continue
        simulation.advance(int(start_ns))
        flight, portion = simulation.flight, 1000
        number = int(flight.segments)
        while simulation.time_ns < until_ns:
            steps, begin_ns, before = steps_of_segment(flight), int(flight.committed_ns), flight.variables.copy()
            simulation.advance(min(until_ns, simulation.time_ns + portion))
            if flight.segments != number:
                break
            taken = steps_of_segment(flight) - steps
            if taken == 1:
                origin_ns = int(flight.start_ns)
                found.append(
                    CommittedStep(
                        flight.problem.copy(),
                        before,
                        flight.variables.copy(),
                        begin_ns - origin_ns,
                        int(flight.committed_ns) - origin_ns,
                        float(max(flight.control.floor_rate, flight.control.pull_floor_rate)),
                    )
                )
                break
            portion = max(1, portion // 4) if taken > 1 else 2 * portion
    return found


def local_error(step: CommittedStep, digits: int = 18) -> float:
    """Largest of attitude angle, |Δx|/ℓ, |Δω|/max(|ω|, 1 rad/s) and |Δv|/max(|v|, ℓ·1 rad/s) of a step."""
    p, length = step.problem, step.problem.length
    with mp.workdps(digits + 10):
        y = [mpf(float(c)) for c in step.before]
        row = [*y[7:10], *y[0:4], *y[10:13], *y[4:7]]
        span = mpf(step.end_ns - step.begin_ns) / 10**9
        (exact,) = reference_motion(reference_problem(p), row, [span], digits)
        angle = angle_between(step.after[0:4], rotation_of(exact[3:7]))
        moved, sped, spun = (
            float(sum((mpf(float(a)) - b) ** 2 for a, b in zip(step.after[k : k + 3], part, strict=True)) ** mpf("0.5"))
            for k, part in ((7, exact[0:3]), (10, exact[7:10]), (4, exact[10:13]))
        )
    time = step.end_ns * 1e-9
    speed = np.linalg.norm(_reference_velocity(p, time) + step.after[10:13])
    spin = np.linalg.norm(step.after[4:7])
    return max(angle, moved / length, spun / max(spin, 1.0), sped / max(speed, length))


def _reference_velocity(p: np.record, time: float) -> np.ndarray:
    """Of the closed-form part of the translation [m/s]."""
    v, a = (
        p.reference_velocity,
        p.reference_acceleration,
    )
    c = p.reference_damping
    if c == 0.0:
        return v + time * a
    decay = np.exp(-c * time)
    return v * decay + a * (1.0 - decay) / c


def reference_problem(p: np.record) -> ReferenceProblem:
    """The same motion in principal axes for the reference; its position is the added displacement."""
    mass = float(p.mass)
    string = None
    if p.has_string:
        string = ReferenceString(
            point=_triple(p.attach, 0),
            target=tuple(-c for c in _triple(p.string_start)),
            stiffness=float(p.stiffness),
            damping=float(p.string_damping),
            rest_length=float(p.rest_length),
            bilateral=bool(p.bilateral),
        )
    with mp.workdps(50):
        # The problem holds accelerations; forces are exact products of them with the mass.
        force_body = tuple(mpf(mass) * mpf(c) for c in _triple(p.acceleration_body))
        damping = mpf(mass) * mpf(float(p.damping_linear))
    return ReferenceProblem(
        mass=mass,
        inertia=tuple(tuple(float(p.moments[i]) if i == j else 0.0 for j in range(3)) for i in range(3)),
        gravity=_triple(p.acceleration_added, 0),
        force_body=force_body,
        torque_world=_triple(p.torque_world, 0),
        torque_body=_triple(p.torque_body, 0),
        moment=tuple(_triple(p.moment, 3 * i) for i in range(3)),
        linear_damping=damping,
        angular_damping=float(p.damping_angular),
        gyroscopic=bool(p.gyroscopic),
        string=string,
    )


def _triple(p: np.ndarray, at: int = 0) -> tuple[float, float, float]:
    return tuple(float(c) for c in p[at : at + 3])
