# SPDX-License-Identifier: MIT
"""What ``rigid_proto identify`` prints: the verdict, then the identified numbers with their standard deviations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..mass.export import urdf_inertial
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes, six_from_tensor
from .fitting import Estimate
from .measurements import MeasuredFlight
from .residual_checks import ResidualCheck, remarks
from .unknowns import DEFAULT_FIT, Values
from .verdict import Identifiability, Quantity, Unidentified, summary

MISFIT = "the residuals are larger than the noise, so the numbers may be farther off than their standard deviations say"
OTHER_UNITS = {"gravity": "m/s²", "offset": "s", "gyro_bias": "rad/s", "accel_bias": "m/s²", "imu_place": "m"}
DAMPING_UNITS = ("N s/m", "N m s")
TENSOR_NAMES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Identification:
    """The estimate, what of it is identified, and the checks of its residuals."""

    flights: Sequence[MeasuredFlight]
    estimate: Estimate
    identifiability: Identifiability
    checks: Sequence[ResidualCheck]
    assumed: Sequence[str]
    guessed: frozenset[str] = frozenset()
    """Of ``mass``, ``com`` and ``inertia`` what was neither asked for nor given: it has no number."""
    cause: str = ""
    """What may be the cause where the residuals are no noise."""

    @property
    def unidentified(self) -> list[Unidentified]:
        """What the motion doesn't identify."""
        return self.identifiability.unidentified

    @property
    def identified(self) -> list[str]:
        """What it identifies, in words."""
        words = {"mass": [self.mass], "centre of mass": self.center_of_mass, "tensor": self.inertia}
        found = [name for name, parts in words.items() if all(part.value is not None for part in parts)]
        if "tensor" not in found and all(part.value is not None for part in self.shape):
            found.append("shape of the tensor")
        return found

    @property
    def verdict(self) -> str:
        """What is identified, in a sentence, after the warning that the model doesn't fit, if it doesn't."""
        text = summary(self.unidentified, self.identified)
        return text if self.fits else f"{MISFIT}; {text}"

    @property
    def fits(self) -> bool:
        """Whether the residuals are noise: else the numbers may be far off, whatever their standard deviations."""
        return all(check.is_noise for check in self.checks)

    @property
    def mass(self) -> Quantity:
        """[kg]."""
        return self._each(lambda values: np.array([values.mass]), 1, "mass")[0]

    @property
    def center_of_mass(self) -> list[Quantity]:
        """[m, tracked frame]."""
        return self._each(lambda values: values.center_of_mass, 3, "com")

    @property
    def inertia(self) -> list[Quantity]:
        """ixx ixy ixz iyy iyz izz [kg m², about the COM, axes of the tracked frame]."""
        return self._whole(lambda values: np.array(six_from_tensor(values.inertia)), 6)

    @property
    def shape(self) -> list[Quantity]:
        """The same divided by the tensor's trace."""
        return self._whole(lambda values: np.array(six_from_tensor(values.inertia)) / np.trace(values.inertia), 6)

    @property
    def moments(self) -> list[Quantity]:
        """Principal moments, ascending [kg m²]."""
        return self._whole(lambda values: principal_axes(values.inertia)[0], 3)

    @property
    def others(self) -> dict[str, Quantity]:
        """Whatever else was asked for, by name."""
        unknowns = self.estimate.unknowns
        return {unknowns.name(k): self.identifiability.quantity(self._reader(k)) for k in self._other_slots}

    @property
    def units(self) -> dict[str, str]:
        """Of the others, by name."""
        unknowns = self.estimate.unknowns
        found = {}
        for k in self._other_slots:
            group, index = unknowns.slots[k]
            found[unknowns.name(k)] = DAMPING_UNITS[index] if group == "damping" else OTHER_UNITS[group]
        return found

    @property
    def _other_slots(self) -> list[int]:
        return [k for k, (group, _) in enumerate(self.estimate.unknowns.slots) if group not in DEFAULT_FIT]

    def _reader(self, slot: int) -> Callable[[Values], float]:
        return lambda values: self.estimate.unknowns.read(values, slot)

    def _each(self, read: Callable[[Values], np.ndarray], count: int, group: str) -> list[Quantity]:
        if group in self.guessed:
            return [Quantity(None, None)] * count

        def one(k: int) -> Quantity:
            return self.identifiability.quantity(lambda values: float(read(values)[k]))

        return [one(k) for k in range(count)]

    def _whole(self, read: Callable[[Values], np.ndarray], count: int) -> list[Quantity]:
        """All of them or none: an entry that happens to be 0 has the size of the others."""
        found = self._each(read, count, "inertia")
        return found if all(one.value is not None for one in found) else [Quantity(None, None)] * count

    @property
    def remarks(self) -> list[str]:
        """On the residuals."""
        return [*([self.cause] if self.cause else []), *remarks(self.checks)]


