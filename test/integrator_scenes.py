# SPDX-License-Identifier: MIT
"""Scenes that exercise everything an integrator can carry, and their high-precision motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from flights import SECOND, flight, wrench
from reference_motion import angle_between, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from problems import P2
from rigid_proto_ros.base.rotation import cross
from rigid_proto_ros.motion.body import make_body
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
from rigid_proto_ros.motion.string import StringSettings
from rigid_proto_ros.simulation.simulation import Simulation

TENSOR = ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9))
MASS = 2.0
BODY = make_body(MASS, (0.0, 0.0, 0.0), TENSOR)
ROW = (0.3, -0.2, 0.1, 0.2, -0.4, 0.4, 0.8, 0.4, 0.1, -0.3, 0.9, 1.3, -0.6)
POINT, FORCE = P2.wrenches[0].point, P2.wrenches[0].force
FORCE_WORLD, TORQUE_WORLD, TORQUE_BODY = (0.4, -0.7, 0.5), (0.2, 0.3, -0.4), (-0.3, 0.2, 0.4)
ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Scene:
    """What acts: keys of the integrators' needs, and always gravity, linear damping and a world force."""

    needs: frozenset
    string: StringSettings | None = None

    @property
    def around(self) -> dict:
        """What acts beside wrenches and a string."""
        return {
            "gravity": np.array((0.0, 0.0, -9.81)),
            "linear_damping": 0.3,
            "angular_damping": 0.2 if ANGULAR_DAMPING in self.needs else 0.0,
            "gyroscopic": NO_GYROSCOPIC_TERM not in self.needs,
        }

    @property
    def wrenches(self) -> list[tuple]:
        """Axes, point, force, torque of each."""
        at_point = "point/" + ",".join(map(repr, POINT))
        found = [("world", "com", FORCE_WORLD, ZERO)]
        if WORLD_TORQUE in self.needs:
            found = [("world", at_point, FORCE_WORLD, TORQUE_WORLD)]
        torque, force = BODY_TORQUE in self.needs, BODY_FORCE in self.needs
        if torque or force:
            point = at_point if torque and force else "com"
            found.append(("body", point, FORCE if force else ZERO, TORQUE_BODY if torque else ZERO))
        return found

    def simulation(self, integrator: str, step_ns: int = SECOND // 1000, accuracy: float = 1e-9) -> Simulation:
        """A simulation that all of it acts in from the start."""
        simulation = flight(
            BODY,
            integrator=integrator,
            step_s=step_ns / SECOND,
            accuracy=accuracy,
            initial=ROW,
            string=self.string or StringSettings(),
            **self.around,
        )
        for axes, point, force, torque in self.wrenches:
            simulation.submit(wrench(f"{axes}@{point};slot={axes}", force, torque))
        return simulation

    def reference(self, times) -> list:
        """Rows of 13 mpf at the times [s]."""
        return _reference(self, tuple(times))


@lru_cache(maxsize=64)
def _reference(scene: Scene, times):
    string = None
    if scene.string is not None:
        tied = scene.simulation("auto").string
        string = ReferenceString(
            tied.attach,
            tuple(tied.target),
            tied.stiffness,
            tied.damping,
            tied.rest_length,
            tied.bilateral,
        )
    loads = {}
    for axes, point, force, torque in scene.wrenches:
        if axes == "world":
            loads |= {"force_world": force, "torque_world": torque}
            if point != "com":
                loads["moment"] = tuple(tuple(r * f for f in force) for r in POINT)
        else:
            arm = ZERO if point == "com" else POINT
            turned = tuple(float(a + b) for a, b in zip(torque, cross(arm, force), strict=True))
            loads |= {"force_body": force, "torque_body": turned}
    around = {**scene.around, "gravity": tuple(map(float, scene.around["gravity"]))}
    problem = ReferenceProblem(mass=MASS, inertia=TENSOR, **around, **loads, string=string)
    return reference_motion(problem, ROW, times, digits=20)


def scene_for(integrator: Integrator, **changes) -> Scene:
    """Everything that the integrator carries except a string and a dropped gyroscopic term."""
    return Scene(integrator.supports - {STRING, NO_GYROSCOPIC_TERM}, **changes)


def flown(name: str, scene: Scene, step_ns: int, until_ns: int) -> State:
    """The state at ``until_ns`` by fixed steps."""
    return scene.simulation(name, step_ns).advance(until_ns)


def error(state: State, reference) -> float:
    """Largest of attitude angle [rad] and absolute errors of position, velocity and spin against a row of mpf."""
    angle = angle_between(state.orientation_xyzw, rotation_of(reference[3:7]))
    others = [abs(float(reference[i] - float(state.row[i]))) for i in (0, 1, 2, 7, 8, 9, 10, 11, 12)]
    return max(angle, *others)
