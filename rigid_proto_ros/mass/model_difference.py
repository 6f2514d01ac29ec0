# SPDX-License-Identifier: MIT
"""How one body's mass properties differ from another's in what counts for its motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from .properties import MassProperties
from .tensor import degenerate_pairs, principal_axes


@dataclass(frozen=True)
class ModelDifference:
    """principal_moments (3,): relative errors of the moments, in ascending order, each by its own. axes_turned [rad]:
    the smallest turn that brings the principal axes onto the true ones. center_of_mass (3,): offset from the true one
    [m].
    """

    principal_moments: np.ndarray
    axes_turned: float
    center_of_mass: np.ndarray


def model_difference(properties: MassProperties, true: MassProperties) -> ModelDifference:
    """How ``properties`` differ from the true ones."""
    moments, axes = principal_axes(properties.inertia)
    true_moments, true_axes = principal_axes(true.inertia)
    turned = _axes_turned(axes, _symmetry_axis(moments), true_axes, _symmetry_axis(true_moments))
    return ModelDifference(moments / true_moments - 1.0, turned, properties.center_of_mass - true.center_of_mass)


ANY = -1


def _symmetry_axis(moments: np.ndarray) -> int | None:
    """The axis about which a tensor is symmetric, None without one, ANY where all moments are the same."""
    first, last = degenerate_pairs(moments)
    if first and last:
        return ANY
    return 2 if first else 0 if last else None


def _axes_turned(axes: np.ndarray, mine: int | None, others: np.ndarray, theirs: int | None) -> float:
    """The smallest angle [rad] of a rotation that takes one set of principal axes (3, 3), columns, to another.

    An axis has no sign. Those across an axis of symmetry are arbitrary, and what turns within their span is no
    difference.
    """
    if mine is ANY or theirs is ANY:
        return 0.0
    if mine is None and theirs is None:
        angles = []
        for a, b in product((1.0, -1.0), repeat=2):
            R = others @ np.diag((a, b, a * b)) @ axes.T
            across = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
            angles.append(math.atan2(float(np.linalg.norm(across)), float(np.trace(R)) - 1.0))
        return min(angles)
    one = mine if mine is not None else theirs
    other = theirs if theirs is not None else mine
    a, b = axes[:, one], others[:, other]
    between = math.atan2(float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b)))
    # Where the axes of symmetry are different ones, mine has to end anywhere across theirs.
    return between if one == other else 0.5 * math.pi - between
