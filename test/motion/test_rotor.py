# SPDX-License-Identifier: MIT
"""A body with a flywheel, a gyrostat: what it conserves, its closed cases, and what changes of parameters do to it."""

import math

import numpy as np
import pytest
from flights import SECOND, StringSettings, changed, flight, flight_setup, spinning
from reference_scenes import END_S, Scene, direction, error, log_uniform, random_body

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.loads import ROTOR
from rigid_proto_ros.simulation.commands import Change

ABLE = [name for name, integrator in INTEGRATORS.items() if ROTOR in integrator.supports]
TIGHT = {"accuracy": 1e-14}
TENSOR = ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9))
BODY = make_body(2.0, (0.0, 0.0, 0.0), TENSOR)
SPIN, H = spinning((0.9, 1.3, -0.6)), (0.7, -1.1, 0.4)


def off(simulation, energy, momentum) -> tuple[float, float]:
    """Relative changes of the energy and of L."""
    moved = np.linalg.norm(simulation.angular_momentum - momentum) / np.linalg.norm(momentum)
    return abs(simulation.kinetic_energy / energy - 1.0), float(moved)


def test_all_but_those_for_a_free_body_alone_can_carry_a_flywheel():
    assert set(INTEGRATORS) - set(ABLE) == {"free_body", "free_body_strang"}


@pytest.mark.parametrize("name", ABLE)
def test_a_steady_flywheel_leaves_the_energy_of_the_body_and_all_of_the_angular_momentum(name):
    """ω·(ω × (Iω + h)) = 0, and no torque acts from outside (Hughes, Spacecraft Attitude Dynamics, 1986)."""
    simulation = flight(BODY, integrator=name, initial=SPIN, rotor_momentum=H, **TIGHT)
    energy, momentum = simulation.kinetic_energy, simulation.angular_momentum
    simulation.advance(10 * SECOND)
    # Measured: auto 2e-14, dop853 8e-15, taylor 9e-15, lie_midpoint 2e-14, rk4 5e-14, midpoint 1.5e-7, the others 5e-3.
    bounds = {"euler": 3e-2, "semi_implicit_euler": 3e-2, "midpoint": 1e-6, "rk4": 5e-13}
    assert max(off(simulation, energy, momentum)) <= bounds.get(name, 1e-13)
    assert np.abs(simulation.state.angular_velocity_body - SPIN[10:13]).max() > 0.1


