# SPDX-License-Identifier: MIT
"""The exact torque-free step over every class of body and spin, against 18 digits: never a NaN, never a surprise; and where
the motion hangs on the last digits, on the separatrix and within a rounding of it.
"""

import math
import zlib

import numpy as np
import pytest
from reference_motion import angle_between, free_motion
from reference_scenes import direction, log_uniform

from problems import P1
from rigid_proto_ros.base.compilation import new_record
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.problem import PROBLEM, VARIABLES

EPSILON = 2.0**-52
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
LONGEST = 3.0
"""rad. Beyond it a rounding of the start grows with the motion itself, and the closed form below judges."""


def body_of(second_moments):
    """Ascending principal moments of a body with these second moments: A + B ≥ C by construction."""
    x, y, z = second_moments
    return np.sort([y + z, z + x, x + y])


def generic(rng):
    return body_of([log_uniform(rng, 1e-3, 1.0) for _ in range(3)]), direction(rng)


def near_equal_first(rng):
    a, c = rng.uniform(0.6, 1.0), rng.uniform(1.01, 1.19)
    return np.array([a, a * (1.0 + log_uniform(rng, 1e-16, 1e-2)), c]), direction(rng)


def near_equal_last(rng):
    a, b = rng.uniform(0.1, 0.98), 1.0
    return np.array([a, b, b * (1.0 + min(log_uniform(rng, 1e-16, 1e-2), a))]), direction(rng)


def near_sphere(rng):
    b = 1.0 + log_uniform(rng, 1e-16, 1e-2)
    return np.array([1.0, b, b * (1.0 + log_uniform(rng, 1e-16, 1e-2))]), direction(rng)


def sphere(rng):
    return np.full(3, rng.uniform(0.1, 10.0)), direction(rng)


def rod(rng):
    return body_of([1.0, log_uniform(rng, 1e-9, 1e-3), log_uniform(rng, 1e-9, 1e-3)]), direction(rng)


def plate(rng):
    return body_of([1.0, log_uniform(rng, 1e-3, 1.0), log_uniform(rng, 1e-9, 1e-3)]), direction(rng)


def separatrix(rng):
    """L² = 2E·I₂ to within 1e-16 ... 1e-2, or as nearly as doubles allow."""
    moments = body_of([log_uniform(rng, 1e-2, 1.0) for _ in range(3)])
    A, B, C = moments
    w = np.array([rng.normal(), rng.normal(), 0.0])
    w[2] = rng.choice([-1.0, 1.0]) * math.sqrt(A * (B - A) / (C * (C - B))) * w[0]
    w[2] *= 1.0 + rng.choice([0.0, 1.0, -1.0]) * log_uniform(rng, 1e-16, 1e-2)
    if rng.random() < 0.2:
        w[1] = 0.0
    return moments, w / np.sqrt((w * w).sum())


def on_axis(rng):
    """Along an axis, or off it by anything down to the smallest doubles."""
    w = np.zeros(3)
    w[rng.integers(3)] = rng.choice([-1.0, 1.0])
    if rng.random() < 0.7:
        w[rng.integers(3)] += log_uniform(rng, 1e-300, 1e-3)
    return body_of([log_uniform(rng, 1e-3, 1.0) for _ in range(3)]), w


def slow(rng):
    """Spins down to 1e-300 rad/s, and none at all."""
    size = 0.0 if rng.random() < 0.1 else log_uniform(rng, 1e-300, 1e-150)
    return body_of([log_uniform(rng, 1e-3, 1.0) for _ in range(3)]), size * direction(rng)


CLASSES = (
    generic,
    near_equal_first,
    near_equal_last,
    near_sphere,
    sphere,
    rod,
    plate,
    separatrix,
    on_axis,
    slow,
)


def cases(draw, count):
    """moments, ω, h: |ω|h log-uniform in 1e-6 ... 3 rad, spins 1e-3 ... 1e3 rad/s unless slow, moments 1e-12 ... 1e6."""
    rng = np.random.default_rng(zlib.crc32(draw.__name__.encode()))
    moments, spins, steps = np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
    for k in range(count):
        moments[k], spins[k] = draw(rng)
        moments[k] *= log_uniform(rng, 1e-12, 1e6)
        if draw is not slow:
            spins[k] *= log_uniform(rng, 1e-3, 1e3)
        size = np.abs(spins[k]).max()
        steps[k] = log_uniform(rng, 1e-6, LONGEST) / (math.sqrt(3.0) * size) if size else 1.0
    return moments, spins, steps


