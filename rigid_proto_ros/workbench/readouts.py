# SPDX-License-Identifier: MIT
"""Energies, angular momentum and spin of a body from its published state, for numbers and small plots beside a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.rotation import rotate, rotate_inverse


@dataclass(frozen=True)
class Readout:
    """kinetic_energy [J], of the COM's motion and of the turning; momentum: L about the COM (3,) [N m s, world];
    angular_velocity_body (3,) [rad/s]; momentum_angle: of L to its direction at the start [rad], 0 without one.
    """

    kinetic_energy: float
    turning_energy: float
    momentum: np.ndarray
    momentum_angle: float
    angular_velocity_body: np.ndarray

    @property
    def momentum_norm(self) -> float:
        """|L| [N m s]."""
        return float(np.linalg.norm(self.momentum))


def readout(row: np.ndarray, mass: float, inertia: np.ndarray, start_momentum: np.ndarray | None = None) -> Readout:
    """What a state says of a body.

    row (13,): position [m], orientation xyzw, linear velocity [m/s] and angular velocity [rad/s], both in world axes.
    mass [kg], inertia (3, 3) [kg m²] about the COM in body axes, as ``~/inertia`` gives them. start_momentum (3,): L to
    measure the angle to.
    """
    q = tuple(float(x) for x in row[3:7])
    w = np.array(rotate_inverse(*q, *(float(x) for x in row[10:13])))
    own = inertia @ w
    momentum = np.array(rotate(*q, *(float(x) for x in own)))
    turning = 0.5 * float(w @ own)
    moving = 0.5 * mass * float(row[7:10] @ row[7:10])
    angle = 0.0 if start_momentum is None else angle_between(momentum, start_momentum)
    return Readout(moving + turning, turning, momentum, angle, w)


def gravity_energy(row: np.ndarray, mass: float, gravity: np.ndarray) -> float:
    """−m g·x [J]."""
    return -mass * float(np.asarray(gravity) @ row[0:3])


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two vectors (3,) [rad], accurate for small ones too; 0 where one of them has no direction."""
    # Halves of the unit vectors' difference and sum: no cancellation at either end (Kahan).
    na, nb = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if na == 0.0 or nb == 0.0:
        return 0.0
    u, v = np.asarray(a) / na, np.asarray(b) / nb
    return 2.0 * math.atan2(float(np.linalg.norm(u - v)), float(np.linalg.norm(u + v)))
