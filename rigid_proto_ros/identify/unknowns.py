# SPDX-License-Identifier: MIT
"""The unknowns: mass, centre of mass and tensor, and on request damping, gravity, clock offsets, and an IMU's place and
biases. Tensors are restricted to those of bodies that can exist: their second moments Σ = ∫ x xᵀ dm have no eigenvalue
below 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from ..base.errors import InputError
from ..base.vectors import FloatArray, Matrix3, Vector3
from ..mass.tensor import principal_axes

GROUPS = ("mass", "inertia", "com", "damping", "gravity", "offset", "gyro_bias", "accel_bias", "imu_place")
"""Groups of unknowns, as ``--fit`` names them."""
DEFAULT_FIT = ("mass", "com", "inertia")
_SIZES = {"mass": 1, "inertia": 6, "damping": 2}
"""Number of unknowns in a group, if it isn't 3."""
THINNEST = 1e-9
"""Least second moment of an estimate, relative to the largest. With 0 it could be a rod, whose least moment is 0."""


@dataclass(frozen=True)
class Values:
    """mass [kg]; center_of_mass (3,) [m, tracked frame]; inertia (3, 3) [kg m², about the COM, axes of the tracked
    frame]; damping (2,): linear [N s/m], angular [N m s]; gravity (3,) [m/s²].

    offsets [s] by topic: a sample stamped t was taken at t + offset. gyro_bias (3,) [rad/s], accel_bias (3,) [m/s²],
    and imu_place (3,) [m, tracked frame]: of the IMU. by_flight: ``gravity`` or ``damping``, if each flight has its
    own.
    """

    mass: float
    center_of_mass: Vector3
    inertia: Matrix3
    damping: FloatArray
    gravity: Vector3
    offsets: Mapping[str, float]
    gyro_bias: Vector3
    accel_bias: Vector3
    imu_place: Vector3
    by_flight: frozenset[str] = frozenset()

    @property
    def size(self) -> float:
        """Radius of gyration [m]."""
        return math.sqrt(float(np.trace(self.inertia) / self.mass))

    def offset(self, topic: str) -> float:
        """Offset of a topic's clock [s]."""
        return float(self.offsets.get(topic, 0.0))


@dataclass(frozen=True)
class Unknowns:
    """The unknowns in their order. slots: (group, index) of each; for ``offset`` the index is a topic."""

    slots: tuple[tuple[str, Any], ...]

    def __len__(self) -> int:
        return len(self.slots)

    def __contains__(self, group: str) -> bool:
        return any(name == group for name, _ in self.slots)

    def scales(self, values: Values) -> FloatArray:
        """A large change of each unknown (n,)."""
        mass, size = values.mass, values.size
        large = {"com": [size] * 3, "damping": [10.0 * mass, 10.0 * mass * size**2 / 3.0]}
        return np.array([large[group][index] if group in large else 1.0 for group, index in self.slots])

    def moved(self, values: Values, change: FloatArray) -> Values:
        """``values`` with the unknowns changed (n,): the mass by a factor e^change, the tensor as in ``moved_tensor``,
        all others by addition. If the tensor isn't an unknown, it is proportional to the mass.
        """
        by_group: dict[str, dict[Any, float]] = {}
        for (group, index), number in zip(self.slots, change.tolist(), strict=True):
            by_group.setdefault(group, {})[index] = number
        new: dict[str, Any] = {}
        for group, numbers in by_group.items():
            if group == "mass":
                factor = math.exp(numbers[0])
                new["mass"] = values.mass * factor
                if "inertia" not in by_group:
                    new["inertia"] = values.inertia * factor
            elif group == "inertia":
                new["inertia"] = moved_tensor(values.inertia, np.array(list(numbers.values())))
            elif group == "offset":
                new["offsets"] = {**values.offsets, **{t: values.offset(t) + s for t, s in numbers.items()}}
            else:
                name = "center_of_mass" if group == "com" else group
                new[name] = getattr(values, name) + np.array(list(numbers.values()))
        return replace(values, **new)

    def read(self, values: Values, slot: int) -> float:
        """Value of an unknown other than mass and tensor."""
        group, index = self.slots[slot]
        return values.offset(index) if group == "offset" else float(getattr(values, group)[index])

    def name(self, slot: int) -> str:
        """Name of an unknown other than mass, COM and tensor."""
        group, index = self.slots[slot]
        if group == "offset":
            return f"offset of {index}"
        return ("linear_damping", "angular_damping")[index] if group == "damping" else f"{group}.{'xyz'[index]}"


