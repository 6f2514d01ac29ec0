# SPDX-License-Identifier: MIT
"""Poinsot's construction: a torque-free body's inertia ellipsoid rolls, without slipping, on the invariable plane.

In ω space, body axes, the ellipsoid ω·Iω = 2T is fixed to the body. Where it touches the plane L·ω = 2T, which is fixed
in the world, is ω itself. The point's path on the ellipsoid is the polhode, that on the plane the herpolhode. The
polhodes through the ends of the middle axis, L² = 2T·I2, are the separatrix.

Everything here is in principal axes with moments I1 ≤ I2 ≤ I3; T [J], L [kg m²/s], ω [rad/s].
"""

from __future__ import annotations

import numpy as np

POINTS = 121
"""Points of a closed curve: every 3 degrees."""

EQUAL_MOMENTS = 1e-9
"""Moments closer than this, relatively, have no separatrix between them: the body is a symmetric top."""


def semi_axes(moments: np.ndarray, energy: float) -> np.ndarray:
    """Semi-axes (3,) [rad/s] of the ellipsoid ω·Iω = 2T."""
    return np.sqrt(2.0 * energy / moments)


def polhode(moments: np.ndarray, energy: float, w: np.ndarray) -> np.ndarray:
    """The closed curve (n, 3) on the ellipsoid through ω (3,), which has the energy T.

    The curve surrounds the axis of the largest moment if L² > 2T·I2, else that of the smallest. L² − 2T·Ii is taken
    from ω directly: as a difference of L² and 2T it would cancel near the axis.
    """
    I1, I2, I3 = moments
    squares = w * w
    above_middle = I3 * (I3 - I2) * squares[2] - I1 * (I2 - I1) * squares[0]
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS)
    curve = np.empty((POINTS, 3))
    if above_middle >= 0.0:
        pole, first, second = 2, 0, 1
        radius2 = I1 * (I3 - I1) * squares[0] + I2 * (I3 - I2) * squares[1]
        weights = (I1 * (I3 - I1), I2 * (I3 - I2))
    else:
        pole, first, second = 0, 1, 2
        radius2 = I2 * (I2 - I1) * squares[1] + I3 * (I3 - I1) * squares[2]
        weights = (I2 * (I2 - I1), I3 * (I3 - I1))
    if min(weights) <= 0.0:
        # Equal moments and no spin about the third axis: ω stays where it is.
        return np.tile(w, (POINTS, 1))
    curve[:, first] = np.sqrt(radius2 / weights[0]) * np.cos(angle)
    curve[:, second] = np.sqrt(radius2 / weights[1]) * np.sin(angle)
    rest = 2.0 * energy - moments[first] * curve[:, first] ** 2 - moments[second] * curve[:, second] ** 2
    curve[:, pole] = np.copysign(np.sqrt(np.maximum(rest, 0.0) / moments[pole]), w[pole])
    return curve


def separatrix(moments: np.ndarray, energy: float) -> list[np.ndarray]:
    """The two ellipses (n, 3) that divide the polhodes; none for a symmetric top."""
    I1, I2, I3 = moments
    if I2 - I1 <= EQUAL_MOMENTS * I3 or I3 - I2 <= EQUAL_MOMENTS * I3:
        return []
    slope = np.sqrt(I3 * (I3 - I2) / (I1 * (I2 - I1)))
    reach = np.sqrt(2.0 * energy / (I1 * slope * slope + I3))
    middle = np.sqrt(2.0 * energy / I2)
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS)
    return [
        np.column_stack([side * slope * reach * np.sin(angle), middle * np.cos(angle), reach * np.sin(angle)])
        for side in (1.0, -1.0)
    ]


def plane_rotation(L: np.ndarray) -> np.ndarray:
    """Quaternion xyzw (4,) that turns z onto the direction of L (3,), the shorter way."""
    x, y, z = L / np.linalg.norm(L)
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turned = np.array([-y, x, 0.0, 1.0 + z])
    return turned / np.linalg.norm(turned)


def inverse(quaternion: np.ndarray) -> np.ndarray:
    """Of a unit quaternion xyzw (4,)."""
    return quaternion * [-1.0, -1.0, -1.0, 1.0]
