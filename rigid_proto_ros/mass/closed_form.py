# SPDX-License-Identifier: MIT
"""Mass, COM and inertia in closed form from the ten moments of a mesh or from given numbers, ballast included;
compiled, for one body and for sweeps.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.vectors import FloatArray, Matrix3, Vector3
from .tensor import MAX_MOMENT_RATIO, TRIANGLE_SLACK_COMPUTED, principal_axes_kernel

Principal = tuple[Vector3, Matrix3]
"""Principal moments (3,) and axes (3, 3) of a tensor, as the kernel in mass/tensor.py gives them."""


@njit(nogil=True)
def loaded(
    mass: float, center: Vector3, second: Matrix3, stretch: Vector3, reference: Vector3, points: FloatArray
) -> tuple[float, Vector3, Matrix3, Principal]:
    """Mass, COM relative to the stretched reference, inertia (3, 3), its principal moments and axes, ballast included.

    mass [kg]; center (3,) relative to the reference and second (3, 3) about it, both stretched already; ``points`` (k,
    4): ballast in mesh coordinates; ``stretch`` and ``reference`` (3,) convert its positions. Each point mass is added
    by the parallel-axis theorem, which avoids cancellation.
    """
    total = mass
    moved = mass * center
    offset = np.empty(3)
    for p in range(points.shape[0]):
        total += points[p, 0]
        for k in range(3):
            moved[k] += points[p, 0] * stretch[k] * (points[p, 1 + k] - reference[k])
    if points.shape[0]:
        moved /= total
    else:
        moved[:] = center
    gathered = second.copy()
    for p in range(-1, points.shape[0]):
        if points.shape[0] == 0:
            break
        m = mass if p < 0 else points[p, 0]
        for k in range(3):
            place = center[k] if p < 0 else stretch[k] * (points[p, 1 + k] - reference[k])
            offset[k] = place - moved[k]
        for i in range(3):
            for j in range(3):
                gathered[i, j] += m * (offset[i] * offset[j])  # symmetric to the bit
    inertia = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            inertia[i, j] = 0.0 - gathered[i, j]  # no -0
        inertia[i, i] = gathered[(i + 1) % 3, (i + 1) % 3] + gathered[(i + 2) % 3, (i + 2) % 3]
    return total, moved, inertia, principal_axes_kernel(inertia)


@njit(nogil=True)
def spread_mass(
    mass: float,
    measure: float,
    scale: Vector3,
    left: Vector3,
    center: Vector3,
    center_low: Vector3,
    reference: Vector3,
    second: FloatArray,
    points: FloatArray,
) -> tuple[float, Vector3, Matrix3, Principal]:
    """Mass [kg] distributed over a mesh: total, COM (3,), inertia (3, 3), its principal moments and axes.

    measure, reference, center and center_low (3,), second (6,): the moments at unit density. scale (3,) of the mesh;
    left (3,): the part of it that the moments don't include yet. points (k, 4): ballast in mesh coordinates.
    """
    place, base, com, matrix = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    slot, per_measure = 0, mass / measure
    for i in range(3):
        base[i] = left[i] * reference[i] + 0.0  # no -0
        place[i] = left[i] * center[i]
        com[i] = base[i] + (place[i] + left[i] * center_low[i])
        for j in range(i, 3):
            matrix[i, j] = matrix[j, i] = second[slot] * (left[i] * left[j]) * per_measure
            slot += 1
    total, moved, inertia, principal = loaded(mass, place, matrix, scale, reference * (left / scale), points)
    if points.shape[0]:
        com = base + moved
    return total, com, inertia, principal


@njit(nogil=True)
def given_mass(
    mass: float, center: Vector3, inertia: Matrix3, scale: Vector3, points: FloatArray
) -> tuple[float, Vector3, Matrix3, Principal]:
    """The same for a given mass [kg], COM (3,) in mesh coordinates and inertia (3, 3) about it, which doesn't depend on
    ``scale``.
    """
    base = scale * center
    if points.shape[0] == 0:
        return mass, base, inertia, principal_axes_kernel(inertia)
    half_trace = 0.5 * (inertia[0, 0] + inertia[1, 1] + inertia[2, 2])
    second = -inertia
    for k in range(3):
        second[k, k] = half_trace - inertia[k, k]
    total, moved, gathered, principal = loaded(mass, np.zeros(3), second, scale, center, points)
    return total, base + moved, gathered, principal


@njit(error_model="numpy")
def is_plainly_good(principal: Vector3) -> bool:
    """Whether ``check_tensor`` has nothing to report about principal moments (3,)."""
    a, b, c = principal[0], principal[1], principal[2]  # type: float, float, float
    return a > 0.0 and c <= MAX_MOMENT_RATIO * a and c < math.inf and a + b >= c * (1.0 - TRIANGLE_SLACK_COMPUTED)