def make_unknowns(fit: Sequence[str], topics: Sequence[str]) -> Unknowns:
    """The unknowns of the groups in ``fit``. topics: those whose clocks may differ; the first is the reference. Raises
    InputError for an unknown group.
    """
    for group in fit:
        if group not in GROUPS:
            raise InputError("--fit", group, ", ".join(GROUPS))
    slots: list[tuple[str, Any]] = []
    for group in GROUPS:
        if group in fit:
            # A common offset of all clocks only shifts the flight in time, so the first clock is taken as right.
            slots += [(group, index) for index in (topics[1:] if group == "offset" else range(_SIZES.get(group, 3)))]
    if not slots:
        raise InputError("--fit", ",".join(fit), ", ".join(GROUPS) + "; an offset needs a second topic")
    return Unknowns(tuple(slots))


def moved_tensor(inertia: Matrix3, change: FloatArray) -> Matrix3:
    """The tensor (3, 3) changed (6,) in its own principal axes, each entry relative to the root of its two moments: a
    third of the trace, the last moment minus the mean of the others, the second minus the first, and products 23, 13,
    12.
    """
    moments, axes = principal_axes(inertia)
    size, ratio, smaller, turn23, turn13, turn12 = change.tolist()
    a, b, c = size - ratio / 3.0 - 0.5 * smaller, size - ratio / 3.0 + 0.5 * smaller, size + 2.0 * ratio / 3.0
    relative: Matrix3 = np.array([[a, turn12, turn13], [turn12, b, turn23], [turn13, turn23, c]])
    moved = inertia + axes @ (relative * np.sqrt(np.outer(moments, moments))) @ axes.T
    return 0.5 * (moved + moved.T)


def second_moments(inertia: Matrix3) -> Matrix3:
    """∫ x xᵀ dm (3, 3) [kg m²] of a tensor. A body can have the tensor if no eigenvalue of it is below 0."""
    return 0.5 * float(np.trace(inertia)) * np.eye(3) - inertia


def possible_tensor(inertia: Matrix3, thinnest: float = THINNEST) -> Matrix3:
    """The nearest tensor of a body whose least second moment is at least ``thinnest`` of the largest."""
    values, axes = np.linalg.eigh(second_moments(inertia))
    least = thinnest * np.abs(values).max()
    if values[0] >= least:
        return inertia
    second: Matrix3 = (axes * np.maximum(values, least)) @ axes.T
    return float(np.trace(second)) * np.eye(3) - second


def is_possible(inertia: Matrix3) -> bool:
    """Whether a body can have the tensor, within rounding."""
    values = np.linalg.eigvalsh(second_moments(inertia))
    return bool(values[0] >= -1e-12 * values[2])


_ROWS, _COLUMNS = np.triu_indices(3)
_UNITS = np.zeros((6, 3, 3))
_UNITS[np.arange(6), _ROWS, _COLUMNS] = _UNITS[np.arange(6), _COLUMNS, _ROWS] = 1.0


def possible_step(
    jacobian: FloatArray, residuals: FloatArray, tensor: slice, inertia: Matrix3, change: FloatArray
) -> FloatArray:
    """The step (n,) with the least ``|jacobian step + residuals|`` that leads to a body that can exist. tensor: slice
    of the six numbers of ``moved_tensor`` in the step; they have so far changed ``inertia`` by ``change`` (6,).

    Flat bodies are on the boundary of what can exist. There the second moments are S S with a symmetric S, which is
    regular on the boundary (Burer and Monteiro, Math. Program. 95, 2003).
    """
    own, others = jacobian[:, tensor], np.delete(jacobian, np.r_[tensor], axis=1)
    # The other unknowns fit what they can for any tensor.
    Q, _ = np.linalg.qr(others)
    left, aim = own - Q @ (Q.T @ own), residuals - Q @ (Q.T @ residuals)
    size = float(np.trace(inertia))
    begin = second_moments(inertia) / size
    changes = [second_moments(moved_tensor(inertia, unit)) / size - begin for unit in np.eye(6)]
    of_second = np.linalg.inv(np.array(changes)[:, _ROWS, _COLUMNS].T)

    def step_to(root: FloatArray) -> FloatArray:
        S = np.tensordot(root, _UNITS, 1)
        return of_second @ (S @ S - begin)[_ROWS, _COLUMNS] - change

    def slopes(root: FloatArray) -> FloatArray:
        S = np.tensordot(root, _UNITS, 1)
        changed: FloatArray = np.array([(unit @ S + S @ unit)[_ROWS, _COLUMNS] for unit in _UNITS]).T
        return left @ of_second @ changed

    values, axes = np.linalg.eigh(begin)
    # Away from 0, where the square root has no slope.
    root = ((axes * np.sqrt(np.maximum(values, 1e-6 * values[2]))) @ axes.T)[_ROWS, _COLUMNS]
    found = least_squares(lambda r: left @ step_to(r) + aim, root, slopes, method="lm", xtol=1e-10, ftol=1e-10)
    step = np.empty(jacobian.shape[1])
    step[tensor] = step_to(found.x)
    step[np.delete(np.arange(len(step)), np.r_[tensor])] = np.linalg.lstsq(
        others, -(residuals + own @ step[tensor]), rcond=None
    )[0]
    return step
