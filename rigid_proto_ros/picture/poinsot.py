# SPDX-License-Identifier: MIT
"""Poinsot's construction: a torque-free body's inertia ellipsoid rolls, without slipping, on the invariable plane.

In ω space, the ellipsoid ω·Iω = 2T is fixed to the body. It touches the plane L·ω = 2T, which is fixed in the world, at
ω. The path of the contact point on the ellipsoid is the polhode, its path on the plane the herpolhode.

The polhode is in principal axes with moments I1 ≤ I2 ≤ I3; T [J], L [kg m²/s], ω [rad/s]. Drawn lengths are ω divided
by the geometric mean of the ellipsoid's two longer semi-axes, so that the picture has about the same size for every
body and spin. The picture is rotated so that the invariable plane is horizontal, below the ellipsoid.
"""

from __future__ import annotations

import numpy as np

from ..base.rotation import quaternion_from_matrix
from ..base.vectors import Attitude, FloatArray, IntArray, Matrix3, Points, Vector3
from . import style
from .backend import Backend
from .surface import ball_mesh

POINTS = 121
"""Points of a closed curve, one every 3 degrees."""

CHANGE, REDRAWN_NS = 5e-4, 50_000_000
"""Relative change of T or L beyond which curve and plane are drawn again, since a smaller one isn't visible; and
shortest period of doing so [ns].
"""

PLANE_HALF_SIZE, PLANE_LINES = 1.6, 9
REST = 1e-12
"""Angular velocity [rad/s] below which nothing is drawn."""


def polhode(moments: Vector3, energy: float, w: Vector3) -> Points:
    """The polhode through w (3,), a closed curve (n, 3); energy: T.

    The curve surrounds the axis of the largest moment if L² > 2T·I2, otherwise that of the smallest. L² − 2T·Ii is
    computed from ω directly, because the difference of L² and 2T·Ii suffers from cancellation near the axis.
    """
    I1, I2, I3 = moments
    squares = w * w
    if I3 * (I3 - I2) * squares[2] >= I1 * (I2 - I1) * squares[0]:
        pole, first, second = 2, 0, 1
    else:
        pole, first, second = 0, 1, 2
    weights = [moments[k] * abs(moments[pole] - moments[k]) for k in (first, second)]
    if min(weights) <= 0.0:
        # Two equal moments and no spin about the third axis: ω is constant.
        return np.tile(w, (POINTS, 1))
    radius2 = weights[0] * squares[first] + weights[1] * squares[second]
    angle = np.linspace(0.0, 2.0 * np.pi, POINTS)
    curve = np.empty((POINTS, 3))
    curve[:, first] = np.sqrt(radius2 / weights[0]) * np.cos(angle)
    curve[:, second] = np.sqrt(radius2 / weights[1]) * np.sin(angle)
    rest = 2.0 * energy - moments[first] * curve[:, first] ** 2 - moments[second] * curve[:, second] ** 2
    curve[:, pole] = np.copysign(np.sqrt(np.maximum(rest, 0.0) / moments[pole]), w[pole])
    return curve


def turn_down(L: Vector3) -> Attitude:
    """Quaternion xyzw (4,) of the shortest rotation of the direction of L (3,) to −z."""
    x, y, z = L / np.linalg.norm(L)
    if z > 1.0 - 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turned: Attitude = np.array([-y, x, 0.0, 1.0 - z])
    return turned / np.linalg.norm(turned)


