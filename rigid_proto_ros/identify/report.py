# SPDX-License-Identifier: MIT
"""What ``rigid_proto identify`` says: the verdict, then the numbers that the motion tells, with their
standard deviations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..mass.export import urdf_inertial
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes, six_from_tensor
from . import mass_parameters as mp
from .comparison import Judged
from .fitting import Estimate
from .measurements import MeasuredFlight
from .residual_checks import ResidualCheck, remarks
from .unknowns import Values
from .verdict import Hidden, Quantity, Visibility, summary

MISFIT = "the fit leaves more than noise, so its numbers may be farther off than their standard deviations say"
TENSOR_NAMES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Identification:
    """Everything that is to be said."""

    flights: Sequence[MeasuredFlight]
    estimate: Estimate
    visibility: Visibility
    checks: Sequence[ResidualCheck]
    compared: Sequence[Judged]
    assumed: Sequence[str]
    guessed: frozenset[str] = frozenset()
    """Of ``mass``, ``com`` and ``inertia`` what was neither asked for nor given: it has no number."""

    @property
    def hidden(self) -> list[Hidden]:
        """What the motion can't tell."""
        return self.visibility.hidden

    @property
    def seen(self) -> list[str]:
        """What it tells, in words."""
        words = {"mass": [self.mass], "centre of mass": self.center_of_mass, "tensor": self.inertia}
        told = [name for name, parts in words.items() if all(part.value is not None for part in parts)]
        if "tensor" not in told and all(part.value is not None for part in self.shape):
            told.append("shape of the tensor")
        return told

    @property
    def verdict(self) -> str:
        """What this motion can tell, in a sentence; and first of all whether the model fits it."""
        said = summary(self.hidden, self.seen)
        return said if self.fits else f"{MISFIT}; {said}"

    @property
    def fits(self) -> bool:
        """Whether what the fit leaves is noise: else its numbers may be far off, whatever their standard deviations."""
        return all(check.is_noise for check in self.checks)

    @property
    def mass(self) -> Quantity:
        """[kg]."""
        return Quantity(None, None) if "mass" in self.guessed else self._of(lambda body: body.mass)

    @property
    def center_of_mass(self) -> list[Quantity]:
        """[m, tracked frame]."""
        return self._each(lambda body: body.center_of_mass, 3, "com")

    @property
    def inertia(self) -> list[Quantity]:
        """ixx ixy ixz iyy iyz izz [kg m², about the COM, axes of the tracked frame]."""
        return self._whole(lambda body: np.array(six_from_tensor(body.inertia)), 6)

    @property
    def shape(self) -> list[Quantity]:
        """The same divided by the tensor's trace."""
        return self._whole(lambda body: np.array(six_from_tensor(body.inertia)) / np.trace(body.inertia), 6)

    @property
    def moments(self) -> list[Quantity]:
        """Principal moments, ascending [kg m²]."""
        return self._whole(lambda body: principal_axes(body.inertia)[0], 3)

    @property
    def others(self) -> dict[str, Quantity]:
        """Whatever else was asked for, by name."""
        unknowns = self.estimate.unknowns
        return {
            unknowns.names[k]: self.visibility.quantity(_reader(name, index))
            for k, (name, index) in enumerate(unknowns.slots)
            if name != "theta"
        }

    def _of(self, read: Callable[[mp.MassEstimate], float]) -> Quantity:
        return self.visibility.quantity(lambda values: read(values.body))

    def _each(self, read: Callable[[mp.MassEstimate], np.ndarray], count: int, group: str) -> list[Quantity]:
        if group in self.guessed:
            return [Quantity(None, None)] * count

        def one(k: int) -> Quantity:
            return self._of(lambda body: float(read(body)[k]))

        return [one(k) for k in range(count)]

    def _whole(self, read: Callable[[mp.MassEstimate], np.ndarray], count: int) -> list[Quantity]:
        """All of them or none: an entry that happens to be 0 has the size of the others."""
        found = self._each(read, count, "inertia")
        return found if all(one.value is not None for one in found) else [Quantity(None, None)] * count

    @property
    def remarks(self) -> list[str]:
        """On the residuals."""
        return remarks(self.checks)


