# SPDX-License-Identifier: MIT
"""Random numbers for a b + c rounded once: of all sizes, subnormal, overflowing, cancelling, equally near two doubles, zeros
with signs, infinities and no numbers."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

import numpy as np

SPECIAL = (
    0.0,
    5e-324,
    2.2250738585072014e-308,
    2.225073858507201e-308,
    1.7976931348623157e308,
    1.0,
    math.inf,
    math.nan,
)


def triples(count: int, seed: int = 5) -> Iterator[tuple[float, float, float]]:
    """So many of them."""
    rng = np.random.default_rng(seed)

    def power(low: int, high: int) -> float:
        return 2.0 ** int(rng.integers(low, high))

    def sign() -> float:
        return float(rng.choice((-1.0, 1.0)))

    numbers = (
        lambda: struct.unpack("<d", rng.bytes(8))[0],
        lambda: sign() * float(rng.choice(SPECIAL)),
        lambda: sign() * float(rng.integers(1, 2**52)) * 5e-324,
        lambda: float(rng.integers(-(2**30), 2**30)),
        lambda: sign() * power(-1074, 1023),
        lambda: rng.normal() * power(-20, 20),
        lambda: rng.normal() * power(-540, -500),
        lambda: rng.normal() * power(500, 1020),
        lambda: float(rng.normal()),
    )
    sums = (
        lambda _: numbers[rng.integers(len(numbers))](),
        lambda product: -product,
        lambda product: -product * (1.0 + float(rng.integers(-3, 4)) * 2.0**-52),
        lambda product: math.nextafter(-product, 0.0),
        lambda product: sign() * product * power(-110, 110),
        lambda product: sign() * product * power(-55, -50),
    )
    for _ in range(count):
        a, b = (numbers[rng.integers(len(numbers))]() for _ in range(2))
        yield a, b, float(sums[rng.integers(len(sums))](a * b))
