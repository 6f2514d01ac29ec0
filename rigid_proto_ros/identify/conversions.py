# SPDX-License-Identifier: MIT
"""What else samples could mean that no rigid body shows: other units, another direction of gravity, another order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from .fitting import CannotFlyError, fit_flights, short_misfit
from .measurements import ACCELERATION, ATTITUDE, POSITION, RATE, MeasuredFlight, Series
from .residual_checks import check_residuals
from .unknowns import Unknowns, Values

USUAL = (
    "usual causes: positions that aren't in m, rates in degrees, accelerations in g, gravity along another axis"
    " (--gravity), quaternions that begin with w, a wrench along other axes (--wrench TOPIC@FRAME), clocks (--offset)"
)
_SCALES = (
    ((POSITION,), 1e-3, "positions are in mm"),
    ((POSITION,), 1e-2, "positions are in cm"),
    ((RATE,), np.pi / 180.0, "rates are in degrees a second"),
    ((ACCELERATION,), 9.80665, "accelerations are in g"),
)
_DIRECTIONS = ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))


def likely_cause(flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> str:
    """Which conversion makes the flights fit, or at least short parts of them, in words, or the usual causes; empty
    where short parts fit as they are and no other unit of a sensor makes the whole fit.
    """
    fits_short = short_misfit(flights, unknowns, values) <= 1.0
    partly = ""
    # Poses of wrong units or axes don't fit for a moment; accelerations may, with another mass.
    for cause, remedy, converted, gravity in _conversions(flights, values, sensors_only=fits_short):
        other = replace(values, gravity=gravity)
        if short_misfit(converted, unknowns, other) > 1.0:
            continue
        if _fits(converted, unknowns, other):
            return f"it fits if {cause}: {remedy}"
        partly = partly or f"short parts fit if {cause}: {remedy}"
    return "" if fits_short else partly or USUAL


def _fits(flights: Sequence[MeasuredFlight], unknowns: Unknowns, values: Values) -> bool:
    """Whether the whole flights leave no more than noise."""
    try:
        estimate = fit_flights(flights, unknowns, values)
        return all(check.is_noise for check in check_residuals(flights, estimate))
    except CannotFlyError:
        return False


def _conversions(
    flights: Sequence[MeasuredFlight], values: Values, sensors_only: bool
) -> Iterator[tuple[str, str, list[MeasuredFlight], np.ndarray]]:
    """Cause, remedy, and flights and gravity as they are then; of rates and accelerations alone or of all."""
    kinds = {series.kind for flight in flights for series in flight.series}
    for scaled, factor, cause in _SCALES:
        if scaled[0] in kinds and not (sensors_only and POSITION in scaled):
            yield (
                cause,
                f"multiply them by {factor:.6g}",
                _changed(flights, scaled, partial(np.multiply, factor)),
                values.gravity,
            )
    if sensors_only:
        return
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
