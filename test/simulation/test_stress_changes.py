# SPDX-License-Identifier: MIT
"""Pokes at every phase of a step and parameters that change in flight: momentum is accounted for and nothing else moves."""

from dataclasses import replace

import numpy as np
import pytest
from flights import SECOND, flight, spinning, wrench
from random_scenes import DURATION_S, log_uniform, random_body, random_scene

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.simulation.commands import Change

TENSOR = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
STEP_NS = 1_000_000
POKED = ("rk4", "dop853", "free_body_strang", "lie_midpoint", "auto")
PHASES = 6
SCENES = 3


def poke_at(name, begin_ns, duration_ns):
    """Momentum and angular momentum in the world that a poke left, less what was there before."""
    body = make_body(2.0, np.zeros(3), TENSOR)
    simulation = flight(body, integrator=name, step_s=STEP_NS / SECOND, initial=spinning((0.7, 1.9, -0.6)))
    L = simulation.angular_momentum
    frame = f"world@com;duration={duration_ns / SECOND!r}"
    simulation.submit(wrench(frame, (3.0, -1.0, 2.0), (0.3, 0.5, -0.2), held=False), begin_ns)
    simulation.advance(begin_ns + duration_ns + 7 * STEP_NS + 123_457)
    return body.mass * simulation.state.linear_velocity, simulation.angular_momentum - L


def check_phases(name, phases):
    """The impulse of a world wrench is what it says, wherever in a step it begins and ends."""
    rng = np.random.default_rng(5)
    # A second-order splitting turns the body during a half step in which the torque doesn't act.
    allowed = 1e-6 if name == "free_body_strang" else 1e-9
    for k in range(phases):
        begin_ns = 10 * STEP_NS + STEP_NS * k // phases
        duration_ns = int(rng.choice([1, 999, STEP_NS - 1, STEP_NS, STEP_NS + 1, 50 * STEP_NS, rng.integers(1, 10**8)]))
        momentum, angular = poke_at(name, begin_ns, duration_ns)
        seconds = duration_ns / SECOND
        assert momentum == pytest.approx(seconds * np.array([3.0, -1.0, 2.0]), rel=1e-12)
        assert angular == pytest.approx(seconds * np.array([0.3, 0.5, -0.2]), rel=allowed, abs=1e-12), (
            begin_ns,
            duration_ns,
        )


@pytest.mark.parametrize("name", POKED)
def test_a_poke_gives_its_impulse_at_every_phase_of_a_step(name):
    check_phases(name, PHASES)


def random_change(rng, simulation) -> Change:
    """Another mass, tensor, gravity, damping, integrator, step or string, from the values in force when it acts."""
    kind = rng.choice(["mass", "body", "gravity", "damping", "step", "string", "gyroscopic"])
    mass, body, gravity = log_uniform(rng, 0.1, 10.0), random_body(rng), 9.81 * rng.normal(size=3)
    linear, angular = (log_uniform(rng, 1e-3, 1.0) for _ in range(2))
    step_ns, stiffness = int(rng.integers(1, 3 * STEP_NS)), log_uniform(rng, 1.0, 1e3)

    def apply():
        now = simulation.setup
        changed = {
            "mass": {"body": make_body(mass, now.body.center_of_mass, now.body.inertia * (mass / now.body.mass))},
            "body": {"body": body},
            "gravity": {"gravity": gravity},
            "damping": {"linear_damping": linear, "angular_damping": angular * now.body.principal_moments[0]},
            "step": {"step_ns": step_ns},
            "string": {"string": replace(now.string, stiffness=stiffness, frequency=0.0)},
            "gyroscopic": {"gyroscopic": not now.gyroscopic},
        }
        return replace(now, **changed[kind])

    return Change({"kind": str(kind)}, apply)


def changing_scene(seed, name):
    """A random scene with a dozen changes at random times, some at the same one."""
    rng = np.random.default_rng(10_000 + seed)
    simulation = random_scene(seed, name)
    times = rng.integers(0, round(DURATION_S * SECOND), 12)
    times[3] = times[2]
    for at_ns in times:
        simulation.submit(random_change(rng, simulation), int(at_ns))
    return simulation


def check_changes(seeds, name):
    for seed in seeds:
        whole, parts = changing_scene(seed, name), changing_scene(seed, name)
        until_ns = round(DURATION_S * SECOND)
        whole.advance(until_ns)
        row = whole.state.row
        assert np.isfinite(row).all()
        if not whole.failure:
            assert abs(np.linalg.norm(row[3:7]) - 1.0) < 1e-14
        for at_ns in np.unique(np.append(np.random.default_rng(seed).integers(0, until_ns, 100), until_ns)):
            if not parts.failure:
                parts.advance(int(at_ns))
                assert np.isfinite(parts.state.row).all()
        assert parts.failure == whole.failure
        if not whole.failure:
            assert parts.state.sha256() == whole.state.sha256(), seed
        assert parts.refused == whole.refused


@pytest.mark.parametrize("name", ["rk4", "auto", "dop853"])
def test_changes_in_flight_do_not_depend_on_portions(name):
    check_changes(range(SCENES), name)
