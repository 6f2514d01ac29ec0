# SPDX-License-Identifier: MIT
"""Ten numbers of a mesh: measure, first and second moments at unit density, for each way to spread mass over it.

All models but the last are sums over triangles about a reference point near the bounding box's centre, chosen so that
subtracting it from a vertex never rounds. Far from the origin a mesh is therefore as exact as at the origin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from ..base.exact_arithmetic import pair_add, pair_divide, pair_multiply
from .moments_solid import blocked_sums, compensated_sums

SMALL_MESH = 1024
"""Up to this many triangles the compensated sums cost well under a millisecond, so they are always taken."""
ROUNDING_LIMIT = 5e-14
"""Above this estimated relative rounding of the volume the compensated sums take over; typical errors are 10 times
smaller than the estimate on meshes of more than SMALL_MESH triangles."""
_UNIT_ROUNDOFF = 2.0**-53

_Bounds = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Moments:
    """Mass distribution at unit density; lengths in mesh units.

    measure: volume, area or number of points. reference (3,): a point near the bounding box's centre. center (3,):
    centroid minus reference; center_low (3,): what a double couldn't hold of it. second (6,): ∫ x xᵀ about the
    centroid in the order xx, xy, xz, yy, yz, zz. path: "blocked" or "compensated" sums, or "closed form".
    """

    measure: float
    reference: np.ndarray
    center: np.ndarray
    center_low: np.ndarray
    second: np.ndarray
    path: str

    @property
    def centroid(self) -> np.ndarray:
        """Centroid (3,) in mesh coordinates, rounded once."""
        return self.reference + self.center

    def as_dict(self) -> dict:
        """The moments as a JSON object that ``from_dict`` reads back to the last bit."""
        arrays = {k: getattr(self, k).tolist() for k in ("reference", "center", "center_low", "second")}
        return {"measure": self.measure, "path": self.path, **arrays}

    @classmethod
    def from_dict(cls, value: dict) -> Moments:
        """The moments of such a JSON object; raises KeyError, TypeError or ValueError when it is none."""
        arrays = {k: np.array(value[k], dtype=np.float64) for k in ("reference", "center", "center_low", "second")}
        if arrays["second"].shape != (6,) or any(arrays[k].shape != (3,) for k in arrays if k != "second"):
            raise ValueError("moments of the wrong length")
        return cls(measure=float(value["measure"]), path=str(value["path"]), **arrays)


# Without NaN in mind a minimum vectorises; the sum of v·0 in the other function is what finds NaN and infinities.
@njit(cache=True, nogil=True, fastmath={"nnan", "nsz", "reassoc"})
def _bounds_of_finite(points: np.ndarray, first: int, last: int, bounds: _Bounds) -> _Bounds:
    x0, y0, z0, x1, y1, z1 = bounds
    for i in range(first, last):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        x0, y0, z0 = min(x0, x), min(y0, y), min(z0, z)
        x1, y1, z1 = max(x1, x), max(y1, y), max(z1, z)
    return x0, y0, z0, x1, y1, z1


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _zero_if_finite(points: np.ndarray, first: int, last: int) -> float:
    total = 0.0
    for i in range(first, last):
        total += points[i, 0] * 0.0 + points[i, 1] * 0.0 + points[i, 2] * 0.0
    return total


@njit(cache=True, nogil=True)
def _bounds(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Lower and upper corner (3,) and whether all coordinates are finite; the corners mean nothing otherwise."""
    bounds = (np.inf, np.inf, np.inf, -np.inf, -np.inf, -np.inf)
    zero = 0.0
    for first in range(0, points.shape[0], 512):  # both passes over a part while it is in the cache
        last = min(first + 512, points.shape[0])
        bounds = _bounds_of_finite(points, first, last, bounds)
        zero += _zero_if_finite(points, first, last)
    return np.array(bounds[:3]), np.array(bounds[3:]), zero == 0.0


