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
from . import style
from .backend import Backend


def energies(rows: np.ndarray, body: BodySnapshot) -> np.ndarray:
    """Energies (n, 3) [J] of states (n, 13): translational, rotational, gravity's."""
    velocity, w = rows[:, 7:10], rows[:, 10:13]
    translational = 0.5 * body.mass * np.einsum("ni,ni->n", velocity, velocity)
    rotational = 0.5 * np.einsum("ni,ij,nj->n", w, body.inertia, w)
    return np.column_stack([translational, rotational, -body.mass * (rows[:, 0:3] @ body.gravity)])


def angle_to(reference: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Angle [rad] between reference (3,) and vectors (n, 3), accurate near 0 and π; 0 where either vanishes."""
    return np.arctan2(np.linalg.norm(np.cross(reference, vectors), axis=1), vectors @ reference)


class Plots:
    """Remembers the run's start."""

    def __init__(self) -> None:
        self._momentum_at_start: np.ndarray | None = None

    def draw(
        self,
        backend: Backend,
        rows: np.ndarray,
        L: np.ndarray,
        w_principal: np.ndarray,
        body: BodySnapshot,
        string_energy: np.ndarray | None,
    ) -> None:
        """Plot states (n, 13) with their angular momenta (n, 3) in world axes and spins (n, 3) in principal ones.

        string_energy (n,) [J] is None as long as the run has had no string.
        """
        own = energies(rows, body)
        total = own.sum(axis=1) if string_energy is None else own.sum(axis=1) + string_energy
        if self._momentum_at_start is None:
            self._momentum_at_start = L[0].copy()
        shown = [own, total] if string_energy is None else [own, total, string_energy]
        backend.scalars(style.ENERGY, np.column_stack(shown))
        backend.scalars(style.ANGULAR_MOMENTUM, np.column_stack([L, np.linalg.norm(L, axis=1)]))
        angle = np.degrees(angle_to(self._momentum_at_start, L))
        backend.scalars(style.ANGULAR_MOMENTUM_ANGLE, angle[:, np.newaxis])
        backend.scalars(style.ANGULAR_VELOCITY_PRINCIPAL, w_principal)
        if np.any(body.gravity) or rows[:, 7:10].any():
            backend.scalars(style.POSITION, rows[:, 0:3])


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

    @property
    def bounds(self) -> tuple[float, float]:
        """The axis in the values' own unit."""
        return self.low * 10.0**self.exponent, self.high * 10.0**self.exponent

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


TICKS_IN_SMALL_PLOT = 5.0
"""Rerun numbers ticks at one power of ten, the least of which no more than these fit between the ends of
a small plot.
"""

BEYOND_TICK = 0.06
"""Of the axis, between its end and a tick whose number is to be read."""


def with_two_ticks(low: float, high: float) -> tuple[float, float]:
    """An axis, widened at one end where fewer than two of the ticks that Rerun numbers would lie on it."""
    step = nice_step((high - low) / TICKS_IN_SMALL_PLOT, (1.0,))
    first, last = math.ceil(low / step), math.floor(high / step)
    if last > first:
        return low, high
    # One tick or none: up or down to the next ones, whichever is nearer.
    up, down = step * (first + 1), step * (last - 1)
    if up - high <= low - down:
        return low, up + BEYOND_TICK * (up - low)
    return down - BEYOND_TICK * (high - down), high


def nice_step(length: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> float:
    """The next above a positive length, or equal to it, of ``steps`` (ascending, from 1 to below 10)
    times a power of ten.
    """
    power = 10.0 ** math.floor(math.log10(length))
    return next(step * power for step in (*steps, 10.0) if step * power >= length * (1.0 - 1e-12))
