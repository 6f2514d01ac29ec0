# SPDX-License-Identifier: MIT
"""Elliptic functions and integrals as the exact free-body step needs them: no cancellation near the separatrix.

The modulus comes as m = k² and m₁ = 1 − m, both accurate, because near the separatrix the motion hangs on m₁ alone.

Sources: Bulirsch, Numerische Mathematik 7 (1965) for sn, cn, dn; Carlson, Numerical Algorithms 10 (1995) for R_J;
Abramowitz and Stegun, chapters 16 and 17, for the rest.
"""

from __future__ import annotations

import math

from ...base.compilation import njit
from ...base.elementary import inverse_tangent, sine_cosine

SMALL_ARGUMENT = 0.03
"""Below it the Maclaurin series of sn, cut after u⁹, errs by 2e-19 (for m = 1 the next term is 0.0089 u¹¹)."""

_DUPLICATION = 3e-3
"""Carlson's series of fifth order errs by about the sixth power of the arguments' relative spread: 1e-16 of it."""


@njit(cache=True, error_model="numpy")
def complete_quarter_period(m1: float) -> float:
    """K(m) by the arithmetic-geometric mean, m₁ > 0."""
    a, b = 1.0, math.sqrt(m1)
    while abs(a - b) > 1e-8 * a:
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    # The mean of two numbers this near is exact to 1e-17.
    return math.pi / (a + b)


@njit(cache=True, error_model="numpy")
def sn_cn_dn(u: float, m: float, m1: float) -> tuple[float, float, float]:
    """sn, cn, dn (u | m) for |u| ≤ K, m₁ > 0; cn and dn keep their relative accuracy where they are small."""
    if abs(u) < 1.0:
        return _by_series(u, m)
    if m == 0.0:
        return (*sine_cosine(u), 1.0)
    return _by_landen(u, m1)


@njit(cache=True, error_model="numpy")
def _by_series(u: float, m: float) -> tuple[float, float, float]:
    """Maclaurin series, after halving u until it is small; then duplication (A&S 16.18)."""
    doublings = 0
    while abs(u) > SMALL_ARGUMENT:
        u *= 0.5
        doublings += 1
    t = u * u
    s = u * (
        1.0
        - t
        / 6.0
        * (
            (1.0 + m)
            - t
            / 20.0
            * (
                (1.0 + m * (14.0 + m))
                - t
                / 42.0
                * (
                    (1.0 + m * (135.0 + m * (135.0 + m)))
                    - t / 72.0 * (1.0 + m * (1228.0 + m * (5478.0 + m * (1228.0 + m))))
                )
            )
        )
    )
    c, d = math.sqrt(1.0 - s * s), math.sqrt(1.0 - m * s * s)
    for _ in range(doublings):
        t = s * s
        s = 2.0 * s * c * d / (1.0 - m * t * t)
        # cn and dn doubled by themselves would double their rounding error each time.
        c, d = math.sqrt(1.0 - s * s), math.sqrt(1.0 - m * s * s)
    return s, c, d


@njit(cache=True, error_model="numpy")
def _by_landen(u: float, m1: float) -> tuple[float, float, float]:
    """Bulirsch's sncndn: descending Landen transformations of cot am, which keeps small cn and dn accurate."""
    squeeze = m1
    means, roots = (0.0,) * 14, (0.0,) * 14
    a, d, c, levels = 1.0, 1.0, 0.0, 0
    while True:
        means = _set(means, levels, a)
        squeeze = math.sqrt(squeeze)
        roots = _set(roots, levels, squeeze)
        c = 0.5 * (a + squeeze)
        levels += 1
        if abs(a - squeeze) <= 1e-8 * a or levels == 13:
            break
        squeeze *= a
        a = c
    s, co = sine_cosine(c * u)
    if s == 0.0:
        return s, co, 1.0
    a = co / s
    c *= a
    for level in range(levels - 1, -1, -1):
        b = means[level]
        a *= c
        c *= d
        d = (roots[level] + a) / (b + a)
        a = c / b
    sn = math.copysign(1.0 / math.sqrt(c * c + 1.0), s)
    return sn, c * sn, d


@njit(cache=True, error_model="numpy")
def _set(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    """A tuple of 14 with one entry replaced: tuples live in registers where an array would be allocated each call."""
    return (
        value if index == 0 else values[0],
        value if index == 1 else values[1],
        value if index == 2 else values[2],
        value if index == 3 else values[3],
        value if index == 4 else values[4],
        value if index == 5 else values[5],
        value if index == 6 else values[6],
        value if index == 7 else values[7],
        value if index == 8 else values[8],
        value if index == 9 else values[9],
        value if index == 10 else values[10],
        value if index == 11 else values[11],
        value if index == 12 else values[12],
        value if index == 13 else values[13],
    )


@njit(cache=True, error_model="numpy")
def _rc_of_one(e: float) -> float:
    """R_C(1, 1 + e), e ≥ 0."""
    if e < 1e-3:
        # Σ (−e)ᵏ/(2k + 1), six terms.
        return 1.0 - e * (1.0 / 3.0 - e * (0.2 - e * (1.0 / 7.0 - e * (1.0 / 9.0 - e / 11.0))))
    root = math.sqrt(e)
    return inverse_tangent(root) / root


@njit(cache=True, error_model="numpy")
def carlson_rj(x: float, y: float, z: float, p: float) -> float:
    """R_J(x, y, z, p), 0 ≤ x, y, z ≤ p with at most one of them 0."""
    delta = (p - x) * (p - y) * (p - z)
    total, weight = 0.0, 1.0
    while True:
        mean = (x + y + z + 2.0 * p) / 5.0
        dx, dy, dz = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
        dp = -0.5 * (dx + dy + dz)
        if max(abs(dx), abs(dy), abs(dz), abs(dp)) < _DUPLICATION:
            break
        rx, ry, rz, rp = math.sqrt(x), math.sqrt(y), math.sqrt(z), math.sqrt(p)
        shift = rx * (ry + rz) + ry * rz
        d = (rp + rx) * (rp + ry) * (rp + rz)
        total += weight / d * _rc_of_one(weight * weight * weight * delta / (d * d))
        weight *= 0.25
        x, y, z, p = 0.25 * (x + shift), 0.25 * (y + shift), 0.25 * (z + shift), 0.25 * (p + shift)
    xyz, pp = dx * dy * dz, dp * dp
    e2 = dx * dy + dx * dz + dy * dz - 3.0 * pp
    e3 = xyz + 2.0 * e2 * dp + 4.0 * pp * dp
    e4 = (2.0 * xyz + e2 * dp + 3.0 * pp * dp) * dp
    e5 = xyz * pp
    series = (
        1.0
        - 3.0 * e2 / 14.0
        + e3 / 6.0
        + 9.0 * e2 * e2 / 88.0
        - 3.0 * e4 / 22.0
        - 9.0 * e2 * e3 / 52.0
        + 3.0 * e5 / 26.0
    )
    return weight * series / (mean * math.sqrt(mean)) + 6.0 * total
