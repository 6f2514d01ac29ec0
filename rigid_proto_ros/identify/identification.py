# SPDX-License-Identifier: MIT
"""From measured flights to the body's mass properties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..mass.properties import MassProperties
from .fitting import CannotFlyError, fit_flights
from .measurements import ACCELERATION, MeasuredFlight, topics_of
from .report import Identification
from .unknowns import DEFAULT_FIT, Values, make_unknowns, possible_tensor
from .verdict import Identifiability, check_residuals

GUESSED_RADIUS = 0.1
"""Of the ball that stands for a body of which nothing is known [m]."""
FEWEST = 8
"""Poses of a flight."""
USUAL = (
    "usual causes: positions that aren't in m, rates in degrees, accelerations in g, gravity along another axis"
    " (--gravity), quaternions that begin with w, a wrench along other axes (--wrench TOPIC@FRAME), clocks"
)


@dataclass(frozen=True)
class Known:
    """mass [kg] when it is known. body: what stands for whatever isn't estimated, or None. length: of the body, by
    which an error of its COM is large [m].
    """

    mass: float | None = None
    body: MassProperties | None = None
    length: float = GUESSED_RADIUS


def identify(
    flights: Sequence[MeasuredFlight],
    fit: Sequence[str] = DEFAULT_FIT,
    known: Known | None = None,
) -> Identification:
    """Mass properties of the body that flew in all of these flights; raises InputError."""
    known = known or Known()
    for flight in flights:
        count = len(flight.pose[0].times_ns)
        if count < FEWEST:
            raise InputError("session", f"{flight.name} has {count} samples", f"at least {FEWEST} poses")
    fit = [group for group in fit if not (group == "mass" and known.mass is not None)]
    unknowns = make_unknowns(fit, topics_of(flights))
    first = _first_values(flights[0], known)
    try:
        estimate = fit_flights(flights, unknowns, first)
    except CannotFlyError:
        raise CannotFlyError(USUAL) from None
    given = {"mass": known.mass is not None or known.body is not None}
    guessed = frozenset(name for name in DEFAULT_FIT if name not in fit and not given.get(name, known.body is not None))
    checks = check_residuals(flights, estimate)
    cause = "" if all(check.is_noise for check in checks) else USUAL
    identifiability = Identifiability(estimate, known.length)
    return Identification(flights, estimate, identifiability, checks, _assumed(flights, known, fit), guessed, cause)


def _first_values(first: MeasuredFlight, known: Known) -> Values:
    """What holds where nothing is estimated."""
    mass, zero = known.mass or (known.body.mass if known.body is not None else 1.0), np.zeros(3)
    inertia = 0.4 * mass * GUESSED_RADIUS**2 * np.eye(3)
    if known.body is not None:
        inertia = possible_tensor(known.body.inertia) * (mass / known.body.mass)
    damping = np.array([first.linear_damping, first.angular_damping])
    return Values(mass, zero, inertia, damping, np.array(first.gravity, float), {}, zero, zero, zero)


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
    for topic in dict.fromkeys(f.load_history.topic for f in flights if len(f.load_history.changes)):
        lines.append(f"{topic} was sampled: it changed between messages, and the errors count that")
    return lines
