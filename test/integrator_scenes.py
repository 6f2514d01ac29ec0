# SPDX-License-Identifier: MIT
"""Scenes that exercise everything an integrator can carry, and their high-precision motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from one_segment import OneSegment, make_problem
from reference_motion import angle_between, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from problems import P2
from rigid_proto_ros.base.rotation import cross
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.integrator import (
    ANGULAR_DAMPING,
    BODY_FORCE,
    BODY_TORQUE,
    NO_GYROSCOPIC_TERM,
    STRING,
    WORLD_TORQUE,
    Integrator,
)
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.motion.string import StringSettings, StringState, tie

TENSOR = ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9))
MASS = 2.0
ROW = (0.3, -0.2, 0.1, 0.2, -0.4, 0.4, 0.8, 0.4, 0.1, -0.3, 0.9, 1.3, -0.6)
POINT, FORCE = P2.wrenches[0].point, P2.wrenches[0].force


@dataclass(frozen=True)
class Scene:
    """What acts: keys of the integrators' needs, and always gravity and linear damping."""

    needs: frozenset
    string: StringSettings | None = None

    def problem_and_start(self) -> tuple[np.ndarray, State]:
        """The core's problem and the state it starts from."""
        body, state = make_body(MASS, (0.0, 0.0, 0.0), TENSOR), State(0, np.array(ROW))
        wanted = self._values()
        sums = ("force_world", "force_body", "torque_world", "torque_body", "moment")
        loads = np.concatenate([np.ravel(wanted[name]) for name in sums])
        problem = make_problem(
            body,
            loads,
            wanted["gravity"],
            wanted["linear_damping"],
            wanted["angular_damping"],
            wanted["gyroscopic"],
            state,
            self.tied(body, state),
        )
        return problem, state

    def tied(self, body, state) -> StringState | None:
        return tie(self.string, self.string.attach, self.string.target, body, state, 0) if self.string else None

    def reference(self, times) -> list:
        """Rows of 13 mpf at the times [s]."""
        return _reference(self, tuple(times))

    def _values(self) -> dict:
        force_world, force_body = np.array((0.4, -0.7, 0.5)), np.array(FORCE)
        world, body = WORLD_TORQUE in self.needs, BODY_FORCE in self.needs
        torque = BODY_TORQUE in self.needs
        point = np.array(POINT)
        return {
            "gravity": np.array((0.0, 0.0, -9.81)),
            "force_world": force_world,
            "force_body": force_body if body else np.zeros(3),
            "torque_world": np.array((0.2, 0.3, -0.4)) if world else np.zeros(3),
            "torque_body": (cross(point, force_body) if body else 0.0) + np.array((-0.3, 0.2, 0.4))
            if torque
            else np.zeros(3),
            "moment": point[:, None] * force_world if world else np.zeros((3, 3)),
            "linear_damping": 0.3,
            "angular_damping": 0.2 if ANGULAR_DAMPING in self.needs else 0.0,
            "gyroscopic": NO_GYROSCOPIC_TERM not in self.needs,
        }


@lru_cache(maxsize=64)
def _reference(scene: Scene, times):
    values, string = scene._values(), None
    if scene.string is not None:
        body, state = make_body(MASS, (0.0, 0.0, 0.0), TENSOR), State(0, np.array(ROW))
        tied = scene.tied(body, state)
        string = ReferenceString(
            tied.attach,
            tuple(tied.target),
            tied.stiffness,
            tied.damping,
            tied.rest_length,
            tied.bilateral,
        )
    problem = ReferenceProblem(
        mass=MASS,
        inertia=TENSOR,
        moment=tuple(tuple(float(x) for x in row) for row in values.pop("moment")),
        **{k: tuple(float(x) for x in v) if isinstance(v, np.ndarray) else v for k, v in values.items()},
        string=string,
    )
    return reference_motion(problem, ROW, times, digits=20)


def scene_for(integrator: Integrator, **changes) -> Scene:
    """Everything that the integrator carries except a string and a dropped gyroscopic term."""
    return Scene(integrator.supports - {STRING, NO_GYROSCOPIC_TERM}, **changes)


def flown(integrator: Integrator | str, scene: Scene, step_ns: int, until_ns: int) -> State:
    """The state at ``until_ns`` by fixed steps."""
    integrator = INTEGRATORS[integrator] if isinstance(integrator, str) else integrator
    problem, start = scene.problem_and_start()
    segment = OneSegment(start, problem, integrator, step_ns)
    segment.advance(until_ns)
    return segment.look(until_ns)


def error(state: State, reference) -> float:
    """Largest of attitude angle [rad] and absolute errors of position, velocity and spin against a row of mpf."""
    angle = angle_between(state.orientation_xyzw, rotation_of(reference[3:7]))
    others = [abs(float(reference[i] - float(state.row[i]))) for i in (0, 1, 2, 7, 8, 9, 10, 11, 12)]
    return max(angle, *others)
