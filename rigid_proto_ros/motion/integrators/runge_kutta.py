# SPDX-License-Identifier: MIT
"""Methods with fixed steps: the loop of the explicit methods, explicit Runge-Kutta methods by their tableau (rk4,
dop853), and semi_implicit_euler.

Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1. The quaternion is
normalized after the step; the right-hand side uses only its direction, so stages may leave the unit sphere. Euler's
equations with the gyroscopic term: Goldstein, Classical Mechanics (2002), section 5.5.

semi_implicit_euler is the usual method of game engines: Hairer, Lubich and Wanner, Geometric Numerical Integration
(2006), section I.1 (symplectic Euler). It is symplectic only if accelerations don't depend on velocities: the
gyroscopic term is explicit, so a spinning body gains energy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...base.compilation import copy_numbers, local_matrix, local_numbers, njit
from ...base.rotation import exponential, multiply, normalize
from ...base.simd import Packed, filled, four, joined, load, number, store
from ...base.vectors import FloatArray
from ..loads import NO_GYROSCOPIC_TERM
from ..problem import (
    DISPLACEMENT,
    HAND_WORK,
    HEAT,
    SPIN,
    TIME,
    VARIABLES,
    VELOCITY,
    Variables,
    accelerations,
    is_good,
    later,
    parts_of,
    stretch,
    tension_margin,
)
from .integrator import EVALUATED, Integrator, Kernel
from .string_law import is_one_sided, shortening_heat

Step = Callable[[Variables, np.record, float, bool, FloatArray, FloatArray, Variables], None]
"""One step (y, p, h, pulls, tableau, k, out) of h seconds from variables y into out with the string's law given.
tableau (s + 1, s): the weights aᵢⱼ of s stages, and as its last row those of the step, bⱼ; k (≥ s, 16): memory for
rates.
"""

ONE_STAGE = np.array([[0.0], [1.0]])
"""The tableau of Euler's method."""

MOST_STAGES = 12
"""Stages for whose rates a kernel has memory: those of dop853."""

_MAX_PARTS = 1000
"""Maximum number of parts of a step; more is chattering in a step too long for its string: the rest uses one law."""
_MAX_TRIALS = 120
_SECANTS = 60
"""Trials by regula falsi, enough for any simple root; later trials are bisections."""
_RESOLUTION = 2.0**-49
"""Fraction of a step to which the time of a change of law is determined."""


@njit(error_model="numpy", allocates=False, forceinline=True)
def _rates(z: Packed, p: np.record, pulls: bool) -> Packed:
    """Time derivatives of the variables z, four by four: q; ω and the hand's work; d and the damper's heat; u, time."""
    qx, qy, qz, qw = number(z, 0), number(z, 1), number(z, 2), number(z, 3)
    wx, wy, wz = number(z, 4), number(z, 5), number(z, 6)
    d = number(z, 8), number(z, 9), number(z, 10)
    u = number(z, 12), number(z, 13), number(z, 14)
    turned = four(
        0.5 * (qw * wx + qy * wz - qz * wy),
        0.5 * (qw * wy - qx * wz + qz * wx),
        0.5 * (qw * wz + qx * wy - qy * wx),
        -0.5 * (qx * wx + qy * wy + qz * wz),
    )
    if p.translates or p.has_world_torque:
        qx, qy, qz, qw = normalize(qx, qy, qz, qw)
    turning, moving, work, heat = accelerations((qx, qy, qz, qw), (wx, wy, wz), d, u, number(z, 15), p, pulls)
    return joined(turned, four(*turning, work), four(*u, heat), four(*moving, 1.0))


@njit(error_model="numpy", allocates=False, forceinline=True)
def tableau_step(
    y: Variables, p: np.record, h: float, pulls: bool, tableau: FloatArray, k: FloatArray, out: Variables
) -> None:
    """A ``Step``: kᵢ = f(y + h Σ aᵢⱼ kⱼ), out = y + h Σ bᵢ kᵢ."""
    stages = tableau.shape[1]
    # Loaded one by one, as they were stored: a vector load would stall on store-to-load forwarding.
    start = joined(
        four(y[0], y[1], y[2], y[3]),
        four(y[SPIN], y[SPIN + 1], y[SPIN + 2], y[HAND_WORK]),
        four(y[DISPLACEMENT], y[DISPLACEMENT + 1], y[DISPLACEMENT + 2], y[HEAT]),
        four(y[VELOCITY], y[VELOCITY + 1], y[VELOCITY + 2], y[TIME]),
    )
    total = filled(0.0, 16)
    for i in range(stages):
        z = filled(0.0, 16)
        for j in range(i):
            if tableau[i, j] != 0.0:
                z = z + load(k, 16 * j, z) * tableau[i, j]
        rate = _rates(start + z * h, p, pulls)
        store(k, 16 * i, rate)
        total = total + rate * tableau[stages, i]
    end = start + total * h
    out[0], out[1], out[2], out[3] = normalize(number(end, 0), number(end, 1), number(end, 2), number(end, 3))
    out[SPIN], out[SPIN + 1], out[SPIN + 2] = number(end, 4), number(end, 5), number(end, 6)
    out[DISPLACEMENT], out[DISPLACEMENT + 1], out[DISPLACEMENT + 2] = number(end, 8), number(end, 9), number(end, 10)
    out[VELOCITY], out[VELOCITY + 1], out[VELOCITY + 2] = number(end, 12), number(end, 13), number(end, 14)
    out[HAND_WORK], out[HEAT], out[TIME] = number(end, 7), number(end, 11), number(end, 15)


