# SPDX-License-Identifier: MIT
"""lie_midpoint: the implicit midpoint rule on the rotation group, which keeps energy and angular momentum to rounding.

Order 2, implicit: Newton's method evaluates the loads 3 to 6 times a step. Sources: integrators/midpoint_spin.py.
Stable at any |ω|h at which the iteration finds a solution (about 2); attitude still errs with h², so a bounded energy
is no proof of a right motion.
"""

from __future__ import annotations

import numpy as np

from ...base.compilation import njit
from ...base.rotation import rotate
from .equations import torque
from .integrator import ANGULAR_DAMPING, LOADS, Integrator
from .midpoint_spin import (
    MAX_ITERATIONS,
    ROUNDING,
    cayley_turned,
    gyroscopic_torque,
    half_turned,
    mean_torque,
    newton_correction,
)
from .runge_kutta import is_good
from .stepping import fixed_steps


@njit(cache=True, error_model="numpy")
def _change_of_momentum(
    y: np.ndarray, ox: float, oy: float, oz: float, p: np.record, h: float
) -> tuple[float, float, float]:
    """I(ω⁺ − ω) that follows from the mean spin."""
    mx, my, mz, mw = half_turned(y[0], y[1], y[2], y[3], ox, oy, oz, h)
    tx, ty, tz = torque(mx, my, mz, mw, ox, oy, oz, p)
    tx, ty, tz = mean_torque(ox, oy, oz, tx, ty, tz, h)
    gx, gy, gz = gyroscopic_torque(ox, oy, oz, p)
    return h * (tx + gx), h * (ty + gy), h * (tz + gz)


@njit(cache=True, error_model="numpy")
def _step(y: np.ndarray, p: np.record, h: float, out: np.ndarray) -> bool:
    """One step from y into out; returns whether the iteration converged."""
    A, B, C = p.moments[0], p.moments[1], p.moments[2]
    wx, wy, wz = y[4], y[5], y[6]
    ox, oy, oz = wx, wy, wz
    change = 0.0
    converged = False
    for _ in range(MAX_ITERATIONS):
        kx, ky, kz = _change_of_momentum(y, ox, oy, oz, p, h)
        rx, ry, rz = 2.0 * A * (ox - wx) - kx, 2.0 * B * (oy - wy) - ky, 2.0 * C * (oz - wz) - kz
        ex, ey, ez = newton_correction(ox, oy, oz, rx, ry, rz, h, p, 0.0, 0.0, 0.0, 0.0)
        ox, oy, oz = ox + ex, oy + ey, oz + ez
        before, change = change, max(abs(ex), abs(ey), abs(ez))
        size = max(abs(ox), abs(oy), abs(oz))
        # Converged when corrections are rounding and no longer shrink.
        if change <= ROUNDING * size or (change <= 64.0 * ROUNDING * size and before != 0.0 and change >= 0.5 * before):
            converged = True
            break
    kx, ky, kz = _change_of_momentum(y, ox, oy, oz, p, h)
    out[4], out[5], out[6] = wx + kx / A, wy + ky / B, wz + kz / C
    out[0], out[1], out[2], out[3] = cayley_turned(y[0], y[1], y[2], y[3], ox, oy, oz, h)
    if p.translates:
        own, added, c = p.acceleration_body, p.acceleration_added, p.damping_linear
        mx, my, mz, mw = half_turned(y[0], y[1], y[2], y[3], ox, oy, oz, h)
        push = rotate(mx, my, mz, mw, own[0], own[1], own[2])
        for k in range(3):
            # v⁺ = v + h(a − c ½(v + v⁺)), solved.
            mean = (y[10 + k] + 0.5 * h * (push[k] + added[k])) / (1.0 + 0.5 * h * c)
            out[7 + k] = y[7 + k] + h * mean
            out[10 + k] = y[10 + k] + h * (push[k] + added[k] - c * mean)
    return converged


@njit(cache=True, error_model="numpy")
def lie_midpoint_steps(y: np.ndarray, p: np.record, h: float, n: int) -> int:
    """Up to n steps of h seconds in place; returns the number of good ones."""
    new = y.copy()
    for done in range(n):
        if not _step(y, p, h, new) or not is_good(new):
            return done
        y[:] = new
    return n


LIE_MIDPOINT = Integrator(
    name="lie_midpoint",
    order=2,
    evaluations=4,
    source="Simo and Wong, Int. J. Numer. Meth. Engng 31 (1991) 19",
    limits="No string; keeps energy and momentum at any step it can solve, attitude errs with h².",
    stability_limit=1.0,
    supports=LOADS | {ANGULAR_DAMPING},
    kernel=lie_midpoint_steps,
    make_methods=fixed_steps,
)
