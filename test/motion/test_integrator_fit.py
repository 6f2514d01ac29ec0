# SPDX-License-Identifier: MIT
"""An integrator that can't carry what a scene or a command asks for is refused, with those that can; facts about each."""

import numpy as np
import pytest
from flights import SECOND, StringSettings, changed, flight, flight_setup, spinning, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.simulation.commands import Change, MoveString

BODY = make_body(1.0, (0.0, 0.0, 0.0), np.diag((1.0, 2.0, 3.0)))
SPIN = spinning((0.3, 1.0, 0.2))


def test_every_integrator_of_the_contract_is_there_and_states_its_source_and_limits():
    assert set(INTEGRATORS) == {
        *("euler", "midpoint", "semi_implicit_euler", "rk4", "lie_midpoint", "dop853", "taylor"),
        *("free_body", "free_body_strang", "auto"),
    }
    for integrator in INTEGRATORS.values():
        assert integrator.source and integrator.limits.endswith(".") and integrator.stability_limit > 0.0


@pytest.mark.parametrize(
    ("name", "frame", "force", "torque"),
    [
        ("free_body", "body", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ("free_body", "body@com", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ("free_body", "world@point/.1,0,0", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ("taylor", "world", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        ("taylor", "world@point/.1,0,0", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ],
)
def test_a_wrench_that_the_integrator_cannot_carry_is_refused_and_the_flight_goes_on(name, frame, force, torque):
    simulation = flight(BODY, integrator=name, initial=SPIN)
    with pytest.raises(CommandRefused) as refusal:
        simulation.submit(wrench(frame, force, torque), SECOND)
    assert refusal.value.reason == "integrator"
    assert name in str(refusal.value)
    assert "auto" in str(refusal.value)
    untouched = flight(BODY, integrator=name, initial=SPIN).advance(2 * SECOND)
    assert simulation.advance(2 * SECOND).sha256() == untouched.sha256()


@pytest.mark.parametrize(
    "name", ["taylor", "lie_midpoint", "dop853", "free_body", "free_body_strang", "semi_implicit_euler"]
)
def test_others_refuse_to_drop_the_gyroscopic_term_and_name_those_that_can(name):
    with pytest.raises(CommandRefused, match="gyroscopic: false: auto, euler, midpoint, rk4$") as refusal:
        flight(BODY, integrator=name, initial=SPIN, gyroscopic=False)
    assert (refusal.value.field, refusal.value.reason) == ("integrator", "integrator")


@pytest.mark.parametrize("name", ["auto", "euler", "midpoint", "rk4"])
def test_without_the_gyroscopic_term_energy_and_size_of_momentum_stay_but_its_direction_turns(name):
    simulation = flight(BODY, integrator=name, initial=SPIN, gyroscopic=False)
    energy, momentum = simulation.kinetic_energy, simulation.angular_momentum
    for half in range(1, 5):
        simulation.advance(half * SECOND // 2)
        now = simulation.angular_momentum
        assert simulation.kinetic_energy == pytest.approx(energy, rel=1e-12)
        assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(momentum), rel=1e-12)
    assert now @ momentum < 0.99 * (momentum @ momentum)


def test_impulses_are_for_all_because_no_integrator_sees_them():
    simulation = flight(BODY, integrator="free_body", initial=SPIN)
    simulation.submit(wrench("body@point/.1,.2,.3;impulse", (1.0, 0.0, 0.0), held=False), SECOND)
    simulation.advance(2 * SECOND)
    assert simulation.state.linear_velocity.any()


@pytest.mark.parametrize("name", ["taylor", "lie_midpoint", "free_body", "free_body_strang"])
def test_a_string_is_refused_at_the_start_and_in_flight(name):
    with pytest.raises(CommandRefused, match="dop853"):
        flight(BODY, integrator=name, initial=SPIN, string=StringSettings(attached=True))
    simulation = flight(BODY, integrator=name, initial=SPIN)
    with pytest.raises(CommandRefused, match="a string"):
        simulation.submit(MoveString((0.0, 0.0, 1.0)))


def test_a_change_to_an_integrator_that_cannot_carry_what_acts_is_refused_and_counted():
    setup = flight_setup(BODY, integrator="rk4", initial=SPIN)
    simulation = flight(BODY, integrator="rk4", initial=SPIN)
    simulation.submit(wrench("world", torque=(0.0, 0.0, 1.0)), 0)
    simulation.submit(Change({}, lambda: changed(setup, integrator="free_body")), SECOND)
    simulation.advance(2 * SECOND)
    assert simulation.refused == {"integrator": 1}
    assert simulation.setup.integrator.name == "rk4"


def test_a_command_scheduled_before_the_change_is_judged_again_when_it_acts():
    setup = flight_setup(BODY, integrator="rk4", initial=SPIN)
    simulation = flight(BODY, integrator="rk4", initial=SPIN)
    simulation.submit(Change({}, lambda: changed(setup, integrator="free_body")), SECOND)
    simulation.submit(wrench("world", torque=(0.0, 0.0, 1.0)), 2 * SECOND)
    simulation.advance(3 * SECOND)
    assert simulation.refused == {"integrator": 1}


@pytest.mark.parametrize(
    ("name", "step_s", "spin", "coarse"),
    [
        ("rk4", 1e-3, 100.0, False),
        ("rk4", 1e-3, 2000.0, True),
        ("euler", 1e-2, 20.0, True),
        ("free_body", 1.0, 1e4, False),
        ("auto", 1.0, 1e4, False),
    ],
)
def test_a_step_too_long_for_its_integrator_is_told(name, step_s, spin, coarse):
    simulation = flight(BODY, integrator=name, step_s=step_s, initial=spinning((0.0, 0.0, spin)))
    assert bool(simulation.too_coarse) == coarse


@pytest.mark.parametrize(("name", "coarse"), [("rk4", True), ("auto", False)])
def test_a_step_too_long_for_a_string_is_told(name, coarse):
    string = StringSettings(attached=True, target=(0.0, 0.0, 1.0), frequency=1e4, rest_length=1.0)
    simulation = flight(BODY, integrator=name, initial=SPIN, string=string)
    assert ("string frequency times step = 10" in simulation.too_coarse) == coarse
