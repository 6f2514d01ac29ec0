# SPDX-License-Identifier: MIT
"""Random numbers that are the same everywhere, from ``random.Random(seed).random()``, whose sequence Python guarantees, by
arithmetic and decimal rounding alone.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any


def short(x: float, digits: int = 4) -> float:
    """The number to so many significant digits."""
    return float(f"{x:.{digits}g}")


class Draw:
    """Random numbers by a seed."""

    def __init__(self, seed: int) -> None:
        self.u = random.Random(seed).random

    def chance(self, p: float) -> bool:
        """With this probability."""
        return self.u() < p

    def below(self, n: int) -> int:
        """A whole number from 0 to n − 1."""
        return int(self.u() * n)

    def pick(self, items: Sequence[Any]) -> Any:
        """One of them."""
        return items[self.below(len(items))]

    def by_weight(self, weights: dict[Any, float]) -> Any:
        """One of them, as often as its weight says."""
        whole = 0.0
        for weight in weights.values():  # not ``sum``, which rounds otherwise in newer versions of Python
            whole += weight
        left = self.u() * whole
        for item, weight in weights.items():
            left -= weight
            if left < 0.0:
                return item
        return item

    def number(self, low: float, high: float, decimals: int = 3) -> float:
        """A number in this range."""
        return round(low + (high - low) * self.u(), decimals)

    def log(self, low: int, high: int) -> float:
        """A number from 10^low to 10^high, about as often of one size as of another."""
        return float(f"{self.number(1.0, 9.99, 2)}e{low + self.below(high - low)}")

    def vector(self, size: float) -> list[float]:
        """Of components up to ``size``, now and then along an axis."""
        if self.chance(0.3):
            numbers = [0.0, 0.0, 0.0]
            numbers[self.below(3)] = short(size * self.pick((-1.0, 1.0, 0.5)))
            return numbers
        return [short(size * self.number(-1.0, 1.0)) for _ in range(3)]
