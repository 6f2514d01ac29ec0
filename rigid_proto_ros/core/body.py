# SPDX-License-Identifier: MIT
"""The rigid body: mass properties, principal axes, and where mesh points lie on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .inertia_tensor import principal_axes
from .rotation import quaternion_from_matrix


@dataclass(frozen=True)
class Body:
    """mass [kg], center_of_mass (3,) [m, mesh axes after scaling], inertia (3, 3) [kg m², about the COM, mesh axes].

    principal_moments (3,) ascending; principal_axes (3, 3): columns, body axes; principal_quaternion (4,) xyzw takes
    principal to body axes. scale (3,): mesh coordinates times scale are metres from the mesh origin.
    """

    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray
    scale: np.ndarray
    principal_moments: np.ndarray
    principal_axes: np.ndarray
    principal_quaternion: np.ndarray

    @cached_property
    def smallest_moment(self) -> float:
        """I₁ [kg m²] as a plain float."""
        return float(self.principal_moments[0])

    @cached_property
    def _placement(self) -> list[tuple[float, float]]:
        return list(zip(self.scale.tolist(), self.center_of_mass.tolist(), strict=True))

    def arm(self, mesh_point: tuple[float, float, float]) -> tuple[float, float, float]:
        """``point`` of plain floats."""
        (a, x), (b, y), (c, z) = self._placement
        return mesh_point[0] * a - x, mesh_point[1] * b - y, mesh_point[2] * c - z

    def point(self, mesh_point) -> np.ndarray:
        """Mesh coordinates (3,) to metres from the COM, body axes."""
        return np.asarray(mesh_point) * self.scale - self.center_of_mass

    def mesh_point(self, point) -> np.ndarray:
        """Metres from the COM, body axes, to mesh coordinates (3,)."""
        return (np.asarray(point) + self.center_of_mass) / self.scale

    def normal(self, mesh_normal) -> np.ndarray:
        """A unit normal (3,) of the unscaled mesh as a unit vector in body axes: normals transform by scale⁻¹."""
        turned = np.asarray(mesh_normal) / self.scale
        turned = turned / np.sqrt((turned * turned).sum())
        return turned

    def angular_acceleration(self, torque_body) -> np.ndarray:
        """I⁻¹ τ (3,), both in body axes."""
        P = self.principal_axes
        turned = (P * np.asarray(torque_body)[:, None]).sum(axis=0) / self.principal_moments
        return (P * turned).sum(axis=1)


def make_body(mass: float, center_of_mass, inertia, scale=(1.0, 1.0, 1.0)) -> Body:
    """A body of given mass properties, its tensor diagonalized once."""
    inertia = np.asarray(inertia, dtype=float)
    moments, axes = principal_axes(inertia)
    return Body(
        mass=float(mass),
        center_of_mass=np.asarray(center_of_mass, dtype=float),
        inertia=inertia,
        scale=np.asarray(scale, dtype=float),
        principal_moments=moments,
        principal_axes=axes,
        principal_quaternion=quaternion_from_matrix(axes),
    )
