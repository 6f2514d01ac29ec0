# SPDX-License-Identifier: MIT
"""Principal moments and axes of slender bodies, whose smallest moment is lost in the rounding of the largest.

A tensor given in axes other than its own holds the smallest moment, and the difference of the other two, as differences
of large numbers. In doubles Jacobi's rotations then add an error of ε I₃ to what the tensor says; in pairs of doubles
(base/exact_arithmetic.py) they add none. Source: Golub and Van Loan, Matrix Computations (2013), section 8.5.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.exact_arithmetic import pair_add, pair_divide, pair_multiply, two_product

SLENDER = 1e5
"""I₃/I₁ beyond which tensors are diagonalized in pairs: measured, doubles cost up to 3e-11 of the smallest there,
and the attitude at a spin of some rad/s as much a second, a thirtieth of the default accuracy.
"""

_NEGLIGIBLE = 2.0**-70
"""Of the two diagonals' geometric mean: an off-diagonal below that moves no moment by a unit in its last place."""


@njit(cache=True, error_model="numpy")
def _turn(a: np.ndarray, p: int, q: int, c: float, c_low: float, s: float, s_low: float) -> None:
    """Columns p and q of a (3, 3, 2) times the rotation with this cosine and sine, in place."""
    for k in range(3):
        x, x_low, y, y_low = a[k, p, 0], a[k, p, 1], a[k, q, 0], a[k, q, 1]
        cx, sx = pair_multiply(c, c_low, x, x_low), pair_multiply(s, s_low, x, x_low)
        cy, sy = pair_multiply(c, c_low, y, y_low), pair_multiply(s, s_low, y, y_low)
        a[k, p] = pair_add(cx[0], cx[1], -sy[0], -sy[1])
        a[k, q] = pair_add(sx[0], sx[1], cy[0], cy[1])


@njit(cache=True, error_model="numpy")
def _rotate(a: np.ndarray, v: np.ndarray, p: int, q: int) -> bool:
    """Turn a so that a[p, q] all but vanishes, and v along, in place; False when it is negligible already."""
    g = a[p, q, 0]
    if g == 0.0 or abs(g) <= _NEGLIGIBLE * math.sqrt(abs(a[p, p, 0])) * math.sqrt(abs(a[q, q, 0])):
        return False
    theta = (a[q, q, 0] - a[p, p, 0]) / (2.0 * g)
    tangent = math.copysign(1.0 / (abs(theta) + math.sqrt(1.0 + theta * theta)), theta)
    # A rotation to all digits, by an angle known to a double's: that of half the angle's tangent.
    half = tangent / (1.0 + math.sqrt(1.0 + tangent * tangent))
    square, square_low = two_product(half, half)
    denominator = pair_add(1.0, 0.0, square, square_low)
    numerator = pair_add(1.0, 0.0, -square, -square_low)
    c, c_low = pair_divide(numerator[0], numerator[1], denominator[0], denominator[1])
    s, s_low = pair_divide(2.0 * half, 0.0, denominator[0], denominator[1])
    _turn(a, p, q, c, c_low, s, s_low)
    _turn(a.transpose(1, 0, 2), p, q, c, c_low, s, s_low)
    _turn(v, p, q, c, c_low, s, s_low)
    return True


@njit(cache=True, error_model="numpy")
def slender_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) and axes (3, 3), columns, of a symmetric ``inertia`` (3, 3), in no order.

    Each moment is the nearest double to what the given doubles say. But of two nearly equal ones the smaller is such
    that their difference, on which the motion depends, is the nearest.
    """
    largest = np.max(np.abs(inertia))
    # Scaled by a power of two, no product's low word underflows.
    scale = math.ldexp(1.0, -math.frexp(largest)[1])
    a, v = np.zeros((3, 3, 2)), np.zeros((3, 3, 2))
    for k in range(3):
        v[k, k, 0] = 1.0
        for j in range(3):
            a[k, j, 0] = scale * inertia[k, j]
    for _ in range(30):
        turned = False
        for p in range(2):
            for q in range(p + 1, 3):
                turned = _rotate(a, v, p, q) or turned
        if not turned:
            break
    moments = np.empty(3)
    for k in range(3):
        moments[k] = a[k, k, 0]
    for k in range(3):
        for j in range(3):
            larger = pair_add(a[k, k, 0], a[k, k, 1], -a[j, j, 0], -a[j, j, 1])
            if larger[0] > 0.0 and 2.0 * moments[j] > moments[k]:
                moments[j] = moments[k] - larger[0]
    return moments / scale, v[:, :, 0].copy()
