# SPDX-License-Identifier: MIT
"""Moments of a solid in rational arithmetic, without rounding, for vertices as given in double precision.

Coordinates become integers in units of a power of two; sums over tetrahedra about a reference point are integers, too.
NumPy object arrays hold them in chunks, which takes some microseconds per triangle. This is a reference for the
floating-point computation, which never uses it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..base.vectors import Matrix3, Points, Triangles, Vector3

CHUNK = 4096
"""Triangles per chunk: the size of the object arrays."""


@dataclass(frozen=True)
class ExactMoments:
    """volume, centroid (3 numbers) and inertia (3 rows of 3) at unit density about it, as Fractions."""

    volume: Fraction
    centroid: tuple[Fraction, ...]
    inertia: tuple[tuple[Fraction, ...], ...]


def _as_integers(vertices: Points) -> tuple[NDArray[np.object_], int]:
    """Vertices (n, 3) as Python integers in units of 2**power, exactly."""
    mantissa, exponent = np.frexp(vertices)
    power = int(exponent[vertices != 0.0].min(initial=0)) - 53
    whole = (mantissa * 2.0**53).astype(np.int64)
    shift = np.where(vertices == 0.0, 0, exponent - 53 - power)
    flat = [int(w) << int(s) for w, s in zip(whole.ravel().tolist(), shift.ravel().tolist(), strict=True)]
    return np.array(flat, dtype=object).reshape(vertices.shape), power


def exact_solid_moments(
    vertices: Points, triangles: Triangles, scale: Iterable[float] = (1.0, 1.0, 1.0)
) -> ExactMoments:
    """Exact moments of the solid bounded by triangles (m, 3) over vertices (n, 3) float64, as if wound outward, after
    its coordinates are multiplied by ``scale`` (3 doubles, taken exactly).

    Raises ZeroDivisionError when the volume is zero.
    """
    whole, power = _as_integers(np.asarray(vertices, dtype=np.float64))
    # A reference near the vertices keeps the integers short; it cancels exactly in the sums of a closed surface.
    used = np.unique(triangles)
    middle = [sum(whole[used, k].tolist()) // len(used) for k in range(3)]
    points = whole - np.array(middle, dtype=object)
    zeroth, first, second = 0, [0] * 3, [[0] * 3 for _ in range(3)]
    for start in range(0, len(triangles), CHUNK):
        a, b, c = (points[triangles[start : start + CHUNK, k]].T for k in range(3))
        d = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        s = a + b + c
        zeroth += sum(d.tolist())
        for i in range(3):
            first[i] += sum((d * s[i]).tolist())
            for j in range(i + 1):
                second[i][j] += sum((d * (s[i] * s[j] + a[i] * a[j] + b[i] * b[j] + c[i] * c[j])).tolist())
    unit, stretch = Fraction(2) ** power, [Fraction(float(value)) for value in scale]
    volume = Fraction(zeroth, 6) * unit**3
    center = [Fraction(moment, 24) * unit**4 / volume for moment in first]
    outward = abs(stretch[0] * stretch[1] * stretch[2]) * (1 if volume > 0 else -1)
    spread = [[Fraction(0)] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i + 1):
            moment = Fraction(second[i][j], 120) * unit**5 - volume * center[i] * center[j]
            spread[i][j] = spread[j][i] = outward * stretch[i] * stretch[j] * moment
    whole_spread = spread[0][0] + spread[1][1] + spread[2][2]
    inertia = tuple(tuple((whole_spread if i == j else 0) - spread[i][j] for j in range(3)) for i in range(3))
    centroid = tuple(stretch[k] * (center[k] + middle[k] * unit) for k in range(3))
    return ExactMoments(outward * volume, centroid, inertia)


def exact_sum(solids: Sequence[ExactMoments], masses: Sequence[Fraction]) -> ExactMoments:
    """Solids with these masses as one: the sum of their volumes, and the inertia with their masses."""
    whole = sum(masses, Fraction(0))
    places = [solid.centroid for solid in solids]
    middle = [sum((m * c[k] for m, c in zip(masses, places, strict=True)), Fraction(0)) / whole for k in range(3)]
    inertia = [[Fraction(0)] * 3 for _ in range(3)]
    for solid, mass in zip(solids, masses, strict=True):
        offset = [solid.centroid[k] - middle[k] for k in range(3)]
        square = sum(x * x for x in offset)
        for i in range(3):
            for j in range(3):
                moved = (square if i == j else 0) - offset[i] * offset[j]
                inertia[i][j] += mass * (solid.inertia[i][j] / solid.volume + moved)
    volume = sum((solid.volume for solid in solids), Fraction(0))
    return ExactMoments(volume, tuple(middle), tuple(map(tuple, inertia)))


def relative_errors(
    exact: ExactMoments, volume: float, centroid: Vector3, inertia: Matrix3, diagonal: float
) -> dict[str, float]:
    """Relative errors of doubles against ``exact``: volume_error |ΔV|/V, inertia_error max|ΔI|/max|I| (unit density,
    about the centroid), center_of_mass_error the largest |Δc_k| beyond one ulp of c_k, over the box's ``diagonal``."""
    truth = exact.inertia
    largest = max(abs(value) for row in truth for value in row)
    worst = max(abs(Fraction(float(inertia[i, j])) - truth[i][j]) for i in range(3) for j in range(3))
    beyond = max(
        max(Fraction(0), abs(Fraction(float(c)) - t) - Fraction(float(np.spacing(abs(float(t))))))
        for c, t in zip(centroid, exact.centroid, strict=True)
    )
    return {
        "volume_error": float(abs(Fraction(float(volume)) - exact.volume) / exact.volume),
        "center_of_mass_error": float(beyond / Fraction(float(diagonal))),
        "inertia_error": float(worst / largest),
    }
