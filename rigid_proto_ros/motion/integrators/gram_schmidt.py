# SPDX-License-Identifier: MIT
"""Attitude as three unit vectors that are moved and then made orthonormal again, as the 2019 paper did it.

A matrix here is its three columns, the body's axes in the world, as nine numbers.
"""

from __future__ import annotations

import math

from ...base.compilation import njit
from ...base.rotation import matrix_elements


@njit(cache=True, error_model="numpy")
def columns(
    x: float, y: float, z: float, w: float
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
    """Columns of the rotation matrix of a unit quaternion."""
    a, b, c, d, e, f, g, h, i = matrix_elements(x, y, z, w)
    return (a, d, g), (b, e, h), (c, f, i)


@njit(cache=True, error_model="numpy")
def turned(
    start: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
    at: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
    wx: float,
    wy: float,
    wz: float,
    h: float,
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
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
def orthonormal(
    matrix: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
) -> tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]:
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
def quaternion_near(
    matrix: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]],
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
