# SPDX-License-Identifier: MIT
"""Whether the residuals are noise, by their size and whiteness; and what else samples could mean that no rigid body
shows: other units, another direction of gravity, another order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import chi2

from .fitting import CannotFlyError, Estimate, fit_flights, residuals_by_series, short_misfit
from .local_motion import noise_by_differences
from .measurements import ACCELERATION, ATTITUDE, POSITION, RATE, UNITS, MeasuredFlight, Series
from .unknowns import Unknowns, Values

LAGS = 10
"""Of the autocorrelation."""
LEAST_PROBABILITY = 1e-4
"""Of noise that is white looking so little like it: below it the check fails."""
FAR = 5.0
"""Standard deviations beyond which a sample is called an outlier; noise alone does that once in half a
million numbers.
"""
NEGLIGIBLE = 1e-7
"""Of the largest value of a series: what is left of a simulated flight is rounding and no error of the model."""
TOO_LARGE = 1.5
"""Residuals so many times the noise between neighbouring samples are no noise."""
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


@dataclass(frozen=True)
class ResidualCheck:
    """noise: standard deviation as estimated. by_differences: what neighbouring samples say it is. probability: of
    white noise looking so (Ljung and Box). outliers: how many samples lie far off.
    """

    flight: str
    series: str
    unit: str
    samples: int
    noise: float
    by_differences: float
    probability: float
    outliers: int

    @property
    def is_white(self) -> bool:
        """Whether nothing speaks against white noise."""
        return self.probability >= LEAST_PROBABILITY

    @property
    def is_noise(self) -> bool:
        """Whether the residuals are no larger than noise."""
        return self.is_white or self.noise <= TOO_LARGE * self.by_differences


def check_residuals(flights: Sequence[MeasuredFlight], estimate: Estimate) -> list[ResidualCheck]:
    """Of every series of every flight."""
    found = residuals_by_series(estimate.segments, estimate.starts, estimate.values)
    return [
        _check(flight, series, found[id(series)], estimate.sigmas[series.name])
        for flight in flights
        for series in flight.series
        if id(series) in found
    ]


def _check(flight: MeasuredFlight, series: Series, residuals: np.ndarray, noise: float) -> ResidualCheck:
    scaled = residuals / noise
    return ResidualCheck(
        flight.name,
        series.name,
        UNITS[series.kind],
        len(residuals),
        noise,
        max(noise_by_differences(series), NEGLIGIBLE * float(np.abs(series.values).max())),
        _whiteness(scaled),
        int(np.sum(np.max(np.abs(scaled), axis=1) > FAR)),
    )


def _whiteness(scaled: np.ndarray) -> float:
    """Probability by Ljung and Box (Biometrika 65, 1978) of the three components together."""
    n = len(scaled)
    lags = min(LAGS, n // 4)
    if lags < 1:
        return 1.0
    centred = scaled - scaled.mean(axis=0)
    power = (centred**2).sum(axis=0)
    if not np.all(power > 0.0):
        return 1.0
    total = 0.0
    for lag in range(1, lags + 1):
        correlation = (centred[lag:] * centred[:-lag]).sum(axis=0) / power
        total += float((correlation**2).sum()) * n * (n + 2) / (n - lag)
    return float(chi2.sf(total, 3 * lags))


def remarks(checks: Sequence[ResidualCheck]) -> list[str]:
    """What they show, in sentences; empty when all is noise."""
    found = []
    for check in checks:
        where = f"{check.series} of {check.flight}"
        if check.outliers:
            many = f"{check.outliers} of {check.samples} samples lie" if check.outliers > 1 else "one sample lies"
            found.append(f"{where}: {many} more than {FAR:g} standard deviations off")
        if check.is_noise:
            continue
        found.append(
            f"{where}: the residuals of {check.noise:.3g} {check.unit} aren't white noise, and neighbouring samples"
            f" differ by {check.by_differences:.3g} only: drag (--fit damping), gravity (--fit gravity), clocks"
            " (--fit offset), a contact (--from and --to exclude it), or a wrench that isn't in the bag; the standard"
            " deviations are too small"
        )
    return found


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
