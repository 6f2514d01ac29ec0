# SPDX-License-Identifier: MIT
"""Sums and products of two doubles as pairs, against exact rationals."""

import itertools
import operator
from fractions import Fraction

import numpy as np
import pytest

from rigid_proto_ros.base.arithmetic import two_product, two_sum

NUMBERS = [0.0, 1.0, -1.0, 3.0, 0.1, 2.0**-30, 1.0 + 2.0**-52, 134217729.0, -1e150, 1e-140]


@pytest.mark.parametrize(("exact", "operation"), [(two_product, operator.mul), (two_sum, operator.add)])
def test_a_product_or_sum_and_its_rounding_error_are_the_exact_one(exact, operation) -> None:
    rng = np.random.default_rng(1)
    random = rng.uniform(-1.0, 1.0, (2000, 2)) * 10.0 ** rng.integers(-100, 100, (2000, 2))
    for a, b in [*itertools.product(NUMBERS, NUMBERS), *random.tolist()]:
        high, low = exact(a, b)
        assert high == operation(a, b)
        assert Fraction(high) + Fraction(low) == operation(Fraction(a), Fraction(b))
