# SPDX-License-Identifier: MIT
"""Drake: MultibodyPlant with one floating body; discrete, or continuous with a Runge-Kutta integrator at a fixed step."""

from __future__ import annotations

import math
from importlib.metadata import version

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo
from pydrake.multibody.tree import LinearSpringDamper, RotationalInertia, SpatialInertia, UnitInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from peers import Contestant, Run
from problems import Problem

INTEGRATORS = {"discrete": 7.8, "runge_kutta3": 12.4, "runge_kutta5": 27.0}


def contestants() -> list[Contestant]:
    """The discrete plant, RK3 and RK5."""

    def bind(name):
        return lambda problem, step: prepare(problem, step, name)

    return [Contestant("drake", version("drake"), name, bind(name), cost=cost) for name, cost in INTEGRATORS.items()]


def prepare(problem: Problem, step: float, integrator: str) -> Run | None:
    """None for damping, timed wrenches, body torques and strings that can go slack; Drake refuses thin tensors itself."""
    spring = problem.spring
    if problem.linear_damping or problem.angular_damping or not problem.constant_body_wrench:
        return None
    if any(any(w.torque) for w in problem.wrenches) or (spring is not None and not spring.bilateral):
        return None
    discrete = integrator == "discrete"
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(time_step=step if discrete else 0.0))
    body = plant.AddRigidBody("body", _inertia(problem))
    plant.mutable_gravity_field().set_gravity_vector(problem.gravity)
    if spring is not None:
        plant.AddForceElement(
            LinearSpringDamper(
                plant.world_body(),
                spring.target,
                body,
                spring.point,
                spring.rest_length,
                spring.stiffness,
                spring.damping,
            )
        )
    plant.Finalize()
    if problem.wrenches:
        _add_forces(builder, plant, body, problem)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    if not discrete:
        ResetIntegratorFromFlags(simulator, integrator, step)
        simulator.get_mutable_integrator().set_fixed_step_mode(True)
    context = diagram.GetMutableSubsystemContext(plant, simulator.get_mutable_context())

    def restart():
        x, q, v, w = (np.array(problem.row[a:b]) for a, b in ((0, 3), (3, 7), (7, 10), (10, 13)))
        plant.SetPositions(context, [q[3], q[0], q[1], q[2], *x])
        # The attitude is the identity at the start of every problem, so body rates are world rates.
        plant.SetVelocities(context, [*w, *v])
        simulator.get_mutable_context().SetTime(0.0)
        simulator.Initialize()

    def row():
        q, v = plant.GetPositions(context), plant.GetVelocities(context)
        if not np.isfinite(q).all():
            return np.full(13, np.nan)
        R = plant.EvalBodyPoseInWorld(context, body).rotation().matrix()
        return np.array([*q[4:7], q[1], q[2], q[3], q[0], *v[3:6], *(R.T @ v[:3])])

    restart()
    return Run(restart, simulator.AdvanceTo, row, lambda: round(simulator.get_context().get_time() / step))


def _inertia(problem: Problem) -> SpatialInertia:
    I = problem.inertia
    rotational = RotationalInertia(I[0][0], I[1][1], I[2][2], I[0][1], I[0][2], I[1][2])
    unit = UnitInertia().SetFromRotationalInertia(rotational, problem.mass)
    return SpatialInertia(problem.mass, np.zeros(3), unit)


def _add_forces(builder, plant, body, problem: Problem) -> None:
    """A propeller's thrust is a force fixed to the body, along the z axis of its own frame."""
    infos = []
    for w in problem.wrenches:
        force = np.array(w.force)
        turn = RotationMatrix.MakeFromOneVector(force / np.linalg.norm(force), 2)
        infos.append(
            PropellerInfo(
                body_index=body.index(), X_BP=RigidTransform(turn, w.point), thrust_ratio=math.dist(force, (0, 0, 0))
            )
        )
    propeller = builder.AddSystem(Propeller(infos))
    source = builder.AddSystem(ConstantVectorSource(np.ones(len(infos))))
    builder.Connect(source.get_output_port(), propeller.get_command_input_port())
    builder.Connect(propeller.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port())
    builder.Connect(plant.get_body_poses_output_port(), propeller.get_body_poses_input_port())
