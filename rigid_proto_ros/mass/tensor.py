# SPDX-License-Identifier: MIT
"""Inertia tensors: principal moments and axes, and which tensors a rigid body can have."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..base.compilation import exported, local_integers, local_matrix, njit
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


@njit(error_model="numpy", allocates=False)
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


@njit(error_model="numpy", allocates=False)
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


@exported("f8[:,:]", "f8[:]", "f8[:,:]")
def principal_axes_kernel(inertia: Matrix3, moments: Vector3, axes: Matrix3) -> None:
    """Fill principal ``moments`` (3,) ascending and ``axes`` (3, 3), columns, of a symmetric ``inertia`` (3, 3).

    Cyclic Jacobi rotations until every off-diagonal element is below the rounding of its two diagonal elements: for a
    well-scaled positive definite tensor each moment then has high relative accuracy (Demmel and Veselić, SIAM J. Matrix
    Anal. Appl. 13, 1992), the smallest one too. The tensor of a slender body, unless given in its principal axes, holds
    the smallest moment, and the difference of the others, only to ε times the largest: flights report this where it
    matters (simulation/flight.py). The axes form a proper rotation: the largest component of the first and second
    column is positive, the third makes them right-handed.
    """
    a, v, order = local_matrix(3, 3), local_matrix(3, 3), local_integers(3)
    for i in range(3):
        order[i] = i
        for j in range(3):
            a[i, j], v[i, j] = inertia[i, j], 1.0 if i == j else 0.0
    for _ in range(30):
        turned = False
        for p in range(2):
            for q in range(p + 1, 3):
                turned = _rotate(a, v, p, q) or turned
        if not turned:
            break
    for p in range(2):  # three numbers: a selection sort
        for q in range(p + 1, 3):
            if a[order[q], order[q]] < a[order[p], order[p]]:
                order[p], order[q] = order[q], order[p]
    for column in range(3):
        moments[column] = a[order[column], order[column]]
        for k in range(3):
            axes[k, column] = v[k, order[column]]
    _sign_columns(axes)


def principal_axes(inertia: Matrix3) -> tuple[Vector3, Matrix3]:
    """Principal moments (3,) ascending [kg m²] and axes (3, 3), columns, of ``inertia`` (3, 3); see the kernel."""
    moments, axes = np.empty(3), np.empty((3, 3))
    principal_axes_kernel(np.ascontiguousarray(inertia, dtype=np.float64), moments, axes)
    return moments, axes


def tensor_from_six(six: Sequence[float]) -> Matrix3:
    """(ixx, ixy, ixz, iyy, iyz, izz) as a symmetric (3, 3) matrix; off-diagonals carry the tensor's sign, −∫xy dm."""
    ixx, ixy, ixz, iyy, iyz, izz = (float(value) for value in six)
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])


def six_from_tensor(inertia: Matrix3) -> tuple[float, float, float, float, float, float]:
    """A symmetric (3, 3) matrix as (ixx, ixy, ixz, iyy, iyz, izz)."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(inertia, dtype=np.float64).tolist()
    return xx, xy, xz, yy, yz, zz


POSSIBLE, NOT_FINITE, NOT_SYMMETRIC, NOT_POSITIVE, UNEQUAL, NEARLY = range(6)
"""Whether a rigid body can have a tensor, or the first rule that it breaks; NEARLY: A + B ≥ C by rounding."""


@exported("f8[:,:]", "f8[:]", returns="i8")
def judged_tensor(inertia: Matrix3, moments: Vector3) -> int:
    """Which rule of ``check_tensor`` an ``inertia`` (3, 3) breaks: POSSIBLE, NOT_FINITE and so on. ``moments`` (3,) are
    filled with its principal ones, if it is finite and symmetric.
    """
    largest = difference = 0.0
    for i in range(3):
        for j in range(3):
            if not math.isfinite(inertia[i, j]):
                return NOT_FINITE
            largest = max(largest, abs(inertia[i, j]))
            difference = max(difference, abs(inertia[i, j] - inertia[j, i]))
    if largest == 0.0 or difference > 1e-12 * largest:
        return NOT_SYMMETRIC
    principal_axes_kernel(inertia, moments, local_matrix(3, 3))
    a, b, c = moments[0], moments[1], moments[2]
    if not a > 0.0 or c > MAX_MOMENT_RATIO * a:
        return NOT_POSITIVE
    gap = (c - a - b) / c
    if gap > TRIANGLE_SLACK_GIVEN:
        return UNEQUAL
    return NEARLY if gap > TRIANGLE_SLACK_COMPUTED else POSSIBLE


def check_tensor(inertia: Matrix3, *, source: str = "inertia tensor") -> tuple[str, ...]:
    """Warnings about ``inertia`` (3, 3) [kg m², about the COM]; empty if there are none.

    Raises TensorError, its field ``source``, when no rigid body has such a tensor: not finite, not symmetric, a moment
    that isn't positive, C/A beyond 1e12, or A + B < C (1 − 1e-5) for principal moments A ≤ B ≤ C.
    """
    inertia, moments = np.ascontiguousarray(inertia, dtype=np.float64), np.zeros(3)
    if inertia.shape != (3, 3):
        raise TensorError(source, inertia.shape, "a 3 x 3 matrix")
    rule = judged_tensor(inertia, moments)
    if rule == NOT_FINITE:
        raise TensorError(source, six_from_tensor(inertia), "finite numbers")
    if rule == NOT_SYMMETRIC:
        raise TensorError(source, inertia.tolist(), "a symmetric matrix other than zero")
    a, b, c = moments.tolist()
    if rule == NOT_POSITIVE:
        why = "all positive, the largest at most 1e12 times the smallest (a body on one line has no such tensor)"
        raise TensorError(source, (a, b, c), f"principal moments {why}")
    if rule == UNEQUAL:
        accepted = "principal moments A <= B <= C with A + B >= C (1 - 1e-5), as every body has"
        remedy = f"with these A and B, C is at most {a + b:.9g} kg m²: look for swapped entries and another unit"
        raise TensorError(source, (a, b, c), f"{accepted}; {remedy}")
    if rule == NEARLY:
        gap = (c - a - b) / c
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
