# SPDX-License-Identifier: MIT
"""SciPy: DOP853 with error control on a right-hand side compiled by numba; the step is the relative tolerance."""

from __future__ import annotations

import time

import numpy as np
import scipy
from numba import njit
from scipy.integrate import solve_ivp

from peers import Contestant, Run
from problems import Problem


def contestants() -> list[Contestant]:
    """DOP853."""
    return [Contestant("scipy", scipy.__version__, "DOP853", prepare, tolerance=True, cost=100.0)]


def prepare(problem: Problem, tolerance: float) -> Run | None:
    """None for strings that can go slack and timed wrenches: each switch would need an event function in Python."""
    if not problem.constant_body_wrench or (problem.spring is not None and not problem.spring.bilateral):
        return None
    right_hand_side = _right_hand_side(problem)
    begin = time.perf_counter()
    right_hand_side(0.0, np.array(problem.row))
    compile_s = time.perf_counter() - begin
    now = {}

    def restart():
        now.update(t=0.0, y=np.array(problem.row), steps=0)

    def advance(until: float):
        solution = solve_ivp(
            right_hand_side, (now["t"], until), now["y"], method="DOP853", rtol=tolerance, atol=0.01 * tolerance
        )
        y = solution.y[:, -1] if solution.success else np.full(13, np.nan)
        now.update(t=until, y=y, steps=now["steps"] + len(solution.t) - 1)

    restart()
    return Run(restart, advance, lambda: now["y"].copy(), lambda: now["steps"], compile_s)


def _right_hand_side(problem: Problem):
    """d/dt of x, q, v, ω of this problem, compiled for its constants."""
    I = np.array(problem.inertia)
    inverse = np.linalg.inv(I)
    m = problem.mass
    gravity = np.array(problem.gravity)
    force, torque = np.zeros(3), np.zeros(3)
    for w in problem.wrenches:
        force += w.force
        torque += np.array(w.torque) + np.cross(w.point, w.force)
    s = problem.spring
    has_string = s is not None
    k, c, rest = (s.stiffness, s.damping, s.rest_length) if has_string else (0.0, 0.0, 0.0)
    arm, target = (np.array(s.point), np.array(s.target)) if has_string else (np.zeros(3), np.zeros(3))
    linear, angular = problem.linear_damping, problem.angular_damping

    @njit
    def rates(t, y):
        out = np.empty(13)
        qx, qy, qz, qw = y[3], y[4], y[5], y[6]
        n = 2.0 / (qx * qx + qy * qy + qz * qz + qw * qw)
        R = np.empty((3, 3))
        R[0, 0], R[0, 1], R[0, 2] = 1 - n * (qy * qy + qz * qz), n * (qx * qy - qw * qz), n * (qx * qz + qw * qy)
        R[1, 0], R[1, 1], R[1, 2] = n * (qx * qy + qw * qz), 1 - n * (qx * qx + qz * qz), n * (qy * qz - qw * qx)
        R[2, 0], R[2, 1], R[2, 2] = n * (qx * qz - qw * qy), n * (qy * qz + qw * qx), 1 - n * (qx * qx + qy * qy)
        w0, w1, w2 = y[10], y[11], y[12]
        fx, fy, fz = force[0], force[1], force[2]
        tx, ty, tz = torque[0] - angular * w0, torque[1] - angular * w1, torque[2] - angular * w2
        if has_string:
            u = np.array([w1 * arm[2] - w2 * arm[1], w2 * arm[0] - w0 * arm[2], w0 * arm[1] - w1 * arm[0]])
            d, speed, length2, rate = np.empty(3), np.empty(3), 0.0, 0.0
            for i in range(3):
                d[i] = target[i] - y[i] - (R[i, 0] * arm[0] + R[i, 1] * arm[1] + R[i, 2] * arm[2])
                speed[i] = -y[7 + i] - (R[i, 0] * u[0] + R[i, 1] * u[1] + R[i, 2] * u[2])
                length2 += d[i] * d[i]
                rate += d[i] * speed[i]
            length = np.sqrt(length2)
            pull = (k * (length - rest) + c * rate / length) / length
            b = np.empty(3)
            for i in range(3):
                b[i] = pull * (R[0, i] * d[0] + R[1, i] * d[1] + R[2, i] * d[2])
            fx, fy, fz = fx + b[0], fy + b[1], fz + b[2]
            tx += arm[1] * b[2] - arm[2] * b[1]
            ty += arm[2] * b[0] - arm[0] * b[2]
            tz += arm[0] * b[1] - arm[1] * b[0]
        l0 = I[0, 0] * w0 + I[0, 1] * w1 + I[0, 2] * w2
        l1 = I[1, 0] * w0 + I[1, 1] * w1 + I[1, 2] * w2
        l2 = I[2, 0] * w0 + I[2, 1] * w1 + I[2, 2] * w2
        tx, ty, tz = tx - (w1 * l2 - w2 * l1), ty - (w2 * l0 - w0 * l2), tz - (w0 * l1 - w1 * l0)
        for i in range(3):
            out[i] = y[7 + i]
            out[7 + i] = gravity[i] + (R[i, 0] * fx + R[i, 1] * fy + R[i, 2] * fz - linear * y[7 + i]) / m
            out[10 + i] = inverse[i, 0] * tx + inverse[i, 1] * ty + inverse[i, 2] * tz
        out[3] = 0.5 * (qw * w0 + qy * w2 - qz * w1)
        out[4] = 0.5 * (qw * w1 - qx * w2 + qz * w0)
        out[5] = 0.5 * (qw * w2 + qx * w1 - qy * w0)
        out[6] = -0.5 * (qx * w0 + qy * w1 + qz * w2)
        return out

    return rates
