# SPDX-License-Identifier: MIT
"""The first attitude of a flight without any: from the directions in which gravity and known forces move it.

With Q the attitude since the first one R0, and positions p reckoned in the axes of the first one,

    p + Q c = x0 + v0 t + ½ (R0ᵀ g) t² + (R0ᵀ / m) ∬ F_world dt² + (1/m) ∬ Q F_body dt²,

which is linear in c, x0, v0, R0ᵀ g, the matrix R0ᵀ / m and 1/m. Directions that are so known in both axes give R0
(Wahba's problem, solved by Markley, J. Astronautical Sciences 36, 1988). Where only one direction is known the turn
about it is open, and nothing that was measured depends on it.
"""

from __future__ import annotations

import numpy as np

from ..base.rotation import quaternion_from_matrix
from . import rotations as rot
from .poses import Poses, integral
from .pushes import pushes_of
from .triangles import upper_triangle
from .unknowns import Values

SHOWN = 0.1
"""Directions of forces that are so much weaker than the strongest one count for nothing."""
EXACT = 1e-6
"""A direction's error is taken for no less than this: weights then stay finite."""


def first_attitude(poses: Poses, values: Values, damped: bool) -> np.ndarray:
    """xyzw (4,), of ``poses`` whose first attitude stands as no turn; no turn where nothing tells it. damped: the
    damping is looked for.
    """
    pushes = pushes_of(poses)
    if poses.positions is None:
        return np.array([0.0, 0.0, 0.0, 1.0])
    t, n = poses.seconds, len(poses.seconds)
    in_world = np.where(pushes.in_body[:, None], 0.0, pushes.impulses)
    of_world, of_body = pushes.way(t, in_world), pushes.way(t, pushes.impulses - in_world)
    # Along the directions in which the forces act, so that each of them that counts is one of three.
    _, strengths, directions = np.linalg.svd(of_world, full_matrices=False)
    of_world = of_world @ directions.T * (strengths > SHOWN * strengths[0])
    turns = rot.turned(poses.attitudes[:, None], np.eye(3)[None]).transpose(0, 2, 1)
    each = np.broadcast_to(np.eye(3), (n, 3, 3))
    parts = [-turns, each, each * t[:, None, None], each * (0.5 * t * t)[:, None, None], of_body[:, :, None]]
    # Row by row: entry (i, j) of the matrix moves component i by the world's component j.
    parts.append(np.einsum("ik,nj->nikj", np.eye(3), of_world).reshape(n, 3, 9))
    if damped or values.damping[0] > 0.0:
        parts.append(-integral(t, poses.positions - poses.positions[0])[:, :, None])
    matrix = np.concatenate(parts, axis=2).reshape(3 * n, -1)
    widths = np.linalg.norm(matrix, axis=0)
    widths[widths == 0.0] = 1.0
    scaled = matrix / widths
    triangle = upper_triangle(np.column_stack([scaled, poses.positions.ravel()]).T)
    left, sizes, axes = np.linalg.svd(triangle[:-1, :-1])
    inverse = np.where(sizes > 1e-9 * sizes[0], 1.0 / np.maximum(sizes, 1e-300), 0.0)
    found = axes.T @ (inverse * (left.T @ triangle[:-1, -1]))
    noise = float(np.linalg.norm(triangle[:, :-1] @ found - triangle[:, -1])) / np.sqrt(len(scaled))
    sds = noise * np.linalg.norm(axes.T * inverse, axis=1) / widths
    found = found / widths
    known = np.zeros((3, 3))
    for first_axes, world_axes, error in (
        _direction_of_gravity(found[9:12], sds[9:12], poses.gravity),
        _directions_of_forces(found[13:22].reshape(3, 3), sds[13:22], directions.T),
    ):
        known += first_axes @ world_axes.T / max(error, EXACT) ** 2
    if not known.any():
        return np.array([0.0, 0.0, 0.0, 1.0])
    left, _, right_axes = np.linalg.svd(known)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left) * np.linalg.det(right_axes)]) @ right_axes
    return quaternion_from_matrix(turn.T)


def _direction_of_gravity(
    found: np.ndarray, sds: np.ndarray, gravity: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """The direction in the first axes and in the world's, (3, k) each, and its error [rad]."""
    size, true = float(np.linalg.norm(found)), float(np.linalg.norm(gravity))
    if size == 0.0 or true == 0.0:
        return np.zeros((3, 0)), np.zeros((3, 0)), 1.0
    return (found / size)[:, None], (gravity / true)[:, None], float(np.linalg.norm(sds)) / size


def _directions_of_forces(
    found: np.ndarray, sds: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """The same of forces along the columns of ``directions``, whose images in the first axes are those of ``found``; a
    column of nothing is a direction without a force.
    """
    sizes = np.linalg.norm(found, axis=0)
    shown = sizes > 1e-9 * sizes.max(initial=1e-300)
    if not shown.any():
        return np.zeros((3, 0)), np.zeros((3, 0)), 1.0
    return found[:, shown] / sizes[shown], directions[:, shown], float(np.linalg.norm(sds) / sizes.max())
