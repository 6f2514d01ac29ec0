# SPDX-License-Identifier: MIT
"""The rigid body: mass properties, principal axes, and conversion of mesh coordinates to body axes.

Compiled kernels read a body as a row of BODY doubles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..base.compilation import exported, njit
from ..base.rotation import norm, quaternion_of_axes
from ..base.vectors import Attitude, Matrix3, Numbers, Vector, Vector3
from ..mass.tensor import principal_axes

# Layout of a body's row.
MASS = 0
COM = 1  # (3,) [m, mesh axes after scaling]
INERTIA = 4  # (9,) row by row
MOMENTS = 13  # (3,) ascending
AXES = 16  # (9,) principal axes row by row
QUATERNION = 25  # (4,) principal to body
BODY_SCALE = 29  # (3,)
LENGTH = 32  # ℓ, reference length of displacement errors [m]; 1 without a mesh
BODY = 33

BodyRow = NDArray[np.float64]
"""(BODY,)"""

MAX_ACCELERATION = 1e15
"""Limit in m/s² and rad/s²; in m/s and rad/s for impulses. A larger command is most likely a typing error, and would
leave no significant digits of the motion.
"""


@njit(error_model="numpy", allocates=False)
def angular_acceleration(body: BodyRow, x: float, y: float, z: float) -> tuple[float, float, float]:
    """I⁻¹ τ of a torque x, y, z, in body axes."""
    P, m = AXES, MOMENTS
    a = (body[P] * x + body[P + 3] * y + body[P + 6] * z) / body[m]
    b = (body[P + 1] * x + body[P + 4] * y + body[P + 7] * z) / body[m + 1]
    c = (body[P + 2] * x + body[P + 5] * y + body[P + 8] * z) / body[m + 2]
    return (
        body[P] * a + body[P + 1] * b + body[P + 2] * c,
        body[P + 3] * a + body[P + 4] * b + body[P + 5] * c,
        body[P + 6] * a + body[P + 7] * b + body[P + 8] * c,
    )


@njit(error_model="numpy", allocates=False)
def rotor_rate(body: BodyRow, h: Vector) -> float:
    """Angular frequency [rad/s] at which a slow body turns about a flywheel of momentum h [N m s, body axes]: the
    eigenvalue √(hᵀI h/det I) of I ω' = h × ω.
    """
    P, A, B, C = AXES, math.sqrt(body[MOMENTS]), math.sqrt(body[MOMENTS + 1]), math.sqrt(body[MOMENTS + 2])
    a = body[P] * h[0] + body[P + 3] * h[1] + body[P + 6] * h[2]
    b = body[P + 1] * h[0] + body[P + 4] * h[1] + body[P + 7] * h[2]
    c = body[P + 2] * h[0] + body[P + 5] * h[1] + body[P + 8] * h[2]
    return norm(a / (B * C), b / (A * C), c / (A * B))


@njit(error_model="numpy", allocates=False)
def arm(body: BodyRow, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Mesh coordinates x, y, z to metres from the COM, body axes."""
    s, c = BODY_SCALE, COM
    return x * body[s] - body[c], y * body[s + 1] - body[c + 1], z * body[s + 2] - body[c + 2]


@njit(error_model="numpy", allocates=False)
def normal(body: BodyRow, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A unit normal x, y, z of the unscaled mesh as a unit vector in body axes: normals transform by scale⁻¹."""
    x, y, z = x / body[BODY_SCALE], y / body[BODY_SCALE + 1], z / body[BODY_SCALE + 2]
    size = norm(x, y, z)
    return x / size, y / size, z / size


@exported("f8", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", "f8[:]", "f8[:]")
def fill_body(
    mass: float, com: Vector3, inertia: Matrix3, moments: Vector3, axes: Matrix3, scale: Vector3, body: BodyRow
) -> None:
    """Fill the row of a body (BODY,), with length ℓ = 1, from mass, com (3,), inertia (3, 3), its principal moments
    (3,) and axes (3, 3), and scale (3,).
    """
    quaternion_of_axes(axes, body[QUATERNION : QUATERNION + 4])
    body[MASS], body[LENGTH] = mass, 1.0
    for k in range(3):
        body[COM + k] = com[k]
        body[MOMENTS + k] = moments[k]
        body[BODY_SCALE + k] = scale[k]
        for j in range(3):
            body[INERTIA + 3 * k + j] = inertia[k, j]
            body[AXES + 3 * k + j] = axes[k, j]


@dataclass(frozen=True)
class Body:
    """A rigid body. row (BODY,): the body as compiled kernels read it; it is never modified."""

    row: BodyRow

    @cached_property
    def mass(self) -> float:
        """[kg]"""
        return float(self.row[MASS])

    @cached_property
    def center_of_mass(self) -> Vector3:
        """(3,) [m, mesh axes after scaling]."""
        return self.row[COM : COM + 3]

    @cached_property
    def inertia(self) -> Matrix3:
        """(3, 3) [kg m², about the COM, mesh axes]."""
        return self.row[INERTIA : INERTIA + 9].reshape(3, 3)

    @cached_property
    def scale(self) -> Vector3:
        """(3,): factors from mesh coordinates to metres from the mesh origin."""
        return self.row[BODY_SCALE : BODY_SCALE + 3]

    @cached_property
    def principal_moments(self) -> Vector3:
        """(3,) [kg m²], ascending."""
        return self.row[MOMENTS : MOMENTS + 3]

    @cached_property
    def principal_axes(self) -> Matrix3:
        """(3, 3): principal axes as columns, in body axes."""
        return self.row[AXES : AXES + 9].reshape(3, 3)

    @cached_property
    def principal_quaternion(self) -> Attitude:
        """(4,) xyzw, rotation from principal to body axes."""
        return self.row[QUATERNION : QUATERNION + 4]

    @cached_property
    def light(self) -> float:
        """Bound of (Σ|F| + Σ|τ|)(1 + Σ|point|), with point in mesh coordinates, up to which a load stays far below
        MAX_ACCELERATION.
        """
        row: list[float] = self.row.tolist()
        largest = max(map(abs, (*row[BODY_SCALE : BODY_SCALE + 3], *row[COM : COM + 3])))
        return 0.1 * MAX_ACCELERATION * min(row[MASS], row[MOMENTS] / (1.0 + 3.0 * largest))

    def point(self, mesh_point: Numbers) -> Vector3:
        """Mesh coordinates (3,) to metres from the COM, body axes."""
        x, y, z = mesh_point
        return np.array(arm(self.row, float(x), float(y), float(z)))

    def mesh_point(self, point: Numbers) -> Vector3:
        """Metres from the COM, body axes, to mesh coordinates (3,)."""
        found: Vector3 = (np.asarray(point) + self.center_of_mass) / self.scale
        return found


def make_body(
    mass: float, center_of_mass: Numbers, inertia: Sequence[Numbers] | Matrix3, scale: Numbers = (1.0, 1.0, 1.0)
) -> Body:
    """A body of given mass properties, its tensor diagonalized once."""
    row = np.empty(BODY)
    com, tensor, sides = (np.ascontiguousarray(numbers, dtype=float) for numbers in (center_of_mass, inertia, scale))
    fill_body(float(mass), com, tensor, *principal_axes(tensor), sides, row)
    return Body(row)
