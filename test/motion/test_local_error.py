# SPDX-License-Identifier: MIT
"""auto keeps its word: each committed step errs by at most accuracy·h, against the exact flow from that step's own start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from flights import SECOND
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_scenes import END_S, FEATURES, error, make_scene
from reference_taylor import DIGITS, ReferenceProblem, ReferenceString, reference_motion

from rigid_proto_ros.motion.integrators.series_steps import floor_of_step, heavier, scales
from rigid_proto_ros.motion.integrators.string_law import PULLS, law_of
from rigid_proto_ros.motion.problem import TIME
from rigid_proto_ros.simulation.flight import steps_of_segment
from rigid_proto_ros.simulation.simulation import Simulation


@dataclass(frozen=True)
class CommittedStep:
    """Problem of its segment, variables before and after, times from the segment's start [ns], and the error rate [1/s] that
    the integrator had reported by then as set by rounding, not by the accuracy; 0 for none.
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

    def allowed(self, accuracy: float) -> float:
        """accuracy·h, or what rounding may err in this step by itself where that is more and reported."""
        p, ends = self.problem, ((self.before, self.begin_ns), (self.after, self.end_ns))
        begin, end = (scales(y, p, time_ns * 1e-9) for y, time_ns in ends)
        pulls = p.has_string and any(law_of(y, p) == PULLS for y, _ in ends)
        floor = floor_of_step(self.before, p, heavier(end, begin)[0], pulls, self.length)
        allowed = max(accuracy * self.length, floor)
        assert max(accuracy, self.floor_rate) * self.length >= (1.0 - 1e-9) * allowed
        return allowed

    def error(self) -> float:
        """In principal axes; the position is the displacement added to a motion in closed form, the velocity both."""
        span = (self.end_ns - self.begin_ns) * 1e-9
        (exact,) = reference_motion(reference_problem(self.problem, self.before), row_of(self.before), [span], DIGITS)
        row, closed = row_of(self.after), _closed_form_velocity(self.problem, self.end_ns * 1e-9)
        exact[7:10] = [a + float(b) for a, b in zip(exact[7:10], closed, strict=True)]
        row[7:10] += closed
        return error(row, exact, self.problem.length)


def row_of(variables: np.ndarray) -> np.ndarray:
    """x, q, v, ω of an integrator's variables."""
    return np.concatenate([variables[7:10], variables[0:4], variables[10:13], variables[4:7]])


def _closed_form_velocity(p: np.record, time: float) -> np.ndarray:
    v, a, c = p.reference_velocity, p.reference_acceleration, p.reference_damping
    if c == 0.0:
        return v + time * a
    decay = np.exp(-c * time)
    return v * decay + a * (1.0 - decay) / c


def reference_problem(p: np.record, variables: np.ndarray) -> ReferenceProblem:
    """The same motion in principal axes for the reference, from these variables on; its position is the added displacement."""
    string, mass = None, np.longdouble(p.mass)
    if p.has_string:
        string = ReferenceString(
            p.attach, -p.string_start, p.stiffness, p.string_damping, p.rest_length, bool(p.bilateral)
        )
    # The problem holds accelerations; a long double holds nearly all digits of their products with the mass.
    return ReferenceProblem(
        mass=p.mass,
        inertia=np.diag(p.moments),
        gravity=p.acceleration_added,
        force_body=mass * p.acceleration_body,
        torque_world=p.torque_world,
        torque_body=p.torque_body,
        moment=p.moment.reshape(3, 3),
        linear_damping=mass * p.damping_linear,
        angular_damping=p.damping_angular,
        gyroscopic=bool(p.gyroscopic),
        string=string,
        rotor=p.rotor + variables[TIME] * p.rotor_torque,
        rotor_torque=p.rotor_torque,
    )


def committed_steps(
    simulation: Simulation, until_ns: int, wanted: int, rng: np.random.Generator
) -> list[CommittedStep]:
    """Up to ``wanted`` single steps that the simulation committed on its way to ``until_ns``, spread over the flight."""
    found: list[CommittedStep] = []
    for start_ns in np.sort(rng.integers(0, until_ns, wanted)):
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
                origin_ns, after = int(flight.start_ns), flight.variables.copy()
                times_ns = (begin_ns - origin_ns, int(flight.committed_ns) - origin_ns)
                floor_rate = float(max(flight.control.floor_rate, flight.control.pull_floor_rate))
                found.append(CommittedStep(flight.problem.copy(), before, after, *times_ns, floor_rate))
                break
            portion = max(1, portion // 4) if taken > 1 else 2 * portion
    return found


def check(features: dict, accuracy: float, seed: int) -> None:
    simulation, rng = make_scene(features, np.random.default_rng(seed)).simulation(accuracy=accuracy), [seed, 1]
    for step in committed_steps(simulation, round(END_S * SECOND), 6, np.random.default_rng(rng)):
        assert step.error() <= step.allowed(accuracy), (features, accuracy, seed, step.begin_ns)
    assert not simulation.failure


ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)
OR_STIFF = {
    **FEATURES,
    "frequency": (*FEATURES["frequency"], (30.0, 300.0)),
    "rotor": ("none", "none", "steady", "driven"),
}


@settings(max_examples=40, deadline=None)
@given(
    features=st.fixed_dictionaries({name: st.sampled_from(levels) for name, levels in OR_STIFF.items()}),
    accuracy=st.sampled_from(ACCURACIES),
    seed=st.integers(0, 2**32 - 1),
)
def test_auto_meets_its_accuracy_in_each_step(features, accuracy, seed):
    check(features, accuracy, seed)


@pytest.mark.stress
@pytest.mark.parametrize("first", range(0, 1200, 40))
def test_auto_meets_its_accuracy_in_each_step_of_many_scenes(first):
    for seed in range(first, first + 40):
        rng = np.random.default_rng([seed, 2])
        features = {name: levels[rng.integers(len(levels))] for name, levels in OR_STIFF.items()}
        check(features, ACCURACIES[seed % 4], seed)
