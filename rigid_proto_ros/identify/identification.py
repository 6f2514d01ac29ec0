# SPDX-License-Identifier: MIT
"""From measured flights to mass properties, and the output of ``rigid_proto identify``: the verdict, then the
identified numbers with their standard deviations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.vectors import Numbers
from ..mass.export import urdf_inertial
from ..mass.properties import MassProperties
from ..mass.tensor import SIX, principal_axes, six_from_tensor
from .fitting import USUAL, CannotFlyError, Estimate, fit_flights
from .measurements import ACCELERATION, RATE, MeasuredFlight, topics_of
from .unknowns import DEFAULT_FIT, Values, make_unknowns, possible_tensor
from .verdict import Identifiability, Quantity, ResidualCheck, Unidentified, check_residuals

GUESSED_RADIUS = 0.1
"""Radius of the ball that stands for an unknown body [m]."""
FEWEST = 8
"""Least number of poses of a flight."""
MISFIT = "the residuals are larger than the noise, so the errors may be larger than the standard deviations"
OTHER_UNITS = {"gravity": "m/s²", "offset": "s", "gyro_bias": "rad/s", "accel_bias": "m/s²", "imu_place": "m"}
DAMPING_UNITS = ("N s/m", "N m s")


@dataclass(frozen=True)
class Identification:
    """The estimate, what of it is identified, and the checks of its residuals. guessed: which of ``mass``, ``com`` and
    ``inertia`` were neither requested nor given, and therefore have no number.
    """

    flights: Sequence[MeasuredFlight]
    estimate: Estimate
    identifiability: Identifiability
    checks: Sequence[ResidualCheck]
    assumed: Sequence[str]
    guessed: frozenset[str] = frozenset()

    @property
    def unidentified(self) -> list[Unidentified]:
        """What the motion doesn't identify."""
        return self.identifiability.unidentified

    @property
    def verdict(self) -> str:
        """One sentence on what is identified, after a warning if the model doesn't fit."""
        text = "all requested quantities are identified from this motion"
        if self.unidentified:
            words = {"mass": [self.mass], "centre of mass": self.center_of_mass, "tensor": self.inertia}
            found = [name for name, parts in words.items() if all(part.value is not None for part in parts)]
            if "tensor" not in found and all(part.value is not None for part in self.shape):
                found.append("shape of the tensor")
            hidden = ", ".join(one.what for one in self.unidentified)
            identified = ", ".join(found) or "none of the requested quantities"
            text = f"identified from this motion: {identified}; not identified: {hidden}"
        return text if self.fits else f"{MISFIT}; {text}"

    @property
    def fits(self) -> bool:
        """Whether the residuals are noise. If not, the numbers may be far off, whatever their standard deviations."""
        return all(check.is_noise for check in self.checks)

    @property
    def mass(self) -> Quantity:
        """The mass [kg]."""
        return self._each(lambda values: [values.mass], "mass")[0]

    @property
    def center_of_mass(self) -> list[Quantity]:
        """Components of the centre of mass [m, tracked frame]."""
        return self._each(lambda values: values.center_of_mass, "com")

    @property
    def inertia(self) -> list[Quantity]:
        """ixx ixy ixz iyy iyz izz [kg m², about the COM, axes of the tracked frame]."""
        return self._all_or_none(lambda values: six_from_tensor(values.inertia))

    @property
    def shape(self) -> list[Quantity]:
        """The entries of the tensor divided by its trace."""
        return self._all_or_none(lambda values: six_from_tensor(values.inertia / np.trace(values.inertia)))

    @property
    def moments(self) -> list[Quantity]:
        """Principal moments, ascending [kg m²]."""
        return self._all_or_none(lambda values: principal_axes(values.inertia)[0])

    @property
    def others(self) -> dict[str, Quantity]:
        """Other requested quantities by name."""
        unknowns, slots = self.estimate.unknowns, self._other_slots
        found = self.identifiability.quantities(lambda values: [unknowns.read(values, slot) for slot in slots])
        return dict(zip(map(unknowns.name, slots), found, strict=True))

    @property
    def units(self) -> dict[str, str]:
        """Units of the others by name."""
        unknowns, found = self.estimate.unknowns, {}
        for slot in self._other_slots:
            group, index = unknowns.slots[slot]
            found[unknowns.name(slot)] = DAMPING_UNITS[index] if group == "damping" else OTHER_UNITS[group]
        return found

    @property
    def remarks(self) -> list[str]:
        """Remarks on residuals that aren't noise, the most usual cause first."""
        return [*([] if self.fits else [USUAL]), *(remark for check in self.checks for remark in check.remarks)]

    @property
    def _other_slots(self) -> list[int]:
        return [k for k, (group, _) in enumerate(self.estimate.unknowns.slots) if group not in DEFAULT_FIT]

    def _each(self, read: Callable[[Values], Numbers], group: str) -> list[Quantity]:
        found = self.identifiability.quantities(read)
        return [Quantity(None, None)] * len(found) if group in self.guessed else found

    def _all_or_none(self, read: Callable[[Values], Numbers]) -> list[Quantity]:
        """All quantities, or none if one isn't identified: an entry that happens to be 0 has the scale of the
        others.
        """
        found = self._each(read, "inertia")
        return found if all(one.value is not None for one in found) else [Quantity(None, None)] * len(found)


