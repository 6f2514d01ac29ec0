# SPDX-License-Identifier: MIT
"""Plotted values of one run, computed over a batch of states at once, and what a small plot shows of them.

States are rows (n, 13) in ``simulation/observer.py``'s ``STATE_FIELDS`` order: COM position, attitude xyzw, COM
velocity (world), angular velocity (body axes).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..simulation.observer import BodySnapshot


def energies(rows: np.ndarray, body: BodySnapshot) -> np.ndarray:
    """Energies (n, 3) [J] of states (n, 13): translational, rotational, gravity's."""
    velocity, w = rows[:, 7:10], rows[:, 10:13]
    translational = 0.5 * body.mass * np.einsum("ni,ni->n", velocity, velocity)
    rotational = 0.5 * np.einsum("ni,ij,nj->n", w, body.inertia, w)
    return np.column_stack([translational, rotational, -body.mass * (rows[:, 0:3] @ body.gravity)])


def angle_to(reference: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Angle [rad] between reference (3,) and vectors (n, 3), accurate near 0 and π; 0 where either vanishes."""
    return np.arctan2(np.linalg.norm(np.cross(reference, vectors), axis=1), vectors @ reference)


# Axes
#
# uPlot writes ticks in full, "0.00000012" or "7,200,000", into a column of fixed width, which cuts off what is longer.
# Ticks of values between 1 and 1000 always fit.

NARROWEST = 0.05
"""Of the largest value: a range isn't narrower, so that rounding isn't blown up to fill the plot."""

AXIS_PIXELS = 58
"""Width for the longest tick, "-999.95", its gap and its mark."""

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class PlotRange:
    """Values are plotted divided by 10**exponent (a multiple of 3), on an axis from ``low`` to ``high``
    in these units.
    """

    exponent: int
    low: float
    high: float

    def title(self, name: str, unit: str) -> str:
        """The plot's title: the quantity, its power of ten and its unit."""
        power = f"10{self.exponent}".translate(SUPERSCRIPTS).replace("¹⁰", "10", 1) if self.exponent else ""
        return f"{name} [{f'{power} ' if power else ''}{unit}]"


def plot_range(values: np.ndarray, least: float = 0.0) -> PlotRange:
    """For finite values in any order; ``least``: the range is at least as wide, in the values' unit."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    largest = max(abs(low), abs(high), least)
    exponent = 3 * math.floor(math.log10(largest) / 3.0) if largest > 0.0 else 0
    unit = 10.0**exponent
    low, high, largest, least = low / unit, high / unit, largest / unit, least / unit
    span = max(high - low, NARROWEST * largest, least)
    if span == 0.0:
        return PlotRange(0, -1.0, 1.0)
    middle = 0.5 * (low + high)
    step = nice_step(span / 4.0)
    # Outward to whole steps, with room at both ends: the range stays while the values change little.
    low = min(low, middle - 0.5 * span)
    high = max(high, middle + 0.5 * span)
    low, high = math.floor(low / step - 0.25) * step, math.ceil(high / step + 0.25) * step
    return PlotRange(exponent, round(low, 9), round(high, 9))


def nice_step(length: float) -> float:
    """The next above a positive length, or equal to it, of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= length * (1.0 - 1e-12))
