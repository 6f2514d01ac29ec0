# SPDX-License-Identifier: MIT
"""How far half kicks at the ends of a long free motion are from loads that act all along it, where those average out.

To first order in the loads, a change of the spin shows in two ways. It moves attitude and spin at once, by no more than
the change over |ω|, and this averages out as the body turns. And it changes the magnitude of the angular momentum and
the energy, L and E, and with them the rates Ω of the free motion: of ω's circulation in the body (Ω_p), and of the
turning about the angular momentum (Ω_ψ, of the angle ψ of free_body_step.py). Such errors grow with the time that is
left. With the rates L' = τ·M/L, E' = τ·ω of a load's torque τ, a half kick at each end stands for the rate at the
start, where the mean over the free motion is due:

    attitude angle and |Δω|/|ω| ≤ ½ h² |D(L', E' − their means)| + h |D(largest L', E')|/Ω + c h δ,

D(L', E') = |∂Ω_ψ L', E'| + g |∂Ω_p L', E'|, with g the turn of the body [rad] and its change of spin, whichever is
larger, in a radian of the circulation. Of a torque fixed in the body the means are those with ω's mean, which lies on
the axis of the circulation; they are τ·M/L and 2E τ·M/L² of one fixed in the world, and none of a force fixed in the
world at a point of the body, whose work is bounded. Ω is the slowest rate at which what is left of them comes and goes:
Ω_p in the body, |Ω_ψ + kΩ_p| in the world. δ is how fast the loads tilt ω and L directly: κ/|ω|, with κ the largest
angular acceleration, more of it where the polhode is long and narrow, or |τ|/L.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import exponential_of
from ...base.rotation import rotate_inverse
from ..problem import HAS_WORLD_TORQUE, MOMENT, MOMENTS, TORQUE_BODY, TORQUE_WORLD
from .elliptic import carlson_rj, complete_quarter_period
from .equations import undamped_torque
from .free_body_step import precession_terms

NEAREST_SEPARATRIX = 1e-3
"""m₁ below which rates change too fast with the energy for a first order."""

LEAST_CHANGE = 1e-12
"""Of the energy, relative; rates at smaller ones aren't told apart in doubles."""

HIGHEST_HARMONIC = 8
"""k: harmonics of the circulation that are higher hardly show in the turning, unless next to the separatrix."""

LEAST_MODULUS = 1e-12
"""m below which the circulation has no harmonics in doubles."""

DIRECT = 4.0
"""c: measured, 3 at most where little else shows."""


@njit(cache=True, error_model="numpy", allocates=False)
def mean_rates(
    A: float, B: float, C: float, P: float, Q: float, m1: float, L: float, E2: float
) -> tuple[float, float, float]:
    """Ω_p and Ω_ψ [rad/s] of a free motion about the axis C, in the letters of free_body_step.py, and ω₃ on average."""
    gba, gcb = abs(B - A), abs(C - B)
    kappa, W, nu, f_a, f_b, modulus1 = precession_terms(A, B, C, P, Q, L, E2, gba * Q / (gcb * P), math.sqrt(m1))
    K = complete_quarter_period(m1)
    turning = f_a + f_b * (1.0 + kappa) * carlson_rj(0.0, modulus1, 1.0, 1.0 + nu) / (3.0 * K)
    return math.pi * math.sqrt(gcb * P / (A * B * C)) / (2.0 * K), turning, math.pi * W / (2.0 * K)


