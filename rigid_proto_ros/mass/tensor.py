# SPDX-License-Identifier: MIT
"""Inertia tensors: principal moments and axes, and which tensors a rigid body can have."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base.compilation import njit
from ..base.errors import TensorError
from ..base.vectors import Matrix3, Vector3

TRIANGLE_SLACK_GIVEN = 1e-5
"""Fraction of C by which given tensors may violate A + B ≥ C: published ones are rounded to five or six digits."""
TRIANGLE_SLACK_COMPUTED = 1e-14
"""The same for tensors computed here, which satisfy A + B ≥ C to rounding."""
MAX_MOMENT_RATIO = 1e12
"""Largest C/A: beyond it the body is a line to double precision, and its rotation about that line is undefined."""
SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Names of the entries of a tensor, in the order in which they are given everywhere."""
_EQUAL_COMPONENT = 1e-9  # components closer than this count as equal; the first one then decides the column's sign


@njit()
def _rotate(a: Matrix3, v: Matrix3, p: int, q: int) -> bool:
    """Jacobi rotation of a (3, 3) to a[p, q] = 0, and of v (3, 3), in place; False if it is below rounding already."""
    g = a[p, q]
    if abs(g) <= 1e-17 * math.sqrt(abs(a[p, p]) * abs(a[q, q])) or g == 0.0:
        return False
    theta = (a[q, q] - a[p, p]) / (2.0 * g)
    t = 1.0 / (abs(theta) + math.sqrt(1.0 + theta * theta))
    if theta < 0.0:
        t = -t
    c = 1.0 / math.sqrt(1.0 + t * t)
    s = t * c
    a[p, p] -= t * g
    a[q, q] += t * g
    a[p, q] = 0.0
    a[q, p] = 0.0
    r = 3 - p - q
    arp, arq = a[r, p], a[r, q]
    a[r, p] = c * arp - s * arq
    a[p, r] = a[r, p]
    a[r, q] = s * arp + c * arq
    a[q, r] = a[r, q]
    for k in range(3):
        vkp, vkq = v[k, p], v[k, q]
        v[k, p] = c * vkp - s * vkq
        v[k, q] = s * vkp + c * vkq
    return True


@njit()
def _sign_columns(axes: Matrix3) -> None:
    """Fix the signs of axes (3, 3), columns, in place: largest component of the first two positive, right-handed."""
    for column in range(2):
        largest = max(abs(axes[0, column]), abs(axes[1, column]), abs(axes[2, column]))
        k = 0
        while abs(axes[k, column]) < (1.0 - _EQUAL_COMPONENT) * largest:
            k += 1
        if axes[k, column] < 0.0:
            for row in range(3):
                axes[row, column] = -axes[row, column]
    determinant = (
        axes[0, 2] * (axes[1, 0] * axes[2, 1] - axes[2, 0] * axes[1, 1])
        + axes[1, 2] * (axes[2, 0] * axes[0, 1] - axes[0, 0] * axes[2, 1])
        + axes[2, 2] * (axes[0, 0] * axes[1, 1] - axes[1, 0] * axes[0, 1])
    )
    if determinant < 0.0:
        for row in range(3):
            axes[row, 2] = -axes[row, 2]


@njit()
def principal_axes_kernel(inertia: Matrix3) -> tuple[Vector3, Matrix3]:
    """Principal moments (3,) ascending and axes (3, 3), columns, of a symmetric ``inertia`` (3, 3).

    Cyclic Jacobi rotations until every off-diagonal element is below the rounding of its two diagonal elements: for a
    well-scaled positive definite tensor each moment then has high relative accuracy (Demmel and Veselić, SIAM J. Matrix
    Anal. Appl. 13, 1992), the smallest one too. The tensor of a slender body, unless given in its principal axes, holds
    the smallest moment, and the difference of the others, only to ε times the largest: flights report this where it
    matters (simulation/flight.py). The axes form a proper rotation: the largest component of the first and second
    column is positive, the third makes them right-handed.
    """
    a = inertia.copy()
    v = np.eye(3)
    for _ in range(30):
        turned = False
        for p in range(2):
            for q in range(p + 1, 3):
                turned = _rotate(a, v, p, q) or turned
        if not turned:
            break
    order = np.array([0, 1, 2])
    for p in range(2):  # three numbers: a selection sort
        for q in range(p + 1, 3):
            if a[order[q], order[q]] < a[order[p], order[p]]:
                order[p], order[q] = order[q], order[p]
    moments = np.empty(3)
    axes = np.empty((3, 3))
    for column in range(3):
        moments[column] = a[order[column], order[column]]
        for k in range(3):
            axes[k, column] = v[k, order[column]]
    _sign_columns(axes)
    return moments, axes


