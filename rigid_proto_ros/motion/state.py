# SPDX-License-Identifier: MIT
"""The state of the body and its hash."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from ..base.compilation import exported, njit
from ..base.rotation import matrix_elements, matrix_from_quaternion, rotate, times, to_unit
from ..base.vectors import Attitude, FloatArray, Matrix3, StateRow, Vector3

NO_ROTOR = np.zeros(3)


@dataclass(slots=True)
class State:
    """State at one instant of simulated time; every instant has its own object, which is never modified.

    time_ns: simulated time [ns]. row (13,) float64: COM position x [m, world], attitude q xyzw (body to world), COM
    velocity v [m/s, world], angular velocity ω [rad/s, body axes].
    """

    time_ns: int
    row: StateRow

    @property
    def position(self) -> Vector3:
        """COM position x [m, world]."""
        return self.row[0:3]

    @property
    def orientation_xyzw(self) -> Attitude:
        """Attitude q, body to world."""
        return self.row[3:7]

    @property
    def linear_velocity(self) -> Vector3:
        """COM velocity v [m/s, world]."""
        return self.row[7:10]

    @property
    def angular_velocity_body(self) -> Vector3:
        """ω [rad/s, body axes]."""
        return self.row[10:13]

    @property
    def rotation(self) -> Matrix3:
        """Rotation matrix (3, 3), body to world."""
        return matrix_from_quaternion(self.orientation_xyzw)

    @property
    def angular_velocity(self) -> Vector3:
        """ω in world axes [rad/s]."""
        return times(self.rotation, self.angular_velocity_body)

    def kinetic_energy(self, mass: float, inertia: Matrix3) -> float:
        """½ m|v|² + ½ ωᵀIω [J]."""
        return kinetic_energy(self.row, mass, np.ravel(inertia))

    def angular_momentum(self, inertia: Matrix3, rotor: Vector3 = NO_ROTOR) -> Vector3:
        """L = R (I ω + h) about the COM, world axes [N m s]; rotor: h of a flywheel (3,) [N m s, body axes]."""
        return np.array(angular_momentum(self.row, np.ravel(inertia), rotor))

    def sha256(self) -> str:
        """SHA-256 of int64 time_ns, then float64 x, q xyzw, v, ω body, little-endian, with −0 written as +0."""
        digest = hashlib.sha256(np.array([self.time_ns], dtype="<i8").tobytes())
        digest.update((self.row + 0.0).astype("<f8").tobytes())
        return digest.hexdigest()


@njit(error_model="numpy", allocates=False)
def fill_initial_row(
    position: Vector3, orientation: Attitude, velocity: Vector3, angular_velocity: Vector3, row: StateRow
) -> bool:
    """Fill a state row (13,), given an orientation (4,) of any length and ω (3,) in world axes; returns False when the
    orientation has length zero.
    """
    x, y, z, w = to_unit(orientation[0], orientation[1], orientation[2], orientation[3])
    row[3], row[4], row[5], row[6] = x, y, z, w
    R = matrix_elements(x, y, z, w)
    a, b, c = angular_velocity[0], angular_velocity[1], angular_velocity[2]
    for k in range(3):
        row[k] = position[k]
        row[7 + k] = velocity[k]
    row[10] = R[0] * a + R[3] * b + R[6] * c
    row[11] = R[1] * a + R[4] * b + R[7] * c
    row[12] = R[2] * a + R[5] * b + R[8] * c
    return x != 0.0 or y != 0.0 or z != 0.0 or w != 0.0


@njit(error_model="numpy", allocates=False)
def to_body_axes(row: StateRow, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rᵀ v of v = (x, y, z) in world axes."""
    R = matrix_elements(row[3], row[4], row[5], row[6])
    return R[0] * x + R[3] * y + R[6] * z, R[1] * x + R[4] * y + R[7] * z, R[2] * x + R[5] * y + R[8] * z


@exported("f8[:]", "f8", "f8", "f8")
def shift_com(row: StateRow, x: float, y: float, z: float) -> None:
    """Change the reference point of a state row (13,) to the one at d = (x, y, z) [m, body axes] from the COM on the
    same moving body: the position changes by R d, the velocity by ω × R d.
    """
    R = matrix_elements(row[3], row[4], row[5], row[6])
    x, y, z = R[0] * x + R[1] * y + R[2] * z, R[3] * x + R[4] * y + R[5] * z, R[6] * x + R[7] * y + R[8] * z
    a, b, c = row[10], row[11], row[12]
    a, b, c = R[0] * a + R[1] * b + R[2] * c, R[3] * a + R[4] * b + R[5] * c, R[6] * a + R[7] * b + R[8] * c
    row[0], row[1], row[2] = row[0] + x, row[1] + y, row[2] + z
    row[7], row[8], row[9] = row[7] + (b * z - c * y), row[8] + (c * x - a * z), row[9] + (a * y - b * x)


@exported("f8[:]", "f8", "f8[:]", returns="f8")
def kinetic_energy(row: FloatArray, mass: float, inertia: FloatArray) -> float:
    """½ m|v|² + ½ ωᵀIω [J] of a state row (≥ 13,); inertia (9,) row by row."""
    x, y, z = row[10], row[11], row[12]
    turning = (
        x * (inertia[0] * x + inertia[1] * y + inertia[2] * z)
        + y * (inertia[3] * x + inertia[4] * y + inertia[5] * z)
        + z * (inertia[6] * x + inertia[7] * y + inertia[8] * z)
    )
    return float(0.5 * mass * (row[7] * row[7] + row[8] * row[8] + row[9] * row[9]) + 0.5 * turning)


@exported("f8[:]", "f8[:]", "f8[:]", returns="f8 f8 f8")
def angular_momentum(row: FloatArray, inertia: FloatArray, rotor: Vector3) -> tuple[float, float, float]:
    """L = R (I ω + h) about the COM, world axes [N m s], of a state row (≥ 13,); inertia (9,) row by row, rotor (3,): h
    of a flywheel.
    """
    x, y, z = row[10], row[11], row[12]
    return rotate(
        row[3],
        row[4],
        row[5],
        row[6],
        inertia[0] * x + inertia[1] * y + inertia[2] * z + rotor[0],
        inertia[3] * x + inertia[4] * y + inertia[5] * z + rotor[1],
        inertia[6] * x + inertia[7] * y + inertia[8] * z + rotor[2],
    )
