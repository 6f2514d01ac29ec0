# SPDX-License-Identifier: MIT
"""Draws Poinsot's construction beside the flight; see poinsot.py for the mathematics.

Lengths are ω divided by the geometric mean of the ellipsoid's two longer semi-axes, so that the picture has about the
same size for every body and spin. It is turned to have the invariable plane as floor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from ..base.rotation import matrix_from_quaternion
from ..simulation.observer import BodySnapshot
from . import entities as e
from .columns import Send, Ticks, one_time, time_columns
from .derived import to_world
from .inertia_shapes import PrincipalFrame
from .poinsot import inverse, plane_rotation, polhode, semi_axes, separatrix

RATE = 100
"""[1/s, simulated] of the picture's moving parts."""

REDRAWN_PER_S = 20
"""[1/s, simulated] How often curve and plane are drawn anew while a torque changes T and L."""

CHANGE = 5e-4
"""Relative change of T or L beyond which they are; less can't be seen."""

PLANE_HALF_SIZE = 1.6
REST = 1e-12
"""[rad/s] Below this spin there is nothing to draw."""


class PoinsotPicture:
    """Follows one run."""

    def __init__(self) -> None:
        self._ticks = Ticks(RATE)
        self._redraw = Ticks(REDRAWN_PER_S)
        self._frame = PrincipalFrame.of(np.eye(3))
        self._has_body = False
        self._drawn: tuple[float, np.ndarray] | None = None

    def change_body(self, time_ns: int, wall_ns: int, body: BodySnapshot, send: Send) -> None:
        """Another tensor: another ellipsoid, in other axes. At this scale it is the same for every spin."""
        self._frame = PrincipalFrame.of(np.asarray(body.inertia, dtype=float))
        self._has_body = True
        self._drawn = None
        times = one_time(time_ns, wall_ns)
        moments = self._frame.moments
        scale = self._scale(0.5)
        send(e.POINSOT_PRINCIPAL, times, rr.Transform3D.columns(mat3x3=[self._frame.axes]))
        send(e.POINSOT_ELLIPSOID, times, rr.Ellipsoids3D.columns(half_sizes=[scale * semi_axes(moments, 0.5)]))
        curves = [scale * curve for curve in separatrix(moments, 0.5)]
        strips = rr.LineStrips3D.columns(strips=curves).partition([len(curves)])
        send(e.POINSOT_SEPARATRIX, times, strips)

    def _scale(self, energy: Any) -> Any:
        """What ω is multiplied with to be drawn at energies T (n,) or a number; 0 at rest."""
        I1, I2, _ = self._frame.moments
        product = 2.0 * np.asarray(energy) / np.sqrt(I1 * I2)
        return np.divide(1.0, np.sqrt(product), out=np.zeros_like(product), where=product > 0.0)[()]

    def rows(self, times_ns: np.ndarray, walls: np.ndarray, rows: np.ndarray, L: np.ndarray, send: Send) -> None:
        """States (n, 13) with their angular momenta (n, 3) in world axes."""
        chosen = self._ticks.choose(times_ns)
        if not len(chosen) or not self._has_body:
            return
        times_ns, walls, rows, L = times_ns[chosen], walls[chosen], rows[chosen], L[chosen]
        w = np.einsum("ij,ni->nj", self._frame.axes, rows[:, 10:13])
        energy = 0.5 * np.einsum("ni,i,ni->n", w, self._frame.moments, w)
        changes = self._changes(times_ns, energy, L)
        if changes:
            self._draw(times_ns[changes], walls[changes], energy[changes], w[changes], L[changes], send)
        tips = self._scale(energy)[:, np.newaxis] * to_world(matrix_from_quaternion(rows[:, 3:7]), rows[:, 10:13])
        times = time_columns(times_ns, walls)
        send(e.POINSOT_BODY, times, rr.Transform3D.columns(quaternion=rows[:, 3:7]))
        turns = tips.any(axis=1)
        send(e.POINSOT_OMEGA, times, rr.Arrows3D.columns(vectors=tips[turns]).partition(turns.astype(int)))
        send(e.POINSOT_HERPOLHODE, times, rr.Points3D.columns(positions=tips[turns]).partition(turns.astype(int)))

    def _changes(self, times_ns: np.ndarray, energy: np.ndarray, L: np.ndarray) -> list[int]:
        """Indices of the states at which T and L are no longer those drawn."""
        changed = []
        for k in self._redraw.choose(times_ns):
            if self._drawn is not None:
                drawn_energy, drawn_L = self._drawn
                same_energy = abs(energy[k] - drawn_energy) <= CHANGE * drawn_energy
                if same_energy and np.linalg.norm(L[k] - drawn_L) <= CHANGE * np.linalg.norm(drawn_L):
                    continue
            self._drawn = (float(energy[k]), L[k].copy())
            changed.append(int(k))
        return changed

    def _draw(
        self, times_ns: np.ndarray, walls: np.ndarray, energy: np.ndarray, w: np.ndarray, L: np.ndarray, send: Send
    ) -> None:
        """Polhode, plane and L from each of these times on; a body at rest has none."""
        turns = np.linalg.norm(w, axis=1) > REST
        counts = turns.astype(int)
        curves, distances, directions = [], [], []
        for T, spin, momentum in zip(energy[turns], w[turns], L[turns], strict=True):
            scale, norm = self._scale(T), float(np.linalg.norm(momentum))
            curves.append(scale * polhode(self._frame.moments, T, spin))
            distances.append(scale * 2.0 * T / norm)
            directions.append(momentum / norm)
        reach = np.array(distances)[:, np.newaxis] * np.array(directions).reshape(-1, 3)
        times = time_columns(times_ns, walls)
        send(e.POINSOT_POLHODE, times, rr.LineStrips3D.columns(strips=curves).partition(counts))
        plane = rr.Boxes3D.columns(
            half_sizes=np.tile([PLANE_HALF_SIZE, PLANE_HALF_SIZE, 0.002], (len(reach), 1)),
            centers=reach,
            quaternions=np.array([plane_rotation(d) for d in directions]).reshape(-1, 4),
        )
        send(e.POINSOT_PLANE, times, plane.partition(counts))
        send(e.POINSOT_MOMENTUM, times, rr.Arrows3D.columns(vectors=1.35 * reach).partition(counts))
        upright = np.array([inverse(plane_rotation(-d)) for d in directions]).reshape(-1, 4)
        send(e.POINSOT_UPRIGHT, times, rr.Transform3D.columns(quaternion=upright).partition(counts))
