# SPDX-License-Identifier: MIT
"""One step of Radau IIA with five stages: order 9, implicit, L-stable and stiffly accurate, on the rotation group.

The unknowns are the velocities V = (ω, u) at the stages; displacements follow from them by the same quadrature, dᵢ = d
+ h Σ aᵢⱼ uⱼ, and attitudes by the rotation vector θ of q ⊗ exp θ, θᵢ = h Σ aᵢⱼ g(θⱼ, ωⱼ), g = ω + ½ θ × ω + κ θ × (θ ×
ω). Newton's iteration uses the exact derivatives at every stage: with a frozen one it would stall where a stiff string
turns. A turn ξ of stage j in world axes obeys ξ' = δW with W = R ω, so the unknown changes are those of W and u, and
turns and displacements are hA times them.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II (1996), sections IV.5 and IV.8; θ' from
Munthe-Kaas, BIT 38 (1998) 92.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import sine, sine_cosine
from ...base.rotation import multiply, normalize
from ..problem import (
    HAS_STRING,
    LENGTH,
    TRANSLATES,
)
from ..variables import HAND_WORK, HEAT, LOW
from .derivatives import derivatives
from .equations import accelerations
from .knot import moved_pair, unit_attitude
from .radau_tableau import POWERS, STAGES, A

MOST_ITERATIONS = 12
"""Of Newton; four to six are used, and a step that needs more is too long."""

_MOST_SWEEPS = 60
"""Of the rotation vectors; their error falls by |ω|h/4 each."""

_N = 6


@njit(cache=True, error_model="numpy")
def _rates_of_turn(tx: float, ty: float, tz: float, wx: float, wy: float, wz: float) -> tuple[float, float, float]:
    """θ' = ω + ½ θ × ω + κ θ × (θ × ω) with κ = (1 − ½θ cot ½θ)/θ²."""
    x = tx * tx + ty * ty + tz * tz
    if x < 0.25:
        k = 1.0 / 12.0 + x * (
            1.0 / 720.0
            + x * (1.0 / 30240.0 + x * (1.0 / 1209600.0 + x * (1.0 / 47900160.0 + x * (691.0 / 1307674368000.0))))
        )
    else:
        half = 0.5 * math.sqrt(x)
        s, c = sine_cosine(half)
        k = (1.0 - half * c / s) / x
    ax, ay, az = ty * wz - tz * wy, tz * wx - tx * wz, tx * wy - ty * wx
    return (
        wx + 0.5 * ax + k * (ty * az - tz * ay),
        wy + 0.5 * ay + k * (tz * ax - tx * az),
        wz + 0.5 * az + k * (tx * ay - ty * ax),
    )


@njit(cache=True, error_model="numpy")
def _turns(V: np.ndarray, h: float, theta: np.ndarray, rates: np.ndarray) -> bool:
    """Rotation vectors theta (5, 3) of the stages from their spins V[:, :3], from the guess there;
    whether they were found.
    """
    for _ in range(_MOST_SWEEPS):
        for j in range(STAGES):
            rates[j, 0], rates[j, 1], rates[j, 2] = _rates_of_turn(
                theta[j, 0], theta[j, 1], theta[j, 2], V[j, 0], V[j, 1], V[j, 2]
            )
        moved, largest = 0.0, 0.0
        for i in range(STAGES):
            for k in range(3):
                total = 0.0
                for j in range(STAGES):
                    total += A[i, j] * rates[j, k]
                total *= h
                moved = max(moved, abs(total - theta[i, k]))
                largest = max(largest, abs(total))
                theta[i, k] = total
        if moved <= 4e-16 * largest:
            return True
        if not largest < 3.0:
            return False
    return moved <= 1e-14


@njit(cache=True, error_model="numpy")
def _half_turn(tx: float, ty: float, tz: float) -> tuple[float, float, float, float]:
    """exp θ as quaternion, its scalar part less 1 without cancellation."""
    angle = math.sqrt(tx * tx + ty * ty + tz * tz)
    s = 0.5 if angle < 1e-8 else sine(0.5 * angle) / angle
    less = sine(0.25 * angle)
    return s * tx, s * ty, s * tz, -2.0 * less * less


