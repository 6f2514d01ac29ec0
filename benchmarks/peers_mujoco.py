# SPDX-License-Identifier: MIT
"""MuJoCo: one free body, no contacts; steps are taken in C by one call of mj_step(model, data, n)."""

from __future__ import annotations

import mujoco
import numpy as np

from peers import Contestant, Run
from problems import Problem

# A blow-up is a row of the table; by default MuJoCo also writes it to a log file in the working folder.
mujoco.set_mju_user_warning(lambda text: None)

INTEGRATORS = {"Euler": 1.4, "implicitfast": 1.8, "implicit": 2.4, "RK4": 6.0}


def contestants() -> list[Contestant]:
    """All four integrators."""

    def bind(name):
        return lambda problem, step: prepare(problem, step, name)

    return [Contestant("mujoco", mujoco.__version__, name, bind(name), cost=cost) for name, cost in INTEGRATORS.items()]


def prepare(problem: Problem, step: float, integrator: str) -> Run | None:
    """None for what has no counterpart: isotropic damping, timed wrenches, a damped string that can go slack."""
    if problem.linear_damping or problem.angular_damping or not problem.constant_body_wrench:
        return None
    spring = problem.spring
    if spring is not None and not spring.bilateral and spring.damping:
        return None
    model = mujoco.MjModel.from_xml_string(_mjcf(problem, step, integrator))
    data = mujoco.MjData(model)

    def restart():
        mujoco.mj_resetData(model, data)
        x, q, v, w = (np.array(problem.row[a:b]) for a, b in ((0, 3), (3, 7), (7, 10), (10, 13)))
        data.qpos[:] = [*x, q[3], q[0], q[1], q[2]]
        data.qvel[:] = [*v, *w]
        data.ctrl[:] = 1.0

    def advance(until: float):
        mujoco.mj_step(model, data, round((until - data.time) / step))

    def row():
        x, q = data.qpos[:3], data.qpos[3:]
        # MuJoCo resets a simulation that blew up to its start, and warns: that is no result.
        if any(w.number for w in data.warning):
            return np.full(13, np.nan)
        return np.array([*x, q[1], q[2], q[3], q[0], *data.qvel])

    restart()
    return Run(restart, advance, row, lambda: round(data.time / step))


def _numbers(values) -> str:
    return " ".join(repr(float(v)) for v in values)


def _mjcf(problem: Problem, step: float, integrator: str) -> str:
    I = problem.inertia
    sites, actuators, tendon, world = [], [], "", ""
    for k, w in enumerate(problem.wrenches):
        sites.append(f'<site name="s{k}" pos="{_numbers(w.point)}"/>')
        actuators.append(f'<general site="s{k}" gear="{_numbers([*w.force, *w.torque])}" gainprm="1"/>')
    if problem.spring is not None:
        s = problem.spring
        world = f'<site name="hand" pos="{_numbers(s.target)}"/>'
        sites.append(f'<site name="tie" pos="{_numbers(s.point)}"/>')
        # Two spring lengths are a dead band: no force below the second one.
        length = _numbers([s.rest_length if s.bilateral else 0.0, s.rest_length])
        tendon = (
            f'<tendon><spatial stiffness="{s.stiffness!r}" damping="{s.damping!r}" springlength="{length}">'
            '<site site="hand"/><site site="tie"/></spatial></tendon>'
        )
    full = _numbers([I[0][0], I[1][1], I[2][2], I[0][1], I[0][2], I[1][2]])
    return f"""<mujoco>
    <option timestep="{step!r}" integrator="{integrator}" gravity="{_numbers(problem.gravity)}">
      <flag contact="disable" constraint="disable"/>
    </option>
    <compiler boundmass="0" boundinertia="0"/>
    <worldbody>{world}<body name="b"><freejoint/>
      <inertial pos="0 0 0" mass="{problem.mass!r}" fullinertia="{full}"/>{"".join(sites)}
    </body></worldbody>
    <actuator>{"".join(actuators)}</actuator>{tendon}
    </mujoco>"""
