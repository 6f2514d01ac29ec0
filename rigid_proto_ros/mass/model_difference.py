# SPDX-License-Identifier: MIT
"""How one body's mass properties differ from another's in what counts for its motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from .properties import MassProperties
from .tensor import degenerate_pairs, principal_axes


@dataclass(frozen=True)
class ModelDifference:
    """principal_moments (3,): relative errors of the moments, in ascending order, each by its own. axes_turned [rad]:
    the smallest turn that brings the principal axes onto the true ones. center_of_mass (3,): offset from the true one
    [m]. tensor: max|ΔI|/max|I| of the entries.
    """

    principal_moments: np.ndarray
    axes_turned: float
    center_of_mass: np.ndarray
    tensor: float

    @property
    def center_of_mass_offset(self) -> float:
        """Distance of the centres of mass [m]."""
        return float(np.linalg.norm(self.center_of_mass))


def model_difference(properties: MassProperties, true: MassProperties) -> ModelDifference:
    """How ``properties`` differ from the true ones."""
    moments, axes = principal_axes(properties.inertia)
    true_moments, true_axes = principal_axes(true.inertia)
    return ModelDifference(
        moments / true_moments - 1.0,
        axes_turned(axes, degenerate_pairs(moments), true_axes, degenerate_pairs(true_moments)),
        properties.center_of_mass - true.center_of_mass,
        float(np.abs(properties.inertia - true.inertia).max() / np.abs(true.inertia).max()),
    )


def axes_turned(axes: np.ndarray, equal: tuple, others: np.ndarray, others_equal: tuple) -> float:
    """The smallest angle [rad] of a rotation that takes one set of principal axes (3, 3), columns, to another.

    An axis has no sign. ``equal`` says that the first and the second moment are the same, or the second and the third:
    axes within their span are arbitrary, and what turns within it is no difference.
    """
    mine, theirs = _symmetry_axis(equal), _symmetry_axis(others_equal)
    if mine is ANY or theirs is ANY:
        return 0.0
    if mine is None and theirs is None:
        return min(_angle(others @ np.diag((a, b, a * b)) @ axes.T) for a, b in product((1.0, -1.0), repeat=2))
    if mine is None or theirs is None or mine == theirs:
        # What is free about one axis leaves only that axis to be brought over.
        axis = theirs if mine is None else mine
        return _between_lines(axes[:, axis], others[:, axis])
    # Mine has to end anywhere across theirs.
    return 0.5 * math.pi - _between_lines(axes[:, mine], others[:, theirs])


ANY = -1


def _symmetry_axis(equal: tuple) -> int | None:
    """The axis about which the tensor is symmetric, None without one, ANY where all moments are the same."""
    if all(equal):
        return ANY
    return 2 if equal[0] else 0 if equal[1] else None


def _angle(R: np.ndarray) -> float:
    """Of a rotation matrix, accurate for small ones too."""
    across = np.array([R[j, i] - R[i, j] for i, j in (*pairwise(range(3)), (2, 0))])
    return math.atan2(float(np.linalg.norm(across)), float(np.trace(R)) - 1.0)


def _between_lines(a: np.ndarray, b: np.ndarray) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), abs(float(a @ b)))