@njit(cache=True, error_model="numpy")
def _solve(M: np.ndarray, x: np.ndarray, size: int) -> bool:
    """Solve M z = x in place, by elimination with the largest pivot of each column; whether there is a solution."""
    for k in range(size):
        pivot, largest = k, abs(M[k, k])
        for i in range(k + 1, size):
            if abs(M[i, k]) > largest:
                pivot, largest = i, abs(M[i, k])
        if not (largest > 0.0 and math.isfinite(largest)):
            return False
        if pivot != k:
            for j in range(k, size):
                M[k, j], M[pivot, j] = M[pivot, j], M[k, j]
            x[k], x[pivot] = x[pivot], x[k]
        inverse = 1.0 / M[k, k]
        for i in range(k + 1, size):
            f = M[i, k] * inverse
            if f != 0.0:
                for j in range(k + 1, size):
                    M[i, j] -= f * M[k, j]
                x[i] -= f * x[k]
    for k in range(size - 1, -1, -1):
        total = x[k]
        for j in range(k + 1, size):
            total -= M[k, j] * x[j]
        x[k] = total / M[k, k]
    return True


@njit(cache=True, error_model="numpy")
def radau_step(  # noqa: C901 - loops over stages and unknowns that share their workspace
    y: np.ndarray, p: np.ndarray, h: float, taut: bool, V: np.ndarray, out: np.ndarray
) -> int:
    """One step of h seconds from y into out (STORED,). V (5, 6): velocities at the stages, a guess, then the solution.

    Returns how often the equations of motion were evaluated, 0 when no solution was found: the step is too long then.
    """
    n = _N if p[TRANSLATES] != 0.0 else 3
    size = STAGES * n
    theta, rates = np.zeros((STAGES, 3)), np.zeros((STAGES, 3))
    d, q, f = np.zeros((STAGES, 3)), np.zeros((STAGES, 4)), np.zeros((STAGES, 8))
    Jv, Jx = np.zeros((STAGES, _N, _N)), np.zeros((STAGES, _N, _N))
    R, K = np.zeros((STAGES, 3, 3)), np.zeros((2, 3, 3))
    M, x = np.empty((size, size)), np.empty(size)
    before, evaluations = math.inf, 0
    found = False
    while not found and evaluations < MOST_ITERATIONS * STAGES:
        if not _turns(V, h, theta, rates):
            return 0
        spin, speed = 0.0, 0.0
        for i in range(STAGES):
            rx, ry, rz, less = _half_turn(theta[i, 0], theta[i, 1], theta[i, 2])
            a, b, c, e = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, 1.0 + less)
            q[i, 0], q[i, 1], q[i, 2], q[i, 3] = normalize(a, b, c, e)
            for k in range(3):
                total = 0.0
                if n == _N:
                    for j in range(STAGES):
                        total += A[i, j] * V[j, 3 + k]
                d[i, k] = y[7 + k] + h * total
                spin = max(spin, abs(V[i, k]))
                speed = max(speed, abs(V[i, 3 + k]))
            f[i, 0], f[i, 1], f[i, 2], f[i, 3], f[i, 4], f[i, 5], f[i, 6], f[i, 7] = accelerations(
                *(q[i, 0], q[i, 1], q[i, 2], q[i, 3]),
                *(V[i, 0], V[i, 1], V[i, 2], d[i, 0], d[i, 1], d[i, 2], V[i, 3], V[i, 4], V[i, 5]),
                p,
                taut,
            )
            derivatives(q[i], V[i, :3], d[i], V[i, 3:], p, taut, R[i], Jv[i], Jx[i], K)
        evaluations += STAGES
        # Newton: (δᵢⱼ Rᵀ − h aᵢⱼ Jv − h² Σ aᵢₖ Jx aₖⱼ) δ = −(Vᵢ − V − h Σ aᵢⱼ V'ⱼ).
        for i in range(STAGES):
            for a in range(n):
                start = y[4 + a] if a < 3 else y[7 + a]
                total = 0.0
                for j in range(STAGES):
                    total += A[i, j] * f[j, a]
                x[i * n + a] = (start - V[i, a]) + h * total
            for j in range(STAGES):
                for a in range(n):
                    for b in range(n):
                        total = A[i, j] * Jv[j, a, b]
                        more = 0.0
                        for k in range(STAGES):
                            more += A[i, k] * A[k, j] * Jx[k, a, b]
                        M[i * n + a, j * n + b] = -h * (total + h * more)
            for a in range(3):
                for b in range(3):
                    M[i * n + a, i * n + b] += R[i, b, a]
            for a in range(3, n):
                M[i * n + a, i * n + a] += 1.0
        if not _solve(M, x, size):
            return 0
        change = 0.0
        # Changes are measured as errors are (error_measure.scales): a speed that a medium stops is beside the spin's
        # but rounding.
        spin, speed = max(spin, 1.0), max(speed, p[LENGTH])
        for i in range(STAGES):
            for a in range(3):
                turned = R[i, 0, a] * x[i * n] + R[i, 1, a] * x[i * n + 1] + R[i, 2, a] * x[i * n + 2]
                V[i, a] += turned
                change = max(change, abs(turned) / spin)
            for a in range(3, n):
                V[i, a] += x[i * n + a]
                change = max(change, abs(x[i * n + a]) / speed)
        if not math.isfinite(change):
            return 0
        # Changes that no longer fall are rounding, or there is nothing to be found.
        stalls = evaluations > 4 * STAGES and change > before
        if stalls and not change < 1e-12:
            return 0
        # Convergence is quadratic: what remains is about change²; where rounding stands in its way, change stays.
        found = change <= 1e-15 or (math.isfinite(before) and change * min(change / before, 1.0) < 1e-17)
        found = found or stalls or (change < 1e-13 and change > 0.25 * before)
        before = change
    if not found or not _turns(V, h, theta, rates):
        return 0
    last = STAGES - 1
    out[:] = y
    rx, ry, rz, less = _half_turn(theta[last, 0], theta[last, 1], theta[last, 2])
    a, b, c, e = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, less)
    moved_pair(y, out, 0, LOW, a)
    moved_pair(y, out, 1, LOW + 1, b)
    moved_pair(y, out, 2, LOW + 2, c)
    moved_pair(y, out, 3, LOW + 3, e)
    unit_attitude(out)
    for k in range(3):
        out[4 + k] = V[last, k]
        if n == _N:
            out[10 + k] = V[last, 3 + k]
            total = 0.0
            for j in range(STAGES):
                total += A[last, j] * V[j, 3 + k]
            moved_pair(y, out, 7 + k, LOW + 4 + k, h * total)
    if p[HAS_STRING] != 0.0:
        work, heat = 0.0, 0.0
        for j in range(STAGES):
            work += A[last, j] * f[j, 6]
            heat += A[last, j] * f[j, 7]
        out[HAND_WORK] = y[HAND_WORK] + h * work
        out[HEAT] = y[HEAT] + h * heat
    return evaluations


