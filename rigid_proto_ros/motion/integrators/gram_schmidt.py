# SPDX-License-Identifier: MIT
"""euler and midpoint: the explicit steps of the 2019 paper, on a rotation matrix kept orthonormal by Gram-Schmidt.

Orders 1 and 2, one and two evaluations a step (the paper's O(n²) and O(n³) are local errors). Source: "Interactively
prototyping properties of rigid bodies for physically-based animation" (2019); Hairer, Nørsett and Wanner, Solving
Ordinary Differential Equations I (1993), section II.1. Energy grows steadily; with ``gyroscopic: false`` they solve the
paper's eq. 9.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.rotation import matrix_elements
from ...base.vectors import Vector
from .equations import accelerations
from .integrator import ANGULAR_DAMPING, LOADS, NO_GYROSCOPIC_TERM, STRING, Integrator
from .runge_kutta import repeated
from .stepping import fixed_steps

_Matrix = tuple[Vector, Vector, Vector]
"""Its three columns, the body's axes in the world."""


@njit(cache=True, error_model="numpy")
def _axes(x: float, y: float, z: float, w: float) -> _Matrix:
    """Columns of the rotation matrix of a unit quaternion."""
    a, b, c, d, e, f, g, h, i = matrix_elements(x, y, z, w)
    return (a, d, g), (b, e, h), (c, f, i)


@njit(cache=True, error_model="numpy")
def _turned(
    start: _Matrix,
    at: _Matrix,
    wx: float,
    wy: float,
    wz: float,
    h: float,
) -> _Matrix:
    """``start`` + h R [ω]× with R = ``at``: each axis moves with the velocity of its tip."""
    e, f, g = at
    a, b, c = start
    return (
        (
            a[0] + h * (wz * f[0] - wy * g[0]),
            a[1] + h * (wz * f[1] - wy * g[1]),
            a[2] + h * (wz * f[2] - wy * g[2]),
        ),
        (
            b[0] + h * (wx * g[0] - wz * e[0]),
            b[1] + h * (wx * g[1] - wz * e[1]),
            b[2] + h * (wx * g[2] - wz * e[2]),
        ),
        (
            c[0] + h * (wy * e[0] - wx * f[0]),
            c[1] + h * (wy * e[1] - wx * f[1]),
            c[2] + h * (wy * e[2] - wx * f[2]),
        ),
    )


@njit(cache=True, error_model="numpy")
def _orthonormal(
    matrix: _Matrix,
) -> _Matrix:
    """Gram-Schmidt: the first axis keeps its direction, the second its plane, the third completes the right hand."""
    a, b, _ = matrix
    a = _unit(a)
    along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    b = _unit((b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]))
    return a, b, (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(cache=True, error_model="numpy")
def _unit(v: tuple[float, float, float]) -> tuple[float, float, float]:
    scale = 1.0 / math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v[0] * scale, v[1] * scale, v[2] * scale


@njit(cache=True, error_model="numpy")
def _quaternion_near(
    matrix: _Matrix,
    qx: float,
    qy: float,
    qz: float,
    qw: float,
) -> tuple[float, float, float, float]:
    """Unit quaternion of a rotation matrix, of the two signs the one nearer to q (Shepperd 1978)."""
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
    if x * qx + y * qy + z * qz + w * qw < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale, w * scale


@njit(cache=True, error_model="numpy")
def _moved(y: np.ndarray, at: np.ndarray, p: np.record, h: float, pulls: bool, out: np.ndarray) -> None:
    """y + h f(at) into out; of the attitude the matrix."""
    q = (at[0], at[1], at[2], at[3])
    w, d, u = (at[4], at[5], at[6]), (at[7], at[8], at[9]), (at[10], at[11], at[12])
    ex, ey, ez, ax, ay, az, work, heat = accelerations(*q, *w, *d, *u, p, pulls)
    R = _orthonormal(_turned(_axes(y[0], y[1], y[2], y[3]), _axes(*q), *w, h))
    out[0], out[1], out[2], out[3] = _quaternion_near(R, *q)
    out[4], out[5], out[6] = y[4] + h * ex, y[5] + h * ey, y[6] + h * ez
    out[7], out[8], out[9] = y[7] + h * u[0], y[8] + h * u[1], y[9] + h * u[2]
    out[10], out[11], out[12] = y[10] + h * ax, y[11] + h * ay, y[12] + h * az
    out[13], out[14] = y[13] + h * work, y[14] + h * heat


@njit(cache=True, error_model="numpy")
def _euler_step(y: np.ndarray, p: np.record, h: float, pulls: bool, _k: np.ndarray, out: np.ndarray) -> None:
    _moved(y, y, p, h, pulls, out)


@njit(cache=True, error_model="numpy")
def euler_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_euler_step, y, p, h, n, 1)


@njit(cache=True, error_model="numpy")
def _midpoint_step(y: np.ndarray, p: np.record, h: float, pulls: bool, k: np.ndarray, out: np.ndarray) -> None:
    middle = k[0]
    _moved(y, y, p, 0.5 * h, pulls, middle)
    _moved(y, middle, p, h, pulls, out)


@njit(cache=True, error_model="numpy")
def midpoint_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_midpoint_step, y, p, h, n, 1)


EULER = Integrator(
    name="euler",
    order=1,
    evaluations=1,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: gains energy at every step, useless beyond |ω|h of about 0.1.",
    stability_limit=0.1,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=euler_steps,
    make_methods=fixed_steps,
)

MIDPOINT = Integrator(
    name="midpoint",
    order=2,
    evaluations=2,
    source="The 2019 paper, section on integration; Hairer, Nørsett and Wanner (1993), section II.1",
    limits="Explicit: energy drifts with h³ per step; diverges beyond |ω|h of about 1.",
    stability_limit=0.3,
    supports=LOADS | {ANGULAR_DAMPING, STRING, NO_GYROSCOPIC_TERM},
    kernel=midpoint_steps,
    make_methods=fixed_steps,
)
