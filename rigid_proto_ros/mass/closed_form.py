# SPDX-License-Identifier: MIT
"""Mass, COM and inertia in closed form from the ten moments of a mesh or from given numbers, ballast included;
compiled, for one body and for sweeps.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import exported, local_matrix, local_numbers, njit
from ..base.vectors import FloatArray, Matrix3, Vector3
from .moments import MOMENTS
from .tensor import MAX_MOMENT_RATIO, TRIANGLE_SLACK_COMPUTED, principal_axes_kernel


@njit(error_model="numpy", allocates=False)
def _as_inertia(second: Matrix3, inertia: Matrix3) -> None:
    """Fill the inertia (3, 3) of second moments ∫ x xᵀ (3, 3)."""
    for i in range(3):
        for j in range(3):
            inertia[i, j] = 0.0 - second[i, j]  # no -0
        inertia[i, i] = second[(i + 1) % 3, (i + 1) % 3] + second[(i + 2) % 3, (i + 2) % 3]


@njit(error_model="numpy", allocates=False)
def _loaded(
    mass: float,
    center: Vector3,
    second: Matrix3,
    stretch: Vector3,
    reference: Vector3,
    points: FloatArray,
    moved: Vector3,
    inertia: Matrix3,
) -> float:
    """Total mass [kg], ballast included; fills the COM ``moved`` (3,) relative to the stretched reference, and the
    inertia (3, 3).

    mass [kg]; center (3,) relative to the reference and second (3, 3) about it, both stretched already; ``points`` (k,
    4): ballast in mesh coordinates; ``stretch`` and ``reference`` (3,) convert its positions. Each point mass is added
    by the parallel-axis theorem, which avoids cancellation.
    """
    count, total = points.shape[0], mass
    gathered, offset = local_matrix(3, 3), local_numbers(3)
    for k in range(3):
        moved[k] = mass * center[k] if count else center[k]
        for j in range(3):
            gathered[k, j] = second[k, j]
    for p in range(count):
        total += points[p, 0]
        for k in range(3):
            moved[k] += points[p, 0] * stretch[k] * (points[p, 1 + k] - reference[k])
    if count:
        for k in range(3):
            moved[k] /= total
        for p in range(-1, count):
            m = mass if p < 0 else points[p, 0]
            for k in range(3):
                place = center[k] if p < 0 else stretch[k] * (points[p, 1 + k] - reference[k])
                offset[k] = place - moved[k]
            for i in range(3):
                for j in range(3):
                    gathered[i, j] += m * (offset[i] * offset[j])  # symmetric to the bit
    _as_inertia(gathered, inertia)
    return total


@exported(
    "f8", MOMENTS, MOMENTS, "b1", "f8[:]", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", returns="f8"
)
def spread_mass(
    mass: float,
    unit: np.record,
    placed: np.record,
    at_solid: bool,
    scale: Vector3,
    left: Vector3,
    points: FloatArray,
    com: Vector3,
    inertia: Matrix3,
    moments: Vector3,
    axes: Matrix3,
) -> float:
    """Total mass [kg] of a mass [kg] distributed over a mesh, and ballast; fills COM (3,), inertia (3, 3), its
    principal moments (3,) and axes (3, 3).

    unit: MOMENTS at unit density; placed: MOMENTS whose centre is taken: ``unit`` itself or, ``at_solid``, those of the
    solid at no scale. scale (3,) of the mesh; left (3,): the part of it that ``unit`` doesn't include yet. points (k,
    4): ballast, masses [kg] and mesh coordinates.
    """
    place, base, reference, second = local_numbers(3), local_numbers(3), local_numbers(3), local_matrix(3, 3)
    low = local_numbers(3)
    slot, per_measure = 0, mass / unit.measure
    for i in range(3):
        stretch = scale[i] / left[i] if at_solid else 1.0
        at = stretch * placed.reference[i]
        reference[i] = at * (left[i] / scale[i])
        base[i] = left[i] * at + 0.0  # no -0
        place[i] = left[i] * (stretch * placed.center[i])
        low[i] = stretch * placed.center_low[i]
        for j in range(i, 3):
            second[i, j] = second[j, i] = unit.second[slot] * (left[i] * left[j]) * per_measure
            slot += 1
    total = _loaded(mass, place, second, scale, reference, points, com, inertia)
    for i in range(3):
        with_rest = base[i] + (place[i] + left[i] * low[i])
        com[i] = base[i] + com[i] if points.shape[0] else with_rest
    principal_axes_kernel(inertia, moments, axes)
    return total


@exported("f8", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", "f8[:]", "f8[:,:]", returns="f8")
def given_mass(
    mass: float,
    center: Vector3,
    given: Matrix3,
    scale: Vector3,
    points: FloatArray,
    com: Vector3,
    inertia: Matrix3,
    moments: Vector3,
    axes: Matrix3,
) -> float:
    """The same for a given mass [kg], COM ``center`` (3,) in mesh coordinates and inertia ``given`` (3, 3) about it,
    which doesn't depend on ``scale``.
    """
    total, zero, second = mass, local_numbers(3), local_matrix(3, 3)
    half_trace = 0.5 * (given[0, 0] + given[1, 1] + given[2, 2])
    for i in range(3):
        zero[i] = 0.0
        for j in range(3):
            inertia[i, j], second[i, j] = given[i, j], -given[i, j]
        second[i, i] = half_trace - given[i, i]
    if points.shape[0]:
        total = _loaded(mass, zero, second, scale, center, points, com, inertia)
    for k in range(3):
        com[k] = scale[k] * center[k] + com[k] if points.shape[0] else scale[k] * center[k]
    principal_axes_kernel(inertia, moments, axes)
    return total


@exported("f8[:]", returns="b1")
def is_plainly_good(moments: Vector3) -> bool:
    """Whether ``check_tensor`` has nothing to report about principal moments (3,)."""
    a, b, c = moments[0], moments[1], moments[2]  # type: float, float, float
    return a > 0.0 and c <= MAX_MOMENT_RATIO * a and c < math.inf and a + b >= c * (1.0 - TRIANGLE_SLACK_COMPUTED)