def as_json(found: Identification) -> dict:
    """The command's JSON object; what isn't identified is null."""
    return {
        "verdict": found.verdict,
        "fits": found.fits,
        "hidden": [{"what": one.what, "remedy": one.remedy} for one in found.unidentified],
        "mass": _pair(found.mass),
        "center_of_mass": _pairs(found.center_of_mass),
        "inertia": dict(zip(TENSOR_NAMES, map(_pair, found.inertia), strict=True)),
        "inertia_over_trace": dict(zip(TENSOR_NAMES, map(_pair, found.shape), strict=True)),
        "principal_moments": _pairs(found.moments),
        "others": {name: _pair(one) for name, one in found.others.items()},
        "assumed": list(found.assumed),
        "residuals": [
            {
                "flight": one.flight,
                "series": one.series,
                "unit": one.unit,
                "samples": one.samples,
                "noise": one.noise,
                "noise_by_differences": one.by_differences,
                "white": one.is_white,
                "white_probability": one.probability,
                "outliers": one.outliers,
            }
            for one in found.checks
        ],
        "remarks": found.remarks,
        "flights": [{"name": flight.name, "duration": flight.duration_s} for flight in found.flights],
    }


def _pair(quantity: Quantity) -> dict | None:
    return None if quantity.value is None else {"value": quantity.value, "sd": quantity.sd}


def _pairs(quantities: Sequence[Quantity]) -> list:
    return [_pair(one) for one in quantities]


def as_text(found: Identification) -> list[str]:
    """Lines for a terminal."""
    lines = [found.verdict]
    lines += [f"  {one.what}: needs {one.remedy}" for one in found.unidentified]
    lines += [f"  {text}" for text in found.assumed]
    if found.mass.value is not None:
        lines.append(f"mass               {number(found.mass)} kg")
    for axis, one in zip("xyz", found.center_of_mass, strict=True):
        if one.value is not None:
            lines.append(f"centre of mass {axis}   {number(one)} m")
    tensor, unit = found.inertia, " kg m²"
    if any(one.value is None for one in tensor):
        tensor, unit = found.shape, " of the trace"
    for name, one in zip(TENSOR_NAMES, tensor, strict=True):
        if one.value is not None:
            lines.append(f"{name}                {number(one)}{unit}")
    units = found.units
    lines += [f"{name:<18} {number(one)} {units[name]}" for name, one in found.others.items() if one.value is not None]
    for check in found.checks:
        white = "white" if check.is_white else "not white"
        lines.append(f"noise of {check.series}: {check.noise:.3g} {check.unit}, {white}, {check.samples} samples")
    lines += found.remarks
    return lines


def number(quantity: Quantity) -> str:
    """Value ± standard deviation, with two digits of the latter."""
    value, sd = quantity.value, quantity.sd
    if value is None or sd is None:
        return "not identified"
    if not 0.0 < sd < np.inf:
        return f"{value:.9g}"
    power = int(np.floor(np.log10(max(abs(value), sd))))
    digits = min(max(power - int(np.floor(np.log10(sd))) + 1, 1), 15)
    if -4 <= power < 6:
        return f"{value:.{max(digits - power, 0)}f} ± {sd:.2g}"
    scale = 10.0**power
    return f"({value / scale:.{digits}f} ± {sd / scale:.2g})e{power:+d}"


def as_urdf(found: Identification) -> str:
    """A URDF <inertial>; raises InputError where not all of it is identified."""
    parts = [found.mass, *found.center_of_mass, *found.inertia]
    if any(part.value is None for part in parts):
        raise InputError("--urdf", f"{found.verdict}; a URDF needs mass, centre of mass and tensor")
    body = found.estimate.values
    written = urdf_inertial(MassProperties(body.mass, body.center_of_mass, body.inertia))
    return written if found.fits else f"<!-- {MISFIT} -->\n{written}"
