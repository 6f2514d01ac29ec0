# SPDX-License-Identifier: MIT
"""A step with a string so stiff that nothing of its swing is resolved, as if it were inextensible; it always has a
solution.

The body flies freely for the step (exactly, but for half kicks of the loads at both ends). A string that is stretched
then is brought back to its rest length by moving the body along it, and an impulse J along it at the knot gives the
body what the string's potential and the loads' work on that way make of its kinetic energy: with r the rate of the
string's length and 1/m_eff what the knot yields,

    r' = r + J/m_eff,    ½ m_eff r'² = ½ m_eff r² + V − V⁺ + m g·δ,

the root that turns the knot back, as a stiff spring does within half a swing; a string that doesn't push turns it
inwards. The damper takes the part 1 − exp(−ch/m_eff) of that energy. So there is a solution whatever the step, and
kinetic and potential energy are kept to rounding; phase and direction of a motion that the step doesn't resolve are
not, nor is angular momentum on the way back.
"""

from __future__ import annotations

import math

import numpy as np

from ...base.compilation import njit
from ...base.elementary import exponential_of
from ...base.rotation import exponential, multiply, rotate, rotate_inverse
from .. import problem as of
from ..variables import HAND_WORK, HEAT, LOW
from .free_body_step import free_step
from .kick import kick, push
from .knot import knot_and_stretch, moved_pair, unit_attitude

_CORRECTIONS = 3
"""Of the string's length: each leaves a rounding of the one before."""


@njit(cache=True, error_model="numpy")
def kinetic_energy(y: np.ndarray, p: np.ndarray) -> float:
    """As seen from the free end [J]."""
    energy = 0.0
    for k in range(3):
        energy += 0.5 * p[of.MOMENTS + k] * y[4 + k] ** 2 + 0.5 * p[of.MASS] * y[10 + k] ** 2
    return energy


@njit(cache=True, error_model="numpy")
def yield_along(y: np.ndarray, p: np.ndarray, nx: float, ny: float, nz: float) -> tuple[float, float, float, float]:
    """1/m_eff = 1/m + (r × n)ᵀ I⁻¹ (r × n) along the world direction n, and r × n in principal axes."""
    nx, ny, nz = rotate_inverse(y[0], y[1], y[2], y[3], nx, ny, nz)
    rx, ry, rz = p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2]
    a, b, c = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
    lightness = 1.0 / p[of.MASS] + a * a / p[of.MOMENTS] + b * b / p[of.MOMENTS + 1] + c * c / p[of.MOMENTS + 2]
    return lightness, a, b, c


@njit(cache=True, error_model="numpy")
def _rate(y: np.ndarray, p: np.ndarray, n: tuple[float, float, float]) -> float:
    """Of the knot along n, from the free end."""
    rx, ry, rz = p[of.ATTACH], p[of.ATTACH + 1], p[of.ATTACH + 2]
    wx, wy, wz = y[4], y[5], y[6]
    vx, vy, vz = rotate(y[0], y[1], y[2], y[3], wy * rz - wz * ry, wz * rx - wx * rz, wx * ry - wy * rx)
    return n[0] * (y[10] + vx) + n[1] * (y[11] + vy) + n[2] * (y[12] + vz)


@njit(cache=True, error_model="numpy")
def _strike(y: np.ndarray, p: np.ndarray, n: tuple[float, float, float], impulse: float) -> None:
    """An impulse along n at the knot, in place."""
    _, a, b, c = yield_along(y, p, n[0], n[1], n[2])
    y[4] += impulse * a / p[of.MOMENTS]
    y[5] += impulse * b / p[of.MOMENTS + 1]
    y[6] += impulse * c / p[of.MOMENTS + 2]
    for k in range(3):
        y[10 + k] += impulse * n[k] / p[of.MASS]
        y[HAND_WORK] += impulse * n[k] * p[of.HAND_VELOCITY + k]