@dataclass(frozen=True)
class Known:
    """What is known beforehand. mass: [kg], or None. body: values for whatever isn't estimated, or None. length: of the
    body; an error of the COM by this length is large [m].
    """

    mass: float | None = None
    body: MassProperties | None = None
    length: float = GUESSED_RADIUS


@np.errstate(all="ignore")  # for numbers that no flight has, which are refused
def identify(
    flights: Sequence[MeasuredFlight],
    fit: Sequence[str] = DEFAULT_FIT,
    known: Known | None = None,
) -> Identification:
    """Identify the mass properties of the body of these flights. Raises InputError."""
    known = known or Known()
    for flight in flights:
        count = len(flight.pose[0].times_ns)
        if count < FEWEST:
            raise InputError("session", f"{flight.name} has {count} samples", f"at least {FEWEST} poses")
    flights = [flight.from_first_position() for flight in flights]
    fit = [group for group in fit if not (group == "mass" and known.mass is not None)]
    kinds = {series.kind for flight in flights for series in flight.series}
    for group, kind in {"gyro_bias": RATE, "accel_bias": ACCELERATION, "imu_place": ACCELERATION}.items():
        if group in fit and kind not in kinds:
            raise InputError("--fit", f"{group} needs an Imu that measures {kind}: record one, or name it with --imu")
    unknowns = make_unknowns(fit, topics_of(flights))
    by_flight = frozenset({"gravity", "damping"} - set(fit))
    try:
        estimate = fit_flights(flights, unknowns, replace(_first_values(flights[0], known), by_flight=by_flight))
    except np.linalg.LinAlgError:  # for numbers that overflow
        raise CannotFlyError from None
    given = {"mass": known.mass is not None or known.body is not None}
    guessed = frozenset(name for name in DEFAULT_FIT if name not in fit and not given.get(name, known.body is not None))
    checks = check_residuals(flights, estimate)
    identifiability = Identifiability(estimate, known.length)
    return Identification(flights, estimate, identifiability, checks, _assumed(flights, known, fit), guessed)


def _first_values(first: MeasuredFlight, known: Known) -> Values:
    """Values of whatever isn't estimated."""
    mass, zero = known.mass or (known.body.mass if known.body is not None else 1.0), np.zeros(3)
    inertia = 0.4 * mass * GUESSED_RADIUS**2 * np.eye(3)
    if known.body is not None:
        inertia = possible_tensor(known.body.inertia) * (mass / known.body.mass)
    damping = np.array([first.linear_damping, first.angular_damping])
    return Values(mass, zero, inertia, damping, np.array(first.gravity, float), {}, zero, zero, zero)


