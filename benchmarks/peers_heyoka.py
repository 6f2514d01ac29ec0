# SPDX-License-Identifier: MIT
"""heyoka.py: adaptive Taylor series compiled for each system; the step is the tolerance.

Each problem is written as its users would write it: principal axes, a quaternion, and where loads change, parameters of the
compiled system that are set between two calls of ``propagate_until``. Compiling is for one system and one tolerance.
"""

from __future__ import annotations

import time

import heyoka
import numpy as np

from peers import Contestant, Run, quaternion_of, quaternion_product
from problems import Problem, Wrench, rotation

LOADS = 21
"""Parameters: force [N] and torque [N m] fixed to the body (principal axes), force and torque fixed to the world, and the sum
of r Fᵀ (3, 3) over world forces F at body points r.
"""


def contestants() -> list[Contestant]:
    """The adaptive integrator."""
    return [Contestant("heyoka", heyoka.__version__, "Taylor", prepare, tolerance=True, cost=100.0)]


def prepare(problem: Problem, tolerance: float) -> Run | None:
    """None for ropes that go slack while the problem lasts, P3p; the heavy crate's stays taut."""
    spring = problem.spring
    if spring is not None and not spring.bilateral and not problem.name.startswith("heavy"):
        return None
    axes, start = start_of(problem)
    begin = time.perf_counter()
    integrator = heyoka.taylor_adaptive(
        system(problem, axes), list(start), pars=[0.0] * parameters(problem), tol=tolerance
    )
    compile_s = time.perf_counter() - begin
    pieces = pieces_of(problem, axes)
    now = {"steps": 0}

    def restart():
        integrator.time = 0.0
        integrator.state[:] = start
        now["steps"] = 0

    def advance(until: float):
        for begin, end, loads, kick in pieces:
            if end <= integrator.time or begin >= until:
                continue
            if loads is not None:
                integrator.pars[:] = loads
            if kick is not None and integrator.time == begin:
                kick(integrator.state)
            outcome, _, _, steps, *_ = integrator.propagate_until(min(end, until))
            now["steps"] += steps
            if outcome != heyoka.taylor_outcome.time_limit:
                integrator.state[:] = np.nan
                return

    restart()
    return Run(restart, advance, lambda: row_of(integrator.state, axes), lambda: now["steps"], compile_s)


