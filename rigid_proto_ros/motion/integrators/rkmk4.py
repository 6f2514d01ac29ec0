# SPDX-License-Identifier: MIT
"""rkmk4: Runge-Kutta-Munthe-Kaas of order 4 on the rotation group, the attitude by the exponential map.

Order 4, four evaluations a step. Source: Munthe-Kaas, BIT 38 (1998) 92; Iserles, Munthe-Kaas, Nørsett and Zanna, Acta
Numerica 9 (2000) 215. With R = R₀ exp(σ), σ' = ω + ½ σ × ω + 1/12 σ × (σ × ω) to the order needed. Unlike rk4 it keeps
the unit length of the attitude by construction; energy still drifts with h⁵ per step.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import exponential, multiply, normalize
from .equations import accelerations
from .integrator import ANGULAR_DAMPING, LOADS, STRING, Integrator
from .runge_kutta import repeated, repeated_on_string
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def _stage(y: np.ndarray, p: np.ndarray, h: float, taut: bool, k: tuple[float, ...]) -> tuple[float, ...]:
    """Rates (14) of σ, ω, d, u, work and heat at the variables that the rates k lead to in h seconds."""
    sx, sy, sz = h * k[0], h * k[1], h * k[2]
    rx, ry, rz, rw = exponential(sx, sy, sz)
    qx, qy, qz, qw = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, rw)
    wx, wy, wz = y[4] + h * k[3], y[5] + h * k[4], y[6] + h * k[5]
    dx, dy, dz = y[7] + h * k[6], y[8] + h * k[7], y[9] + h * k[8]
    ux, uy, uz = y[10] + h * k[9], y[11] + h * k[10], y[12] + h * k[11]
    ex, ey, ez, ax, ay, az, work, heat = accelerations(qx, qy, qz, qw, wx, wy, wz, dx, dy, dz, ux, uy, uz, p, taut)
    cx, cy, cz = sy * wz - sz * wy, sz * wx - sx * wz, sx * wy - sy * wx
    ox = wx + 0.5 * cx + (sy * cz - sz * cy) / 12.0
    oy = wy + 0.5 * cy + (sz * cx - sx * cz) / 12.0
    oz = wz + 0.5 * cz + (sx * cy - sy * cx) / 12.0
    return ox, oy, oz, ex, ey, ez, ux, uy, uz, ax, ay, az, work, heat


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.ndarray, h: float, taut: bool, out: np.ndarray) -> None:
    """One step of h seconds from y into out, the string's law given."""
    k1 = _stage(y, p, 0.0, taut, (0.0,) * 14)
    k2 = _stage(y, p, 0.5 * h, taut, k1)
    k3 = _stage(y, p, 0.5 * h, taut, k2)
    k4 = _stage(y, p, h, taut, k3)
    sixth = h / 6.0
    sx = sixth * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
    sy = sixth * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
    sz = sixth * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
    rx, ry, rz, rw = exponential(sx, sy, sz)
    qx, qy, qz, qw = multiply(y[0], y[1], y[2], y[3], rx, ry, rz, rw)
    out[0], out[1], out[2], out[3] = normalize(qx, qy, qz, qw)
    for j in range(11):
        out[4 + j] = y[4 + j] + sixth * (k1[3 + j] + 2.0 * (k2[3 + j] + k3[3 + j]) + k4[3 + j])


@njit(cache=True, error_model="numpy")
def rkmk4_steps(y: np.ndarray, p: np.ndarray, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    return repeated(_step, y, p, h, n)


@njit(cache=True, error_model="numpy")
def rkmk4_string_steps(y: np.ndarray, p: np.ndarray, h: float, n: int) -> int:
    """The same, each step cut where the string turns slack or taut."""
    return repeated_on_string(_step, y, p, h, n)


RKMK4 = Integrator(
    name="rkmk4",
    order=4,
    evaluations=4,
    source="Munthe-Kaas, BIT 38 (1998) 92",
    limits="Explicit: diverges beyond |ω|h of about 2.5; energy drifts with h⁵ per step.",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING, STRING},
    kernel=rkmk4_steps,
    string_kernel=rkmk4_string_steps,
    make_methods=fixed_steps,
)
