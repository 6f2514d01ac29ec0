# SPDX-License-Identifier: MIT
"""Sums and products of two doubles as pairs, against exact rationals."""

from fractions import Fraction

import numpy as np
import pytest

from rigid_proto_ros.base.arithmetic import two_product, two_sum

NUMBERS = [0.0, 1.0, -1.0, 3.0, 0.1, 2.0**-30, 1.0 + 2.0**-52, 134217729.0, -1e150, 1e-140]


@pytest.fixture(scope="module")
def pairs() -> list[tuple[float, float]]:
    rng = np.random.default_rng(1)
    random = rng.uniform(-1.0, 1.0, (2000, 2)) * 10.0 ** rng.integers(-100, 100, (2000, 2))
    return [(a, b) for a in NUMBERS for b in NUMBERS] + [(float(a), float(b)) for a, b in random]


def test_a_product_and_its_rounding_error_are_the_exact_product(pairs) -> None:
    for a, b in pairs:
        high, low = two_product(a, b)
        assert high == a * b
        assert Fraction(high) + Fraction(low) == Fraction(a) * Fraction(b)


def test_a_sum_and_its_rounding_error_are_the_exact_sum(pairs) -> None:
    for a, b in pairs:
        high, low = two_sum(a, b)
        assert high == a + b
        assert Fraction(high) + Fraction(low) == Fraction(a) + Fraction(b)
