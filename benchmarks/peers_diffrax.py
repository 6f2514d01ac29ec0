# SPDX-License-Identifier: MIT
"""diffrax: Tsit5 with a PID step-size controller on the CPU in double precision; the step is the relative tolerance."""

from __future__ import annotations

import time

import jax

jax.config.update("jax_enable_x64", True)

import diffrax
import jax.numpy as jnp
import numpy as np

from peers import Contestant, Run
from problems import Problem


def contestants() -> list[Contestant]:
    """Tsit5 and Dopri8."""

    def bind(name):
        return lambda problem, tolerance: prepare(problem, tolerance, name)

    return [
        Contestant("diffrax", diffrax.__version__, name, bind(name), tolerance=True, cost=10.0)
        for name in ("Tsit5", "Dopri8")
    ]


def prepare(problem: Problem, tolerance: float, solver: str) -> Run | None:
    """None for strings and timed wrenches."""
    if problem.spring or not problem.constant_body_wrench:
        return None
    I, m = jnp.array(problem.inertia), problem.mass
    inverse = jnp.array(np.linalg.inv(np.array(problem.inertia)))
    gravity = jnp.array(problem.gravity)
    force, torque = np.zeros(3), np.zeros(3)
    for w in problem.wrenches:
        force += w.force
        torque += np.array(w.torque) + np.cross(w.point, w.force)

    def rates(t, y, args):
        u, s, v, w = y[3:6], y[6], y[7:10], y[10:13]
        n = u @ u + s * s
        turned = force + 2.0 * jnp.cross(u, jnp.cross(u, force) + s * force) / n
        acceleration = gravity + (turned - problem.linear_damping * v) / m
        spin = inverse @ (torque - problem.angular_damping * w - jnp.cross(w, I @ w))
        return jnp.concatenate([v, 0.5 * (s * w + jnp.cross(u, w)), -0.5 * (u @ w)[None], acceleration, spin])

    controller = diffrax.PIDController(rtol=tolerance, atol=0.01 * tolerance)
    term, method = diffrax.ODETerm(rates), getattr(diffrax, solver)()

    @jax.jit
    def solve(y, begin, end):
        result = diffrax.diffeqsolve(
            term, method, begin, end, None, y, stepsize_controller=controller, max_steps=10_000_000, throw=False
        )
        return result.ys[-1], result.stats["num_accepted_steps"]

    start = jnp.array(problem.row)
    begin = time.perf_counter()
    solve(start, 0.0, 1e-3)[0].block_until_ready()
    compile_s = time.perf_counter() - begin
    now = {}

    def restart():
        now.update(t=0.0, y=start, steps=0)

    def advance(until: float):
        y, steps = solve(now["y"], now["t"], until)
        y.block_until_ready()
        now.update(t=until, y=y, steps=now["steps"] + int(steps))

    restart()
    return Run(restart, advance, lambda: np.array(now["y"]), lambda: now["steps"], compile_s)