@njit(error_model="numpy", allocates=False, inline="always")
def repeated(step: Step, tableau: FloatArray, y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place, each split where a pull-only string becomes slack or taut; returns the
    number of good ones.

    Inlined into the kernel that calls it, since numba can't cache compiled code that takes a function as an argument.
    """
    new, k = local_numbers(VARIABLES), local_matrix(MOST_STAGES, 16)
    copy_numbers(y, new)
    # From one to the other and back: a copy would wait until all that is stored one by one can be loaded as vectors.
    here, there = y, new
    for done in range(n):
        if is_one_sided(p):
            _step_on_string(step, tableau, here, p, h, k, there)
        else:
            step(here, p, h, True, tableau, k, there)
        there[TIME] = later(here[TIME], h)
        if not is_good(there):
            n = done
            break
        here, there = there, here
    if n % 2 == 1:
        copy_numbers(new, y)
    return n


@njit(error_model="numpy", allocates=False, inline="always")
def _step_on_string(
    step: Step, tableau: FloatArray, y: Variables, p: np.record, h: float, k: FloatArray, end: Variables
) -> None:
    """A step of h seconds from y into ``end``, split where the law of tension changes: the law has a kink there (a
    jump, with a damper), and a step across it would lose its order.
    """
    here, left, resolution = local_numbers(VARIABLES), h, h * _RESOLUTION
    copy_numbers(y, here)
    for part in range(_MAX_PARTS):
        # 1. Step over all that is left, with the law at its start.
        low, high, at_low = 0.0, left, tension_margin(here, p)
        pulls = at_low > 0.0
        step(here, p, left, pulls, tableau, k, end)
        at_high = tension_margin(end, p)
        # 2. Locate the change of law: regula falsi, Illinois variant (Dowell and Jarratt, BIT 11, 1971).
        if (at_high > 0.0) != pulls and part < _MAX_PARTS - 1:
            for trial in range(_MAX_TRIALS):
                if high - low <= resolution:
                    break
                middle = 0.5 * (low + high)
                if trial < _SECANTS and at_high != at_low:
                    root = high - at_high * (high - low) / (at_high - at_low)
                    middle = root if low <= root <= high else middle
                # A root at one end is bracketed from the other side by the smallest step.
                middle = min(max(middle, low + 0.5 * resolution), high - 0.5 * resolution)
                step(here, p, middle, pulls, tableau, k, end)
                margin = tension_margin(end, p)
                if (margin > 0.0) == pulls:
                    low, at_low, at_high = middle, margin, 0.5 * at_high
                else:
                    high, at_high, at_low = middle, margin, 0.5 * at_low
        else:
            high = left
        step(here, p, high, pulls, tableau, k, end)
        if not pulls:
            end[HEAT] += shortening_heat(p, stretch(here, p)[0], stretch(end, p)[0])
        left -= high
        if left <= resolution:
            break
        copy_numbers(end, here)


def explicit(tableau: FloatArray) -> Kernel:
    """The kernel of the explicit method with this tableau (s + 1, s), s ≤ MOST_STAGES."""
    assert tableau.shape[1] <= MOST_STAGES, tableau.shape

    @njit(error_model="numpy", allocates=False)
    def steps(y: Variables, p: np.record, h: float, n: int) -> int:
        return repeated(tableau_step, tableau, y, p, h, n)

    return steps


rk4_steps = explicit(
    np.array(
        [
            [0.0, 0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0, 0.0],
            [0.0, 0.5, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
        ]
    )
)

RK4 = Integrator(
    name="rk4",
    order=4,
    evaluations=4,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.1",
    limits="Explicit: diverges beyond |ω|h of about 2.8; energy drifts with h⁵ per step.",
    stability_limit=1.0,
    supports=EVALUATED | {NO_GYROSCOPIC_TERM},
    kernel=rk4_steps,
)


# Coefficients of dop853.f (Prince and Dormand 1981; Hairer, section II.10): row i has the weights of the earlier stages
# in stage i (0 to 11), row 12 those of all stages in the step.
DOP853_TABLEAU = np.zeros((13, 12))
DOP853_TABLEAU[1, [0]] = [0.05260015195876773]
DOP853_TABLEAU[2, [0, 1]] = [0.0197250569845379, 0.0591751709536137]
DOP853_TABLEAU[3, [0, 2]] = [0.02958758547680685, 0.08876275643042054]
DOP853_TABLEAU[4, [0, 2, 3]] = [0.2413651341592667, -0.8845494793282861, 0.924834003261792]
DOP853_TABLEAU[5, [0, 3, 4]] = [0.037037037037037035, 0.17082860872947386, 0.12546768756682242]
DOP853_TABLEAU[6, [0, 3, 4, 5]] = [0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125]
DOP853_TABLEAU[7, [0, 3, 4, 5, 6]] = [
    0.03709200011850479,
    0.17038392571223998,
    0.10726203044637328,
    -0.015319437748624402,
    0.008273789163814023,
]
DOP853_TABLEAU[8, [0, 3, 4, 5, 6, 7]] = [
    0.6241109587160757,
    -3.3608926294469414,
    -0.868219346841726,
    27.59209969944671,
    20.154067550477894,
    -43.48988418106996,
]
DOP853_TABLEAU[9, [0, 3, 4, 5, 6, 7, 8]] = [
    0.47766253643826434,
    -2.4881146199716677,
    -0.590290826836843,
    21.230051448181193,
    15.279233632882423,
    -33.28821096898486,
    -0.020331201708508627,
]
DOP853_TABLEAU[10, [0, 3, 4, 5, 6, 7, 8, 9]] = [
    -0.9371424300859873,
    5.186372428844064,
    1.0914373489967295,
    -8.149787010746927,
    -18.52006565999696,
    22.739487099350505,
    2.4936055526796523,
    -3.0467644718982196,
]
DOP853_TABLEAU[11, [0, 3, 4, 5, 6, 7, 8, 9, 10]] = [
    2.273310147516538,
    -10.53449546673725,
    -2.0008720582248625,
    -17.9589318631188,
    27.94888452941996,
    -2.8589982771350235,
    -8.87285693353063,
    12.360567175794303,
    0.6433927460157636,
]
DOP853_TABLEAU[12, [0, 5, 6, 7, 8, 9, 10, 11]] = [
    0.054293734116568765,
    4.450312892752409,
    1.8915178993145003,
    -5.801203960010585,
    0.3111643669578199,
    -0.1521609496625161,
    0.20136540080403034,
    0.04471061572777259,
]

dop853_steps = explicit(DOP853_TABLEAU)

DOP853 = Integrator(
    name="dop853",
    order=8,
    evaluations=12,
    source="Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.10",
    limits="Explicit: accurate up to |ω|h of about 1, diverges beyond about 4.",
    stability_limit=2.0,
    supports=EVALUATED,
    kernel=dop853_steps,
)


@njit(error_model="numpy", allocates=False)
def _semi_implicit_step(
    y: Variables, p: np.record, h: float, pulls: bool, _tableau: FloatArray, _k: FloatArray, out: Variables
) -> None:
    """A ``Step``: velocities first, then positions with the new velocities, the attitude by the exponential map."""
    q, w, d, u = parts_of(y)
    turning, moving, work, heat = accelerations(q, w, d, u, y[TIME], p, pulls)
    for j in range(3):
        out[SPIN + j] = w[j] + h * turning[j]
        out[VELOCITY + j] = u[j] + h * moving[j]
        out[DISPLACEMENT + j] = d[j] + h * out[VELOCITY + j]
    turn = exponential(h * out[SPIN], h * out[SPIN + 1], h * out[SPIN + 2])
    out[0], out[1], out[2], out[3] = normalize(*multiply(*q, *turn))
    out[HAND_WORK], out[HEAT] = y[HAND_WORK] + h * work, y[HEAT] + h * heat
    out[TIME] = y[TIME] + h


@njit(error_model="numpy", allocates=False)
def semi_implicit_euler_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_semi_implicit_step, ONE_STAGE, y, p, h, n)


SEMI_IMPLICIT_EULER = Integrator(
    name="semi_implicit_euler",
    order=1,
    evaluations=1,
    source="Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), section I.1",
    limits="First order; a string stays bounded up to ω_s h of about 2, "
    "a spinning body gains energy beyond |ω|h of 0.1.",
    stability_limit=0.1,
    supports=EVALUATED,
    kernel=semi_implicit_euler_steps,
)
