# SPDX-License-Identifier: MIT
"""Mass, COM and inertia in closed form from the moments of a mesh or from given numbers, ballast included;
compiled, for one body and for sweeps.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import exported, local_matrix, local_numbers, njit
from ..base.vectors import FloatArray, Matrix3, Vector3
from .moments import MOMENTS
from .tensor import MAX_MOMENT_RATIO, TRIANGLE_SLACK_COMPUTED, principal_axes_kernel
from .walls import LIMIT, RAYS, WALLS


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


@njit(error_model="numpy", allocates=False)
def walls_error(solid: np.record, walls: np.record, thickness: float, infill: float) -> float:
    """The model's error, relative to mass or tensor, whichever is larger: the next term in the thickness, and what
    opposite walls share; thickness in units of the mesh as stretched.
    """
    rest, stretch = 1.0 - infill, walls.stretch[1] * walls.stretch[2]
    volume, t, squares = solid.measure * stretch, thickness, 0.0
    area, twice, trace = walls.surface.measure, 0.0, 0.0
    for k in range(3):
        slot = 3 if k == 1 else 5 if k == 2 else 0
        squares += solid.second[slot] * stretch * (walls.stretch[k] * walls.stretch[k])
        trace += walls.surface.second[slot]
    for k in range(RAYS):
        if walls.depth[k] < 2.0 * t:
            twice += (1.0 - walls.depth[k] / (2.0 * t)) / RAYS
    measure, second = infill * volume + rest * t * area, infill * squares + rest * t * trace
    of_mass = rest * (t * t * abs(walls.edges) + t * area * twice) / measure
    of_tensor = rest * (t * t * abs(3.0 * volume + walls.edges_second) + t * trace * twice) / second
    error: float = of_mass if of_mass > of_tensor else of_tensor
    return error


@njit(error_model="numpy", allocates=False)
def thickest_walls(solid: np.record, walls: np.record, infill: float) -> float:
    """The largest thickness whose error is within LIMIT, in units of the mesh as stretched."""
    low, high = 0.0, solid.measure * walls.stretch[1] * walls.stretch[2] / walls.surface.measure
    for _ in range(60):
        middle = 0.5 * (low + high)
        if walls_error(solid, walls, middle, infill) <= LIMIT:
            low = middle
        else:
            high = middle
    return low


@njit(error_model="numpy", allocates=False)
def mix_walls(
    solid: np.record,
    walls: np.record,
    thickness: float,
    infill: float,
    reference: Vector3,
    center: Vector3,
    second: FloatArray,
) -> float:
    """Fill reference (3,), centre (3,) relative to it, and second moments (6,) about that of walls of unit density and
    what is within; returns their measure. All in units of the mesh as stretched, as is ``thickness``.
    """
    offset, stretch = local_numbers(3), walls.stretch[1] * walls.stretch[2]
    of_walls = (1.0 - infill) * thickness
    inner, outer = infill * solid.measure * stretch, of_walls * walls.surface.measure
    measure: float = inner + outer
    for k in range(3):
        s = walls.stretch[k]
        reference[k] = s * solid.reference[k]
        own = s * (solid.center[k] + solid.center_low[k])
        of_surface = walls.surface.center[k] + walls.surface.center_low[k]
        offset[k] = (walls.surface.reference[k] - reference[k]) + (of_surface - own)
        center[k] = own + outer / measure * offset[k]
    slot = 0
    for i in range(3):
        for j in range(i, 3):
            own = infill * solid.second[slot] * stretch * (walls.stretch[i] * walls.stretch[j])
            apart = inner * (outer / measure) * (offset[i] * offset[j])
            second[slot] = own + of_walls * walls.surface.second[slot] + apart
            slot += 1
    return measure


@exported(MOMENTS, WALLS, "f8", "f8", "f8[:]", "f8[:]", "f8[:]", returns="f8 f8 f8")
def printed_moments(
    solid: np.record,
    walls: np.record,
    thickness: float,
    infill: float,
    reference: Vector3,
    center: Vector3,
    second: FloatArray,
) -> tuple[float, float, float]:
    """The measure, see ``mix_walls``, the error, and the largest thickness that is taken."""
    measure = mix_walls(solid, walls, thickness, infill, reference, center, second)
    return measure, walls_error(solid, walls, thickness, infill), thickest_walls(solid, walls, infill)


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
    per_measure, center = mass / unit.measure, placed.center
    second, low = unit.second, placed.center_low
    return spread_over(
        mass,
        per_measure,
        second,
        placed.reference,
        center,
        low,
        at_solid,
        scale,
        left,
        points,
        com,
        inertia,
        moments,
        axes,
    )


@njit(error_model="numpy", allocates=False)
def spread_over(
    mass: float,
    per_measure: float,
    unit_second: FloatArray,
    placed: Vector3,
    center: Vector3,
    center_low: Vector3,
    at_solid: bool,
    scale: Vector3,
    left: Vector3,
    points: FloatArray,
    com: Vector3,
    inertia: Matrix3,
    moments: Vector3,
    axes: Matrix3,
) -> float:
    """The same with the numbers of a record: second moments (6,), reference, centre and the rest of it (3,)."""
    place, base, reference, second = local_numbers(3), local_numbers(3), local_numbers(3), local_matrix(3, 3)
    low, slot = local_numbers(3), 0
    for i in range(3):
        stretch = scale[i] / left[i] if at_solid else 1.0
        at = stretch * placed[i]
        reference[i] = at * (left[i] / scale[i])
        base[i] = left[i] * at + 0.0  # no -0
        place[i] = left[i] * (stretch * center[i])
        low[i] = stretch * center_low[i]
        for j in range(i, 3):
            second[i, j] = second[j, i] = unit_second[slot] * (left[i] * left[j]) * per_measure
            slot += 1
    total = _loaded(mass, place, second, scale, reference, points, com, inertia)
    for i in range(3):
        with_rest = base[i] + (place[i] + left[i] * low[i])
        com[i] = base[i] + com[i] if points.shape[0] else with_rest
    principal_axes_kernel(inertia, moments, axes)
    return total


@njit(error_model="numpy", allocates=False)
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
