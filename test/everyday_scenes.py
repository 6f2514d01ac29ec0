# SPDX-License-Identifier: MIT
"""What people try first: a bundled body thrown on a rope, all else as the parameters' defaults have it, in numbers that people type."""

from __future__ import annotations

import numpy as np
from feature_scenes import Scene, numbers_of

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.scene.scenario import make_scenario

SPEEDS = (0.0, 0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0)
SPINS = (0.0, 0.0, 0.0, 0.1, 0.5, 1.0, 3.0, 10.0)
LENGTHS = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0)


def _signed(rng, numbers) -> float:
    return float(rng.choice(numbers) * rng.choice([-1.0, 1.0]))


def everyday_scene(seed: int) -> Scene:
    """A throw; the same for every run of a seed."""
    rng = np.random.default_rng([1000, seed])
    mesh = str(rng.choice(body_names()))
    attach = [0.0, 0.0, 0.0]
    if rng.random() < 0.6:
        attach = [round(float(c), 3) for c in rng.choice(load_mesh(mesh).vertices)]
    values = {
        "mesh": mesh,
        "gravity": [0.0, 0.0, 0.0 if rng.random() < 0.2 else -9.81],
        "initial.linear_velocity": [_signed(rng, SPEEDS) for _ in range(3)],
        "initial.angular_velocity": [_signed(rng, SPINS) for _ in range(3)],
        "string.attached": True,
        "string.attach": attach,
        "string.rest_length": float(rng.choice(LENGTHS)),
        "string.target": [0.0, 0.0, float(rng.choice([0.0, 0.0, 0.1, 0.2, 0.5]))],
    }
    if rng.random() < 0.3:
        values["string.damping_ratio"] = float(rng.choice([0.0, 0.3, 1.0]))
    if rng.random() < 0.3:
        values["linear_damping"] = float(rng.choice([0.01, 0.1]))
    if rng.random() < 0.3:
        values["initial.position"] = [float(rng.choice([0.0, 0.1, -0.2])) for _ in range(3)]
    setup = make_scenario(values).setup
    target = np.array(setup.string.target)
    return Scene(setup, (), numbers_of(setup, setup.length, target, [np.zeros(3)] * 6))
