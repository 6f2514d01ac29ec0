# SPDX-License-Identifier: MIT
"""lie_midpoint: the implicit midpoint rule on the rotation group, which conserves energy and angular momentum to
rounding.

Order 2, implicit: Newton's method evaluates the loads 3 to 6 times per step. Stable at any |ω|h for which the iteration
converges (up to about 2). The attitude error is still of order h²: a bounded energy doesn't prove accuracy.

With the mean spin ω̄ = ½(ω + ω⁺) and the Cayley map F = (1 − ½hΩ̄)⁻¹(1 + ½hΩ̄), R⁺ = R F, the angular momentum balance
R⁺Iω⁺ = R(Iω + h t), t the torque in the axes at the start of the step, is

    I(ω⁺ − ω) = h (t − ½h ω̄ × t − ω̄ × Iω̄):

angular momentum changes by exactly h t and energy by h ω̄·t. With a flywheel's momentum, whose mean over the step is H̄,
the total R(Iω + H) is balanced so: I(ω⁺ − ω) = h (t − ½h ω̄ × t − ω̄ × (Iω̄ + H̄)) − (H⁺ − H). Source: Simo and Wong,
Int. J. Numer. Meth. Engng 31 (1991) 19; Lewis and Simo, J. Nonlinear Sci. 4 (1994) 253; with the Cayley map, Austin,
Krishnaprasad and Wang, J. Comput. Phys. 107 (1993) 105. A torque τ given in the body's axes at the mean attitude enters
as t − ½h ω̄ × t = sτ − ¼h²/(1 + s)(ω̄·τ) ω̄, s² = 1 + ¼h²|ω̄|².
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import copy_numbers, local_numbers, njit
from ...base.rotation import multiply, normalize, rotate
from ...base.vectors import Quaternion, Vector
from ..loads import ANGULAR_DAMPING, ROTOR
from ..problem import TIME, VARIABLES, Variables, is_good, later, parts_of, rotor_momentum, torque
from .integrator import LOADS, Integrator

_MAX_ITERATIONS = 60
"""Newton's method needs 3 to 6; many more only if the step is too long to converge."""

_ROUNDING = 2.0**-52


@njit(error_model="numpy", allocates=False, forceinline=True)
def _half_turned(q: Quaternion, o: Vector, h: float) -> Quaternion:
    """Attitude at the middle of the step: q followed by half of the Cayley rotation of ω̄ = o."""
    a, b, c = 0.5 * h * o[0], 0.5 * h * o[1], 0.5 * h * o[2]
    w = math.sqrt(1.0 + a * a + b * b + c * c)
    return normalize(*multiply(*q, a, b, c, 1.0 + w))


@njit(error_model="numpy", allocates=False, forceinline=True)
def _mean_torque(o: Vector, t: Vector, h: float) -> Vector:
    """t − ½h ω̄ × t for a torque t in the axes of the mean attitude."""
    s = math.sqrt(1.0 + 0.25 * h * h * (o[0] * o[0] + o[1] * o[1] + o[2] * o[2]))
    along = -0.25 * h * h / (1.0 + s) * (o[0] * t[0] + o[1] * t[1] + o[2] * t[2])
    return s * t[0] + along * o[0], s * t[1] + along * o[1], s * t[2] + along * o[2]


@njit(error_model="numpy", allocates=False, forceinline=True)
def _change_of_momentum(q: Quaternion, o: Vector, mean: Vector, p: np.record, h: float) -> Vector:
    """I(ω⁺ − ω) for the mean spin o and the flywheel's mean momentum."""
    tx, ty, tz = _mean_torque(o, torque(_half_turned(q, o, h), o, p), h)
    A, B, C = p.moments[0], p.moments[1], p.moments[2]
    gx, gy, gz = (B - C) * o[1] * o[2], (C - A) * o[2] * o[0], (A - B) * o[0] * o[1]
    if p.has_rotor:
        a, b, c = mean
        rate = p.rotor_torque
        gx, gy, gz = (
            gx + (o[2] * b - o[1] * c - rate[0]),
            gy + (o[0] * c - o[2] * a - rate[1]),
            gz + (o[1] * a - o[0] * b - rate[2]),
        )
    return h * (tx + gx), h * (ty + gy), h * (tz + gz)