def start_of(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Principal axes (3, 3) as columns, and the variables q, ω, x, v (13,) at time 0."""
    _, axes = np.linalg.eigh(np.array(problem.inertia))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    row = np.array(problem.row)
    attitude = quaternion_product(row[3:7], quaternion_of(axes))
    return axes, np.concatenate([attitude, axes.T @ row[10:13], row[0:3], row[7:10]])


def row_of(state, axes) -> np.ndarray:
    """The state row (13,) of the variables."""
    turned = quaternion_of(axes) * [-1.0, -1.0, -1.0, 1.0]
    attitude = quaternion_product(state[0:4], turned)
    return np.concatenate([state[7:10], attitude / np.linalg.norm(attitude), state[10:13], axes @ state[4:7]])


def parameters(problem: Problem) -> int:
    """How many the compiled system has."""
    return 0 if problem.constant_body_wrench else LOADS


def pieces_of(problem: Problem, axes) -> list[tuple]:
    """(begin, end [s], parameters (12,) or None, what happens to the variables at its begin or None)."""
    if problem.constant_body_wrench:
        return [(0.0, problem.duration, None, None)]
    times = {0.0, problem.duration} | {t for w in problem.wrenches for t in (w.begin, w.end) if t is not None}
    ordered = sorted(times)
    pieces = []
    for begin, end in zip(ordered, ordered[1:], strict=False):
        loads = np.zeros(LOADS)
        kick = None
        for w in problem.wrenches:
            if w.impulse and w.begin == begin:
                kick = _impulse(problem, axes, w)
            elif not w.impulse and w.begin <= begin and (w.end is None or end <= w.end):
                loads += _loads(w, axes)
        pieces.append((begin, end, loads, kick))
    return pieces


def _loads(w: Wrench, axes) -> np.ndarray:
    """A wrench as parameters."""
    loads = np.zeros(LOADS)
    point, force, torque = axes.T @ w.point, np.array(w.force), np.array(w.torque)
    if w.axes == "body":
        loads[0:3] = axes.T @ force
        loads[3:6] = axes.T @ torque + np.cross(point, loads[0:3])
    else:
        loads[6:9], loads[9:12] = force, torque
        loads[12:21] = np.outer(point, force).ravel()
    return loads


def _impulse(problem: Problem, axes, w: Wrench):
    """What an impulse does to the variables (13,), or to those of several flights side by side (13, n)."""
    inverse = 1.0 / np.diag(axes.T @ np.array(problem.inertia) @ axes)
    force, torque, arm = np.array(w.force), np.array(w.torque), axes.T @ w.point

    def kick(state):
        R = rotation(state[0:4])
        if state.ndim > 1:
            own, turn = (
                np.repeat((axes.T @ v)[:, None], state.shape[1], axis=1)
                if w.axes == "body"
                else R[0] * v[0] + R[1] * v[1] + R[2] * v[2]
                for v in (force, torque)
            )
            state[4:7] += inverse[:, None] * (turn + np.cross(arm[:, None], own, axis=0))
            state[10:13] += (R * own).sum(axis=1) / problem.mass
            return
        own = axes.T @ force if w.axes == "body" else R.T @ force
        turn = axes.T @ torque if w.axes == "body" else R.T @ torque
        state[4:7] += inverse * (turn + np.cross(arm, own))
        state[10:13] += (R @ own) / problem.mass

    return kick


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def system(problem: Problem, axes) -> list[tuple]:
    """The equations of motion as (variable, right-hand side)."""
    names = ["qx", "qy", "qz", "qw", "wx", "wy", "wz", "x", "y", "z", "vx", "vy", "vz"]
    variables = heyoka.make_vars(*names)
    qx, qy, qz, qw, wx, wy, wz, *_, vx, vy, vz = variables
    place, velocity, spin = variables[7:10], variables[10:13], variables[4:7]
    A, B, C = (float(m) for m in np.diag(axes.T @ np.array(problem.inertia) @ axes))
    mass = problem.mass
    R = [
        [1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy - qw * qz), 2.0 * (qx * qz + qw * qy)],
        [2.0 * (qx * qy + qw * qz), 1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz - qw * qx)],
        [2.0 * (qx * qz - qw * qy), 2.0 * (qy * qz + qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)],
    ]
    damping = problem.angular_damping
    torques = [-damping * rate if damping else 0.0 for rate in spin]
    accelerations = [float(g) for g in problem.gravity]
    if problem.linear_damping:
        accelerations = [a - (problem.linear_damping / mass) * v for a, v in zip(accelerations, velocity, strict=True)]
    if problem.constant_body_wrench:
        loads = sum((_loads(w, axes) for w in problem.wrenches), np.zeros(LOADS))
        force, torque = [float(c) for c in loads[0:3]], [float(c) for c in loads[3:6]]
    else:
        force, torque = [heyoka.par[k] for k in range(3)], [heyoka.par[k] for k in range(3, 6)]
        accelerations = [a + heyoka.par[6 + k] / mass for k, a in enumerate(accelerations)]
        M = [[heyoka.par[12 + 3 * i + k] for k in range(3)] for i in range(3)]
        turned = [[_dot(M[i], [R[n][j] for n in range(3)]) for j in range(3)] for i in range(3)]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            world = _dot([R[n][k] for n in range(3)], [heyoka.par[9 + n] for n in range(3)])
            torques[k] = torques[k] + world + turned[i][j] - turned[j][i]
    if problem.wrenches:
        accelerations = [a + _dot(R[k], [f / mass for f in force]) for k, a in enumerate(accelerations)]
    torques = [t + c for t, c in zip(torques, torque, strict=True)]
    if problem.spring is not None:
        s = problem.spring
        arm = [float(c) for c in axes.T @ np.array(s.point)]
        swing = [
            spin[1] * arm[2] - spin[2] * arm[1],
            spin[2] * arm[0] - spin[0] * arm[2],
            spin[0] * arm[1] - spin[1] * arm[0],
        ]
        span = [place[k] + sum(R[k][j] * arm[j] for j in range(3)) - s.target[k] for k in range(3)]
        speed = [velocity[k] + sum(R[k][j] * swing[j] for j in range(3)) for k in range(3)]
        square = span[0] * span[0] + span[1] * span[1] + span[2] * span[2]
        length = heyoka.sqrt(square)
        pull = s.stiffness * (length - s.rest_length) / length
        if s.damping:
            pull = pull + s.damping * (span[0] * speed[0] + span[1] * speed[1] + span[2] * speed[2]) / square
        pulls = [-pull * c for c in span]
        accelerations = [a + f / mass for a, f in zip(accelerations, pulls, strict=True)]
        b = [sum(R[k][j] * pulls[k] for k in range(3)) for j in range(3)]
        torques = [
            torques[0] + arm[1] * b[2] - arm[2] * b[1],
            torques[1] + arm[2] * b[0] - arm[0] * b[2],
            torques[2] + arm[0] * b[1] - arm[1] * b[0],
        ]
    return [
        (qx, 0.5 * (qw * wx + qy * wz - qz * wy)),
        (qy, 0.5 * (qw * wy - qx * wz + qz * wx)),
        (qz, 0.5 * (qw * wz + qx * wy - qy * wx)),
        (qw, -0.5 * (qx * wx + qy * wy + qz * wz)),
        (wx, (torques[0] + (B - C) * wy * wz) / A),
        (wy, (torques[1] + (C - A) * wz * wx) / B),
        (wz, (torques[2] + (A - B) * wx * wy) / C),
        *zip(place, (vx, vy, vz), strict=True),
        *(
            (v, heyoka.expression(a) if isinstance(a, float) else a)
            for v, a in zip(velocity, accelerations, strict=True)
        ),
    ]