def as_arrays(vertices: np.ndarray, triangles: np.ndarray, *, check: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) float64 and triangles (m, 3) int64, contiguous; raises MeshError for what is no mesh."""
    vertices = np.ascontiguousarray(vertices, dtype=np.float64)
    triangles = np.ascontiguousarray(triangles, dtype=np.int64)
    if triangles.shape[0] == 0 or vertices.shape[0] == 0:
        raise MeshError("mesh", "there are no faces; a surface has at least one triangle")
    if check and (int(triangles.min()) < 0 or int(triangles.max()) >= vertices.shape[0]):
        raise _out_of_range(vertices)
    return vertices, triangles


def _out_of_range(vertices: np.ndarray) -> MeshError:
    return MeshError("mesh", f"a face uses a vertex outside 0 to {vertices.shape[0] - 1}")


@njit(cache=True, nogil=True)
def _reference(lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, float, float]:
    """As ``exact_reference``: (reference (3,), factor, size); size 0 when the box is a point."""
    reference = np.zeros(3)
    size = 0.0
    extent = 0.0
    for k in range(3):
        middle = 0.5 * lower[k] + 0.5 * upper[k]
        half = 0.5 * upper[k] - 0.5 * lower[k]
        if half <= 0.25 * abs(middle):
            reference[k] = middle
        extent = max(extent, half)
        size = max(size, abs(lower[k] - reference[k]), abs(upper[k] - reference[k]))
    if not extent > 0.0:
        return reference, 1.0, 0.0
    return reference, math.ldexp(1.0, -math.frexp(size)[1]), size


def exact_reference(vertices: np.ndarray) -> tuple[np.ndarray, float, float]:
    """A point near the bounding box's centre from which no vertex differs by more than a double holds exactly.

    Per axis: the centre c if the box's half extent is at most |c|/4, since v − c is then exact (Sterbenz), otherwise
    0. Returns (reference (3,), power of two that brings the largest |v − reference| to about 1, that largest).
    Raises MeshError for coordinates that are not finite, or all equal.
    """
    lower, upper, finite = _bounds(vertices)
    if not finite:
        raise MeshError("mesh", "a vertex coordinate is not finite")
    reference, factor, size = _reference(lower, upper)
    if size == 0.0:
        raise MeshError("mesh", "all vertices lie in one point")
    return reference, factor, size


@njit(cache=True, nogil=True)
def _central(
    sums: np.ndarray,
    low: np.ndarray,
    factor: float,
    measure_divisor: float,
    first_divisor: float,
    second_divisor: float,
) -> np.ndarray:
    """Measure, centroid from the reference with its low part, and second moments about it, from raw sums: (13,).

    The subtraction that cancels is done in pair arithmetic. A measure of 0 leaves the rest undefined.
    """
    out = np.zeros(13)
    volume, volume_low = pair_divide(sums[0], low[0], measure_divisor, 0.0)
    if volume == 0.0:
        return out
    inverse = 1.0 / factor
    cubed = inverse * inverse * inverse
    out[0] = volume * cubed
    first = np.empty((3, 2))
    center = np.empty((3, 2))
    for k in range(3):
        first[k, 0], first[k, 1] = pair_divide(sums[1 + k], low[1 + k], first_divisor, 0.0)
        center[k, 0], center[k, 1] = pair_divide(first[k, 0], first[k, 1], volume, volume_low)
        out[1 + k] = center[k, 0] * inverse
        out[4 + k] = center[k, 1] * inverse
    slot = 0
    for i in range(3):
        for j in range(i, 3):
            raw, raw_low = pair_divide(sums[4 + slot], low[4 + slot], second_divisor, 0.0)
            moved, moved_low = pair_multiply(first[i, 0], first[i, 1], center[j, 0], center[j, 1])
            out[7 + slot] = pair_add(raw, raw_low, -moved, -moved_low)[0] * cubed * inverse * inverse
            slot += 1
    return out


def central_moments(
    sums: np.ndarray,
    low: np.ndarray,
    reference: np.ndarray,
    factor: float,
    divisors: tuple[float, float, float],
    path: str,
) -> Moments:
    """Moments about the centroid from raw sums of 1, x and x xᵀ, taken as (v − reference)·factor, each to be divided by
    its divisor. Raises MeshError when the measure is zero."""
    return _moments(_central(sums, low, factor, *divisors), reference, path)


def _moments(out: np.ndarray, reference: np.ndarray, path: str) -> Moments:
    if out[0] == 0.0:
        raise MeshError("mesh", "the surface encloses no volume")
    return Moments(float(out[0]), reference, out[1:4], out[4:7], out[7:], path)


_DONE, _NOT_FINITE, _ONE_POINT, _NO_SUCH_VERTEX = 0, 1, 2, 3


@njit(cache=True, nogil=True)
def _is_good(total: np.ndarray, factor: float, size: float) -> bool:
    """Whether the blocked sums' volume is within ROUNDING_LIMIT by the estimate ε·size·Σ|edge|²/V."""
    return _UNIT_ROUNDOFF * (size * factor) * 0.5 * total[10] <= ROUNDING_LIMIT * abs(total[0])


@njit(cache=True, nogil=True)
def _prepared(vertices: np.ndarray) -> tuple[int, np.ndarray, float, float]:
    """(status, reference (3,), factor, size) of the vertices."""
    lower, upper, finite = _bounds(vertices)
    reference, factor, size = _reference(lower, upper)
    status = _NOT_FINITE if not finite else (_ONE_POINT if size == 0.0 else _DONE)
    return status, reference, factor, size


