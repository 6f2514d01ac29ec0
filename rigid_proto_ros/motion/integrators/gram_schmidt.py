# SPDX-License-Identifier: MIT
"""euler and midpoint: the explicit steps of the 2019 paper, on a rotation matrix kept orthonormal by Gram-Schmidt.

Orders 1 and 2, one and two evaluations per step (the paper's O(n²) and O(n³) are local errors). Source: "Interactively
prototyping properties of rigid bodies for physically-based animation" (2019); Hairer, Nørsett and Wanner, Solving
Ordinary Differential Equations I (1993), section II.1. Energy grows steadily; with ``gyroscopic: false`` they solve the
paper's eq. 9.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import copy_numbers, njit
from ...base.rotation import matrix_elements, norm
from ...base.vectors import FloatArray, Quaternion, Vector
from ..loads import NO_GYROSCOPIC_TERM
from ..problem import DISPLACEMENT, HAND_WORK, HEAT, SPIN, TIME, VELOCITY, Variables, accelerations, parts_of
from .integrator import EVALUATED, Integrator, Kernel
from .runge_kutta import ONE_STAGE, repeated

_Matrix = tuple[Vector, Vector, Vector]
"""A matrix as its three columns, the body's axes in world axes."""


@njit(error_model="numpy", allocates=False)
def _axes(q: Quaternion) -> _Matrix:
    """Columns of the rotation matrix of a unit quaternion."""
    a, b, c, d, e, f, g, h, i = matrix_elements(*q)
    return (a, d, g), (b, e, h), (c, f, i)


@njit(error_model="numpy", allocates=False)
def _sum(a: Vector, h: float, x: float, b: Vector, y: float, c: Vector) -> Vector:
    """a + h (x b − y c)."""
    return a[0] + h * (x * b[0] - y * c[0]), a[1] + h * (x * b[1] - y * c[1]), a[2] + h * (x * b[2] - y * c[2])


@njit(error_model="numpy", allocates=False)
def _turned(start: _Matrix, at: _Matrix, w: Vector, h: float) -> _Matrix:
    """``start`` + h R [ω]× with R = ``at``: each axis moves with the velocity of its tip."""
    e, f, g = at
    a, b, c = start
    return _sum(a, h, w[2], f, w[1], g), _sum(b, h, w[0], g, w[2], e), _sum(c, h, w[1], e, w[0], f)


@njit(error_model="numpy", allocates=False)
def _unit(v: Vector) -> Vector:
    scale = 1.0 / norm(*v)
    return v[0] * scale, v[1] * scale, v[2] * scale


@njit(error_model="numpy", allocates=False)
def _orthonormal(matrix: _Matrix) -> _Matrix:
    """Gram-Schmidt: the first axis keeps its direction, the second its plane, the third is their vector product."""
    a, b, _ = matrix
    a = _unit(a)
    along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    b = _unit((b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]))
    return a, b, (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(error_model="numpy", allocates=False)
def _quaternion_near(matrix: _Matrix, q: Quaternion) -> Quaternion:
    """Unit quaternion of a rotation matrix, with the sign for which it is nearer to q (Shepperd 1978)."""
    a, b, c = matrix
    xx, yy, zz = a[0], b[1], c[2]
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        x, y, z, w = b[2] - c[1], c[0] - a[2], a[1] - b[0], 1.0 + trace
    elif xx >= yy and xx >= zz:
        x, y, z, w = 1.0 + xx - yy - zz, b[0] + a[1], c[0] + a[2], b[2] - c[1]
    elif yy >= zz:
        x, y, z, w = b[0] + a[1], 1.0 + yy - xx - zz, c[1] + b[2], c[0] - a[2]
    else:
        x, y, z, w = c[0] + a[2], c[1] + b[2], 1.0 + zz - xx - yy, a[1] - b[0]
    scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    if x * q[0] + y * q[1] + z * q[2] + w * q[3] < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale, w * scale


@njit(error_model="numpy", allocates=False)
def _moved(y: Variables, at: Variables, p: np.record, h: float, pulls: bool, out: Variables) -> None:
    """Write y + h f(at) into out, which may be ``at``; the attitude is advanced as a matrix."""
    q, w, d, u = parts_of(at)
    turning, moving, work, heat = accelerations(q, w, d, u, at[TIME], p, pulls)
    start, _, _, _ = parts_of(y)
    R = _orthonormal(_turned(_axes(start), _axes(q), w, h))
    out[0], out[1], out[2], out[3] = _quaternion_near(R, q)
    for j in range(3):
        out[SPIN + j] = y[SPIN + j] + h * turning[j]
        out[DISPLACEMENT + j] = y[DISPLACEMENT + j] + h * u[j]
        out[VELOCITY + j] = y[VELOCITY + j] + h * moving[j]
    out[HAND_WORK], out[HEAT] = y[HAND_WORK] + h * work, y[HEAT] + h * heat
    out[TIME] = y[TIME] + h


@njit(error_model="numpy", allocates=False)
def _step(
    y: Variables, p: np.record, h: float, pulls: bool, tableau: FloatArray, _k: FloatArray, out: Variables
) -> None:
    copy_numbers(y, out)
    for i in range(tableau.shape[1]):
        _moved(y, out, p, tableau[i + 1, i] * h, pulls, out)


def _steps(tableau: FloatArray) -> Kernel:
    """The kernel of a method with this tableau, in which each stage uses only the previous one."""

    @njit(error_model="numpy", allocates=False)
    def steps(y: Variables, p: np.record, h: float, n: int) -> int:
        return repeated(_step, tableau, y, p, h, n)

    return steps


euler_steps = _steps(ONE_STAGE)
midpoint_steps = _steps(np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 1.0]]))

EULER = Integrator(
    name="euler",
    order=1,
    evaluations=1,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: gains energy at every step, useless beyond |ω|h of about 0.1.",
    stability_limit=0.1,
    supports=EVALUATED | {NO_GYROSCOPIC_TERM},
    kernel=euler_steps,
)

MIDPOINT = Integrator(
    name="midpoint",
    order=2,
    evaluations=2,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: energy drifts with h³ per step; diverges beyond |ω|h of about 1.",
    stability_limit=0.3,
    supports=EVALUATED | {NO_GYROSCOPIC_TERM},
    kernel=midpoint_steps,
)
