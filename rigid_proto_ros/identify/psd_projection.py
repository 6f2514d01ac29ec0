# SPDX-License-Identifier: MIT
"""Least squares among the tensors that a body can have: those whose second moments Σ have no eigenvalue below 0.

Flat bodies lie at the rim of these. So the steps are taken in the tensor itself, and only where they end outside is the
rim held to, by Σ = S S with a symmetric S, which is regular there (Burer and Monteiro, Math. Program. 95, 2003).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from .unknowns import moved_tensor, second_moments

_ROWS, _COLUMNS = np.triu_indices(3)
_UNITS = np.zeros((6, 3, 3))
_UNITS[np.arange(6), _ROWS, _COLUMNS] = _UNITS[np.arange(6), _COLUMNS, _ROWS] = 1.0


def is_possible(inertia: np.ndarray) -> bool:
    """Whether a body can have it, to rounding."""
    values = np.linalg.eigvalsh(second_moments(inertia))
    return bool(values[0] >= -1e-12 * values[2])


def possible_step(
    jacobian: np.ndarray, residuals: np.ndarray, tensor_columns: slice, inertia: np.ndarray
) -> np.ndarray:
    """The step (n,) with the least ``|jacobian step + residuals|`` that leads to a body that can exist.

    tensor_columns: where the six numbers of ``unknowns.moved_tensor`` stand in it; they change ``inertia``, which a
    body can have.
    """
    width = jacobian.shape[1]
    tensor = np.arange(width)[tensor_columns]
    order = np.concatenate([np.setdiff1d(np.arange(width), tensor), tensor])
    first = width - 6
    # The others first: whatever the tensor is, they take what they can, and the rows below tell of the tensor alone.
    left, triangle = np.linalg.qr(jacobian[:, order])
    right = -(left.T @ residuals)
    own, aim = triangle[first:, first:], right[first:]
    size = float(np.trace(inertia))
    begin = second_moments(inertia) / size
    changes = [second_moments(moved_tensor(inertia, unit)) / size - begin for unit in np.eye(6)]
    of_second = np.linalg.inv(np.array(changes)[:, _ROWS, _COLUMNS].T)

    def change(root: np.ndarray) -> np.ndarray:
        S = np.tensordot(root, _UNITS, 1)
        return of_second @ (S @ S - begin)[_ROWS, _COLUMNS]

    def slopes(root: np.ndarray) -> np.ndarray:
        S = np.tensordot(root, _UNITS, 1)
        return own @ of_second @ np.array([(unit @ S + S @ unit)[_ROWS, _COLUMNS] for unit in _UNITS]).T

    values, axes = np.linalg.eigh(begin)
    # Away from 0, where the root's slope is nothing.
    root = ((axes * np.sqrt(np.maximum(values, 1e-6 * values[2]))) @ axes.T)[_ROWS, _COLUMNS]
    found = least_squares(lambda r: own @ change(r) - aim, root, slopes, method="lm", xtol=1e-10, ftol=1e-10)
    step = np.empty(width)
    step[tensor] = change(found.x)
    others = right[:first] - triangle[:first, first:] @ step[tensor]
    step[order[:first]] = np.linalg.solve(triangle[:first, :first], others)
    return step