@njit(cache=True, nogil=True)
def _solid(
    vertices: np.ndarray, triangles: np.ndarray, try_blocked: bool, only_blocked: bool
) -> tuple[int, bool, np.ndarray, np.ndarray]:
    """Returns (status, whether the compensated sums were taken, reference (3,), numbers (13,) as ``_central``)."""
    status, reference, factor, size = _prepared(vertices)
    if status != _DONE:
        return status, False, reference, np.zeros(13)
    if try_blocked:
        total, low = blocked_sums(vertices, triangles, reference, factor)
        if total[10] < 0.0:
            return _NO_SUCH_VERTEX, False, reference, np.zeros(13)
        if only_blocked or _is_good(total, factor, size):
            return _DONE, False, reference, _central(total, low, factor, 6.0, 24.0, 120.0)
    return _compensated(vertices, triangles, reference, factor)


@njit(cache=True, nogil=True)
def _compensated(
    vertices: np.ndarray, triangles: np.ndarray, reference: np.ndarray, factor: float
) -> tuple[int, bool, np.ndarray, np.ndarray]:
    sums, low, there = compensated_sums(vertices, triangles, reference, factor)
    if not there:
        return _NO_SUCH_VERTEX, True, reference, np.zeros(13)
    return _DONE, True, reference, _central(sums, low, factor, 6.0, 24.0, 120.0)


def solid_moments(vertices: np.ndarray, triangles: np.ndarray, *, path: str = "auto") -> Moments:
    """Moments of the solid that ``triangles`` (m, 3) over ``vertices`` (n, 3) bound, exact to about 1e-14.

    Signed: a surface wound inward gives a negative volume and negative second moments. One pass in plain doubles;
    where the estimated rounding ε·size·Σ|edge|²/V is too large (thin bodies, few triangles) a second path in pair
    arithmetic takes over. ``path`` "blocked" or "compensated" asks for one of them. Source: ``moments_solid``.
    Raises MeshError for an empty or non-finite mesh, a vertex number out of range, or zero volume.
    """
    vertices, triangles = as_arrays(vertices, triangles, check=False)
    try_blocked = path == "blocked" or (path == "auto" and triangles.shape[0] > SMALL_MESH)
    status, compensated, reference, numbers = _solid(vertices, triangles, try_blocked, path == "blocked")
    if status == _NOT_FINITE:
        raise MeshError("mesh", "a vertex coordinate is not finite")
    if status == _ONE_POINT:
        raise MeshError("mesh", "all vertices lie in one point")
    if status == _NO_SUCH_VERTEX:
        raise _out_of_range(vertices)
    return _moments(numbers, reference, "compensated" if compensated else "blocked")


def referenced_vertices(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The vertices (k, 3) that at least one triangle uses, in the file's order."""
    used = np.zeros(vertices.shape[0], dtype=bool)
    used[triangles.ravel()] = True
    return vertices if used.all() else vertices[used]


@njit(cache=True, nogil=True)
def _point_sums(points: np.ndarray, reference: np.ndarray, factor: float) -> tuple[np.ndarray, np.ndarray]:
    total = np.zeros(10)
    low = np.zeros(10)
    for i in range(points.shape[0]):
        x = (
            (points[i, 0] - reference[0]) * factor,
            (points[i, 1] - reference[1]) * factor,
            (points[i, 2] - reference[2]) * factor,
        )
        total[0] += 1.0
        slot = 4
        for row in range(3):
            total[1 + row], low[1 + row] = pair_add(total[1 + row], low[1 + row], x[row], 0.0)
            for column in range(row, 3):
                total[slot], low[slot] = pair_add(total[slot], low[slot], x[row] * x[column], 0.0)
                slot += 1
    return total, low


def point_moments(vertices: np.ndarray, triangles: np.ndarray) -> Moments:
    """Equal point masses at the referenced vertices, the measure being their number (the 2019 paper's eq. 7)."""
    vertices, triangles = as_arrays(vertices, triangles)
    points = referenced_vertices(vertices, triangles)
    reference, factor, _ = exact_reference(points)
    sums, low = _point_sums(points, reference, factor)
    moments = central_moments(sums, low, reference, factor, (1.0, 1.0, 1.0), "closed form")
    return Moments(
        float(points.shape[0]),
        reference,
        moments.center,
        moments.center_low,
        moments.second * (factor * factor * factor),
        "closed form",
    )


def box_moments(vertices: np.ndarray, triangles: np.ndarray) -> Moments:
    """The bounding box of the referenced vertices as a solid cuboid (the 2019 paper's eq. 8, centred on the box)."""
    vertices, triangles = as_arrays(vertices, triangles)
    lower, upper, finite = _bounds(referenced_vertices(vertices, triangles))
    if not finite:
        raise MeshError("mesh", "a vertex coordinate is not finite")
    side = upper - lower
    volume = float(side[0] * side[1] * side[2])
    middle = 0.5 * lower + 0.5 * upper
    second = np.zeros(6)
    # A flat box has no volume but a distribution all the same: a unit measure then stands for its mass.
    measure = volume if volume > 0.0 else 1.0
    second[[0, 3, 5]] = measure * (side * side) / 12.0
    return Moments(measure, middle, np.zeros(3), np.zeros(3), second, "closed form")
