# SPDX-License-Identifier: MIT
"""What each kind of sensor would show of a flight, how far its samples are from that, and how that changes with what
varied flights show: compiled, as there are thousands of samples and some thirty flights beside one another.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit
from ..base.rotation import multiply, rotate, rotate_inverse
from . import measurements as ms
from . import trajectories as tr

_POSITION, _ATTITUDE, _VELOCITY, _RATE, _ACCELERATION = range(5)
CODES = {
    ms.POSITION: _POSITION,
    ms.ATTITUDE: _ATTITUDE,
    ms.VELOCITY: _VELOCITY,
    ms.RATE: _RATE,
    ms.ACCELERATION: _ACCELERATION,
}
"""Numbers of the kinds of series."""

# What a sensor's samples depend on beside the flight: centre of mass and place of the IMU in the tracked frame [m], and
# what the IMU adds to rates [rad/s] and accelerations [m/s²], (3,) each.
COM, PLACE, GYRO_BIAS, ACCEL_BIAS, SENSOR = 0, 3, 6, 9, 12


@njit(cache=True, error_model="numpy")
def _shown(kind: int, in_body: bool, is_imu: bool, s: np.ndarray, sensor: np.ndarray) -> tuple[float, ...]:
    """What a series of this kind shows of a sample s (SAMPLE,): three numbers and 0, or an attitude xyzw."""
    q = (s[3], s[4], s[5], s[6])
    if kind == _ATTITUDE:
        return q
    wx, wy, wz = s[10], s[11], s[12]
    cx, cy, cz = sensor[COM], sensor[COM + 1], sensor[COM + 2]
    if kind == _POSITION:
        x, y, z = rotate(*q, cx, cy, cz)
        return s[0] - x, s[1] - y, s[2] - z, 0.0
    if kind == _VELOCITY:
        x, y, z = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
        if in_body:
            u, v, w = rotate_inverse(*q, s[7], s[8], s[9])
            return u - x, v - y, w - z, 0.0
        x, y, z = rotate(*q, x, y, z)
        return s[7] - x, s[8] - y, s[9] - z, 0.0
    if kind == _RATE:
        if not in_body:
            x, y, z = rotate(*q, wx, wy, wz)
            return x, y, z, 0.0
        if not is_imu:
            return wx, wy, wz, 0.0
        return wx + sensor[GYRO_BIAS], wy + sensor[GYRO_BIAS + 1], wz + sensor[GYRO_BIAS + 2], 0.0
    ax, ay, az = sensor[PLACE] - cx, sensor[PLACE + 1] - cy, sensor[PLACE + 2] - cz
    along, speed = wx * ax + wy * ay + wz * az, wx * wx + wy * wy + wz * wz
    A, F = tr.ANGULAR_ACCELERATION, tr.SPECIFIC_FORCE
    bx, by, bz = s[A], s[A + 1], s[A + 2]
    return (
        s[F] + by * az - bz * ay + wx * along - ax * speed + sensor[ACCEL_BIAS],
        s[F + 1] + bz * ax - bx * az + wy * along - ay * speed + sensor[ACCEL_BIAS + 1],
        s[F + 2] + bx * ay - by * ax + wz * along - az * speed + sensor[ACCEL_BIAS + 2],
        0.0,
    )


@njit(cache=True, error_model="numpy")
def rotation_vector(
    a: float, b: float, c: float, d: float, e: float, f: float, g: float, h: float
) -> tuple[float, float, float]:
    """Of the turn from an attitude (a, b, c, d) xyzw to another one, in body axes [rad]."""
    x, y, z, w = multiply(-a, -b, -c, d, e, f, g, h)
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    size = math.sqrt(x * x + y * y + z * z)
    # 2 asin(s) / s: below 1e-4 the series 2 + s²/3 errs by 2e-17.
    factor = 2.0 * math.atan2(size, w) / size if size > 1e-4 else 2.0 + size * size / 3.0
    return factor * x, factor * y, factor * z


@njit(cache=True, error_model="numpy")
def _deviation(kind: int, shown: tuple[float, ...], measured: tuple[float, ...]) -> tuple[float, float, float]:
    """Measured minus shown; of attitudes the rotation vector between them, in the body's axes."""
    a, b, c, d = shown
    e, f, g, h = measured
    if kind == _ATTITUDE:
        return rotation_vector(a, b, c, d, e, f, g, h)
    return e - a, f - b, g - c


@njit(cache=True, error_model="numpy")
def _measured(kind: int, values: np.ndarray) -> tuple[float, float, float, float]:
    return values[0], values[1], values[2], values[3] if kind == _ATTITUDE else 0.0