def _reader(name: str, index: int) -> Callable[[Values], float]:
    return lambda values: float(getattr(values, name)[index])


def as_json(found: Identification) -> dict:
    """The command's JSON object; what the motion can't tell is null."""
    return {
        "verdict": found.verdict,
        "fits": found.fits,
        "hidden": [{"what": one.what, "remedy": one.remedy} for one in found.hidden],
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
        "compared": [
            {
                "name": one.name,
                "log_likelihood": one.log_likelihood if np.isfinite(one.log_likelihood) else None,
                "freedoms": one.freedoms,
                "probability": one.probability,
                "weight": one.weight,
                "contradicted": one.is_contradicted,
                "problem": one.problem,
            }
            for one in found.compared
        ],
        "flights": [{"name": flight.name, "duration": flight.duration_s} for flight in found.flights],
    }


def _pair(quantity: Quantity) -> dict | None:
    return None if quantity.value is None else {"value": quantity.value, "sd": quantity.sd}


def _pairs(quantities: Sequence[Quantity]) -> list:
    return [_pair(one) for one in quantities]


def as_text(found: Identification) -> list[str]:
    """Lines for a terminal."""
    lines = [found.verdict]
    lines += [f"  {one.what}: {one.remedy} would show it" for one in found.hidden]
    lines += [f"  {text}" for text in found.assumed]
    if found.mass.value is not None:
        lines.append(f"mass               {number(found.mass)} kg")
    for axis, one in zip("xyz", found.center_of_mass, strict=True):
        if one.value is not None:
            lines.append(f"centre of mass {axis}   {number(one)} m")
    tensor, unit = found.inertia, " kg m^2"
    if any(one.value is None for one in tensor):
        tensor, unit = found.shape, " of the trace"
    for name, one in zip(TENSOR_NAMES, tensor, strict=True):
        if one.value is not None:
            lines.append(f"{name}                {number(one)}{unit}")
    lines += [f"{name:<18} {number(one)}" for name, one in found.others.items() if one.value is not None]
    for check in found.checks:
        white = "white" if check.is_white else "not white"
        lines.append(f"noise of {check.series}: {check.noise:.3g} {check.unit}, {white}, {check.samples} samples")
    lines += found.remarks
    for one in found.compared:
        if one.problem:
            said = one.problem
        else:
            said = "contradicted by the motion" if one.is_contradicted else "agrees with the motion"
            said += f" (log likelihood {one.log_likelihood:.4g} below the free fit's, p = {one.probability:.2g})"
        lines.append(f"{one.name:<18} {said}")
    return lines


def number(quantity: Quantity) -> str:
    """Value ± standard deviation, with two digits of the latter."""
    value, sd = quantity.value, quantity.sd
    if value is None or sd is None:
        return "not told"
    if not 0.0 < sd < np.inf:
        return f"{value:.9g}"
    power = int(np.floor(np.log10(max(abs(value), sd))))
    digits = min(max(power - int(np.floor(np.log10(sd))) + 1, 1), 15)
    if -4 <= power < 6:
        return f"{value:.{max(digits - power, 0)}f} ± {sd:.2g}"
    scale = 10.0**power
    return f"({value / scale:.{digits}f} ± {sd / scale:.2g})e{power:+d}"


def as_urdf(found: Identification) -> str:
    """A URDF <inertial>; raises InputError where the motion doesn't tell all of it."""
    parts = [found.mass, *found.center_of_mass, *found.inertia]
    if any(part.value is None for part in parts):
        raise InputError("--urdf", f"{found.verdict}, and a URDF needs all of mass, centre of mass and tensor")
    body = found.estimate.mass
    written = urdf_inertial(MassProperties(body.mass, body.center_of_mass, body.inertia))
    return written if found.fits else f"<!-- {MISFIT} -->\n{written}"
