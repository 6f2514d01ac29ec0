# SPDX-License-Identifier: MIT
"""What a C library has functions for gives its bits, and elementary functions are the same when they aren't compiled."""

from __future__ import annotations

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from rigid_proto_ros.base import arithmetic as el

COUNT = 15_000
SPECIAL = (0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 2.0**-1022, 1.7976931348623157e308, 1.0, -0.5)

# Compiled and not, by the bits of the results: the argument is a seed.
HASH = """
import hashlib, math, sys
import numpy as np
from rigid_proto_ros.base import arithmetic as el
from rigid_proto_ros.base.compilation import INTERPRETED

random = np.random.default_rng(int(sys.argv[1]))
digest = hashlib.sha256()

def spread(low, high, count=3000):
    return (10.0 ** random.uniform(low, high, count) * random.choice([-1.0, 1.0], count)).tolist()

SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 2.0**-1022, 1.7976931348623157e308, 1.0, -1.0]
functions = {
    el.sine_cosine: [(x,) for x in [*spread(-320, 9), *spread(0, 308, 300), *SPECIAL]],
    el.exponential_of: [(x,) for x in [*spread(-320, 2.9), *SPECIAL, 709.9, 745.2]],
    el.expm1: [(x,) for x in [*spread(-320, 2.9), *SPECIAL]],
    el.logarithm: [(x,) for x in [*map(abs, spread(-323, 308)), *(1.0 + 1e-6 * np.array(spread(-9, 0))).tolist(), *SPECIAL]],
    el.inverse_tangent_of: [
        *zip(spread(-320, 308), spread(-320, 308)),
        *((a, a * b) for a, b in zip(spread(-100, 100), spread(-3, 3))),
        *((a, b) for a in SPECIAL for b in SPECIAL),
    ],
    el.exact_quotient: [
        *((a * b, b) for a, b in zip(spread(-100, 100), spread(-100, 100))),
        *((a, b) for a in SPECIAL for b in SPECIAL if b != 0.0),
        *((5e-324 * round(a), b) for a, b in zip(spread(0, 5), spread(-3, 3))),
    ],
    el.exponent_of: [(x,) for x in [*spread(-323, 308), *SPECIAL]],
    el.scaled: [(x, int(n)) for x, n in zip([*spread(-323, 308), *SPECIAL], random.integers(-2200, 2200, 3011))],
    el.next_up: [(x,) for x in [*spread(-323, 308), *SPECIAL]],
    el.nearest_whole: [(x,) for x in [*spread(-3, 25), *SPECIAL, 0.5, 1.5, 2.5, -0.5]],
    el.remainder_of: [*zip(spread(-20, 20), spread(-20, 20)), *((a, b) for a in SPECIAL for b in SPECIAL)],
}
for function, arguments in functions.items():
    found = [function(*of_one) for of_one in arguments]
    numbers = np.array(found, dtype=float)
    numbers[np.isnan(numbers)] = np.nan
    print(function.__name__, hashlib.sha256(numbers.tobytes()).hexdigest()[:16], len(arguments))
"""


def bits(x: float) -> str:
    return "nan" if math.isnan(x) else x.hex()


@pytest.fixture(scope="module", params=[COUNT, pytest.param(4 * COUNT, marks=pytest.mark.stress)])
def numbers(request) -> list[float]:
    """Doubles of random bits, subnormal ones too, and special ones."""
    random = np.random.default_rng(1)
    drawn = random.integers(-(2**63), 2**63, request.param, dtype=np.int64)
    drawn[: request.param // 6] &= ~np.int64(0x7FF << 52)
    return [*drawn.view(np.float64).tolist(), *SPECIAL]


def test_an_exponent_is_that_of_frexp(numbers) -> None:
    for x in numbers:
        assert el.exponent_of(x) == math.frexp(x)[1], x.hex()


def test_scaling_by_a_power_of_two_rounds_once_as_ldexp_does(numbers) -> None:
    random = np.random.default_rng(2)
    subnormal = 0
    for x in numbers:
        _, e = math.frexp(x)
        # Any power, and one that ends at or below the smallest normal number.
        for n in (int(random.integers(-2300, 2300)), -1022 - e + int(random.integers(-54, 3))):
            try:
                exact = math.ldexp(x, n)
            except OverflowError:
                exact = math.copysign(math.inf, x)
            subnormal += 0.0 < abs(exact) < 2.0**-1022
            assert bits(el.scaled(x, n)) == bits(exact), (x.hex(), n)
    assert subnormal > len(numbers) // 2
    for n in (10**9, -(10**9)):
        assert el.scaled(-3.0, n) == math.copysign(math.inf if n > 0 else 0.0, -1.0)


@pytest.mark.filterwarnings("ignore:.* encountered in nextafter")
def test_the_next_number_is_the_next_one(numbers) -> None:
    for x in numbers:
        assert bits(el.next_up(x)) == bits(float(np.nextafter(x, np.inf))), x.hex()
        assert bits(-el.next_up(-x)) == bits(float(np.nextafter(x, -np.inf))), x.hex()


def test_a_remainder_is_pythons(numbers) -> None:
    random = np.random.default_rng(3)
    others = random.permutation(numbers)
    for x, other in zip(numbers, others.tolist(), strict=True):
        near = x * 2.0 ** -float(random.integers(0, 60)) * random.uniform(0.5, 1.0)
        for divisor in (other, float(near), 2.0 * math.pi):
            if divisor == 0.0 or not math.isfinite(x) or math.isnan(divisor):
                assert math.isnan(el.remainder_of(x, divisor))
            else:
                assert bits(el.remainder_of(x, divisor)) == bits(x % divisor), (x.hex(), divisor.hex())


def test_a_whole_number_is_the_nearest_an_even_one_between_two(numbers) -> None:
    random = np.random.default_rng(4)
    sizes = (2.0 ** random.uniform(-3.0, 63.0, COUNT) * random.choice([-1.0, 1.0], COUNT)).tolist()
    halves = (random.integers(-100, 100, 200) + 0.5).tolist()
    for x in [*sizes, *halves, *(x for x in numbers if abs(x) < 2.0**63)]:
        assert bits(el.nearest_whole(x)) == bits(float(round(x))), x.hex()
    for x in (2.0**63, -(2.0**63), 1e300, math.inf, math.nan):
        assert el.nearest_whole(x) == -(2.0**63)


def test_functions_that_are_not_compiled_give_the_same_bits() -> None:
    results = {}
    for way in ("library", "interpreted"):
        environment = {**os.environ, "RIGID_PROTO_KERNELS": way}
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", HASH, "5"],
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        results[way] = done.stdout.splitlines()
    assert results["library"] == results["interpreted"]
    assert len(results["library"]) == 11