@njit(cache=True, error_model="numpy")
def fill_residuals(
    kind: int,
    in_body: bool,
    is_imu: bool,
    samples: np.ndarray,
    where: np.ndarray,
    sensor: np.ndarray,
    values: np.ndarray,
    residuals: np.ndarray,
) -> None:
    """Measured minus shown of the measured ``values`` (m, 3 or 4) into residuals (m, 3). samples (T, SAMPLE): the
    flight's; where (m,): which of them the series sees; sensor (SENSOR,).
    """
    for j in range(where.shape[0]):
        shown = _shown(kind, in_body, is_imu, samples[where[j]], sensor)
        x, y, z = _deviation(kind, shown, _measured(kind, values[j]))
        residuals[j, 0], residuals[j, 1], residuals[j, 2] = x, y, z


@njit(cache=True, error_model="numpy")
def fill_columns(
    kind: int,
    in_body: bool,
    is_imu: bool,
    samples: np.ndarray,
    where: np.ndarray,
    flights: np.ndarray,
    sensors: np.ndarray,
    differences: np.ndarray,
    widths: np.ndarray,
    values: np.ndarray,
    weights: np.ndarray,
    columns: np.ndarray,
    first: int,
) -> None:
    """Residuals of a series, weighted (m,), into the last row of columns (k, 3 samples) from ``first`` on, and how
    they change with each unknown into the rows that ``differences`` names.

    samples (n, T, SAMPLE): of each flight. flights (v,): that of each variation, the first one the base; sensors (v,
    SENSOR). differences (c, 3): row, and the two variations whose difference divided by widths (c,) is the derivative.
    """
    last, count = columns.shape[0] - 1, flights.shape[0]
    shown = np.empty((count, 4))
    for j in range(where.shape[0]):
        for v in range(count):
            shown[v] = _shown(kind, in_body, is_imu, samples[flights[v], where[j]], sensors[v])
        at, weight = first + 3 * j, weights[j]
        base = (shown[0, 0], shown[0, 1], shown[0, 2], shown[0, 3])
        x, y, z = _deviation(kind, base, _measured(kind, values[j]))
        columns[last, at], columns[last, at + 1], columns[last, at + 2] = weight * x, weight * y, weight * z
        for c in range(differences.shape[0]):
            row, plus, minus = differences[c]
            one = (shown[minus, 0], shown[minus, 1], shown[minus, 2], shown[minus, 3])
            other = (shown[plus, 0], shown[plus, 1], shown[plus, 2], shown[plus, 3])
            x, y, z = _deviation(kind, one, other)
            # What a flight shows moves by that, what is measured less what it shows by minus that.
            factor = -weight / widths[c]
            columns[row, at], columns[row, at + 1], columns[row, at + 2] = factor * x, factor * y, factor * z


@njit(cache=True, error_model="numpy")
def fill_shift_columns(
    kind: int,
    in_body: bool,
    samples: np.ndarray,
    where: np.ndarray,
    seconds: np.ndarray,
    rate: float,
    start: np.ndarray,
    weights: np.ndarray,
    columns: np.ndarray,
    first: int,
) -> None:
    """How a series changes with its start's position, rows 0 to 2 of columns (k, 3 samples), and velocity, rows 6 to 8.

    samples (T, SAMPLE) at seconds (T,) from the start; rate: c/m [1/s]; start (13,): in whose axes its velocity
    changes.
    """
    for j in range(where.shape[0]):
        s, at, weight = samples[where[j]], first + 3 * j, weights[j]
        if kind == _POSITION:
            for k in range(3):
                columns[k, at + k] = -weight
        decay, passed = math.exp(-rate * seconds[where[j]]), seconds[where[j]]
        if kind == _POSITION:
            factor = -math.expm1(-rate * passed) / rate if rate != 0.0 else passed
        elif kind == _VELOCITY:
            factor = decay
        elif kind == _ACCELERATION:
            factor = -rate * decay
        else:
            continue
        turns_back = kind == _ACCELERATION or (kind == _VELOCITY and in_body)
        for k in range(3):
            x, y, z = 1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0
            x, y, z = rotate(start[3], start[4], start[5], start[6], x, y, z)
            if turns_back:
                x, y, z = rotate_inverse(s[3], s[4], s[5], s[6], x, y, z)
            own = -weight * factor
            columns[6 + k, at], columns[6 + k, at + 1], columns[6 + k, at + 2] = own * x, own * y, own * z


@njit(cache=True, error_model="numpy")
def fill_time_column(
    kind: int,
    in_body: bool,
    is_imu: bool,
    earlier: np.ndarray,
    later: np.ndarray,
    between_s: float,
    sensor: np.ndarray,
    weights: np.ndarray,
    column: np.ndarray,
) -> None:
    """How what a series shows changes with its clock, into column (3 m,), of samples (m, SAMPLE) that are ``between_s``
    apart.
    """
    for j in range(earlier.shape[0]):
        one = _shown(kind, in_body, is_imu, earlier[j], sensor)
        x, y, z = _deviation(kind, one, _shown(kind, in_body, is_imu, later[j], sensor))
        factor = -weights[j] / between_s
        column[3 * j], column[3 * j + 1], column[3 * j + 2] = factor * x, factor * y, factor * z