@pytest.mark.parametrize("name", ABLE)
def test_a_motor_turns_the_body_and_the_wheel_against_each_other(name):
    """L stays, and the body takes what −ω·h' works."""
    torque = np.array((-0.2, 0.3, 0.6))
    simulation = flight(BODY, integrator=name, initial=SPIN, rotor_momentum=H, rotor_torque=torque, **TIGHT)
    momentum, energy, worked, before = simulation.angular_momentum, simulation.kinetic_energy, 0.0, SPIN[10:13]
    for k in range(1, 2001):
        now = simulation.advance(2 * SECOND * k // 2000).angular_velocity_body
        worked, before = worked - 0.5e-3 * (before + now) @ torque, now
    # Measured: auto and lie_midpoint 1e-15, dop853 and taylor 4e-15, rk4 2e-14, midpoint 3e-7, the others 1e-3; the sum
    # for the work errs by 2e-8.
    bounds = {"euler": 1e-2, "semi_implicit_euler": 1e-2, "midpoint": 3e-6, "rk4": 2e-13}
    assert np.linalg.norm(simulation.angular_momentum - momentum) <= bounds.get(name, 1e-13) * np.linalg.norm(momentum)
    assert simulation.kinetic_energy - energy == pytest.approx(worked, abs=1e-7 + bounds.get(name, 0.0))
    assert simulation.rotor_momentum == pytest.approx(np.add(H, 2.0 * torque), rel=1e-15)


@pytest.mark.parametrize("name", ABLE)
def test_a_wheel_on_the_axis_of_symmetry_changes_the_rate_of_precession_alone(name):
    """ω₁ + iω₂ turns at ((I₃ − I₁)ω₃ + h)/I₁ in the body, its axis about L at |L|/I₁ (Hughes, 1986)."""
    i1, i3, h, spin = 1.3, 2.1, 3.7, np.array((0.7, -0.4, 2.5))
    body = make_body(1.0, (0.0, 0.0, 0.0), np.diag((i1, i1, i3)))
    simulation = flight(body, integrator=name, initial=spinning(spin), rotor_momentum=(0.0, 0.0, h), **TIGHT)
    momentum = simulation.angular_momentum
    assert momentum == pytest.approx((i1 * spin[0], i1 * spin[1], i3 * spin[2] + h), rel=1e-15)
    # Measured: auto, dop853 and taylor 4e-15, rk4 9e-11, lie_midpoint and midpoint below 1e-4, the others 0.06.
    within = {"rk4": 1e-9, "lie_midpoint": 5e-4, "midpoint": 1e-3, "euler": 0.3, "semi_implicit_euler": 0.3}
    for t in (1, 4, 10):
        state = simulation.advance(t * SECOND)
        w = complex(spin[0], spin[1]) * np.exp(1j * ((i3 - i1) * spin[2] + h) / i1 * t)
        expected = (w.real, w.imag, spin[2])
        assert np.abs(state.angular_velocity_body - expected).max() <= within.get(name, 1e-12)
        axis, unit = np.array((0.0, 0.0, 1.0)), momentum / np.linalg.norm(momentum)
        angle = np.linalg.norm(momentum) / i1 * t
        cross, along = np.cross(unit, axis), unit * (unit @ axis)
        expected = axis * math.cos(angle) + cross * math.sin(angle) + along * (1.0 - math.cos(angle))
        assert np.abs(state.rotation[:, 2] - expected).max() <= within.get(name, 1e-12)


@pytest.mark.parametrize("name", ABLE)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_at_total_momentum_zero_the_body_turns_back_against_the_wheel(name, axis):
    """From rest, driven about a principal axis: ω = −h/I and the angle −½ h' t²/I, about any of the three axes."""
    moments, torque = np.array((1.0, 2.0, 2.5)), 0.3
    drive = torque * np.eye(3)[axis]
    body = make_body(1.0, (0.0, 0.0, 0.0), np.diag(moments))
    simulation = flight(body, integrator=name, rotor_torque=drive, step_s=1 / 1024, **TIGHT)
    for t in (1, 3, 5):
        state = simulation.advance(t * SECOND)
        assert state.angular_velocity_body == pytest.approx(-drive * t / moments[axis], rel=1e-12, abs=1e-15)
        assert np.abs(simulation.angular_momentum).max() <= 1e-12  # measured 7e-14
        angle = -0.5 * torque * t * t / moments[axis]
        first_order = INTEGRATORS[name].order == 1 and 2e-3
        turned = 2.0 * math.atan2(state.orientation_xyzw[axis], state.orientation_xyzw[3])
        assert math.remainder(turned - angle, 2.0 * math.pi) == pytest.approx(0.0, abs=first_order or 1e-6)


def test_driven_from_rest_about_no_axis_of_its_own_it_turns_at_once_about_the_inverse_tensor():
    """With L = 0 the body has ω = −I⁻¹h at every instant."""
    torque = np.array((0.2, -0.5, 0.3))
    simulation = flight(BODY, rotor_torque=torque, integrator="auto", **TIGHT)
    for k in range(1, 9):
        state = simulation.advance(k * SECOND)
        assert state.angular_velocity_body == pytest.approx(-np.linalg.solve(TENSOR, k * torque), rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(
    ("part", "steady"),
    [(0.9, False), (1.1, True), (0.0, False), (-0.9, False), (-1.1, True)],
)
def test_spin_about_the_middle_axis_is_steady_once_the_wheel_beats_the_stability_limit(part, steady):
    """Ω about the axis of B with h along it: unstable just for −(B − A)Ω < h < (C − B)Ω (Hughes, 1986). ``part``
    of the limit on either side.
    """
    (a, b, c), spin = (1.0, 2.0, 2.5), 2.0
    h = part * (c - b if part > 0.0 else b - a) * spin
    square = ((b - c) * spin + h) * ((a - b) * spin - h) / (a * c)
    assert (square < 0.0) == steady
    body = make_body(1.0, (0.0, 0.0, 0.0), np.diag((a, b, c)))
    start = np.array((1e-6, spin, 0.0))
    simulation = flight(body, integrator="auto", initial=spinning(start), rotor_momentum=(0.0, h, 0.0))
    strays, rate = [], math.sqrt(abs(square))
    for k in range(1, 401):
        w = simulation.advance(k * SECOND // 4).angular_velocity_body
        strays.append(max(abs(w[0]), abs(w[2])))
    if steady:
        # An ellipse, flat near the limit: ω₃ is up to √((A/C) (h + (B − A)Ω)/(h − (C − B)Ω)) times ω₁.
        assert max(strays) <= 2e-5
        return
    assert max(strays) > 0.1
    # While it is small it grows as cosh: one quarter second more, one factor.
    w1, late = (abs(strays[round(4 * t) - 1]) for t in (4.0 / rate // 0.25 * 0.25, 6.0 / rate // 0.25 * 0.25))
    grown = (6.0 / rate // 0.25 - 4.0 / rate // 0.25) * 0.25 * rate
    assert math.log(late / w1) == pytest.approx(grown, rel=2e-2)


@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.stress) for seed in range(4, 200))])
def test_auto_follows_random_gyrostats_to_its_accuracy_against_long_doubles(seed):
    """Any tensor, held, driven, with damping, loads of both axes and a string now and then, in flights of 2 s."""
    rng = np.random.default_rng(seed)
    size = float(rng.choice([1e-3, 1.0, 1e3]))
    body = random_body(rng, log_uniform(rng, 0.1, 10.0) * size**3, 0.3 * size, 0.05)
    least = body.principal_moments.min()
    row = spinning(direction(rng) * log_uniform(rng, 0.01, 20.0))
    held = least * log_uniform(rng, 0.1, 30.0) * direction(rng) * (rng.random() < 0.8)
    driven = least * log_uniform(rng, 0.1, 30.0) * direction(rng) * (rng.random() < 0.6 or not held.any())
    arm = 0.3 * size * rng.normal(size=3)
    tied = StringSettings(attached=True, attach=tuple(arm), target=(0.0, 0.0, 2.0 * size), frequency=10.0, timeout_ns=0)
    force, torque = body.mass * size * direction(rng), least * direction(rng)
    loads = ((str(rng.choice(["world", "body"])), 0.2 * size * direction(rng), force, torque),)
    setup = flight_setup(
        body,
        integrator="auto",
        initial=row,
        accuracy=1e-10,
        rotor_momentum=held,
        rotor_torque=driven,
        angular_damping=least * log_uniform(rng, 0.01, 1.0) * (rng.random() < 0.3),
        string=tied if rng.random() < 0.3 else StringSettings(),
        size=size,
    )
    scene = Scene(setup, loads if rng.random() < 0.5 else (), (0.5, 0.7))
    # Measured up to 2.8e-10 over 200 seeds.
    assert error(scene.flown(END_S), scene.reference(END_S), setup.length) <= 4e-9


def test_it_doesnt_depend_on_who_looks_how_long_a_flywheel_is_driven():
    """A million steps: h is of the clock, not of a sum of steps."""
    simulation = flight(BODY, integrator="rk4", rotor_torque=(1e-3, 0.0, 0.0), step_s=1e-3)
    for portion in range(1, 11):
        simulation.advance(portion * 10 * SECOND)
    variables = simulation.flight.variables
    assert variables[15] == 100.0
    assert np.abs(simulation.angular_momentum).max() <= 1e-12


# What a change of parameters does


def change(simulation, **values):
    setup = changed(simulation.setup, **values)
    simulation.submit(Change({}, lambda: setup))
    simulation.act()


def test_another_momentum_changes_the_wheel_alone_as_another_tensor_changes_the_body_alone():
    simulation = flight(BODY, integrator="auto", initial=SPIN, rotor_momentum=H)
    before = simulation.advance(SECOND).row.copy()
    change(simulation, rotor_momentum=(1.0, 2.0, 3.0))
    assert simulation.rotor_momentum.tolist() == [1.0, 2.0, 3.0]
    assert simulation.state.row.tolist() == before.tolist()
    momentum = simulation.angular_momentum
    simulation.advance(2 * SECOND)
    assert simulation.angular_momentum == pytest.approx(momentum, rel=1e-8)


def test_another_torque_or_another_parameter_drives_on_from_the_momentum_that_there_is():
    simulation = flight(BODY, integrator="auto", initial=SPIN, rotor_torque=(0.0, 0.5, 0.0))
    momentum = simulation.angular_momentum
    simulation.advance(2 * SECOND)
    change(simulation, gravity=np.array((0.0, 0.0, -9.81)))
    assert simulation.rotor_momentum.tolist() == [0.0, 1.0, 0.0]
    simulation.advance(3 * SECOND)
    change(simulation, rotor_torque=np.zeros(3))
    simulation.advance(5 * SECOND)
    assert simulation.rotor_momentum.tolist() == [0.0, 1.5, 0.0]
    assert simulation.angular_momentum == pytest.approx(momentum, rel=1e-8)
    change(simulation, rotor_torque=(0.0, -0.5, 0.0))
    simulation.advance(8 * SECOND)
    assert simulation.rotor_momentum.tolist() == [0.0, 0.0, 0.0]
    simulation.reset()
    assert simulation.rotor_momentum.tolist() == [0.0, 0.0, 0.0] and simulation.time_ns == 0


def test_a_flywheel_at_zero_is_none():
    plain, zero = (
        flight(BODY, integrator="auto", initial=SPIN, **rotor) for rotor in ({}, {"rotor_momentum": (0.0, -0.0, 0.0)})
    )
    assert "free_body" in zero.choice
    assert plain.advance(SECOND).sha256() == zero.advance(SECOND).sha256()
    change(zero, rotor_momentum=(0.0, 1e-3, 0.0))
    assert "taylor" in zero.choice
    change(zero, rotor_momentum=(0.0, 0.0, 0.0))
    assert "free_body" in zero.choice


def test_without_the_gyroscopic_term_only_the_motor_is_felt():
    simulation = flight(BODY, integrator="auto", initial=SPIN, rotor_momentum=H, gyroscopic=False)
    assert "closed form" in simulation.choice
    assert simulation.advance(SECOND).angular_velocity_body == pytest.approx(SPIN[10:13], rel=1e-14)


def test_a_clock_that_jumps_leaves_the_wheel_as_it_is():
    simulation = flight(BODY, integrator="auto", initial=SPIN, rotor_torque=(0.0, 0.5, 0.0))
    momentum = simulation.angular_momentum
    simulation.advance(SECOND)
    simulation.leap(1000 * SECOND)
    assert simulation.rotor_momentum.tolist() == [0.0, 0.5, 0.0]
    simulation.advance(1002 * SECOND)
    assert simulation.rotor_momentum.tolist() == [0.0, 1.0, 0.0]
    assert simulation.angular_momentum == pytest.approx(momentum, rel=1e-8)


# What is refused


@pytest.mark.parametrize("name", ["free_body", "free_body_strang"])
@pytest.mark.parametrize("rotor", [{"rotor_momentum": (0.0, 0.0, 1e-9)}, {"rotor_torque": (1e-9, 0.0, 0.0)}])
def test_integrators_that_turn_a_free_body_refuse_a_flywheel_and_name_those_that_can(name, rotor):
    with pytest.raises(CommandRefused, match="supports a flywheel: .*taylor") as refusal:
        flight(BODY, integrator=name, **rotor)
    assert refusal.value.reason == "integrator"
    plain = flight(BODY, integrator=name, initial=SPIN)
    with pytest.raises(CommandRefused, match="a flywheel"):
        plain.check_change(changed(plain.setup, **rotor))


def test_a_wheel_that_turns_refuses_another_integrator_whatever_the_parameters_say():
    simulation = flight(BODY, integrator="auto", rotor_torque=(0.5, 0.0, 0.0))
    simulation.advance(SECOND)
    change(simulation, rotor_torque=np.zeros(3))
    with pytest.raises(CommandRefused, match="a flywheel"):
        simulation.check_change(changed(simulation.setup, integrator="free_body"))


def test_auto_refuses_a_wheel_faster_than_it_can_follow_and_says_the_largest():
    with pytest.raises(CommandRefused, match=r"rotor\.momentum.* N m s for this body: auto follows rates") as refusal:
        flight(BODY, integrator="auto", rotor_momentum=(1e9, 0.0, 0.0))
    largest = float(refusal.value.accepted.split()[2])
    flight(BODY, integrator="auto", rotor_momentum=(largest, 0.0, 0.0)).advance(1000)
    with pytest.raises(CommandRefused):
        flight(BODY, integrator="auto", rotor_momentum=(1.01 * largest, 0.0, 0.0))
    # Fixed steps are only said to be too coarse.
    assert "rate of the flywheel" in flight(BODY, integrator="rk4", rotor_momentum=(1e9, 0.0, 0.0)).too_coarse


def test_a_torque_that_no_body_can_take_is_refused():
    with pytest.raises(CommandRefused, match="1e\\+15 of each") as refusal:
        flight(BODY, integrator="rk4", rotor_torque=(1e30, 0.0, 0.0))
    assert (refusal.value.field, refusal.value.reason) == ("rotor.torque", "magnitude")


def test_acceleration_and_diagnostics_know_it():
    simulation = flight(BODY, integrator="auto", initial=SPIN, rotor_momentum=H, rotor_torque=(0.1, 0.2, 0.3))
    simulation.advance(SECOND)
    w, h = simulation.state.angular_velocity_body, simulation.rotor_momentum
    expected = np.linalg.solve(TENSOR, -np.cross(w, TENSOR @ w + h) - (0.1, 0.2, 0.3))
    _, angular = simulation.accelerations()
    assert angular == pytest.approx(simulation.state.rotation @ expected, rel=1e-12)
    assert simulation.angular_momentum_drift <= 1e-8