class Poinsot:
    """Draws the construction for one run."""

    def __init__(self) -> None:
        self._moments, self._axes = np.ones(3), np.eye(3)
        self._drawn = -REDRAWN_NS, 0.0, np.zeros(3)

    def set_body(self, moments: Vector3, axes: Matrix3) -> None:
        """Set the tensor by its principal moments and axes, as returned by ``principal_axes``."""
        self._moments, self._axes = moments, axes
        self._drawn = -REDRAWN_NS, 0.0, np.zeros(3)

    def describe(self, backend: Backend) -> None:
        """Draw the ellipsoid, which doesn't depend on the spin at this scale."""
        backend.place(style.POINSOT_PRINCIPAL, attitudes=quaternion_from_matrix(self._axes)[np.newaxis])
        backend.mesh(style.POINSOT_ELLIPSOID, ball_mesh())
        I1, I2, _ = self._moments
        backend.place(style.POINSOT_ELLIPSOID, scale=(I1 * I2) ** 0.25 / np.sqrt(self._moments))

    def draw(
        self, backend: Backend, times_ns: IntArray, rows: FloatArray, spin: Points, L: Points, has_rotor: bool
    ) -> None:
        """Draw states (n, 13) at times (n,), with angular velocities and angular momenta (n, 3) in world axes. With a
        flywheel L·ω isn't 2T, and nothing is drawn.
        """
        w = rows[:, 10:13] @ self._axes
        energy = 0.5 * np.einsum("ni,i,ni->n", w, self._moments, w)
        turns = (np.linalg.norm(w, axis=1) > REST) & (not has_rotor)
        scale = np.zeros(len(w))
        scale[turns] = (self._moments[0] * self._moments[1]) ** 0.25 / np.sqrt(2.0 * energy[turns])
        changes = [k for k in range(len(w)) if self._changes(int(times_ns[k]), energy[k], L[k])]
        if changes:
            backend.begin(times_ns[changes])
            self._draw_curves(backend, scale[changes], energy[changes], w[changes], L[changes])
            backend.begin(times_ns)
        counts, ends = turns.astype(int), (scale[:, np.newaxis] * spin)[turns]
        backend.place(style.POINSOT_BODY, attitudes=rows[:, 3:7])
        backend.arrows(style.POINSOT_OMEGA, counts, ends)
        backend.labels(style.POINSOT_OMEGA, counts, 1.08 * ends, ["ω"] * len(ends))
        backend.points(style.POINSOT_HERPOLHODE, counts, ends)

    def _changes(self, time_ns: int, energy: float, L: Vector3) -> bool:
        """Whether T or L differ from those drawn last, and REDRAWN_NS has passed."""
        drawn_ns, drawn_energy, drawn_L = self._drawn
        same = abs(energy - drawn_energy) <= CHANGE * drawn_energy
        same = same and np.linalg.norm(L - drawn_L) <= CHANGE * np.linalg.norm(drawn_L)
        if same or time_ns < drawn_ns + REDRAWN_NS:
            return False
        self._drawn = time_ns, float(energy), L.copy()
        return True

    def _draw_curves(self, backend: Backend, scale: FloatArray, energy: FloatArray, w: Points, L: Points) -> None:
        """Draw polhode, plane and L from each of these states on; nothing for a body at rest."""
        turns = scale > 0.0
        counts = turns.astype(int)
        curves, planes, ends = [], [], []
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(w), 1))
        sides = np.linspace(-PLANE_HALF_SIZE, PLANE_HALF_SIZE, PLANE_LINES)
        for k in np.flatnonzero(turns):
            curves.append(scale[k] * polhode(self._moments, energy[k], w[k]))
            upright[k] = turn_down(L[k])
            depth = -scale[k] * 2.0 * energy[k] / float(np.linalg.norm(L[k]))
            ends.append([0.0, 0.0, depth])
            for side in sides:
                planes.append(np.array([[side, sides[0], depth], [side, sides[-1], depth]]))
                planes.append(np.array([[sides[0], side, depth], [sides[-1], side, depth]]))
        backend.place(style.POINSOT_UPRIGHT, attitudes=upright)
        backend.lines(style.POINSOT_POLHODE, counts, curves)
        backend.lines(style.POINSOT_PLANE, 2 * PLANE_LINES * counts, planes)
        arrows = np.array(ends).reshape(-1, 3)
        backend.arrows(style.POINSOT_MOMENTUM, counts, 1.35 * arrows)
        backend.labels(style.POINSOT_MOMENTUM, counts, 1.45 * arrows, ["L"] * len(arrows))
