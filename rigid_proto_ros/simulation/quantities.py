# SPDX-License-Identifier: MIT
"""Scalars of a flight by name: what measures take maxima of, what conditions compare, what samples hold.

A quantity is a function of the state now and of the start, which is kept as a row (CONTEXT,): mass, tensor, gravity,
the state row at time 0, its energy and angular momentum.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.elementary import inverse_tangent_of
from ..base.rotation import rotate
from ..base.uncounted_arrays import copy_numbers
from ..motion.state import angular_momentum, kinetic_energy

QUANTITIES = {
    "position.x": "m",
    "position.y": "m",
    "position.z": "m",
    "orientation.x": "",
    "orientation.y": "",
    "orientation.z": "",
    "orientation.w": "",
    "velocity.x": "m/s",
    "velocity.y": "m/s",
    "velocity.z": "m/s",
    "spin.x": "rad/s",
    "spin.y": "rad/s",
    "spin.z": "rad/s",
    "speed": "m/s",
    "spin": "rad/s",
    "distance": "m",
    "turned": "rad",
    "kinetic_energy": "J",
    "potential_energy": "J",
    "energy": "J",
    "energy_drift": "",
    "angular_momentum": "N m s",
    "momentum_turned": "rad",
}
"""Units by name; ``spin.x`` is in body axes, the rest of a state in world axes. ``distance`` and ``turned`` are from
the start, ``energy_drift`` is |E − E₀|/|E₀|, ``momentum_turned`` the drift of L's direction.
"""

NAMES = tuple(QUANTITIES)
SPEED, SPIN, DISTANCE, TURNED, KINETIC, POTENTIAL, ENERGY, DRIFT, MOMENTUM, MOMENTUM_TURNED = range(13, 23)

DIFFERENCES = {"attitude": "rad", "position": "m", "velocity": "m/s", "spin": "rad/s"}
"""How far two states are apart; velocities and spins in world axes."""

STATE = 14
"""A state row (13,) and the string's energy [J]."""

MASS, INERTIA, GRAVITY, START, START_ENERGY, START_MOMENTUM, CONTEXT = 0, 1, 10, 13, 27, 28, 31


@njit(cache=True, error_model="numpy", allocates=False)
def _momentum(row: np.ndarray, context: np.ndarray) -> tuple[float, float, float]:
    return angular_momentum(row, context[INERTIA : INERTIA + 9])


@njit(cache=True, error_model="numpy", allocates=False)
def _kinetic(row: np.ndarray, context: np.ndarray) -> float:
    return kinetic_energy(row, context[MASS], context[INERTIA : INERTIA + 9])


@njit(cache=True, error_model="numpy", allocates=False)
def _potential(row: np.ndarray, context: np.ndarray) -> float:
    g = GRAVITY
    fallen = context[g] * row[0] + context[g + 1] * row[1] + context[g + 2] * row[2]
    return row[13] - context[MASS] * fallen


@njit(cache=True, error_model="numpy", allocates=False)
def _length(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@njit(cache=True, error_model="numpy", allocates=False)
def attitude_angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle of the rotation from attitude a (4,) to b (4,), xyzw [rad, 0 to π]."""
    w = a[3] * b[3] + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    x = a[3] * b[0] - a[0] * b[3] - a[1] * b[2] + a[2] * b[1]
    y = a[3] * b[1] + a[0] * b[2] - a[1] * b[3] - a[2] * b[0]
    z = a[3] * b[2] - a[0] * b[1] + a[1] * b[0] - a[2] * b[3]
    return 2.0 * inverse_tangent_of(_length(x, y, z), abs(w))


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def begin(mass: float, inertia: np.ndarray, gravity: np.ndarray, row: np.ndarray, context: np.ndarray) -> None:
    """Fill the context (CONTEXT,) from mass, tensor (9,), gravity (3,) and the state row (STATE,) at time 0."""
    context[MASS] = mass
    copy_numbers(inertia, context[INERTIA : INERTIA + 9])
    copy_numbers(gravity, context[GRAVITY : GRAVITY + 3])
    copy_numbers(row, context[START : START + STATE])
    context[START_ENERGY] = _kinetic(row, context) + _potential(row, context)
    lx, ly, lz = _momentum(row, context)
    context[START_MOMENTUM], context[START_MOMENTUM + 1], context[START_MOMENTUM + 2] = lx, ly, lz


@njit(cache=True, error_model="numpy", allocates=False)
def quantity(code: int, row: np.ndarray, context: np.ndarray) -> float:
    """The quantity NAMES[code] of a state row (STATE,)."""
    if code < 13:
        return row[code]
    if code == SPEED:
        return _length(row[7], row[8], row[9])
    if code == SPIN:
        return _length(row[10], row[11], row[12])
    if code == DISTANCE:
        return _length(row[0] - context[START], row[1] - context[START + 1], row[2] - context[START + 2])
    if code == TURNED:
        return attitude_angle(context[START + 3 : START + 7], row[3:7])
    if code == KINETIC:
        return _kinetic(row, context)
    if code == POTENTIAL:
        return _potential(row, context)
    if code == ENERGY:
        return _kinetic(row, context) + _potential(row, context)
    if code == DRIFT:
        return abs(_kinetic(row, context) + _potential(row, context) - context[START_ENERGY]) / abs(
            context[START_ENERGY]
        )
    lx, ly, lz = _momentum(row, context)
    if code == MOMENTUM:
        return _length(lx, ly, lz)
    ax, ay, az = context[START_MOMENTUM], context[START_MOMENTUM + 1], context[START_MOMENTUM + 2]
    across = _length(ly * az - lz * ay, lz * ax - lx * az, lx * ay - ly * ax)
    return inverse_tangent_of(across, lx * ax + ly * ay + lz * az)


@njit(cache=True, error_model="numpy", allocates=False)
def difference(code: int, a: np.ndarray, b: np.ndarray) -> float:
    """The difference number ``code`` of DIFFERENCES between two state rows."""
    if code == 0:
        return attitude_angle(a[3:7], b[3:7])
    if code == 1:
        return _length(a[0] - b[0], a[1] - b[1], a[2] - b[2])
    if code == 2:
        return _length(a[7] - b[7], a[8] - b[8], a[9] - b[9])
    ax, ay, az = rotate(a[3], a[4], a[5], a[6], a[10], a[11], a[12])
    bx, by, bz = rotate(b[3], b[4], b[5], b[6], b[10], b[11], b[12])
    return _length(ax - bx, ay - by, az - bz)


STOP_CODE, STOP_SIGN, STOP_LIMIT = range(3)


@njit(cache=True, error_model="numpy", allocates=False)
def met(condition: np.ndarray, row: np.ndarray, context: np.ndarray) -> bool:
    """Whether a condition (code, sign, limit) holds: the quantity is above the limit (sign 1) or below it (−1)."""
    return condition[STOP_SIGN] * (quantity(int(condition[STOP_CODE]), row, context) - condition[STOP_LIMIT]) > 0.0


@njit(cache=True, error_model="numpy", allocates=False)
def which_is_met(conditions: np.ndarray, row: np.ndarray, context: np.ndarray) -> int:
    """Number of the first condition (k, 3) that holds, or −1."""
    for k in range(conditions.shape[0]):
        if met(conditions[k], row, context):
            return k
    return -1
