# SPDX-License-Identifier: MIT
"""Shapes that show an inertia tensor: the box and the ellipsoid that turn as the body does.

With principal moments I1 ≤ I2 ≤ I3 and mass m, a solid cuboid of sides² = 6 (Ij + Ik − Ii)/m and a solid ellipsoid of
semi-axes² = 5 (Ij + Ik − Ii)/(2 m) have the same mass and the same tensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PrincipalFrame:
    """moments (3,) ascending [kg m²] and axes (3, 3), columns, a proper rotation from principal to body axes."""

    moments: np.ndarray
    axes: np.ndarray

    @staticmethod
    def of(inertia: np.ndarray) -> PrincipalFrame:
        """Of a tensor (3, 3) in body axes."""
        moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
        if np.linalg.det(axes) < 0.0:
            axes = axes * [1.0, 1.0, -1.0]
        return PrincipalFrame(moments, axes)

    @property
    def second_moments(self) -> np.ndarray:
        """Twice ∫ x_i² dm (3,) [kg m²]; never negative, though a flat body's may round to below zero."""
        return np.maximum(self.moments.sum() - 2.0 * self.moments, 0.0)

    def box_sides(self, mass: float) -> np.ndarray:
        """Sides (3,) [m] along the principal axes of the solid cuboid of equal mass and inertia."""
        return np.sqrt(6.0 * self.second_moments / mass)

    def ellipsoid_semi_axes(self, mass: float) -> np.ndarray:
        """Semi-axes (3,) [m] of the solid ellipsoid of equal mass and inertia."""
        return np.sqrt(2.5 * self.second_moments / mass)


SKEWED = 0.1
"""Least product of inertia of a skewed body, against the largest difference of two moments: axes some 6° off."""


def skewed(inertia: np.ndarray) -> bool:
    """Whether the principal axes of a tensor (3, 3) are clearly others than its own axes, so that
    products of inertia tell.
    """
    products = np.abs(inertia - np.diag(np.diag(inertia))).max()
    return bool(products > SKEWED * max(np.ptp(np.linalg.eigvalsh(inertia)), 1e-300))


def bounding_box(vertices: np.ndarray, scale: np.ndarray, center_of_mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (3,) and half sizes (3,) [m, body axes from the COM] of the box along the mesh axes around the mesh."""
    scaled = vertices * scale
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    return 0.5 * (low + high) - center_of_mass, 0.5 * (high - low)
