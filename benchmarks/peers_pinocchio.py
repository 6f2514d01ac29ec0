# SPDX-License-Identifier: MIT
"""Pinocchio: its articulated-body algorithm and its Lie group integrate(), in a Runge-Kutta-Munthe-Kaas step of order 4.

Pinocchio ships no time stepper; this is the one that its functions suggest. The loop is Python over compiled calls.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from peers import Contestant, Run
from problems import Problem


def contestants() -> list[Contestant]:
    """aba + RKMK4."""
    return [Contestant("pinocchio", pin.__version__, "aba+RKMK4", prepare, cost=20.0)]


def prepare(problem: Problem, step: float) -> Run | None:
    """None for damping, strings and timed wrenches, which would be written here and not be Pinocchio's."""
    if problem.linear_damping or problem.angular_damping or problem.spring or not problem.constant_body_wrench:
        return None
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(
        joint, pin.Inertia(problem.mass, np.zeros(3), np.array(problem.inertia)), pin.SE3.Identity()
    )
    model.gravity.linear = np.array(problem.gravity)
    data = model.createData()
    forces = [pin.Force.Zero(), pin.Force.Zero()]
    for w in problem.wrenches:
        forces[1] += pin.Force(np.array(w.force), np.array(w.torque) + np.cross(w.point, w.force))
    external = pin.StdVec_Force()
    external.extend(forces)
    zero = np.zeros(6)
    now = {"steps": 0}

    def restart():
        # At the identity attitude body and world axes agree.
        now.update(q=np.array(problem.row[:7]), v=np.array(problem.row[7:13]), steps=0)

    def advance(until: float):
        q, v = now["q"], now["v"]
        n = round(until / step) - now["steps"]
        aba, integrate, h = pin.aba, pin.integrate, step
        for _ in range(n):
            a1 = aba(model, data, q, v, zero, external)
            v2 = v + (0.5 * h) * a1
            a2 = aba(model, data, integrate(model, q, (0.5 * h) * v), v2, zero, external)
            v3 = v + (0.5 * h) * a2
            # Munthe-Kaas: the displacement u from the step's start, in body axes, obeys u' = v + ½ [u, v] + ...
            u3 = (0.5 * h) * v2
            a3 = aba(model, data, integrate(model, q, u3 + (h * h / 8.0) * _bracket(v, v2)), v3, zero, external)
            v4 = v + h * a3
            a4 = aba(model, data, integrate(model, q, h * v3), v4, zero, external)
            u = (h / 6.0) * (v + 2.0 * (v2 + v3) + v4) + (h * h / 12.0) * _bracket(v, v4)
            q = integrate(model, q, u)
            v = v + (h / 6.0) * (a1 + 2.0 * (a2 + a3) + a4)
        now.update(q=q, v=v, steps=now["steps"] + n)

    def row():
        q, v = now["q"], now["v"]
        R = pin.Quaternion(q[3:7]).matrix()
        return np.array([*q, *(R @ v[:3]), *v[3:]])

    restart()
    return Run(restart, advance, row, lambda: now["steps"])


def _bracket(a, b):
    """[a, b] of two body twists (linear, angular)."""
    return pin.Motion(a).cross(pin.Motion(b)).vector
