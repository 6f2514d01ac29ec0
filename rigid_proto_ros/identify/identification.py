# SPDX-License-Identifier: MIT
"""From measured flights to the body's mass properties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import InputError
from . import mass_parameters as mp
from .comparison import Candidate, compare
from .fitting import fit_flights, topics_of
from .measurements import ACCELERATION, ATTITUDE, RATE, MeasuredFlight
from .poses import FEWEST
from .report import Identification
from .residual_checks import check_residuals
from .unknowns import DEFAULT_FIT, Values, make_unknowns
from .verdict import Identifiability

GUESSED_RADIUS = 0.1
"""Of the ball that stands for a body of which nothing is known [m]."""


@dataclass(frozen=True)
class Known:
    """mass [kg] when it is known. theta: a body to start from, or None. length: of the body, by which an error of its
    COM is large [m].

    offsets [s]: given, by topic; damping: in place of the flights' own.
    """

    mass: float | None = None
    theta: np.ndarray | None = None
    length: float = GUESSED_RADIUS
    offsets: Mapping[str, float] = field(default_factory=dict)


def identify(
    flights: Sequence[MeasuredFlight],
    fit: Sequence[str] = DEFAULT_FIT,
    known: Known | None = None,
    candidates: Mapping[str, Candidate] | None = None,
    robust: bool = False,
) -> Identification:
    """Mass properties of the body that flew in all of these flights; raises InputError."""
    known = known or Known()
    _check_axes(flights)
    _check_counts(flights)
    topics = topics_of(flights)
    theta = _first_guess(known)
    fit = [group for group in fit if not (group == "mass" and known.mass is not None)]
    first = flights[0]
    offsets = tuple(known.offsets.get(topic, 0.0) for topic in topics)
    damping = np.array([first.linear_damping, first.angular_damping])
    zero = np.zeros(3)
    values = Values(theta, damping, np.array(first.gravity, float), offsets, zero, zero, zero)
    unknowns = make_unknowns(fit, topics)
    estimate = fit_flights(flights, unknowns, values, robust)
    identifiability = Identifiability(estimate, known.length)
    compared = []
    if candidates:
        compared = compare(
            flights, estimate, candidates, fit, identifiability.count_identified(len(unknowns.theta_columns))
        )
    given = {"mass": known.mass is not None or known.theta is not None}
    guessed = frozenset(
        name for name in DEFAULT_FIT if name not in fit and not given.get(name, known.theta is not None)
    )
    checks = check_residuals(flights, estimate)
    return Identification(flights, estimate, identifiability, checks, compared, _assumed(flights, known, fit), guessed)


def _check_axes(flights: Sequence[MeasuredFlight]) -> None:
    """Raises InputError where nothing says how the body's axes lie."""
    for flight in flights:
        rate = flight.first(RATE)
        if rate is not None and flight.first(ATTITUDE) is None and flight.first(RATE, in_body=True) is None:
            raise InputError(
                rate.topic,
                f"{flight.name} has rates in world axes and no attitude, so the body's axes are unknown;"
                " add attitudes by --pose or --odom, or give rates along the body's axes as TOPIC@body",
            )


def _check_counts(flights: Sequence[MeasuredFlight]) -> None:
    """Raises InputError where a flight has too few samples for its start and anything else."""
    for flight in flights:
        most = max(len(one.times_ns) for one in flight.series)
        if most < FEWEST:
            raise InputError("session", f"{flight.name} has {most} samples", f"at least {FEWEST} of a pose or rate")


def _first_guess(known: Known) -> np.ndarray:
    mass = known.mass or 1.0
    if known.theta is None:
        return mp.parameters_of(mass, np.zeros(3), 0.4 * mass * GUESSED_RADIUS**2 * np.eye(3))
    if known.mass is None:
        return known.theta
    return mp.scaled(known.theta, known.mass / mp.mass_of(known.theta).mass, 1.0)


def _assumed(flights: Sequence[MeasuredFlight], known: Known, fit: Sequence[str]) -> list[str]:
    """What was taken as given, in words."""
    first = flights[0]
    lines = []
    if known.mass is not None:
        lines.append(f"mass {known.mass:g} kg, given")
    if "gravity" not in fit:
        lines.append(f"gravity {' '.join(f'{g:g}' for g in first.gravity)} m/s², {first.gravity_from}")
    if "damping" not in fit:
        lines.append(f"damping {first.linear_damping:g} N s/m, {first.angular_damping:g} N m s")
    if "imu_place" not in fit and any(s.kind == ACCELERATION for flight in flights for s in flight.series):
        lines.append("the IMU stands at the tracked frame's origin, its axes those of the frame")
    return lines
