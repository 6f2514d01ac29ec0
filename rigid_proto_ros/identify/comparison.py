# SPDX-License-Identifier: MIT
"""Which tensor is true: given ones are flown against the data, all else fitted anew, and compared by likelihood."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from ..base.errors import InputError
from .fitting import Estimate, fit_flights
from .measurements import MeasuredFlight, topics_of
from .unknowns import make_unknowns

CONTRADICTED = 1e-3
"""Probability below which the data contradict a tensor."""


@dataclass(frozen=True)
class Candidate:
    """A given body. fixes_mass: its mass counts as given too, else only its tensor for each kg."""

    mass: float
    inertia: np.ndarray
    fixes_mass: bool = False


@dataclass(frozen=True)
class ModelComparison:
    """log_likelihood: of the candidate less that of the free fit, at most 0. freedoms: how many numbers it fixes that
    are identified otherwise.

    probability: of a true tensor fitting so badly.
    """

    name: str
    log_likelihood: float
    freedoms: int
    probability: float
    problem: str = ""

    @property
    def is_contradicted(self) -> bool:
        """Whether the data contradict it."""
        return self.probability < CONTRADICTED


def compare(
    flights: Sequence[MeasuredFlight],
    estimate: Estimate,
    candidates: Mapping[str, Candidate],
    fit: Sequence[str],
    identified: int,
) -> list[ModelComparison]:
    """The most likely first. fit: the groups that the free fit had; identified: how many of its mass
    parameters are identified.
    """
    fixed = {True: [g for g in fit if g not in ("inertia", "mass")], False: [g for g in fit if g != "inertia"]}
    found = []
    for name, candidate in candidates.items():
        mass = candidate.mass if candidate.fixes_mass else estimate.values.mass
        inertia = candidate.inertia * (mass / candidate.mass)
        values = replace(estimate.values, mass=mass, inertia=inertia)
        try:
            unknowns = make_unknowns(fixed[candidate.fixes_mass], topics_of(flights))
            cost = fit_flights(flights, unknowns, values, known=estimate).cost
        except InputError as error:
            found.append(ModelComparison(name, -np.inf, 0, 0.0, str(error)))
            continue
        fewer = max(1, identified - unknowns.count("mass", "inertia", "com"))
        gain = max(cost - estimate.cost, 0.0)
        found.append(ModelComparison(name, -0.5 * gain, fewer, float(chi2.sf(gain, fewer))))
    return sorted(found, key=lambda one: -one.log_likelihood)
