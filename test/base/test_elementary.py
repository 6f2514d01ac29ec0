# SPDX-License-Identifier: MIT
"""Elementary functions err by less than one unit in the last place, from the smallest to the largest arguments."""

from __future__ import annotations

import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest

from rigid_proto_ros.base import arithmetic as el

mpmath.mp.prec = 160
TINY, HUGE = -300.0, 300.0
Arguments = Callable[[np.random.Generator, int], np.ndarray]


def spread(low: float, high: float, signed: bool = True) -> Arguments:
    """Log-uniform from 10**low to 10**high, of either sign."""

    def drawn(random: np.random.Generator, count: int) -> np.ndarray:
        sizes = 10.0 ** random.uniform(low, high, count)
        return sizes * random.choice([-1.0, 1.0], count) if signed else sizes

    return drawn


def sine(x: float) -> float:
    return el.sine_cosine(x)[0]


def cosine(x: float) -> float:
    return el.sine_cosine(x)[1]


def inverse_tangent(x: float) -> float:
    return el.inverse_tangent_of(x, 1.0)


# Measured over 10⁶ arguments each; 0.5 is what rounding leaves of an exact value.
FUNCTIONS: dict[str, tuple[Callable[[float], float], Callable, Arguments]] = {
    "sine": (sine, mpmath.sin, spread(TINY, 15.3)),
    "cosine": (cosine, mpmath.cos, spread(TINY, 15.3)),
    "sine of what angles are": (sine, mpmath.sin, spread(-3.0, 9.0)),
    "cosine of what angles are": (cosine, mpmath.cos, spread(-3.0, 9.0)),
    "exponential_of": (el.exponential_of, mpmath.exp, spread(TINY, math.log10(708.0))),
    "expm1": (el.expm1, mpmath.expm1, spread(TINY, math.log10(708.0))),
    "logarithm": (el.logarithm, mpmath.log, spread(TINY, HUGE, signed=False)),
    "logarithm near 1": (
        el.logarithm,
        mpmath.log,
        lambda random, count: 1.0 + spread(-16.0, math.log10(0.9))(random, count),
    ),
    "inverse_tangent": (inverse_tangent, mpmath.atan, spread(TINY, HUGE)),
}


def ulps(computed: float, exact: mpmath.mpf) -> float:
    """The error in units of the last place of the exact value."""
    return float(abs(mpmath.mpf(computed) - exact) / math.ulp(float(exact)))


def worst(name: str, count: int, seed: int) -> tuple[float, float]:
    """The largest error of so many arguments [ulp], and where."""
    computed, exact, arguments = FUNCTIONS[name]
    return max(
        (ulps(computed(x), exact(mpmath.mpf(x))), x) for x in arguments(np.random.default_rng(seed), count).tolist()
    )


def worst_angle(count: int, seed: int) -> tuple[float, tuple[float, float]]:
    """The same of the angle of (x, y)."""
    random = np.random.default_rng(seed)
    x = spread(-150.0, 150.0)(random, count)
    y = x * spread(-20.0, 20.0)(random, count)
    pairs = zip(y.tolist(), x.tolist(), strict=True)
    return max((ulps(el.inverse_tangent_of(b, a), mpmath.atan2(b, a)), (b, a)) for b, a in pairs)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_an_elementary_function_errs_by_less_than_one_unit_in_the_last_place(name: str) -> None:
    error, at = worst(name, 1500, 1)
    assert error < 1.0, at


def test_an_angle_errs_by_less_than_one_unit_in_the_last_place() -> None:
    error, at = worst_angle(1500, 1)
    assert error < 1.0, at


def test_multiples_of_a_quarter_turn_keep_their_digits() -> None:
    for x in (math.pi, 1e5 * math.pi, 355.0, 2.0**40 * math.pi, 411557987.0, 2.0**51 - 0.5):
        assert ulps(sine(x), mpmath.sin(mpmath.mpf(x))) < 1.0
        assert ulps(cosine(x), mpmath.cos(mpmath.mpf(x))) < 1.0


def test_beyond_all_use_an_angle_is_still_one() -> None:
    for x in (2.0**51, 1e22, 1.7e308):
        s, c = el.sine_cosine(x)
        assert abs(s * s + c * c - 1.0) < 1e-15


def test_zeros_infinities_and_what_is_no_number() -> None:
    inf, nan = math.inf, math.nan
    for f in (sine, inverse_tangent, el.expm1):
        assert f(0.0) == 0.0 and math.copysign(1.0, f(-0.0)) == -1.0
    for f, x, y in (
        (sine, inf, nan),
        (cosine, -inf, nan),
        (cosine, 0.0, 1.0),
        (el.exponential_of, -inf, 0.0),
        (el.exponential_of, inf, inf),
        (el.exponential_of, 710.0, inf),
        (el.exponential_of, -745.0, 5e-324),
        (el.expm1, -inf, -1.0),
        (el.expm1, inf, inf),
        (el.logarithm, 0.0, -inf),
        (el.logarithm, 1.0, 0.0),
        (el.logarithm, inf, inf),
        (el.logarithm, -1.0, nan),
        (el.logarithm, 5e-324, math.log(5e-324)),
        (inverse_tangent, -inf, -0.5 * math.pi),
    ):
        assert f(x) == y or (math.isnan(y) and math.isnan(f(x))), (f, x)
    for f in (function for function, _, _ in FUNCTIONS.values()):
        assert math.isnan(f(nan))
    for y in (0.0, -0.0, 1.0, -1.0, inf, -inf):
        for x in (0.0, -0.0, 1.0, -1.0, inf, -inf):
            assert math.isclose(el.inverse_tangent_of(y, x), math.atan2(y, x), rel_tol=1e-15), (y, x)
            assert math.copysign(1.0, el.inverse_tangent_of(y, x)) == math.copysign(1.0, math.atan2(y, x))
