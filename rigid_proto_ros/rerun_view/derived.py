# SPDX-License-Identifier: MIT
"""Energies and angular momentum of many states at once, for plots.

States are rows (n, 13) in ``simulation/observer.py``'s ``STATE_FIELDS`` order: COM position, attitude xyzw, COM
velocity (world), angular velocity (body axes).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..simulation.observer import BodySnapshot


@dataclass(frozen=True)
class Derived:
    """Per state, all float64: energies (n, 4) [J] translational, rotational, potential, total;
    angular_momentum (n, 3) [kg m²/s, world, about the COM]."""

    energies: np.ndarray
    angular_momentum: np.ndarray


def to_world(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """R (n, 3, 3) applied to body vectors (n, 3) or (3,)."""
    return np.einsum("nij,j->ni" if vectors.ndim == 1 else "nij,nj->ni", R, vectors)


def derive(rows: np.ndarray, body: BodySnapshot) -> Derived:
    """Energies and angular momentum of states (n, 13) of one body."""
    position, quaternion, velocity, w = rows[:, 0:3], rows[:, 3:7], rows[:, 7:10], rows[:, 10:13]
    L_body = np.einsum("ij,nj->ni", body.inertia, w)
    translational = 0.5 * body.mass * np.einsum("ni,ni->n", velocity, velocity)
    rotational = 0.5 * np.einsum("ni,ni->n", w, L_body)
    potential = -body.mass * np.einsum("i,ni->n", body.gravity, position)
    energies = np.column_stack(
        [translational, rotational, potential, translational + rotational + potential],
    )
    return Derived(energies, to_world(matrix_from_quaternion(quaternion), L_body))


def angle_to(reference: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Angle [rad] between reference (3,) and vectors (n, 3), accurate near 0 and π; 0 where either vanishes."""
    return np.arctan2(np.linalg.norm(np.cross(reference, vectors), axis=1), vectors @ reference)


def carried_along(row: np.ndarray, seconds: float) -> np.ndarray:
    """The state (13,) a short time after ``row``, its twist held: for pictures between two published states."""
    later = row.copy()
    later[0:3] += seconds * row[7:10]
    turn = 0.5 * seconds * row[10:13]
    angle = float(np.linalg.norm(turn))
    axis_part = turn * (np.sin(angle) / angle if angle > 0.0 else 1.0)
    x, y, z, w = row[3:7]
    a, b, c, d = *axis_part, np.cos(angle)
    later[3:7] = (
        w * a + x * d + y * c - z * b,
        w * b - x * c + y * d + z * a,
        w * c + x * b - y * a + z * d,
        w * d - x * a - y * b - z * c,
    )
    return later


class Disturbances:
    """At which states something acts on the body or has acted since the state before: drift is counted anew there.

    Follows one run; ``load_changed`` in the order of what happened, before the rows that come after it.
    """

    def __init__(self) -> None:
        self._load_changes: list[tuple[int, bool]] = []
        self._acted = self._touched = False
        self._disturbed_unseen = 0

    def load_changed(self, after_rows: int, acts: bool) -> None:
        """After so many rows of the block something acts, or nothing does."""
        self._load_changes.append((after_rows, acts))

    def rows(self, begin: int, end: int) -> np.ndarray:
        """Per row begin..end, whether a load acts there or did since the row before."""
        disturbed = np.empty(end - begin, dtype=bool)
        at = 0
        for after_rows, acts in self._load_changes:
            disturbed[at : after_rows - begin] = self._acted
            at, self._acted = after_rows - begin, acts
        disturbed[at:] = self._acted
        for first_after in [0] * self._touched + [after_rows - begin for after_rows, _ in self._load_changes]:
            disturbed[first_after : first_after + 1] = True
        # What began or ended after the last of these rows concerns the next one too.
        self._touched = (self._touched and begin == end) or any(after >= end for after, _ in self._load_changes)
        self._load_changes.clear()
        return disturbed

    def gathered(self, disturbed: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Per chosen row, whether a load acted at any row since the one chosen before."""
        so_far = np.cumsum(disturbed) + self._disturbed_unseen
        at_chosen = so_far[chosen]
        self._disturbed_unseen = int(so_far[-1] - at_chosen[-1]) if len(chosen) else int(so_far[-1])
        return np.diff(at_chosen, prepend=0) > 0
