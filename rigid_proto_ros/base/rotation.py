# SPDX-License-Identifier: MIT
"""Unit quaternions, xyzw (scalar last), taking body axes to world axes: v_world = q v_body q*.

Products and the matrix form follow Diebel, "Representing Attitude" (2006), section 6, with the scalar moved last.
"""

from __future__ import annotations

import math

import numpy as np

from .arithmetic import sine_cosine
from .compilation import exported, njit
from .vectors import Attitude, FloatArray, Matrix3, Numbers, Vector3


def cross(a: Numbers, b: Numbers) -> Vector3:
    """a × b (3,)."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def dot(a: Numbers, b: Numbers) -> float:
    """a · b of three components, summed in their order; in NumPy's dot and norm the order depends on BLAS."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@njit(error_model="numpy", allocates=False)
def norm(x: float, y: float, z: float) -> float:
    """|v| of v = (x, y, z), if squares neither overflow nor underflow."""
    return math.sqrt(x * x + y * y + z * z)


def length(v: Numbers) -> float:
    """|v| of v (3,), with the same restriction."""
    return norm(float(v[0]), float(v[1]), float(v[2]))


def times(matrix: FloatArray, v: Numbers) -> FloatArray:
    """The matrix (n, 3) times v (3,), summed in a fixed order: that of BLAS depends on the processor."""
    return matrix[:, 0] * v[0] + matrix[:, 1] * v[1] + matrix[:, 2] * v[2]


def transposed_times(matrix: Matrix3, v: Numbers) -> Vector3:
    """The transposed matrix (3, 3) times v (3,), in the same order."""
    product: Vector3 = matrix[0] * v[0] + matrix[1] * v[1] + matrix[2] * v[2]
    return product


@njit(error_model="numpy", allocates=False)
def multiply(
    ax: float, ay: float, az: float, aw: float, bx: float, by: float, bz: float, bw: float
) -> tuple[float, float, float, float]:
    """Hamilton product a ⊗ b: first the rotation b, then a."""
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@njit(error_model="numpy", allocates=False)
def rotate(qx: float, qy: float, qz: float, qw: float, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """Rotate v from body to world axes: v + 2w(u × v) + 2u × (u × v), u the vector part."""
    tx = 2.0 * (qy * vz - qz * vy)
    ty = 2.0 * (qz * vx - qx * vz)
    tz = 2.0 * (qx * vy - qy * vx)
    return (
        vx + qw * tx + (qy * tz - qz * ty),
        vy + qw * ty + (qz * tx - qx * tz),
        vz + qw * tz + (qx * ty - qy * tx),
    )


@njit(error_model="numpy", allocates=False)
def rotate_inverse(
    qx: float, qy: float, qz: float, qw: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float]:
    """Rotate v from world to body axes."""
    return rotate(-qx, -qy, -qz, qw, vx, vy, vz)


@njit(error_model="numpy", allocates=False)
def normalize(qx: float, qy: float, qz: float, qw: float) -> tuple[float, float, float, float]:
    """Scale to unit length."""
    scale = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    return qx * scale, qy * scale, qz * scale, qw * scale


@njit(error_model="numpy", allocates=False)
def to_unit(qx: float, qy: float, qz: float, qw: float) -> tuple[float, float, float, float]:
    """A given quaternion scaled to unit length; zeros if its length is zero or not finite.

    A quaternion of unit length, to rounding, is kept bit for bit, so that a saved state is restored exactly.
    """
    largest = max(abs(qx), abs(qy), abs(qz), abs(qw))
    if not 0.0 < largest < math.inf:
        return 0.0, 0.0, 0.0, 0.0
    if abs(qx * qx + qy * qy + qz * qz + qw * qw - 1.0) <= 1e-15:
        return qx, qy, qz, qw
    return normalize(qx / largest, qy / largest, qz / largest, qw / largest)


@njit(error_model="numpy", allocates=False)
def exponential(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Unit quaternion xyzw of the rotation by |v| [rad] about v = (x, y, z); accurate for small angles, too."""
    angle = norm(x, y, z)
    # sin(a/2)/a: below 1e-4 the series ½ − a²/48 errs by 1e-19.
    sine, cosine = sine_cosine(0.5 * angle)
    factor = sine / angle if angle > 1e-4 else 0.5 - angle * angle / 48.0
    return x * factor, y * factor, z * factor, cosine


@njit(error_model="numpy", allocates=False)
def matrix_elements(x: float, y: float, z: float, w: float) -> tuple[float, ...]:
    """The rotation matrix, body to world, of a unit quaternion: nine numbers row by row."""
    return (
        *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@exported("f8[:,:]", "f8[:,:]")
def rotation_matrices(q: FloatArray, R: FloatArray) -> None:
    """Fill rotation matrices R (n, 9), row by row, of unit quaternions q (n, 4)."""
    for k in range(q.shape[0]):
        elements = matrix_elements(q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        for j in range(9):
            R[k, j] = elements[j]


def matrix_from_quaternion(q: Numbers) -> FloatArray:
    """Rotation matrix (3, 3), body to world, of a unit quaternion q (4,) xyzw, or (n, 3, 3) of (n, 4)."""
    q = np.ascontiguousarray(q, dtype=float)
    R = np.empty(q.shape[:-1] + (9,))
    rotation_matrices(q.reshape(-1, 4), R.reshape(-1, 9))
    return R.reshape(*q.shape[:-1], 3, 3)


@exported("f8[:,:]", "f8[:]")
def quaternion_of_axes(R: Matrix3, q: Attitude) -> None:
    """Write the unit quaternion xyzw of a proper rotation matrix R (3, 3) into q (4,).

    The largest of the four squared components is the divisor (Shepperd 1978), which avoids cancellation.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    k, largest = 0, R[0, 0]
    if R[1, 1] > largest:
        k, largest = 1, R[1, 1]
    if R[2, 2] > largest:
        k, largest = 2, R[2, 2]
    if trace > largest:
        k = 3
    if k == 3:
        q[0], q[1], q[2], q[3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace
    else:
        i, j, m = k, (k + 1) % 3, (k + 2) % 3
        q[i] = 1.0 + R[i, i] - R[j, j] - R[m, m]
        q[j] = R[j, i] + R[i, j]
        q[m] = R[m, i] + R[i, m]
        q[3] = R[m, j] - R[j, m]
    q[0], q[1], q[2], q[3] = normalize(q[0], q[1], q[2], q[3])


def quaternion_from_matrix(R: Matrix3) -> Attitude:
    """Unit quaternion (4,) xyzw of a proper rotation matrix (3, 3)."""
    q = np.empty(4)
    quaternion_of_axes(np.array(R, dtype=float, order="C"), q)
    return q
