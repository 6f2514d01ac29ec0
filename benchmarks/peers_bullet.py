# SPDX-License-Identifier: MIT
"""PyBullet: a free multibody without damping, as loadURDF makes it with the flags that keep its tensor and its momentum."""

from __future__ import annotations

import tempfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pybullet

from peers import Contestant, Run, quaternion_of, quaternion_product
from problems import Problem, rotation


def contestants() -> list[Contestant]:
    """Its one stepper."""
    return [Contestant("bullet", version("pybullet"), "multibody", prepare, cost=1.2)]


def prepare(problem: Problem, step: float) -> Run | None:
    """Torque-free problems; a force fixed to the body would have to be set again from Python at every step."""
    if not problem.torque_free:
        return None
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(step, physicsClientId=client)
    pybullet.setPhysicsEngineParameter(numSolverIterations=1, physicsClientId=client)
    pybullet.setGravity(*problem.gravity, physicsClientId=client)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.urdf"
        path.write_text(_urdf(problem))
        flags = pybullet.URDF_USE_INERTIA_FROM_FILE
        body = pybullet.loadURDF(str(path), flags=flags, physicsClientId=client)
    pybullet.changeDynamics(
        body,
        -1,
        linearDamping=0.0,
        angularDamping=0.0,
        maxJointVelocity=1e9,
        activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
        physicsClientId=client,
    )
    taken = [0]
    x, v, w = (problem.row[a:b] for a, b in ((0, 3), (7, 10), (10, 13)))
    # At the identity attitude the principal axes are where they are in the body.
    axes = _principal(problem)[1]
    q = quaternion_of(axes)

    def restart():
        pybullet.resetBasePositionAndOrientation(body, x, q, physicsClientId=client)
        pybullet.resetBaseVelocity(body, v, w, physicsClientId=client)
        taken[0] = 0

    def advance(until: float):
        n = round(until / step) - taken[0]
        advance_one = pybullet.stepSimulation
        for _ in range(n):
            advance_one(client)
        taken[0] += n

    def row():
        position, attitude = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        linear, angular = pybullet.getBaseVelocity(body, physicsClientId=client)
        attitude = quaternion_product(attitude, q * [-1, -1, -1, 1])
        return np.array([*position, *attitude, *linear, *(rotation(attitude).T @ angular)])

    restart()
    return Run(restart, advance, row, lambda: taken[0])


def _principal(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Moments and proper axes: Bullet refuses a full tensor of a flat body, whose A + B ≥ C fails by rounding."""
    moments, axes = np.linalg.eigh(np.array(problem.inertia))
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return moments, axes


def _urdf(problem: Problem) -> str:
    a, b, c = (repr(float(m)) for m in _principal(problem)[0])
    return (
        f'<robot name="r"><link name="b"><inertial><mass value="{problem.mass!r}"/>'
        f'<inertia ixx="{a}" ixy="0" ixz="0" iyy="{b}" iyz="0" izz="{c}"/></inertial></link></robot>'
    )