@njit(error_model="numpy", allocates=False, forceinline=True)
def _newton_correction(o: Vector, r: Vector, mean: Vector, h: float, p: np.record) -> Vector:
    """Newton correction δ: J δ = −r for the residual r of 2I(ω̄ − ω) − h(...) = 0.

    J = 2I + h([ω̄]× I − [Iω̄ + H̄]× + c): exact for the gyroscopic term and damping, whose torque is −c ω̄ in the axes
    of the start, too.
    """
    damping = h * p.damping_angular
    ox, oy, oz = o
    A, B, C = p.moments[0], p.moments[1], p.moments[2]
    j00, j11, j22 = 2.0 * A + damping, 2.0 * B + damping, 2.0 * C + damping
    # Derivatives of row i of ω̄ × Iω̄; for instance of (C − B) ω̄₂ω̄₃.
    j01, j02 = h * (C - B) * oz, h * (C - B) * oy
    j10, j12 = h * (A - C) * oz, h * (A - C) * ox
    j20, j21 = h * (B - A) * oy, h * (B - A) * ox
    if p.has_rotor:
        a, b, c = h * mean[0], h * mean[1], h * mean[2]
        j01, j02, j10, j12, j20, j21 = j01 + c, j02 - b, j10 - c, j12 + a, j20 + b, j21 - a
    c00, c01, c02 = j11 * j22 - j12 * j21, j02 * j21 - j01 * j22, j01 * j12 - j02 * j11
    c10, c11, c12 = j12 * j20 - j10 * j22, j00 * j22 - j02 * j20, j02 * j10 - j00 * j12
    c20, c21, c22 = j10 * j21 - j11 * j20, j01 * j20 - j00 * j21, j00 * j11 - j01 * j10
    d = -1.0 / (j00 * c00 + j01 * c10 + j02 * c20)
    return (
        d * (c00 * r[0] + c01 * r[1] + c02 * r[2]),
        d * (c10 * r[0] + c11 * r[1] + c12 * r[2]),
        d * (c20 * r[0] + c21 * r[1] + c22 * r[2]),
    )


@njit(error_model="numpy", allocates=False)
def _step(y: Variables, p: np.record, h: float, out: Variables) -> bool:
    """One step from y into out; returns whether the iteration converged."""
    A, B, C = p.moments[0], p.moments[1], p.moments[2]
    q, w, _, _ = parts_of(y)
    wx, wy, wz = o = w
    mean = (0.0, 0.0, 0.0)
    if p.has_rotor:
        mean = rotor_momentum(y[TIME] + 0.5 * h, p)
        out[TIME] = later(y[TIME], h)
    change = 0.0
    converged = False
    for _ in range(_MAX_ITERATIONS):
        kx, ky, kz = _change_of_momentum(q, o, mean, p, h)
        r = 2.0 * A * (o[0] - wx) - kx, 2.0 * B * (o[1] - wy) - ky, 2.0 * C * (o[2] - wz) - kz
        ex, ey, ez = _newton_correction(o, r, mean, h, p)
        o = o[0] + ex, o[1] + ey, o[2] + ez
        before, change = change, max(abs(ex), abs(ey), abs(ez))
        size = max(abs(o[0]), abs(o[1]), abs(o[2]))
        # Converged when corrections are at rounding level, or near it and no longer shrinking.
        if change <= _ROUNDING * size or (
            change <= 64.0 * _ROUNDING * size and before != 0.0 and change >= 0.5 * before
        ):
            converged = True
            break
    kx, ky, kz = _change_of_momentum(q, o, mean, p, h)
    out[4], out[5], out[6] = wx + kx / A, wy + ky / B, wz + kz / C
    # The full Cayley rotation: q ⊗ (½hω̄, 1).
    turned = multiply(*q, 0.5 * h * o[0], 0.5 * h * o[1], 0.5 * h * o[2], 1.0)
    out[0], out[1], out[2], out[3] = normalize(*turned)
    if p.translates:
        own, added, c = p.acceleration_body, p.acceleration_added, p.damping_linear
        push = rotate(*_half_turned(q, o, h), own[0], own[1], own[2])
        for k in range(3):
            # Solution of v⁺ = v + h(a − c ½(v + v⁺)).
            average = (y[10 + k] + 0.5 * h * (push[k] + added[k])) / (1.0 + 0.5 * h * c)
            out[7 + k] = y[7 + k] + h * average
            out[10 + k] = y[10 + k] + h * (push[k] + added[k] - c * average)
    return converged


@njit(error_model="numpy", allocates=False)
def lie_midpoint_steps(y: Variables, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    new = local_numbers(VARIABLES)
    copy_numbers(y, new)
    here, there = y, new
    for done in range(n):
        if not _step(here, p, h, there) or not is_good(there):
            n = done
            break
        here, there = there, here
    if n % 2 == 1:
        copy_numbers(new, y)
    return n


LIE_MIDPOINT = Integrator(
    name="lie_midpoint",
    order=2,
    evaluations=4,
    source="Simo and Wong, Int. J. Numer. Meth. Engng 31 (1991) 19",
    limits="No string; conserves energy and momentum at any step it can solve; attitude error of order h².",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, ROTOR},
    kernel=lie_midpoint_steps,
)
