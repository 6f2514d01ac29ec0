# SPDX-License-Identifier: MIT
"""The state of the body and its hash."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from ..base.rotation import Numbers, matrix_from_quaternion, times


@dataclass(slots=True)
class State:
    """State at one instant of simulated time; a new one is made for every instant, and none is changed.

    time_ns: simulated time [ns]. row (13,) float64: COM position x [m, world], attitude q xyzw (body to world), COM
    velocity v [m/s, world], angular velocity ω [rad/s, body axes].
    """

    time_ns: int
    row: np.ndarray

    @property
    def position(self) -> np.ndarray:
        """COM position x [m, world]."""
        return self.row[0:3]

    @property
    def orientation_xyzw(self) -> np.ndarray:
        """Attitude q, body to world."""
        return self.row[3:7]

    @property
    def linear_velocity(self) -> np.ndarray:
        """COM velocity v [m/s, world]."""
        return self.row[7:10]

    @property
    def angular_velocity_body(self) -> np.ndarray:
        """ω [rad/s, body axes]."""
        return self.row[10:13]

    @property
    def rotation(self) -> np.ndarray:
        """Rotation matrix (3, 3), body to world."""
        return matrix_from_quaternion(self.orientation_xyzw)

    @property
    def angular_velocity(self) -> np.ndarray:
        """ω in world axes [rad/s]."""
        return times(self.rotation, self.angular_velocity_body)

    def kinetic_energy(self, mass: float, inertia: np.ndarray) -> float:
        """½ m|v|² + ½ ωᵀIω [J]."""
        v, w = self.linear_velocity, self.angular_velocity_body
        return 0.5 * mass * float((v * v).sum()) + 0.5 * float((w * times(inertia, w)).sum())

    def angular_momentum(self, inertia: np.ndarray) -> np.ndarray:
        """L = R I ω about the COM, world axes [N m s]."""
        return times(self.rotation, times(inertia, self.angular_velocity_body))

    def sha256(self) -> str:
        """SHA-256 of int64 time_ns, then float64 x, q xyzw, v, ω body, little-endian, with −0 written as +0."""
        digest = hashlib.sha256(np.array([self.time_ns], dtype="<i8").tobytes())
        digest.update((self.row + 0.0).astype("<f8").tobytes())
        return digest.hexdigest()


def state_row(
    position: Numbers,
    orientation_xyzw: Numbers,
    linear_velocity: Numbers,
    angular_velocity_body: Numbers,
) -> np.ndarray:
    """The 13 numbers of a state in their order."""
    return np.concatenate([position, orientation_xyzw, linear_velocity, angular_velocity_body]).astype(float)
