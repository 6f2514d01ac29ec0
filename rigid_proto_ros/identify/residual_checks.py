# SPDX-License-Identifier: MIT
"""Whether the residuals are noise: their size and whiteness, outliers, and where in the flight they are largest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from .fitting import Estimate, residuals_by_series
from .local_motion import noise_by_differences
from .measurements import UNITS, MeasuredFlight, Series

LAGS = 10
"""Of the autocorrelation."""
LEAST_PROBABILITY = 1e-4
"""Of noise that is white looking so little like it: below it the check fails."""
FAR = 5.0
"""Standard deviations beyond which a sample is called an outlier; noise alone does that once in half a
million numbers.
"""
WINDOWS = 10
"""Parts of a flight whose residuals are compared."""
WORSE = 3.0
"""So many times the mean square of the other parts is something that happened then."""
NEGLIGIBLE = 1e-7
"""Of the largest value of a series: what is left of a simulated flight is rounding and no error of the model."""
TOO_LARGE = 1.5
"""Residuals so many times the noise between neighbouring samples are no noise."""


@dataclass(frozen=True)
class ResidualCheck:
    """noise: standard deviation as estimated. by_differences: what neighbouring samples say it is. probability: of
    white noise looking so (Ljung and Box). outliers: how many samples lie far off. worst_s: middle of the part of the
    flight that is far worse than the others.
    """

    flight: str
    series: str
    unit: str
    samples: int
    noise: float
    by_differences: float
    probability: float
    outliers: int
    worst_s: float | None

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
    seconds = 1e-9 * (series.times_ns - flight.begin_ns)
    return ResidualCheck(
        flight.name,
        series.name,
        UNITS[series.kind],
        len(residuals),
        noise,
        max(noise_by_differences(series), NEGLIGIBLE * float(np.abs(series.values).max())),
        _whiteness(scaled),
        int(np.sum(np.max(np.abs(scaled), axis=1) > FAR)),
        _worst(scaled, seconds),
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


def _worst(scaled: np.ndarray, seconds: np.ndarray) -> float | None:
    if len(scaled) < 4 * WINDOWS:
        return None
    parts = np.array_split(np.arange(len(scaled)), WINDOWS)
    sizes = np.array([float((scaled[part] ** 2).mean()) for part in parts])
    worst = int(np.argmax(sizes))
    others = (sizes.sum() - sizes[worst]) / (WINDOWS - 1)
    return float(seconds[parts[worst]].mean()) if sizes[worst] > WORSE * others else None


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
        if check.worst_s is not None:
            found.append(
                f"{where}: the model doesn't fit about {check.worst_s:.3g} s after the start of the motion:"
                " a contact, or a wrench that isn't in the bag; --from and --to exclude it"
            )
        else:
            found.append(
                f"{where}: the residuals of {check.noise:.3g} {check.unit} aren't white noise, and neighbouring samples"
                f" differ by {check.by_differences:.3g} only: drag (--fit damping), gravity (--fit gravity), clocks"
                " (--fit offset), or a wrench that isn't in the bag; the standard deviations are too small"
            )
    return found
