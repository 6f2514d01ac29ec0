# SPDX-License-Identifier: MIT
"""When anybody asks never changes the motion: one advance and a thousand random portions give the same bits; and a poke is what it
says wherever in a step it begins.
"""

import numpy as np
import pytest
from flights import SECOND, StringSettings, changed, flight, spinning, wrench
from reference_scenes import BODY, ROW, log_uniform, random_body

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.loads import ANGULAR_DAMPING, ROTOR
from rigid_proto_ros.simulation.commands import Change, MoveString, ReleaseString

FRAMES = ("world@com", "world@point/.1,.2,.3", "body@point/.1,.2,.3", "body", "world@com;impulse")
CHANGES = ("mass", "body", "gravity", "damping", "step", "string", "gyroscopic", "wheel", "motor")
END = 10 * SECOND


def random_change(rng, simulation) -> Change:
    """Another mass, tensor, gravity, damping, step, string or flywheel, from the values in force when it acts."""
    kind = rng.choice(CHANGES)
    mass, body, gravity = log_uniform(rng, 1.0, 4.0), random_body(rng, 2.0, 1.5, 0.5), 9.81 * rng.normal(size=3)
    linear, angular = (log_uniform(rng, 1e-3, 0.3) for _ in range(2))
    wheel, motor = rng.normal(size=3), rng.normal(size=3)
    step_ns, stiffness = int(rng.integers(SECOND // 1000, SECOND // 50)), log_uniform(rng, 10.0, 100.0)

    def apply():
        now = simulation.setup
        changes = {
            "mass": {"body": make_body(mass, now.body.center_of_mass, now.body.inertia * (mass / now.body.mass))},
            "body": {"body": body},
            "gravity": {"gravity": gravity},
            "damping": {"linear_damping": linear, "angular_damping": angular},
            "step": {"step": step_ns * 1e-9},
            "string": {"string_stiffness": stiffness},
            "gyroscopic": {"gyroscopic": not now.scene.gyroscopic},
            "wheel": {"rotor_momentum": wheel},
            "motor": {"rotor_torque": motor},
        }
        return changed(now, **changes[kind])

    return Change({"kind": str(kind)}, apply)


def flown(name, seed, portions):
    """A flight with forty commands of all kinds at random times, some at the same; what the integrator can't carry is refused."""
    damping = 0.05 if ANGULAR_DAMPING in INTEGRATORS[name].supports else 0.0
    motor = (0.1, -0.2, 0.3) if ROTOR in INTEGRATORS[name].supports else (0.0, 0.0, 0.0)
    simulation = flight(
        BODY,
        integrator=name,
        step_s=0.01,
        initial=ROW,
        gravity=np.array((0.0, 0.0, -9.81)),
        linear_damping=0.1,
        angular_damping=damping,
        rotor_torque=motor,
        wrench_timeout=3.0,
        string=StringSettings(stiffness=80.0, rest_length=0.5),
    )
    rng, refused = np.random.default_rng(seed), 0
    for number in range(40):
        time_ns = int(rng.integers(END)) if number % 10 else END // 3
        force, torque, held = rng.normal(0.0, 3.0, 3).tolist(), rng.normal(size=3).tolist(), rng.random() < 0.5
        kind = str(rng.choice((*FRAMES, "string", "string", "release", "change", "change", "change")))
        if kind == "string":
            command = MoveString(tuple(force))
        elif kind == "release":
            command = ReleaseString()
        elif kind == "change":
            command = random_change(rng, simulation)
        else:
            torque = (0.0, 0.0, 0.0) if kind == "world@com" else torque
            command = wrench(kind, force, torque, held=held and "impulse" not in kind)
        try:
            simulation.submit(command, time_ns)
        except CommandRefused as refusal:
            assert refusal.reason == "integrator"
            refused += 1
    for time_ns in portions:
        simulation.advance(int(time_ns))
    simulation.advance(END)
    assert not simulation.failure
    assert refused < 30
    return simulation


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.stress) for seed in range(2, 12))])
def test_a_thousand_random_portions_give_the_same_bits(name, seed):
    portions = np.sort(np.random.default_rng(1000 + seed).integers(0, END, 1000))
    whole, split = flown(name, seed, ()), flown(name, seed, portions)
    assert split.state.sha256() == whole.state.sha256()
    assert (split.steps, split.force_evaluations) == (whole.steps, whole.force_evaluations)
    assert (split.hand_work, split.string_heat) == (whole.hand_work, whole.string_heat)
    assert (split.events.sha256, split.refused) == (whole.events.sha256, whole.refused)


STEP_NS, PHASES = 1_000_000, 6


@pytest.mark.parametrize("name", ["rk4", "dop853", "free_body_strang", "lie_midpoint", "auto"])
def test_a_poke_gives_its_impulse_at_every_phase_of_a_step(name):
    """Of a world wrench, to momentum and angular momentum in the world."""
    rng = np.random.default_rng(5)
    # A second-order splitting turns the body during a half step in which the torque doesn't act.
    allowed = 1e-6 if name == "free_body_strang" else 1e-9
    for k in range(PHASES):
        begin_ns = 10 * STEP_NS + STEP_NS * k // PHASES
        duration_ns = int(rng.choice([1, 999, STEP_NS - 1, STEP_NS, STEP_NS + 1, 50 * STEP_NS, rng.integers(1, 10**8)]))
        simulation = flight(BODY, integrator=name, initial=spinning((0.7, 1.9, -0.6)))
        before, seconds = simulation.angular_momentum, duration_ns / SECOND
        frame = f"world@com;duration={seconds!r}"
        simulation.submit(wrench(frame, (3.0, -1.0, 2.0), (0.3, 0.5, -0.2), held=False), begin_ns)
        state = simulation.advance(begin_ns + duration_ns + 7 * STEP_NS + 123_457)
        angular = simulation.angular_momentum - before
        assert BODY.mass * state.linear_velocity == pytest.approx(seconds * np.array([3.0, -1.0, 2.0]), rel=1e-12)
        assert angular == pytest.approx(seconds * np.array([0.3, 0.5, -0.2]), rel=allowed, abs=1e-12)


def test_a_command_yet_to_come_changes_nothing_before_it():
    """Steps don't end early for a future command: auto's state a nanosecond before it is that without it."""
    with_it, without = (flight(BODY, integrator="auto", initial=ROW) for _ in range(2))
    for simulation in (with_it, without):
        simulation.submit(wrench("body@point/.1,.2,.3", (1.0, 2.0, 3.0)), 0)
    with_it.submit(wrench("body", (5.0, 0.0, 0.0)), 3 * SECOND)
    assert with_it.advance(3 * SECOND - 1).sha256() == without.advance(3 * SECOND - 1).sha256()


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
