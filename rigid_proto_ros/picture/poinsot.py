# SPDX-License-Identifier: MIT
"""Poinsot's construction: a torque-free body's inertia ellipsoid rolls, without slipping, on the invariable plane.

In ω space, body axes, the ellipsoid ω·Iω = 2T is fixed to the body. Where it touches the plane L·ω = 2T, which is fixed
in the world, is ω itself. The point's path on the ellipsoid is the polhode, that on the plane the herpolhode. The
polhodes through the ends of the middle axis, L² = 2T·I2, are the separatrix.

The curves are in principal axes with moments I1 ≤ I2 ≤ I3; T [J], L [kg m²/s], ω [rad/s]. Drawn lengths are ω divided
by the geometric mean of the ellipsoid's two longer semi-axes, so that the picture has about the same size for every
body and spin, and it is turned to have the invariable plane as floor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.rotation import matrix_from_quaternion, quaternion_from_matrix
from . import style
from .backend import Backend
from .surface import ball_mesh

POINTS = 121
"""Points of a closed curve: every 3 degrees."""

EQUAL_MOMENTS = 1e-9
"""Moments closer than this, relatively, have no separatrix between them: the body is a symmetric top."""

CHANGE = 5e-4
"""Relative change of T or L beyond which curve and plane are drawn anew; less can't be seen."""

PLANE_HALF_SIZE, PLANE_LINES = 1.6, 9
REST = 1e-12
"""[rad/s] Below this spin there is nothing to draw."""


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


class PoinsotPicture:
    """Draws the construction for one run."""

    def __init__(self) -> None:
        self._moments, self._axes = np.ones(3), np.eye(3)
        self._drawn: tuple[float, np.ndarray] | None = None

    def set_body(self, moments: np.ndarray, axes: np.ndarray) -> None:
        """Another tensor, as ``principal_axes`` has it: another ellipsoid, in other axes."""
        self._moments, self._axes = moments, axes
        self._drawn = None

    def describe(self, backend: Backend) -> None:
        """What is the same for every spin at this scale."""
        scale = self._scale(0.5)
        backend.place(style.POINSOT_PRINCIPAL, attitudes=quaternion_from_matrix(self._axes)[np.newaxis])
        backend.mesh(style.POINSOT_ELLIPSOID, ball_mesh())
        backend.place(style.POINSOT_ELLIPSOID, scale=scale * semi_axes(self._moments, 0.5))
        curves = [scale * curve for curve in separatrix(self._moments, 0.5)]
        backend.lines(style.POINSOT_SEPARATRIX, np.array([len(curves)]), curves)

    def _scale(self, energy: Any) -> Any:
        """What ω is multiplied with to be drawn at energies T (n,) or a number; 0 at rest."""
        I1, I2, _ = self._moments
        product = 2.0 * np.asarray(energy) / np.sqrt(I1 * I2)
        return np.divide(1.0, np.sqrt(product), out=np.zeros_like(product), where=product > 0.0)[()]

    def draw(
        self,
        backend: Backend,
        times_ns: np.ndarray,
        rows: np.ndarray,
        spin: np.ndarray,
        L: np.ndarray,
        redrawn: np.ndarray,
    ) -> None:
        """States (n, 13) at times (n,) with their spins and angular momenta (n, 3) in world axes. redrawn: indices of
        those at which curve and plane may be drawn anew.
        """
        w = rows[:, 10:13] @ self._axes
        energy = 0.5 * np.einsum("ni,i,ni->n", w, self._moments, w)
        changes = self._changes(redrawn, energy, L)
        if changes:
            backend.begin(times_ns[changes])
            self._draw_curves(backend, energy[changes], w[changes], L[changes])
            backend.begin(times_ns)
        tips = self._scale(energy)[:, np.newaxis] * spin
        turns = tips.any(axis=1)
        counts, ends = turns.astype(int), tips[turns]
        backend.place(style.POINSOT_BODY, attitudes=rows[:, 3:7])
        backend.arrows(style.POINSOT_OMEGA, counts, ends)
        backend.labels(style.POINSOT_OMEGA, counts, 1.08 * ends, ["ω"] * len(ends))
        backend.points(style.POINSOT_HERPOLHODE, counts, ends)

    def _changes(self, redrawn: np.ndarray, energy: np.ndarray, L: np.ndarray) -> list[int]:
        """Indices of the states at which T and L are no longer those drawn."""
        changed = []
        for k in redrawn.tolist():
            if self._drawn is not None:
                drawn_energy, drawn_L = self._drawn
                same_energy = abs(energy[k] - drawn_energy) <= CHANGE * drawn_energy
                if same_energy and np.linalg.norm(L[k] - drawn_L) <= CHANGE * np.linalg.norm(drawn_L):
                    continue
            self._drawn = (float(energy[k]), L[k].copy())
            changed.append(k)
        return changed

    def _draw_curves(self, backend: Backend, energy: np.ndarray, w: np.ndarray, L: np.ndarray) -> None:
        """Polhode, plane and L from each of these states on; a body at rest has none."""
        counts = (np.linalg.norm(w, axis=1) > REST).astype(int)
        curves, planes, reach = [], [], []
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(w), 1))
        for k in np.flatnonzero(counts):
            T, spin, momentum = energy[k], w[k], L[k]
            scale, norm = self._scale(T), float(np.linalg.norm(momentum))
            curves.append(scale * polhode(self._moments, T, spin))
            reach.append(scale * 2.0 * T / norm * momentum / norm)
            upright[k] = inverse(plane_rotation(-momentum))
            planes.extend(_plane(reach[-1]))
        reach_array = np.array(reach).reshape(-1, 3)
        backend.place(style.POINSOT_UPRIGHT, attitudes=upright)
        backend.lines(style.POINSOT_POLHODE, counts, curves)
        backend.lines(style.POINSOT_PLANE, 2 * PLANE_LINES * counts, planes)
        backend.arrows(style.POINSOT_MOMENTUM, counts, 1.35 * reach_array)
        backend.labels(style.POINSOT_MOMENTUM, counts, 1.45 * reach_array, ["L"] * len(reach))


def _plane(nearest: np.ndarray) -> list[np.ndarray]:
    """A grid of lines (2, 3) on the plane whose point nearest to the origin is this one (3,)."""
    x, y, _ = matrix_from_quaternion(plane_rotation(nearest)).T
    ends = PLANE_HALF_SIZE * np.array([-1.0, 1.0])[:, np.newaxis]
    sides = np.linspace(-PLANE_HALF_SIZE, PLANE_HALF_SIZE, PLANE_LINES)
    return [nearest + side * a + ends * b for a, b in ((x, y), (y, x)) for side in sides]