def taylor_flow(moments, spins, times):
    """Attitudes (4, n) from no turn and spins (3, n) after so many seconds, by Taylor series in long doubles, for moments and
    spins (n, 3): steps of at most 0.1 rad, whose series of order 20 leave 1e-20.
    """
    A, w = moments.T.astype(np.longdouble), spins.T.astype(np.longdouble)
    ratios = np.stack([(A[1] - A[2]) / A[0], (A[2] - A[0]) / A[1], (A[0] - A[1]) / A[2]])
    q = np.zeros((4, len(times)), np.longdouble)
    q[3] = 1.0
    steps, order = math.ceil(10.0 * LONGEST), 20
    for _ in range(steps):
        Q, W = [q], [w]
        for k in range(order):
            q_by_w = np.einsum("kin,kjn->ijn", np.array(Q), np.array(W[::-1]))
            w_by_w = np.einsum("kin,kjn->ijn", np.array(W), np.array(W[::-1]))
            turning = ratios * np.stack([w_by_w[1, 2], w_by_w[2, 0], w_by_w[0, 1]])
            t = q_by_w
            turned = [
                t[3, 0] + t[1, 2] - t[2, 1],
                t[3, 1] + t[2, 0] - t[0, 2],
                t[3, 2] + t[0, 1] - t[1, 0],
                -t[0, 0] - t[1, 1] - t[2, 2],
            ]
            Q.append(np.stack(turned) / (2 * (k + 1)))
            W.append(turning / (k + 1))
        h = times.astype(np.longdouble) / steps
        q, w = (sum(c * h**k for k, c in reversed(list(enumerate(series)))) for series in (Q, W))
    return q, w


def check(draw, count):
    """Attitude errs less than 50 ε (1 + |ω|h) rad, and ω as much of its size."""
    moments, spins, steps = cases(draw, count)
    kernel, p = INTEGRATORS["free_body"].kernel, new_record(PROBLEM)
    found, p.gyroscopic = np.zeros((count, VARIABLES)), 1.0
    for k in range(count):
        p.moments[:] = moments[k]
        found[k, 3], found[k, 4:7] = 1.0, spins[k]
        assert kernel(found[k], p, steps[k], 1) == 1 and np.isfinite(found[k]).all(), (moments[k], spins[k], steps[k])
    # In units of time in which all spin alike: a power of two, so nothing is rounded.
    units = np.ldexp(1.0, np.frexp(np.abs(spins).max(axis=1) + (spins == 0.0).all(axis=1))[1])
    q, w = taylor_flow(moments, spins / units[:, None], steps * units)
    size = np.sqrt(((spins / units[:, None]) ** 2).sum(axis=1))
    allowed = 50.0 * EPSILON * (1.0 + size * steps * units)
    apart = np.minimum(*(np.sqrt(((found[:, :4].T + sign * q) ** 2).sum(axis=0)) for sign in (-1, 1)))
    assert (2.0 * apart <= allowed).all()
    assert (np.abs(found[:, 4:7].T / units - w) <= allowed * size).all()


def few_or(count, few):
    return pytest.mark.parametrize("count", [few, pytest.param(count, marks=pytest.mark.stress)])


@few_or(3_000, 60)
@pytest.mark.parametrize("draw", CLASSES, ids=lambda draw: draw.__name__)
def test_exact_step_is_exact(draw, count):
    check(draw, count)


def long_step(moments, spin, time, start=IDENTITY):
    """Attitude and spin after one step."""
    p, y = new_record(PROBLEM), np.zeros(VARIABLES)
    p.moments[:], p.gyroscopic = moments, 1.0
    y[:4], y[4:7] = start, spin
    assert INTEGRATORS["free_body"].kernel(y, p, time, 1) == 1
    assert np.isfinite(y).all()
    return y[:4], y[4:7]


@few_or(400, 2)
@pytest.mark.parametrize(
    "draw", [generic, near_equal_first, near_equal_last, rod, plate, separatrix], ids=lambda draw: draw.__name__
)
def test_one_step_is_exact_however_long(draw, count):
    """Against Jacobi's closed form, over up to a million radians; up to a thousand on the separatrix or 1e-16 to 1e-2 beside it."""
    rng = np.random.default_rng(7)
    for _ in range(count if draw is not separatrix else 6 * count):
        moments, spin = draw(rng)
        turned = log_uniform(rng, 1e-6, 1e3) if draw is separatrix else log_uniform(rng, 3.0, 1e6)
        attitude, found = long_step(moments, spin, turned)
        exact, exact_spin = free_motion(np.diag(moments), spin, turned, digits=60)
        allowed = 50.0 * EPSILON * (1.0 + turned)
        # Measured up to 0.06 of the bound on the separatrix.
        assert angle_between(attitude, exact) <= allowed, (moments, spin, turned)
        assert np.abs(found - exact_spin).max() <= allowed, (moments, spin, turned)


def test_a_hundred_seconds_of_middle_axis_flips_in_one_step():
    """The benchmark's P1: steppers end 1e-9 rad off here."""
    w = P1.row[10:]
    exact, _ = free_motion(np.array(P1.inertia), w, P1.duration)
    attitude, _ = long_step(np.diag(P1.inertia), w, P1.duration, P1.row[3:7])
    assert angle_between(attitude, exact) <= 1e-13  # measured 1.4e-14


@few_or(5000, 5)
def test_no_step_is_too_long_to_end(count):
    """|ω|h up to 1e300, every class: finite, and energy and |L| kept. Nothing can say what the attitude is by then."""
    rng = np.random.default_rng(11)
    for draw in CLASSES:
        for _ in range(count):
            moments, spin = draw(rng)
            _, turned = long_step(moments, spin, log_uniform(rng, 1e6, 1e300))
            size = np.abs(spin).max() or 1.0
            before, after = spin / size, turned / size
            for weight in (moments, moments**2):
                kept = (weight * before**2).sum()
                assert abs((weight * after**2).sum() - kept) <= 1e-12 * kept
