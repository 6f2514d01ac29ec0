# SPDX-License-Identifier: MIT
"""Error-free transformations: a sum or product of two doubles as an unevaluated pair high + low.

Two-sum after Knuth (TAOCP 2, 4.2.2), two-product by a fused multiply-add (Ogita, Rump and Oishi, SIAM J. Sci. Comput.
26, 2005), pair arithmetic after Hida, Li and Bailey (QD, 2001). A pair carries about 104 bits. Nothing here may be
compiled with fastmath: the whole point is the rounding error that algebra says is zero.
"""

from __future__ import annotations

import numpy as np

from .compilation import njit
from .simd import fused_multiply_add


@njit(cache=True)
def two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b = high + low, exactly."""
    high = a + b
    t = high - a
    return high, (a - (high - t)) + (b - t)


@njit(cache=True)
def fast_two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b = high + low, exactly, for |a| ≥ |b| or a = 0."""
    high = a + b
    return high, b - (high - a)


@njit(cache=True)
def two_product(a: float, b: float) -> tuple[float, float]:
    """a b = high + low, exactly, while |a b| > 1e-290 or zero."""
    high = a * b
    return high, fused_multiply_add(a, b, -high)


@njit(cache=True)
def pair_add(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Sum of two pairs, relative error ≤ 3·2⁻¹⁰⁶ even under cancellation (the accurate variant)."""
    s, e = two_sum(a, b)
    t, f = two_sum(a_low, b_low)
    s, e = fast_two_sum(s, e + t)
    return fast_two_sum(s, e + f)


@njit(cache=True)
def pair_multiply(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Product of two pairs, relative error ≤ 7·2⁻¹⁰⁶."""
    p, e = two_product(a, b)
    return fast_two_sum(p, e + (a * b_low + a_low * b))


@njit(cache=True)
def pair_divide(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Quotient of two pairs, relative error ≤ 10·2⁻¹⁰⁶; b ≠ 0."""
    q = a / b
    p, e = pair_multiply(q, 0.0, b, b_low)
    r, r_low = pair_add(a, a_low, -p, -e)
    return fast_two_sum(q, (r + r_low) / b)


@njit(cache=True, error_model="numpy")
def exact_quotient(product: float, factor: float) -> float:
    """x with x · factor == product in double precision where there is one, else the nearest."""
    x = product / factor
    if x * factor == product:
        return x
    up: float = np.nextafter(x, np.inf)
    down: float = np.nextafter(x, -np.inf)
    if up * factor == product:
        return up
    if down * factor == product:
        return down
    return x
