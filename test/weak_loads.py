# SPDX-License-Identifier: MIT
"""Segments of fast spins under weak loads, and the exact flow that splitting steps are judged by.

The judge is the Taylor series at a rate a thousandth of the one judged: it shares no formula with the splitting, and its own
steps are judged in test_stress_auto.py.
"""

from __future__ import annotations

import numpy as np
from one_segment import new_control
from random_scenes import log_uniform

from rigid_proto_ros.motion import problem as of
from rigid_proto_ros.motion.integrators import control as ctl
from rigid_proto_ros.motion.integrators import series_steps, splitting_steps, taylor_adaptive
from rigid_proto_ros.motion.integrators.error_measure import FLOOR, scales, size
from rigid_proto_ros.motion.integrators.taylor_adaptive import MAX_DEGREE
from rigid_proto_ros.motion.variables import STORED

JUDGE_ROUNDING = 1e-14
"""Times |ω| and the turn of a step in rad: an accuracy at which the judge's rounding takes 0.05; measured over 4000 steps."""

MOST_JUDGED_RAD = 1e4


def weak_scene(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, float]:
    """Problem, variables and accuracy: 1e3 to 1e6 rad/s, bodies from sticks to balls, spins on and off the separatrix and the axes, every
    kind of load; the accuracy is such that steps are somewhere about 0.5 to 1e4 rad long, or longer where the loads average out.

    Rounding of the judge's many steps grows with the square of their number: accuracies where that shows are left out.
    """
    p, y = np.zeros(of.SIZE), np.zeros(STORED)
    shares = np.array([1.0, log_uniform(rng, 1e-3, 1.0), log_uniform(rng, 1e-3, 1.0)])
    if rng.random() < 0.3:
        shares[rng.integers(3)] = shares[rng.integers(3)] * (1.0 + log_uniform(rng, 1e-9, 1e-1))
    p[of.MOMENTS : of.MOMENTS + 3] = log_uniform(rng, 1e-6, 10.0) * np.sort(shares.sum() - shares)
    smallest = p[of.MOMENTS]
    p[of.MASS], p[of.LENGTH], p[of.GYROSCOPIC] = log_uniform(rng, 0.1, 10.0), log_uniform(rng, 0.01, 2.0), 1.0
    spin = log_uniform(rng, 1e3, 1e6)
    w = rng.normal(size=3)
    if rng.random() < 0.5:
        w *= [log_uniform(rng, 1e-5, 1.0), 1.0, log_uniform(rng, 1e-5, 1.0)]
    elif rng.random() < 0.3:
        w[rng.integers(3)] *= log_uniform(rng, 1e-9, 1.0)
    elif rng.random() < 0.5:
        w[rng.choice([0, 2])] *= log_uniform(rng, 1.0, 1e6)
    y[4:7] = spin * w / np.linalg.norm(w)
    y[0:4] = rng.normal(size=4)
    y[0:4] /= np.linalg.norm(y[0:4])
    turn = log_uniform(rng, 0.1, min(1e4, 1e-3 / (JUDGE_ROUNDING * spin)))
    accuracy = log_uniform(rng, max(splitting_steps.ROUNDING, JUDGE_ROUNDING * turn) * spin, 1e-3)
    strongest = accuracy * spin / turn
    kind = rng.integers(4)
    if kind in (0, 3):
        p[of.TORQUE_BODY : of.TORQUE_BODY + 3] = strongest * smallest * rng.normal(size=3)
    if kind in (1, 3):
        p[of.TORQUE_WORLD : of.TORQUE_WORLD + 3] = strongest * smallest * rng.normal(size=3)
    if kind in (2, 3):
        p[of.MOMENT : of.MOMENT + 9] = strongest * smallest * rng.normal(size=9)
    p[of.HAS_WORLD_TORQUE] = float(kind > 0)
    if rng.random() < 0.2:
        force = accuracy * p[of.LENGTH] * rng.random() * rng.normal(size=3)
        p[of.ACCELERATION_BODY : of.ACCELERATION_BODY + 3], p[of.TRANSLATES] = 0.3 * force, 1.0
    return p, y, accuracy


def exact_flow(y: np.ndarray, p: np.ndarray, accuracy: float, h_ns: int) -> np.ndarray:
    """Variables after h_ns."""
    method = series_steps if p[of.HAS_WORLD_TORQUE] else taylor_adaptive
    control = new_control(1e-3 * accuracy, MAX_DEGREE)
    room, following, y = method.workspace(MAX_DEGREE), np.zeros(STORED), y.copy()
    far = method.steps(y, p, control, following, room, h_ns, False)
    assert not control[ctl.FAILED]
    if far < h_ns:
        assert method.steps(y, p, control, following, room, h_ns - far, True) == h_ns - far
    return y


def share_of_allowance(p: np.ndarray, y: np.ndarray, accuracy: float, part: float = 1.0) -> tuple[float, float]:
    """Error of one step over the accuracy times its length, or over the floor where that is more, and that length [s]; part: of the step that would be accepted."""
    longest_ns = int(np.floor(splitting_steps.step_length(y, p, accuracy) * 1e9))
    rate = np.linalg.norm(y[4:7])
    # Of steps that are too long for the judge, as much as it can judge.
    most_ns = min(MOST_JUDGED_RAD, accuracy / (JUDGE_ROUNDING * rate)) / rate * 1e9
    part = min(part, most_ns / longest_ns)
    h_ns = max(1, int(part * longest_ns))
    stepped = y.copy()
    control, room = new_control(accuracy, MAX_DEGREE), splitting_steps.workspace(0)
    assert splitting_steps.steps(stepped, p, control, np.zeros(STORED), room, h_ns, part < 1.0) == h_ns
    exact = exact_flow(y, p, accuracy, h_ns)
    attitude, spin, place, speed = scales(exact, p, 0.0)
    return size(stepped - exact, attitude, spin, place, speed) / max(accuracy * h_ns * 1e-9, FLOOR), h_ns * 1e-9
