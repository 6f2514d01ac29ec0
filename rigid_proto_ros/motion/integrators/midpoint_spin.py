# SPDX-License-Identifier: MIT
"""The implicit midpoint rule for spin and attitude that keeps energy and angular momentum, shared by two integrators.

With the mean spin ω̄ = ½(ω + ω⁺) and the Cayley turn F = (1 − ½hΩ̄)⁻¹(1 + ½hΩ̄), R⁺ = R F, the angular momentum balance
R⁺Iω⁺ = R(Iω + h t), t the torque in the axes of the step's start, is

    I(ω⁺ − ω) = h (t − ½h ω̄ × t − ω̄ × Iω̄):

angular momentum changes by h t exactly and energy by h ω̄·t. Source: Simo and Wong, Int. J. Numer. Meth. Engng 31
(1991) 19; Lewis and Simo, J. Nonlinear Sci. 4 (1994) 253; with the Cayley map, Austin, Krishnaprasad and Wang, J.
Comput. Phys. 107 (1993) 105. A torque τ given in the body's axes at the mean attitude enters as t − ½h ω̄ × t = sτ −
¼h²/(1 + s)(ω̄·τ) ω̄, s² = 1 + ¼h²|ω̄|².
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import multiply, normalize

MAX_ITERATIONS = 60
"""Newton's method needs 3 to 6; far more only where the step is too long for a solution to be found."""

ROUNDING = 2.0**-52


@njit(cache=True, error_model="numpy")
def half_turned(
    qx: float, qy: float, qz: float, qw: float, ox: float, oy: float, oz: float, h: float
) -> tuple[float, float, float, float]:
    """The mean attitude: half of the Cayley turn of ω̄ after q."""
    a, b, c = 0.5 * h * ox, 0.5 * h * oy, 0.5 * h * oz
    w = math.sqrt(1.0 + a * a + b * b + c * c)
    qx, qy, qz, qw = multiply(qx, qy, qz, qw, a, b, c, 1.0 + w)
    return normalize(qx, qy, qz, qw)


@njit(cache=True, error_model="numpy")
def cayley_turned(
    qx: float, qy: float, qz: float, qw: float, ox: float, oy: float, oz: float, h: float
) -> tuple[float, float, float, float]:
    """The attitude after the whole turn: q ⊗ (½hω̄, 1), normalized."""
    qx, qy, qz, qw = multiply(qx, qy, qz, qw, 0.5 * h * ox, 0.5 * h * oy, 0.5 * h * oz, 1.0)
    return normalize(qx, qy, qz, qw)


@njit(cache=True, error_model="numpy")
def mean_torque(
    ox: float, oy: float, oz: float, tx: float, ty: float, tz: float, h: float
) -> tuple[float, float, float]:
    """t − ½h ω̄ × t for a torque (tx, ty, tz) in the axes of the mean attitude."""
    s = math.sqrt(1.0 + 0.25 * h * h * (ox * ox + oy * oy + oz * oz))
    along = -0.25 * h * h / (1.0 + s) * (ox * tx + oy * ty + oz * tz)
    return s * tx + along * ox, s * ty + along * oy, s * tz + along * oz


@njit(cache=True, error_model="numpy")
def gyroscopic_torque(ox: float, oy: float, oz: float, p: np.record) -> tuple[float, float, float]:
    """−ω̄ × Iω̄."""
    a, b, c = p.moments[0], p.moments[1], p.moments[2]
    return (b - c) * oy * oz, (c - a) * oz * ox, (a - b) * ox * oy


@njit(cache=True, error_model="numpy")
def newton_correction(
    ox: float,
    oy: float,
    oz: float,
    rx: float,
    ry: float,
    rz: float,
    h: float,
    p: np.record,
    extra: float,
    ax: float,
    ay: float,
    az: float,
) -> tuple[float, float, float]:
    """δ with J δ = −residual r of 2I(ω̄ − ω) − h(...) = 0.

    J = 2I + h([ω̄]× I − [Iω̄]× + c) + ``extra`` (|a|² 1 − a aᵀ): gyroscopic term and damping exactly (its torque is −c
    ω̄ in the axes of the start too), a string at arm a as a spring.
    """
    damping = h * p.damping_angular
    A, B, C = p.moments[0], p.moments[1], p.moments[2]
    size = ax * ax + ay * ay + az * az
    j00 = 2.0 * A + damping + extra * (size - ax * ax)
    j11 = 2.0 * B + damping + extra * (size - ay * ay)
    j22 = 2.0 * C + damping + extra * (size - az * az)
    # Row i of ω̄ × Iω̄ differentiated; for instance (C − B) ω̄₂ω̄₃.
    j01, j02 = h * (C - B) * oz - extra * ax * ay, h * (C - B) * oy - extra * ax * az
    j10, j12 = h * (A - C) * oz - extra * ax * ay, h * (A - C) * ox - extra * ay * az
    j20, j21 = h * (B - A) * oy - extra * ax * az, h * (B - A) * ox - extra * ay * az
    c00, c01, c02 = j11 * j22 - j12 * j21, j02 * j21 - j01 * j22, j01 * j12 - j02 * j11
    c10, c11, c12 = j12 * j20 - j10 * j22, j00 * j22 - j02 * j20, j02 * j10 - j00 * j12
    c20, c21, c22 = j10 * j21 - j11 * j20, j01 * j20 - j00 * j21, j00 * j11 - j01 * j10
    d = -1.0 / (j00 * c00 + j01 * c10 + j02 * c20)
    return (
        d * (c00 * rx + c01 * ry + c02 * rz),
        d * (c10 * rx + c11 * ry + c12 * rz),
        d * (c20 * rx + c21 * ry + c22 * rz),
    )