@njit(cache=True, error_model="numpy")
def stage_rates(V: np.ndarray, h: float, rates: np.ndarray) -> None:
    """Rates (5, 3) of the rotation vector at the stages of a step of h seconds with velocities V there,
    for ``within``.
    """
    _turns(V, h, np.zeros((STAGES, 3)), rates)


@njit(cache=True, error_model="numpy")
def within(y: np.ndarray, h: float, V: np.ndarray, rates: np.ndarray, s: float, out: np.ndarray) -> None:
    """Variables at the part s of a step of h seconds from y, by its own polynomials, into out: order 5, at its end 9.

    V (5, 6): velocities at the stages; rates: ``stage_rates``. Work and heat are left out.
    """
    tx, ty, tz, dx, dy, dz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    out[:] = 0.0
    for j in range(STAGES):
        value, integral = 0.0, 0.0
        for k in range(STAGES - 1, -1, -1):
            value = value * s + POWERS[j, k]
            integral = integral * s + POWERS[j, k] / (k + 1)
        integral *= s * h
        tx, ty, tz = tx + integral * rates[j, 0], ty + integral * rates[j, 1], tz + integral * rates[j, 2]
        dx, dy, dz = dx + integral * V[j, 3], dy + integral * V[j, 4], dz + integral * V[j, 5]
        for k in range(3):
            out[4 + k] += value * V[j, k]
            out[10 + k] += value * V[j, 3 + k]
    rx, ry, rz, less = _half_turn(tx, ty, tz)
    a, b, c, e = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, 1.0 + less)
    out[0], out[1], out[2], out[3] = normalize(a, b, c, e)
    out[7], out[8], out[9] = y[7] + dx, y[8] + dy, y[9] + dz