def _assumed(flights: Sequence[MeasuredFlight], known: Known, fit: Sequence[str]) -> list[str]:
    """What was taken as given, in words."""
    lines = []
    if known.mass is not None:
        lines.append(f"mass {known.mass:g} kg, given")
    told = {
        "gravity": [f"gravity {' '.join(f'{g:g}' for g in one.gravity)} m/s², {one.gravity_from}" for one in flights],
        "damping": [f"damping {one.linear_damping:g} N s/m, {one.angular_damping:g} N m s" for one in flights],
    }
    for group, words in told.items():
        if group not in fit:
            named = [f"{text}, in {one.name}" for text, one in zip(words, flights, strict=True)]
            lines += words[:1] if len(set(words)) == 1 else named
    if "imu_place" not in fit and any(s.kind == ACCELERATION for flight in flights for s in flight.series):
        lines.append("the IMU is assumed to be at the tracked frame's origin, with the axes of that frame")
    for topic in dict.fromkeys(f.load_history.topic for f in flights if len(f.load_history.changes)):
        lines.append(f"{topic} was sampled: it changed between messages, and the errors count that")
    return lines


def as_json(found: Identification) -> dict[str, Any]:
    """The command's JSON object; values that aren't identified are null."""

    def pair(quantity: Quantity) -> dict[str, float | None] | None:
        return None if quantity.value is None else asdict(quantity)

    return {
        "verdict": found.verdict,
        "fits": found.fits,
        "hidden": [asdict(one) for one in found.unidentified],
        "mass": pair(found.mass),
        "center_of_mass": [pair(one) for one in found.center_of_mass],
        "inertia": dict(zip(SIX, map(pair, found.inertia), strict=True)),
        "inertia_over_trace": dict(zip(SIX, map(pair, found.shape), strict=True)),
        "principal_moments": [pair(one) for one in found.moments],
        "others": {name: pair(one) for name, one in found.others.items()},
        "assumed": list(found.assumed),
        "residuals": [{**asdict(check), "white": check.is_white} for check in found.checks],
        "remarks": found.remarks,
    }


def as_text(found: Identification) -> list[str]:
    """Lines for a terminal."""
    lines = [found.verdict]
    lines += [f"  {one.what}: needs {one.remedy}" for one in found.unidentified]
    lines += [f"  {text}" for text in found.assumed]
    tensor, unit = found.inertia, "kg m²"
    if any(one.value is None for one in tensor):
        tensor, unit = found.shape, "of the trace"
    units = found.units
    rows = [("mass", found.mass, "kg")]
    rows += [(f"centre of mass {axis}", one, "m") for axis, one in zip("xyz", found.center_of_mass, strict=True)]
    rows += [(name, one, unit) for name, one in zip(SIX, tensor, strict=True)]
    rows += [(name, one, units[name]) for name, one in found.others.items()]
    lines += [f"{name:<18} {number(one)} {unit}" for name, one, unit in rows if one.value is not None]
    for check in found.checks:
        white = "white" if check.is_white else "not white"
        lines.append(f"noise of {check.series}: {check.noise:.3g} {check.unit}, {white}, {check.samples} samples")
    return lines + found.remarks


def number(quantity: Quantity) -> str:
    """Value ± standard deviation, the latter with two digits."""
    value, sd = quantity.value, quantity.sd
    if value is None or sd is None or not 0.0 < sd < math.inf:
        return f"{value:.9g}"
    digits = 2 + math.floor(math.log10(max(abs(value), sd))) - math.floor(math.log10(sd))
    return f"{value:#.{min(digits, 15)}g} ± {sd:.2g}"


def as_urdf(found: Identification) -> str:
    """A URDF <inertial>. Raises InputError if part of it isn't identified."""
    parts = [found.mass, *found.center_of_mass, *found.inertia]
    if any(part.value is None for part in parts):
        raise InputError("--urdf", f"{found.verdict}; a URDF needs mass, centre of mass and tensor")
    body = found.estimate.values
    written = urdf_inertial(MassProperties(body.mass, body.center_of_mass, body.inertia))
    return written if found.fits else f"<!-- {MISFIT} -->\n{written}"