@njit(cache=True, error_model="numpy")
def _fly(y: np.ndarray, p: np.ndarray, h: float) -> None:
    """Free motion for h seconds between half kicks of the loads, in place."""
    kick(y, p, 0.5 * h, push(y, p))
    if p[of.GYROSCOPIC] != 0.0:
        y[0], y[1], y[2], y[3], y[4], y[5], y[6] = free_step(
            *(y[0], y[1], y[2], y[3], y[4], y[5], y[6]), *(p[of.MOMENTS], p[of.MOMENTS + 1], p[of.MOMENTS + 2]), h
        )
    else:
        rx, ry, rz, rw = exponential(h * y[4], h * y[5], h * y[6])
        y[0], y[1], y[2], y[3] = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, rw)
    for k in range(4):
        y[LOW + k] = 0.0
    unit_attitude(y)
    for k in range(3):
        moved_pair(y, y, 7 + k, LOW + 4 + k, h * y[10 + k])
    kick(y, p, 0.5 * h, push(y, p))


@njit(cache=True, error_model="numpy")
def potential_energy(x: float, p: np.ndarray) -> float:
    """Of the string stretched by x [J]."""
    if x < 0.0 and p[of.BILATERAL] == 0.0:
        return 0.0
    return 0.5 * p[of.STIFFNESS] * x * x


@njit(cache=True, error_model="numpy")
def _direction(ax: float, ay: float, az: float, length: float) -> tuple[float, float, float]:
    """From the free end to the knot; some direction where they are one."""
    if length > 0.0:
        return ax / length, ay / length, az / length
    return 1.0, 0.0, 0.0


@njit(cache=True, error_model="numpy")
def inextensible_step(y: np.ndarray, p: np.ndarray, h: float, out: np.ndarray) -> None:
    """A step of h seconds from y into out (STORED,), of a problem with a string."""
    out[:] = y
    _, _, _, _, before = knot_and_stretch(y, p)
    one_sided = p[of.BILATERAL] == 0.0
    _fly(out, p, h)
    ax, ay, az, length, x = knot_and_stretch(out, p)
    slack = one_sided and x <= 0.0
    if slack and before <= 0.0:
        return
    gained = potential_energy(before, p)
    if not slack:
        for _ in range(_CORRECTIONS):
            n = _direction(ax, ay, az, length)
            for k in range(3):
                moved_pair(out, out, 7 + k, LOW + 4 + k, -x * n[k])
                gained -= p[of.MASS] * p[of.ACCELERATION_ADDED + k] * x * n[k]
            if p[of.REST_LENGTH] == 0.0:
                # The direction is that from which the knot came.
                x = knot_and_stretch(out, p)[4]
                break
            ax, ay, az, length, x = knot_and_stretch(out, p)
        gained -= potential_energy(x, p)
    if slack or p[of.REST_LENGTH] != 0.0:
        n = _direction(ax, ay, az, length)
    _turn_back(out, p, n, gained, h)


@njit(cache=True, error_model="numpy")
def _turn_back(y: np.ndarray, p: np.ndarray, n: tuple[float, float, float], gained: float, h: float) -> None:
    """Let the string turn the knot back with ``gained`` joules more of kinetic energy, and its damper
    work for h seconds, in place.
    """
    one_sided = p[of.BILATERAL] == 0.0
    lightness = yield_along(y, p, n[0], n[1], n[2])[0]
    rate = _rate(y, p, n)
    square = rate * rate + 2.0 * lightness * gained
    back = math.sqrt(max(square, 0.0))
    if one_sided or rate >= 0.0:
        back = -back
    left = exponential_of(-0.5 * p[of.STRING_DAMPING] * lightness * h)
    y[HEAT] += 0.5 * back * back * (1.0 - left) * (1.0 + left) / lightness
    _strike(y, p, n, (left * back - rate) / lightness)
    if square < 0.0:
        # The knot's motion along the string couldn't pay: all of the motion does.
        lacking, kinetic = -0.5 * square / lightness, kinetic_energy(y, p)
        part = math.sqrt(max(1.0 - lacking / kinetic, 0.0)) if kinetic > 0.0 else 0.0
        for k in range(3):
            y[4 + k] *= part
            y[10 + k] *= part
    if p[of.REST_LENGTH] == 0.0 and p[of.STRING_DAMPING] > 0.0:
        # Such a damper works in all directions.
        for axis in range(3):
            n = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
            lightness = yield_along(y, p, n[0], n[1], n[2])[0]
            rate = _rate(y, p, n)
            left = exponential_of(-0.5 * p[of.STRING_DAMPING] * lightness * h)
            y[HEAT] += 0.5 * rate * rate * (1.0 - left) * (1.0 + left) / lightness
            _strike(y, p, n, (left - 1.0) * rate / lightness)
