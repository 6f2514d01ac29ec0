# SPDX-License-Identifier: MIT
"""Plotted values of one run, computed over a batch of states at once.

States are rows (n, 13) in ``simulation/observer.py``'s ``STATE_FIELDS`` order: COM position, attitude xyzw, COM
velocity (world), angular velocity (body axes).
"""

from __future__ import annotations

import numpy as np

from ..simulation.observer import BodySnapshot
from . import style
from .backend import Backend


def energies(rows: np.ndarray, body: BodySnapshot) -> np.ndarray:
    """Energies (n, 3) [J] of states (n, 13): translational, rotational, gravity's."""
    velocity, w = rows[:, 7:10], rows[:, 10:13]
    translational = 0.5 * body.mass * np.einsum("ni,ni->n", velocity, velocity)
    rotational = 0.5 * np.einsum("ni,ij,nj->n", w, body.inertia, w)
    return np.column_stack([translational, rotational, -body.mass * (rows[:, 0:3] @ body.gravity)])


def angle_to(reference: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Angle [rad] between reference (3,) and vectors (n, 3), accurate near 0 and π; 0 where either vanishes."""
    return np.arctan2(np.linalg.norm(np.cross(reference, vectors), axis=1), vectors @ reference)


class Plots:
    """Remembers the run's start, and the last moment from which nothing has acted on the body."""

    def __init__(self) -> None:
        self._momentum_at_start: np.ndarray | None = None
        self._free_from: tuple[float, np.ndarray] | None = None

    def body_changed(self) -> None:
        """Drift counts anew from the next state."""
        self._free_from = None

    def draw(
        self,
        backend: Backend,
        rows: np.ndarray,
        L: np.ndarray,
        w_principal: np.ndarray,
        body: BodySnapshot,
        disturbed: np.ndarray,
        string_energy: np.ndarray | None,
    ) -> None:
        """Plot states (n, 13) with their angular momenta (n, 3) in world axes and spins (n, 3) in principal ones.

        disturbed (n,) says at which a load acts or has acted since the state before; string_energy (n,) [J] is None as
        long as the run has had no string.
        """
        own = energies(rows, body)
        total = own.sum(axis=1) if string_energy is None else own.sum(axis=1) + string_energy
        if self._momentum_at_start is None:
            self._momentum_at_start = L[0].copy()
        shown = [own, total] if string_energy is None else [own, total, string_energy]
        backend.scalars(style.ENERGY, np.column_stack(shown))
        backend.scalars(style.DRIFT, self._drift(total, np.abs(own).sum(axis=1), L, disturbed))
        backend.scalars(style.ANGULAR_MOMENTUM, np.column_stack([L, np.linalg.norm(L, axis=1)]))
        angle = np.degrees(angle_to(self._momentum_at_start, L))
        backend.scalars(style.ANGULAR_MOMENTUM_ANGLE, angle[:, np.newaxis])
        backend.scalars(style.ANGULAR_VELOCITY_PRINCIPAL, w_principal)
        if np.any(body.gravity) or rows[:, 7:10].any():
            backend.scalars(style.POSITION, rows[:, 0:3])

    def _drift(self, total: np.ndarray, size: np.ndarray, L: np.ndarray, disturbed: np.ndarray) -> np.ndarray:
        """Relative change (n, 2) of the total energy and of L since the last disturbance; 0 while there is one."""
        drift = np.zeros((len(L), 2))
        borders = [0, *(np.flatnonzero(np.diff(disturbed)) + 1).tolist(), len(L)]
        for begin, end in zip(borders[:-1], borders[1:], strict=True):
            if disturbed[begin]:
                self._free_from = (float(total[end - 1]), L[end - 1].copy())
                continue
            if self._free_from is None:
                self._free_from = (float(total[begin]), L[begin].copy())
            energy, momentum = self._free_from
            own = slice(begin, end)
            drift[own, 0] = _relative(total[own] - energy, size[own])
            norms = np.full(end - begin, np.linalg.norm(momentum))
            drift[own, 1] = _relative(np.linalg.norm(L[own] - momentum, axis=1), norms)
        return drift


def _relative(difference: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.divide(difference, size, out=np.zeros(len(difference)), where=size > 0.0)