def principal_axes(inertia: Matrix3) -> tuple[Vector3, Matrix3]:
    """Principal moments (3,) ascending [kg m²] and axes (3, 3), columns, of ``inertia`` (3, 3); see the kernel."""
    return principal_axes_kernel(np.ascontiguousarray(inertia, dtype=np.float64))


def tensor_from_six(six: Sequence[float]) -> Matrix3:
    """(ixx, ixy, ixz, iyy, iyz, izz) as a symmetric (3, 3) matrix; off-diagonals carry the tensor's sign, −∫xy dm."""
    ixx, ixy, ixz, iyy, iyz, izz = (float(value) for value in six)
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def six_from_tensor(inertia: Matrix3) -> tuple[float, float, float, float, float, float]:
    """A symmetric (3, 3) matrix as (ixx, ixy, ixz, iyy, iyz, izz)."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(inertia, dtype=np.float64).tolist()
    return xx, xy, xz, yy, yz, zz


def check_tensor(inertia: Matrix3, *, source: str = "inertia tensor") -> tuple[str, ...]:
    """Warnings about ``inertia`` (3, 3) [kg m², about the COM]; empty if there are none.

    Raises TensorError, its field ``source``, when no rigid body has such a tensor: not finite, not symmetric, a moment
    that isn't positive, C/A beyond 1e12, or A + B < C (1 − 1e-5) for principal moments A ≤ B ≤ C.
    """
    inertia = np.asarray(inertia, dtype=np.float64)
    if inertia.shape != (3, 3):
        raise TensorError(source, inertia.shape, "a 3 x 3 matrix")
    if not np.all(np.isfinite(inertia)):
        raise TensorError(source, six_from_tensor(inertia), "finite numbers")
    largest = float(np.max(np.abs(inertia)))
    if largest == 0.0 or np.max(np.abs(inertia - inertia.T)) > 1e-12 * largest:
        raise TensorError(source, inertia.tolist(), "a symmetric matrix other than zero")
    a, b, c = (float(moment) for moment in principal_axes(inertia)[0])
    if not a > 0.0 or c > MAX_MOMENT_RATIO * a:
        why = "all positive, the largest at most 1e12 times the smallest (a body on one line has no such tensor)"
        raise TensorError(source, (a, b, c), f"principal moments {why}")
    gap = (c - a - b) / c
    if gap > TRIANGLE_SLACK_GIVEN:
        accepted = "principal moments A <= B <= C with A + B >= C (1 - 1e-5), as every body has"
        remedy = f"with these A and B, C is at most {a + b:.9g} kg m²: look for swapped entries and another unit"
        raise TensorError(source, (a, b, c), f"{accepted}; {remedy}")
    if gap > TRIANGLE_SLACK_COMPUTED:
        return (f"{source}: A + B falls short of C by {gap:.1e} C (principal moments {a:.9g}, {b:.9g}, {c:.9g})",)
    return ()


def equimomental_shapes(mass: float, moments: Vector3) -> tuple[Vector3, Vector3]:
    """Sides (3,) of the uniform box and semi-axes (3,) of the uniform ellipsoid with ``mass`` [kg] and principal
    ``moments`` (3,) [kg m²]; both lengths [m], in the order of the moments.

    side_i² = 6 (I_j + I_k − I_i)/m and semi-axis_i² = 5 (I_j + I_k − I_i)/(2 m).
    """
    a, b, c = (float(moment) for moment in moments)
    total = a + b + c
    spread = np.maximum(total - 2.0 * np.asarray(moments), 0.0) / mass
    return np.sqrt(6.0 * spread), np.sqrt(2.5 * spread)
