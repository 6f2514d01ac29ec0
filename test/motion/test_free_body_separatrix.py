# SPDX-License-Identifier: MIT
"""The exact step where the motion hangs on the last digits: on the separatrix and within a rounding of it."""

import numpy as np
import pytest
from reference_motion import angle_between, free_motion

from problems import P1
from rigid_proto_ros.motion.integrators.free_body import free_step

EPSILON = 2.0**-52


def stepped(w, moments, h, start=(0.0, 0.0, 0.0, 1.0)):
    """Attitude and spin by one exact step."""
    return free_step(*(tuple(float(x) for x in numbers) for numbers in (start, w, moments)), h)


def cases(seed, count):
    """(moments, ω, h): on the separatrix to rounding, or 1e-16 to 1e-1 beside it."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        a, b = rng.uniform(0.3, 1.0, 2)
        moments = np.sort((a, b, rng.uniform(abs(a - b), a + b)))
        w = rng.normal(size=3)
        beside = rng.choice((0.0, 10.0 ** rng.uniform(-16, -1)))
        gaps = moments[0] * (moments[1] - moments[0]) / (moments[2] * (moments[2] - moments[1]))
        w[2] = w[0] * np.sqrt(gaps) * (1.0 + beside)
        yield moments, w / np.linalg.norm(w), 10.0 ** rng.uniform(-6, 3)


def check(seed, count):
    for moments, w, h in cases(seed, count):
        q, turned = stepped(w, moments, h)
        exact, spin = free_motion(np.diag(moments), w, h)
        # Measured up to 0.06 of the bound.
        assert angle_between(q, exact) <= 50.0 * EPSILON * (1.0 + h), (moments, w, h)
        assert max(abs(float(s - turned[j])) for j, s in enumerate(spin)) <= 50.0 * EPSILON * (1.0 + h)


def test_exact_step_is_exact_on_the_separatrix():
    check(4, 60)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(20))
def test_exact_step_is_exact_on_the_separatrix_many_times(seed):
    check(100 + seed, 1000)


def test_the_pole_is_chosen_where_doubles_see_no_side_of_the_separatrix():
    """Here I₃(I₃ − I₂)ω₃² − I₁(I₂ − I₁)ω₁² is 5.5e-19, and 0.0 in doubles."""
    moments = (0.32107783195903766, 0.41139569317079067, 0.43914544871392436)
    w, h = (0.5434771010920717, 0.041908343419505265, 0.8383772011096144), 126.1754678181084
    q, _ = stepped(w, moments, h)
    exact, _ = free_motion(np.diag(moments), w, h)
    assert angle_between(q, exact) <= 50.0 * EPSILON * (1.0 + h)  # measured 8e-15


def test_a_hundred_seconds_of_middle_axis_flips_in_one_step():
    """The benchmark's P1: steppers end 1e-9 rad off here."""
    w = P1.row[10:]
    exact, _ = free_motion(np.array(P1.inertia), w, P1.duration)
    q, _ = stepped(w, np.diag(P1.inertia), P1.duration, P1.row[3:7])
    assert angle_between(q, exact) <= 1e-13  # measured 1.4e-14
