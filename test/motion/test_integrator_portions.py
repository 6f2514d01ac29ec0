# SPDX-License-Identifier: MIT
"""When anybody asks never changes the motion: one advance and a thousand random portions give the same bits."""

import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flights import SECOND, flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.integrator import ANGULAR_DAMPING
from rigid_proto_ros.motion.string import StringSettings
from rigid_proto_ros.simulation.commands import MoveString, ReleaseString

BODY = make_body(2.0, (0.0, 0.0, 0.0), ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9)))
ROW = np.array([0.3, -0.2, 0.1, 0.2, -0.4, 0.4, 0.8, 0.4, 0.1, -0.3, 0.9, 1.3, -0.6])
FRAMES = ("world@com", "world@point/.1,.2,.3", "body@point/.1,.2,.3", "body", "world@com;impulse")
END = 10 * SECOND


def flown(name, seed, portions):
    """A flight with thirty commands of all kinds at random times; those the integrator can't carry are refused."""
    damping = 0.05 if ANGULAR_DAMPING in INTEGRATORS[name].supports else 0.0
    simulation = flight(
        BODY,
        integrator=name,
        step_s=0.01,
        initial=ROW,
        gravity=np.array((0.0, 0.0, -9.81)),
        linear_damping=0.1,
        angular_damping=damping,
        wrench_timeout_ns=3 * SECOND,
        string=StringSettings(stiffness=80.0, rest_length=0.5),
    )
    rng, refused = random.Random(seed), 0
    for _i in range(30):
        time_ns, force = rng.randrange(END), tuple(rng.gauss(0.0, 3.0) for _ in range(3))
        torque, held = tuple(rng.gauss(0.0, 1.0) for _ in range(3)), rng.random() < 0.5
        kind = rng.choice((*FRAMES, "string", "string", "release"))
        if kind == "string":
            command = MoveString(force)
        elif kind == "release":
            command = ReleaseString()
        else:
            torque = (0.0, 0.0, 0.0) if kind == "world@com" else torque
            command = wrench(kind, force, torque, held=held and "impulse" not in kind)
        try:
            simulation.submit(command, time_ns)
        except CommandRefused as refusal:
            assert refusal.reason == "integrator"
            refused += 1
    for time_ns in portions:
        simulation.advance(time_ns)
    simulation.advance(END)
    assert not simulation.failure
    assert refused < 25
    return simulation


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.stress) for seed in range(2, 12))])
def test_a_thousand_random_portions_give_the_same_bits(name, seed):
    rng = random.Random(1000 + seed)
    portions = sorted(rng.randrange(END) for _ in range(1000))
    whole, split = flown(name, seed, ()), flown(name, seed, portions)
    assert split.state.sha256() == whole.state.sha256()
    assert (split.steps, split.force_evaluations) == (whole.steps, whole.force_evaluations)
    assert (split.hand_work, split.string_heat) == (whole.hand_work, whole.string_heat)
    assert split.events.sha256 == whole.events.sha256


def test_a_command_yet_to_come_changes_nothing_before_it():
    """Steps don't end early for a future command: auto's state a nanosecond before it is that without it."""
    with_it, without = (flight(BODY, integrator="auto", initial=ROW) for _ in range(2))
    for simulation in (with_it, without):
        simulation.submit(wrench("body@point/.1,.2,.3", (1.0, 2.0, 3.0)), 0)
    with_it.submit(wrench("body", (5.0, 0.0, 0.0)), 3 * SECOND)
    assert with_it.advance(3 * SECOND - 1).sha256() == without.advance(3 * SECOND - 1).sha256()


def test_another_process_with_one_thread_gives_the_same_bits():
    names = ("auto", "rk4", "dop853")
    code = f"from test_integrator_portions import flown\nfor n in {names}: print(flown(n, 1, ()).state.sha256())"
    settings = {"NUMBA_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parents[1],
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [flown(name, 1, ()).state.sha256() for name in names]


@pytest.mark.parametrize("settings", [{}, {"angular_damping": 0.05}, {"string": StringSettings(stiffness=80.0)}])
def test_commands_that_come_within_a_step_however_many_act_as_those_given_before(settings):
    """More than the tables hold at first: they grow while a step is planned."""
    states = []
    for when_ns in (0, 3_333_333):
        simulation = flight(BODY, integrator="auto", initial=ROW, **settings)
        simulation.submit(wrench("body@point/.1,.2,.3", (1.0, 2.0, 3.0)))
        if settings.get("string"):
            simulation.submit(MoveString((0.0, 0.0, 0.5)))
        simulation.advance(when_ns)
        for _ in range(100):
            simulation.submit(wrench("world@com;impulse", (0.0, 0.0, 1e-3), held=False), 4_000_000)
        states.append(simulation.advance(6_000_000).sha256())
    assert states[0] == states[1]
