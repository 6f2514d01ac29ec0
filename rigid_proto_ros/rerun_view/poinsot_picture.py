# SPDX-License-Identifier: MIT
"""Draws Poinsot's construction beside the flight; see poinsot.py for the mathematics.

Lengths are ω divided by the mean of the ellipsoid's two longer semi-axes (the geometric one), so that the picture has about the
same size for every body and spin. It is turned to have the invariable plane as floor.
"""

from __future__ import annotations

import numpy as np
import rerun as rr

from ..core.observer import BodySnapshot
from . import entities as e
from .columns import Send, Ticks, one_time, time_columns
from .derived import rotation_matrices, to_world
from .inertia_shapes import PrincipalFrame
from .poinsot import inverse, plane_rotation, polhode, semi_axes, separatrix

RATE = 100
"""[1/s, simulated] of the picture's moving parts."""

REDRAWN_PER_S = 25
"""[1/s, simulated] How often ellipsoid, curves and plane are drawn anew while a torque changes T and L."""

CHANGE = 1e-6
"""Relative change of T or L beyond which they are."""

PLANE_HALF_SIZE = 1.6
REST = 1e-12
"""[rad/s] Below this spin there is nothing to draw."""


class PoinsotPicture:
    """Follows one run."""

    def __init__(self) -> None:
        self._ticks = Ticks(RATE)
        self._redraw = Ticks(REDRAWN_PER_S)
        self._frame: PrincipalFrame | None = None
        self._drawn: tuple[float, np.ndarray] | None = None
        self._scale = 1.0

    def change_body(self, time_ns: int, wall_ns: int, body: BodySnapshot, send: Send) -> None:
        """Another tensor: another ellipsoid, in other axes."""
        self._frame = PrincipalFrame.of(np.asarray(body.inertia, dtype=float))
        self._drawn = None
        columns = rr.Transform3D.columns(mat3x3=[self._frame.axes])
        send(e.POINSOT_PRINCIPAL, one_time(time_ns, wall_ns), columns)

    def rows(self, times_ns: np.ndarray, walls: np.ndarray, rows: np.ndarray, L: np.ndarray, send: Send) -> None:
        """States (n, 13) with their angular momenta (n, 3) in world axes."""
        chosen = self._ticks.choose(times_ns)
        if not len(chosen) or self._frame is None:
            return
        times_ns, walls, rows, L = times_ns[chosen], walls[chosen], rows[chosen], L[chosen]
        w_principal = rows[:, 10:13] @ self._frame.axes
        energy = 0.5 * np.einsum("ni,i,ni->n", w_principal, self._frame.moments, w_principal)
        for k in self._changes(times_ns, energy, L):
            self._draw(int(times_ns[k]), int(walls[k]), float(energy[k]), w_principal[k], L[k], send)
        times = time_columns(times_ns, walls)
        w = self._scale * to_world(rotation_matrices(rows[:, 3:7]), rows[:, 10:13])
        send(e.POINSOT_BODY, times, rr.Transform3D.columns(quaternion=rows[:, 3:7]))
        send(e.POINSOT_OMEGA, times, rr.Arrows3D.columns(vectors=w))
        send(e.POINSOT_HERPOLHODE, times, rr.Points3D.columns(positions=w))

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

    def _draw(self, time_ns: int, wall_ns: int, energy: float, w: np.ndarray, L: np.ndarray, send: Send) -> None:
        times = one_time(time_ns, wall_ns)
        if np.linalg.norm(w) < REST:
            for entity in (e.POINSOT_ELLIPSOID, e.POINSOT_POLHODE, e.POINSOT_SEPARATRIX, e.POINSOT_PLANE):
                send(entity, times, rr.Clear.columns(is_recursive=[False]))
            send(e.POINSOT_MOMENTUM, times, rr.Clear.columns(is_recursive=[False]))
            return
        moments = self._frame.moments
        axes = semi_axes(moments, energy)
        self._scale = s = 1.0 / float(np.sqrt(axes[0] * axes[1]))
        send(e.POINSOT_ELLIPSOID, times, rr.Ellipsoids3D.columns(half_sizes=[s * axes]))
        send(e.POINSOT_POLHODE, times, rr.LineStrips3D.columns(strips=[s * polhode(moments, energy, w)]))
        curves = separatrix(moments, energy)
        if curves:
            strips = rr.LineStrips3D.columns(strips=[s * curve for curve in curves]).partition([len(curves)])
            send(e.POINSOT_SEPARATRIX, times, strips)
        momentum = float(np.linalg.norm(L))
        distance, direction = s * 2.0 * energy / momentum, L / momentum
        plane = rr.Boxes3D.columns(
            half_sizes=[[PLANE_HALF_SIZE, PLANE_HALF_SIZE, 0.002]],
            centers=[distance * direction],
            quaternions=[plane_rotation(L)],
        )
        send(e.POINSOT_PLANE, times, plane)
        send(e.POINSOT_UPRIGHT, times, rr.Transform3D.columns(quaternion=[inverse(plane_rotation(-L))]))
        send(e.POINSOT_MOMENTUM, times, rr.Arrows3D.columns(vectors=[1.35 * distance * direction]))
