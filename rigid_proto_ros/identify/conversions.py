# SPDX-License-Identifier: MIT
"""What else samples could mean that no rigid body shows: other units, another direction of gravity, another order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from .fitting import short_misfit
from .measurements import ACCELERATION, ATTITUDE, POSITION, RATE, VELOCITY, MeasuredFlight, Series
from .unknowns import Unknowns, Values

USUAL = (
    "usual causes: positions that aren't in m, rates in degrees, accelerations in g, gravity along another axis"
    " (--gravity), quaternions that begin with w, a wrench along other axes (--wrench TOPIC@FRAME), clocks (--offset)"
)
_SCALES = (
    ((POSITION, VELOCITY), 1e-3, "positions are in mm"),
    ((POSITION, VELOCITY), 1e-2, "positions are in cm"),
    ((RATE,), np.pi / 180.0, "rates are in degrees a second"),
    ((ACCELERATION,), 9.80665, "accelerations are in g"),
)
_DIRECTIONS = ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))


def likely_cause(flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> str:
    """Which conversion makes short parts of the flights fit, in words, or the usual causes; empty where they fit as
    they are, so that none of these is the cause.
    """
    if short_misfit(flights, unknowns, values) <= 1.0:
        return ""
    for cause, remedy, converted, gravity in _conversions(flights, values):
        if short_misfit(converted, unknowns, replace(values, gravity=gravity)) <= 1.0:
            return f"it fits if {cause}: {remedy}"
    return USUAL


def _conversions(
    flights: Sequence[MeasuredFlight], values: Values
) -> Iterator[tuple[str, str, list[MeasuredFlight], np.ndarray]]:
    """Cause, remedy, and flights and gravity as they are then."""
    kinds = {series.kind for flight in flights for series in flight.series}
    for scaled, factor, cause in _SCALES:
        if scaled[0] in kinds:
            yield (
                cause,
                f"multiply them by {factor:.6g}",
                _changed(flights, scaled, partial(np.multiply, factor)),
                values.gravity,
            )
    for direction in _DIRECTIONS:
        gravity = 9.81 * np.array(direction)
        if not np.allclose(gravity, values.gravity):
            text = " ".join(f"{g:g}" for g in gravity.tolist())
            yield f"gravity is {text} m/s²", f"--gravity {text}", list(flights), gravity
    if values.gravity.any():
        yield "there is no gravity", "--gravity 0 0 0", list(flights), np.zeros(3)
    reordered = _changed(flights, (ATTITUDE,), partial(np.roll, shift=-1, axis=1))
    yield "quaternions begin with w", "reorder them to x y z w", reordered, values.gravity


def _changed(
    flights: Sequence[MeasuredFlight], kinds: Sequence[str], convert: Callable[[np.ndarray], np.ndarray]
) -> list[MeasuredFlight]:
    def one(series: Series) -> Series:
        return replace(series, values=convert(series.values)) if series.kind in kinds else series

    return [replace(flight, series=tuple(one(series) for series in flight.series)) for flight in flights]
