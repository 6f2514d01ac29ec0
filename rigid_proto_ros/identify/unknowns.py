# SPDX-License-Identifier: MIT
"""What is estimated: the ten mass parameters, and on request damping, gravity, clock offsets, an IMU's
place and biases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.errors import InputError
from . import mass_parameters as mp

MASS_NAMES = ("alpha", "lambda", "e1", "e2", "s12", "s23", "s13", "t1", "t2", "t3")
GROUPS = ("mass", "com", "inertia", "damping", "gravity", "offset", "gyro_bias", "accel_bias", "imu_place")
"""What ``--fit`` takes."""
DEFAULT_FIT = ("mass", "com", "inertia")


@dataclass(frozen=True)
class Values:
    """theta (10,): mass_parameters.py. damping (2,): linear [N s/m], angular [N m s]. gravity (3,) [m/s²].

    offsets [s] by topic: a sample stamped t was taken at t + offset. gyro_bias (3,) [rad/s], accel_bias (3,) [m/s²],
    and imu_place (3,) [m, tracked frame] of the IMU.
    """

    theta: np.ndarray
    damping: np.ndarray
    gravity: np.ndarray
    offsets: tuple[float, ...]
    gyro_bias: np.ndarray
    accel_bias: np.ndarray
    imu_place: np.ndarray
    tensor_change: np.ndarray = field(default_factory=lambda: np.zeros(6))

    @cached_property
    def body(self) -> mp.MassEstimate:
        """The body that these say."""
        body = mp.mass_of(self.theta)
        return mp.changed_tensor(body, self.tensor_change) if self.tensor_change.any() else body


@dataclass(frozen=True)
class Unknowns:
    """Which numbers are free, in their order; topics: those whose clocks may differ, the first one keeps its own.

    slots: (field of Values, index) for each; steps: for difference quotients.
    """

    slots: tuple[tuple[str, int], ...]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.slots)

    @property
    def theta_columns(self) -> list[tuple[int, int]]:
        """(place among the unknowns, index in theta) of the mass parameters that are free."""
        return [(k, index) for k, (name, index) in enumerate(self.slots) if name == "theta"]

    @property
    def physical(self) -> Unknowns:
        """The same with the tensor itself for its parameters, which near the rim of what can exist hardly
        change it any more.
        """
        slots = [("tensor_change", i - 1) if n == "theta" and 1 <= i <= 6 else (n, i) for n, i in self.slots]
        return Unknowns(tuple(slots), self.names)

    def read(self, values: Values) -> np.ndarray:
        """The free numbers of ``values``."""
        return np.array([float(getattr(values, name)[index]) for name, index in self.slots])

    def put(self, values: Values, numbers: np.ndarray) -> Values:
        """``values`` with these for the free numbers."""
        changed = {name: np.array(getattr(values, name), dtype=float) for name, _ in self.slots}
        for (name, index), number in zip(self.slots, numbers, strict=True):
            changed[name][index] = number
        new: dict[str, Any] = dict(changed)
        if "offsets" in changed:
            new["offsets"] = tuple(changed["offsets"].tolist())
        return replace(values, **new)

    def steps(self, values: Values) -> np.ndarray:
        """Steps for difference quotients."""
        theta = mp.difference_steps(values.theta)
        mass = values.body
        damping = 10.0 * mp.STEP * np.array([mass.mass, np.trace(mass.inertia) / 3.0])
        given = {"theta": theta, "damping": damping}
        return np.array([float(given[name][index]) if name in given else mp.STEP for name, index in self.slots])


NONE = Unknowns((), ())
"""Nothing is free."""


def make_unknowns(fit: Sequence[str], topics: Sequence[str]) -> Unknowns:
    """Of the groups in ``fit``; raises InputError for one that isn't known."""
    slots: list[tuple[str, int]] = []
    names: list[str] = []
    for group in fit:
        if group not in GROUPS:
            raise InputError("--fit", group, ", ".join(GROUPS))
    if "mass" in fit:
        slots.append(("theta", mp.MASS))
    if "inertia" in fit:
        slots += [("theta", k) for k in range(1, 7)]
    if "com" in fit:
        slots += [("theta", k) for k in range(7, 10)]
    names += [MASS_NAMES[index] for _, index in slots]
    if "damping" in fit:
        slots += [("damping", 0), ("damping", 1)]
        names += ["linear_damping", "angular_damping"]
    if "offset" in fit:
        # All clocks together say nothing but when the flight began: the first one is taken as right.
        slots += [("offsets", k) for k in range(1, len(topics))]
        names += [f"offset of {topic}" for topic in topics[1:]]
    for group in ("gravity", "gyro_bias", "accel_bias", "imu_place"):
        if group in fit:
            slots += [(group, k) for k in range(3)]
            names += [f"{group}.{axis}" for axis in "xyz"]
    if not slots:
        raise InputError("--fit", "", ", ".join(GROUPS))
    return Unknowns(tuple(slots), tuple(names))
