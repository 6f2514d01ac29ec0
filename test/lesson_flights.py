# SPDX-License-Identifier: MIT
"""Bundled scenes flown and sampled, for what the lessons claim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_proto_ros.base.bundled import example_path
from rigid_proto_ros.motion.body import Body
from rigid_proto_ros.scene.scenario import nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.simulation.simulation import Simulation

Z = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Flight:
    """A scene flown and looked at every ``interval`` seconds; all arrays have one row a look, in world axes.

    rotation (n, 3, 3): body to world. spin and momentum (n, 3): ω [rad/s] and L [N m s]. energy: kinetic [J].
    """

    simulation: Simulation
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray
    momentum: np.ndarray
    energy: np.ndarray

    @property
    def body(self) -> Body:
        return self.simulation.setup.body

    def at(self, time_s: float) -> int:
        """The row of a look."""
        return int(np.argmin(np.abs(self.time - time_s)))

    def momentum_about(self, axis: int) -> np.ndarray:
        """Cosine of the angle between L and a mesh axis: −1 after a flip."""
        size = np.linalg.norm(self.momentum, axis=1)
        return (self.rotation[:, :, axis] * self.momentum).sum(axis=1) / size

    def flips(self, axis: int) -> np.ndarray:
        """Times at which the body turned its mesh axis over with respect to L."""
        cosine = self.momentum_about(axis)
        return self.time[1:][np.sign(cosine[1:]) != np.sign(cosine[:-1])]


def fly(scene: str, duration_s: float, script: str = "", interval_s: float = 0.01, **changes) -> Flight:
    """Fly a bundled scene as ``rigid_proto simulate`` does; a parameter's dots are written as two underscores."""
    scenario = read_scene(scene, {name.replace("__", "."): value for name, value in changes.items()})
    run = OfflineRun(scenario, read_script(example_path(script)) if script else [])
    looks = []
    for k in range(round(duration_s / interval_s) + 1):
        assert run.advance(nanoseconds(k * interval_s))
        simulation = run.simulation
        state = simulation.state
        looks.append(
            (
                state.time_ns / 1e9,
                state.position,
                state.linear_velocity,
                state.rotation,
                state.angular_velocity,
                simulation.angular_momentum,
                simulation.kinetic_energy,
            )
        )
    assert not run.simulation.refused
    return Flight(run.simulation, *(np.array(column) for column in zip(*looks, strict=True)))


def degrees_between(rows: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Angles between rows (n, 3) and one direction (3,)."""
    size = np.linalg.norm(rows, axis=1) * np.linalg.norm(direction)
    across = np.linalg.norm(np.cross(rows, direction), axis=1)
    return np.degrees(np.arctan2(across / size, rows @ direction / size))
