# SPDX-License-Identifier: MIT
"""The solid's moments in rational arithmetic: no rounding at all on the vertices as the doubles they are.

Coordinates become integers over a common power of two; sums over tetrahedra to the origin are integers, too. Numpy's
object arrays carry them in chunks, some microseconds a triangle. This is the reference for the floating-point path,
never a part of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

CHUNK = 4096
"""Triangles at a time: the object arrays' size."""


@dataclass(frozen=True)
class ExactMoments:
    """volume, centroid (3 numbers) and second moments about the centroid (xx, xy, xz, yy, yz, zz) as Fractions."""

    volume: Fraction
    centroid: tuple[Fraction, Fraction, Fraction]
    second: tuple[Fraction, ...]

    def scaled(self, scale: np.ndarray) -> ExactMoments:
        """The moments after mesh coordinates are multiplied by ``scale`` (3 doubles, taken exactly), kept outward."""
        s = [Fraction(float(value)) for value in scale]
        stretch = abs(s[0] * s[1] * s[2])
        pairs = [(i, j) for i in range(3) for j in range(i, 3)]
        second = tuple(stretch * s[i] * s[j] * value for (i, j), value in zip(pairs, self.second, strict=True))
        x, y, z = self.centroid
        return ExactMoments(self.volume * stretch, (s[0] * x, s[1] * y, s[2] * z), second)

    def outward(self) -> ExactMoments:
        """The same solid wound outward."""
        if self.volume >= 0:
            return self
        return ExactMoments(-self.volume, self.centroid, tuple(-value for value in self.second))

    def inertia(self) -> list[list[Fraction]]:
        """Inertia (3, 3) about the centroid at unit density."""
        xx, xy, xz, yy, yz, zz = self.second
        return [[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]]


def _as_integers(vertices: np.ndarray) -> tuple[np.ndarray, int]:
    """Vertices (n, 3) as Python integers times 2**power, exactly."""
    mantissa, exponent = np.frexp(vertices)
    power = int(exponent[vertices != 0.0].min(initial=0)) - 53
    whole = (mantissa * 2.0**53).astype(np.int64)
    shift = np.where(vertices == 0.0, 0, exponent - 53 - power)
    flat = [int(w) << int(s) for w, s in zip(whole.ravel().tolist(), shift.ravel().tolist(), strict=True)]
    return np.array(flat, dtype=object).reshape(vertices.shape), power


def exact_solid_moments(vertices: np.ndarray, triangles: np.ndarray) -> ExactMoments:
    """Exact signed moments of the solid that triangles (m, 3) over vertices (n, 3) float64 bound.

    Raises ZeroDivisionError when the volume is zero.
    """
    whole, power = _as_integers(np.asarray(vertices, dtype=np.float64))
    # A reference amid the vertices keeps the integers short; it drops out of a closed surface's sums exactly.
    used = np.unique(triangles)
    middle = [sum(whole[used, k].tolist()) // len(used) for k in range(3)]
    points = whole - np.array(middle, dtype=object)
    raw = [0] * 10
    for start in range(0, len(triangles), CHUNK):
        part = triangles[start : start + CHUNK]
        a, b, c = (points[part[:, k]].T for k in range(3))
        d = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        s = [a[k] + b[k] + c[k] for k in range(3)]
        raw[0] += sum(d.tolist())
        slot = 4
        for i in range(3):
            raw[1 + i] += sum((d * s[i]).tolist())
            for j in range(i, 3):
                raw[slot] += sum((d * (s[i] * s[j] + a[i] * a[j] + b[i] * b[j] + c[i] * c[j])).tolist())
                slot += 1
    unit = Fraction(2) ** power
    volume = Fraction(raw[0], 6) * unit**3
    offset = [Fraction(raw[1 + k], 24) * unit**4 / volume for k in range(3)]
    second, slot = [], 4
    for i in range(3):
        for j in range(i, 3):
            second.append(Fraction(raw[slot], 120) * unit**5 - volume * offset[i] * offset[j])
            slot += 1
    centroid = tuple(offset[k] + middle[k] * unit for k in range(3))
    return ExactMoments(volume, centroid, tuple(second))


def relative_errors(
    exact: ExactMoments, volume: float, centroid: np.ndarray, inertia: np.ndarray, diagonal: float
) -> dict[str, float]:
    """How far doubles are from ``exact``: volume_error |ΔV|/V, inertia_error max|ΔI|/max|I| (unit density, about the
    centroid), center_of_mass_error the largest |Δc_k| beyond one ulp of c_k, over the box's ``diagonal``."""
    truth = exact.inertia()
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
