# SPDX-License-Identifier: MIT
"""The estimate: after the approach one segment for each flight, which uses all there is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from . import mass_parameters as mp
from . import measurements as ms
from . import shooting as sh
from .approach import approached, spread
from .fit_state import FitState, noise_left, residuals_of, segments_of, solved
from .local_motion import noise_by_differences
from .unknowns import Unknowns, Values

LEAST_NOISE = 1e-4
"""Part of what a series shows that is taken for noise at first: a simulated flight leaves nothing at the end."""
HUBER = 1.5
"""Robust fits: residuals beyond so many standard deviations count by their size alone (95 % efficient at
1.345, Huber 1981).
"""
WIDER = 8.0
"""Of steps of difference quotients: of what is rounding alone so much less is left."""


@dataclass(frozen=True)
class Estimate:
    """values: what came out. segments and starts (k, 13): one for each flight. sigmas: of each series by flight's
    number and name.

    root (m, n): rootᵀ root is the Fisher information of the unknowns, the starts eliminated; root_wide by steps WIDER
    times as long, which shows what of it is rounding. cost: sum of squares in standard deviations. evaluations: of the
    residuals.
    """

    values: Values
    unknowns: Unknowns
    segments: list[sh.ShootingInterval]
    starts: np.ndarray
    sigmas: dict[int, float]
    root: np.ndarray
    root_wide: np.ndarray
    cost: float
    evaluations: int

    @property
    def mass(self) -> mp.MassEstimate:
        """The body."""
        return mp.mass_of(self.values.theta)


def topics_of(flights: Sequence[ms.MeasuredFlight]) -> list[str]:
    """All topics in their order."""
    return list(dict.fromkeys(series.topic for flight in flights for series in flight.series))


def fit_flights(
    flights: Sequence[ms.MeasuredFlight],
    unknowns: Unknowns,
    values: Values,
    robust: bool = False,
    known: Estimate | None = None,
) -> Estimate:
    """The most likely values, from these on; raises InputError where they can't be flown.

    known: an estimate of the same flights whose noise counts and whose starts are near.
    """
    series = [one for flight in flights for one in flight.series]
    noise = {id(one): max(noise_by_differences(one), LEAST_NOISE * spread(one)) for one in series}
    ones = {id(one): np.ones(len(one.times_ns)) for one in series}
    fit = FitState(flights, topics_of(flights), unknowns, values, dict(known.sigmas if known else noise), ones)
    whole = 2.0 * max(flight.duration_s for flight in flights)
    if known is not None:
        segments = segments_of(fit, whole)
        return _estimate(fit, segments, solved(fit, segments, known.starts, 30, 1e-7))
    starts = approached(fit, whole)
    fit.sigmas = noise_left(fit, segments_of(fit, whole), starts)
    for turn in range(4):
        segments = segments_of(fit, whole)
        starts = solved(fit, segments, starts, 60, 1e-7)
        before = dict(fit.sigmas)
        if robust:
            fit.weights = _huber_weights(fit, segments, starts)
        fit.sigmas = noise_left(fit, segments, starts)
        if all(abs(fit.sigmas[key] - before[key]) < 0.01 * before[key] for key in before) and (turn or not robust):
            break
    return _estimate(fit, segments_of(fit, whole), starts)


def residuals_by_series(
    segments: Sequence[sh.ShootingInterval], starts: np.ndarray, values: Values
) -> dict[int, np.ndarray]:
    """Departures (n, 3) of each series in its own unit, by ``id``."""
    parts: dict[int, list[np.ndarray]] = {}
    for segment, start in zip(segments, starts, strict=True):
        for piece, residual in zip(segment.pieces, residuals_of(segment, start, values), strict=True):
            parts.setdefault(id(piece.series), []).append(residual)
    return {key: np.concatenate(part) for key, part in parts.items()}


def _huber_weights(fit: FitState, segments: Sequence[sh.ShootingInterval], starts: np.ndarray) -> dict[int, np.ndarray]:
    """1, or less for samples that lie too far off; too far is relative to the median size of the residuals."""
    weights = {}
    for key, part in residuals_by_series(segments, starts, fit.values).items():
        size = np.linalg.norm(part, axis=1)
        # The median length of three normal numbers is 1.538.
        scale = max(float(np.median(size)) / 1.538, 1e-300)
        weights[key] = np.minimum(1.0, HUBER * np.sqrt(3.0) * scale / np.maximum(size, 1e-300))
    return weights


def _estimate(fit: FitState, segments: list[sh.ShootingInterval], starts: np.ndarray) -> Estimate:
    roots: dict[float, list[np.ndarray]] = {1.0: [], WIDER: []}
    cost = 0.0
    for wider, parts in roots.items():
        variations = sh.Variations(fit.values, fit.unknowns.physical, wider=wider)
        for segment, start in zip(segments, starts, strict=True):
            flown = sh.linearized(segment, start, variations)
            if flown is None:
                raise InputError("identify", "the estimate can't be simulated; see --from and --to")
            triangle = sh.compressed(flown)
            # Rows that are left when the start has taken all that it can.
            parts.append(triangle[sh.START : -1, sh.START : -1])
            cost += float(flown[-1] @ flown[-1]) if wider == 1.0 else 0.0
    near, far = (np.concatenate(parts) for parts in roots.values())
    return Estimate(fit.values, fit.unknowns, segments, starts, fit.sigmas, near, far, cost, fit.evaluations)
