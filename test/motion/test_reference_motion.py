# SPDX-License-Identifier: MIT
"""The references that judge the integrators agree with each other and with conservation laws."""

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf
from reference_motion import angle_between, free_motion, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from problems import P1, P2, P3, tuples

FULL = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
ATTITUDE = (0.2, -0.4, 0.4, 0.8)


def largest_difference(a, b):
    return max(abs(a[i][j] - b[i][j]) for i in range(3) for j in range(3))


@pytest.mark.parametrize(
    ("inertia", "spin", "time"),
    [
        (np.array(P1.inertia), P1.row[10:], 20),
        (np.diag([1.0, 2.0, 3.0]), (0.1, 0.2, 3.0), 5),
        (np.diag([3.0, 1.0, 2.0]), (-2.0, 0.1, 0.2), 5),
        (FULL, (0.3, 1.0, -0.2), 5),
        (FULL, (-3.0, 0.2, 0.5), 5),
    ],
)
def test_closed_form_and_taylor_series_agree_to_38_digits(inertia, spin, time):
    row = [0, 0, 0, *ATTITUDE, 0, 0, 0, *spin]
    (turned,) = reference_motion(ReferenceProblem(1.0, tuples(inertia)), row, [time], digits=40)
    R, w = free_motion(inertia, spin, time, ATTITUDE)
    with mp.workdps(60):
        assert largest_difference(rotation_of(turned[3:7]), R) < mpf("1e-38")
        assert max(abs(a - b) for a, b in zip(turned[10:], w, strict=True)) < mpf("1e-38")


@pytest.mark.parametrize("flight", [p for p in P3 if p.spring.damping == 0.0 and p.spring.frequency == 10.0])
def test_undamped_string_keeps_energy_through_slack_and_taut(flight):
    spring = flight.spring
    string = ReferenceString(
        spring.point, spring.target, spring.stiffness, rest_length=spring.rest_length, bilateral=spring.bilateral
    )
    problem = ReferenceProblem(flight.mass, flight.inertia, gravity=flight.gravity, string=string)
    rows = reference_motion(problem, flight.row, [0, 0.5, 1.0], digits=25)
    with mp.workdps(40):
        energies = [energy(problem, r) for r in rows]
        assert max(abs(e - energies[0]) for e in energies) < mpf("1e-22")


def energy(problem, row):
    s, R = problem.string, rotation_of(row[3:7])
    point = [row[i] + sum(R[i][j] * mpf(s.point[j]) for j in range(3)) for i in range(3)]
    stretch = mpmath.sqrt(sum((mpf(t) - p) ** 2 for t, p in zip(s.target, point, strict=True))) - mpf(s.rest_length)
    if not s.bilateral:
        stretch = max(mpf(0), stretch)
    kinetic = sum(mpf(problem.inertia[i][j]) * row[10 + i] * row[10 + j] for i in range(3) for j in range(3)) / 2
    kinetic += mpf(problem.mass) / 2 * sum(c * c for c in row[7:10])
    return kinetic + mpf(s.stiffness) / 2 * stretch**2 - mpf(problem.mass) * mpf(problem.gravity[2]) * row[2]


def test_loads_are_what_they_say():
    """A world force at a point, a body force and damping against sums done by hand at time 0."""
    arm, force = np.array(P2.wrenches[0].point), np.array(P2.wrenches[0].force)
    R = np.array([[float(c) for c in row] for row in rotation_of(ATTITUDE)])
    problem = ReferenceProblem(
        2.0, tuples(FULL), moment=tuples(np.outer(arm, force)), force_world=tuple(force), linear_damping=0.5
    )
    row = [0, 0, 0, *ATTITUDE, 1, 0, 0, 0.3, 1.0, -0.2]
    h = 1e-9
    (after,) = reference_motion(problem, row, [h], digits=30)
    w = np.array(row[10:])
    rate = np.linalg.solve(FULL, np.cross(arm, R.T @ force) - np.cross(w, FULL @ w))
    assert np.array([float((after[10 + i] - mpf(w[i])) / h) for i in range(3)]) == pytest.approx(rate, rel=1e-7)
    acceleration = (force - 0.5 * np.array([1, 0, 0])) / 2.0
    found = [float((after[7 + i] - mpf(row[7 + i])) / h) for i in range(3)]
    assert np.array(found) == pytest.approx(acceleration, rel=1e-7)


def test_angle_between_sees_angles_far_below_epsilon():
    with mp.workdps(50):
        half = mpf("1e-25")
        R = rotation_of((half, 0, 0, 1))
    assert angle_between((0, 0, 0, 1), R) == pytest.approx(2e-25, rel=1e-12)
