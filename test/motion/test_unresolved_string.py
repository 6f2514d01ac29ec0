# SPDX-License-Identifier: MIT
"""Strings that no step resolves, 1e6 to 1e13 rad/s, on bodies of a nanometre to ten metres: every flight goes on, and energy stays bounded."""

import json

import numpy as np
import pytest
from flights import SECOND, flight

from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.string import StringSettings

SCENES = 15
STRESS_SCENES = 150
ROUNDING = 2.0**-52


def random_flight(seed):
    """A body on a string: slack, stretched or within a millionth of its length; with and without spin, damping, weight, push."""
    rng = np.random.default_rng(seed)
    size, frequency = 10.0 ** rng.uniform(-9.0, 1.0), 10.0 ** rng.uniform(6.0, 13.0)
    mass = 1000.0 * size**3 * rng.uniform(0.05, 1.0)
    a, b, c = (size * rng.uniform(0.2, 1.0, 3)) ** 2
    body = make_body(mass, np.zeros(3), mass / 12.0 * np.diag([b + c, a + c, a + b]))
    arm = size * rng.uniform(-0.5, 0.5, 3)
    rest_length = float(rng.choice([0.0, size * 10.0 ** rng.uniform(-2.0, 2.0)]))
    string = StringSettings(
        attached=True,
        attach=tuple(arm),
        frequency=frequency,
        damping_ratio=float(rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 0.5)])),
        rest_length=rest_length,
        bilateral=bool(rng.integers(2)),
        timeout_ns=0,
    )
    start = rng.integers(3)
    part = (
        rng.uniform(0.1, 0.99),
        1.0 + 10.0 ** rng.uniform(-6.0, 1.0),
        1.0 + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, -6.0),
    )[start]
    q, direction = rng.normal(size=4), rng.normal(size=3)
    q, direction = q / np.linalg.norm(q), direction / np.linalg.norm(direction)
    position = part * (rest_length or size) * direction - np.array(rotate(*q, *arm))
    velocity = rng.normal(size=3) * rng.choice([0.0, 1.0, size])
    spin = rng.normal(size=3) * rng.choice([0.0, 0.1, 10.0, 1000.0])
    gravity = np.array([0.0, 0.0, -9.81]) * rng.integers(2)
    initial = [*position, *q, *velocity, *spin]
    return flight(body, integrator="auto", initial=initial, gravity=gravity, string=string)


def energies(simulation):
    """Kinetic and potential energy, the heat of the string's damper taken as still there; and what rounding of the state does to it [J]."""
    body, state, string = simulation.setup.body, simulation.state, simulation.string
    v, w = state.row[7:10], state.row[10:13]
    moving = 0.5 * body.mass * v @ v + 0.5 * w @ body.inertia @ w + string.potential_energy(body, state)
    place = 4.0 * ROUNDING * float(np.abs(state.position).sum() + np.linalg.norm(string.span(body, state)))
    stretch = abs(string.stretch(body, state)) + place
    rounding = string.stiffness * stretch * place
    weight = -body.mass * simulation.setup.gravity @ state.position
    return moving, moving + weight + simulation.string_heat, rounding


def check(seeds):
    for seed in seeds:
        simulation = random_flight(seed)
        simulation.advance(0)
        largest, start, rounding = energies(simulation)
        for k in range(1, 51):
            # Every third look is within a step.
            simulation.advance(2_000_000 * k + (137 if k % 3 == 0 else 0))
            assert not simulation.failure, seed
            moving, energy, here = energies(simulation)
            largest, rounding = max(largest, moving), max(rounding, here)
            # Heat is counted up: more of it than there is energy is one more rounding.
            largest = max(largest, simulation.string_heat)
            assert abs(energy - start) <= 1e-8 * largest + 2.0 * rounding, (seed, k)


def test_strings_that_no_step_resolves_keep_the_energy_and_never_end_a_flight():
    check(range(SCENES))


@pytest.mark.stress
@pytest.mark.parametrize("first", range(0, STRESS_SCENES, 15))
def test_more_strings_that_no_step_resolves(first):
    check(range(1000 + first, 1000 + first + 15))


@pytest.mark.parametrize("scale", [1e-6, 1e-9])
def test_a_tiny_body_on_the_default_string_flies_to_the_end(scale, capsys):
    settings = (f"scale=[{scale}, {scale}, {scale}]", "string.attached=true", "initial.position=[0.3, 0, 1]")
    command = ["simulate", "book", "--duration", "0.2", "--json"]
    assert main([*command, *(word for setting in settings for word in ("--set", setting))]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["time_ns"] == SECOND // 5
    assert "accuracy 1e-09 is not held" in printed.err