@njit(cache=True, error_model="numpy", allocates=False)
def _length(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@njit(cache=True, error_model="numpy", allocates=False)
def _growth(at_rate: tuple[float, ...], of_momentum: float, of_energy: float) -> float:
    """|D| from rates of L and 2E; at_rate: ∂Ω_ψ/∂L, ∂Ω_ψ/∂2E, ∂Ω_p/∂L, ∂Ω_p/∂2E, g."""
    turning = abs(at_rate[0] * of_momentum + at_rate[1] * of_energy)
    return turning + at_rate[4] * abs(at_rate[2] * of_momentum + at_rate[3] * of_energy)


@njit(cache=True, error_model="numpy", allocates=False)
def _largest_growth(at_rate: tuple[float, ...], of_momentum: float, of_energy: float) -> float:
    """|D| at most where the rates of L and 2E are at most these, whatever their signs."""
    turning = abs(at_rate[0]) * of_momentum + abs(at_rate[1]) * of_energy
    return turning + at_rate[4] * (abs(at_rate[2]) * of_momentum + abs(at_rate[3]) * of_energy)


@njit(cache=True, error_model="numpy", allocates=False)
def _slowest(turning: float, circling: float, m1: float) -> float:
    """Ω in world axes: the smallest |Ω_ψ + kΩ_p|, each over the share that the harmonic k has in the motion, q^(|k|/2)
    with q Jacobi's nome.
    """
    m = max(1.0 - m1, LEAST_MODULUS)
    decay = exponential_of(0.5 * math.pi * complete_quarter_period(m) / complete_quarter_period(1.0 - m))
    slowest, share = abs(turning), 1.0
    for k in range(1, HIGHEST_HARMONIC + 1):
        share *= decay
        slowest = min(slowest, share * abs(turning + k * circling), share * abs(turning - k * circling))
    return slowest


@njit(cache=True, error_model="numpy", allocates=False)
def averaged_error(y: np.ndarray, p: np.ndarray, strongest: float) -> tuple[float, float]:
    """(a [1/s²], b [1/s]): a step of h seconds errs at most ½ a h² + b h to first order in the loads, of which κ is
    ``strongest`` [rad/s²]; infinite where that isn't known.
    """
    # In units of |ω| and of the largest moment.
    spin = math.sqrt(y[4] * y[4] + y[5] * y[5] + y[6] * y[6])
    i1, i2, i3 = p[MOMENTS] / p[MOMENTS + 2], p[MOMENTS + 1] / p[MOMENTS + 2], 1.0
    third, first = i3 * (i3 - i2) * y[6] * y[6], i1 * (i2 - i1) * y[4] * y[4]
    about_third = third > first or (third == first and i3 - i2 >= i2 - i1)
    start, last = (0, 2) if about_third else (2, 0)
    A, B, C = (i1, i2, i3) if about_third else (i3, i2, i1)
    w1, w2, w3 = y[4 + start] / spin, y[5] / spin, y[4 + last] / spin
    gba, gcb, gca = abs(B - A), abs(C - B), abs(C - A)
    P = B * gba * w2 * w2 + C * gca * w3 * w3
    Q = A * gca * w1 * w1 + B * gcb * w2 * w2
    distance = abs(C * gcb * w3 * w3 - A * gba * w1 * w1)
    if gcb * P == 0.0 or gca * distance < NEAREST_SEPARATRIX * gcb * P:
        return math.inf, math.inf
    L = math.sqrt((A * w1) ** 2 + (B * w2) ** 2 + (C * w3) ** 2)
    E2 = A * w1 * w1 + B * w2 * w2 + C * w3 * w3
    m1 = min(gca * distance / (gcb * P), 1.0)
    circling, turning, mean = mean_rates(A, B, C, P, Q, m1, L, E2)
    # At the same L, a thousandth of the way to the separatrix.
    change = 1e-3 * math.copysign(distance, C - A) / B
    if abs(change) < LEAST_CHANGE * E2:
        return math.inf, math.inf
    P_on, Q_on = P - abs(A * change), Q + abs(C * change)
    circling_on, turning_on, _ = mean_rates(A, B, C, P_on, Q_on, 1.0 - gba * Q_on / (gcb * P_on), L, E2 + change)
    # Ω(λL, λ²E) = λ Ω(L, E) gives the derivatives by L.
    circling_by_E, turning_by_E = (circling_on - circling) / change, (turning_on - turning) / change
    circling_by_L = (circling - 2.0 * E2 * circling_by_E) / L
    turning_by_L = (turning - 2.0 * E2 * turning_by_E) / L
    # The largest components of ω; the third one is between ``least`` and W.
    a1, W = math.sqrt(Q / (A * gca)), math.sqrt(P / (C * gca))
    a2 = math.sqrt(min(Q / (B * gcb), P / (B * gba) if gba > 0.0 else math.inf))
    least = W * math.sqrt(m1)
    swing = max(
        _length(a1 * (1.0 - turning * A / L), W * (1.0 - turning * C / L)),
        _length(a2 * (1.0 - turning * B / L), least * (1.0 - turning * C / L)),
        max(gca * a1 * W / B, gcb * a2 * W / A, gba * a1 * a2 / C),
    )
    at_rate = (turning_by_L, turning_by_E, circling_by_L, circling_by_E, swing / circling)
    # Torques, as changes of ω in its own units [1/s].
    unit = 1.0 / (p[MOMENTS + 2] * spin)
    t = undamped_torque(y[0], y[1], y[2], y[3], p)
    t1, t2, t3 = t[start] * unit, t[1] * unit, t[last] * unit
    f1, f2, f3 = p[TORQUE_BODY + start] * unit, p[TORQUE_BODY + 1] * unit, p[TORQUE_BODY + last] * unit
    mean = math.copysign(mean, w3)
    of_momentum, of_energy = f3 * C * mean / L, 2.0 * f3 * mean
    swings = (a1, a2, W - least)
    moments = (A, B, C)
    forces = (abs(f1), abs(f2), abs(f3))
    oscillating = 0.0
    for k in range(3):
        rate = forces[k] * swings[k]
        oscillating += _growth(at_rate, rate * moments[k] / L, 2.0 * rate)
    oscillating /= circling
    if p[HAS_WORLD_TORQUE] != 0.0:
        x, y_, z = rotate_inverse(y[0], y[1], y[2], y[3], p[TORQUE_WORLD], p[TORQUE_WORLD + 1], p[TORQUE_WORLD + 2])
        along = unit * (x * p[MOMENTS] * y[4] + y_ * p[MOMENTS + 1] * y[5] + z * p[MOMENTS + 2] * y[6])
        along /= p[MOMENTS + 2] * spin * L
        of_momentum += along
        of_energy += 2.0 * along * E2 / L
        fixed = unit * math.sqrt(x * x + y_ * y_ + z * z)
        square = 0.0
        for k in range(9):
            square += p[MOMENT + k] * p[MOMENT + k]
        at_point = unit * math.sqrt(2.0 * square)
        fastest2 = max(a1 * a1 + W * W, a2 * a2 + least * least)
        across = math.sqrt(max(fastest2 - (E2 / L) ** 2, 0.0))
        slowest = _slowest(turning, circling, m1)
        growth = _growth(at_rate, 0.0, 2.0 * fixed * across)
        growth += _largest_growth(at_rate, at_point, 2.0 * at_point * math.sqrt(fastest2))
        oscillating += growth / slowest
    momentum_now = (t1 * A * w1 + t2 * B * w2 + t3 * C * w3) / L
    energy_now = 2.0 * (t1 * w1 + t2 * w2 + t3 * w3)
    growing = spin * _growth(at_rate, momentum_now - of_momentum, energy_now - of_energy)
    # Where B and C are nearly the same, a little of ω₁ soon is much of ω₂; where C is small, a torque tilts L by more.
    lever = max(1.0, a2 / a1 if a1 > 0.0 else math.sqrt(A * gca / (B * gcb)))
    tilt = math.sqrt(f1 * f1 + f2 * f2 + f3 * f3) / L
    return growing, oscillating + DIRECT * max(lever * strongest / spin, tilt)
