# SPDX-License-Identifier: MIT
"""auto follows damping and strings up to the rate that it can resolve in real time; beyond, they are refused with what the body takes."""

import numpy as np
import pytest
from flights import SECOND, StringSettings, changed, flight, flight_setup, spinning, wrench
from mpmath import mp, mpf

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators.auto import FASTEST
from rigid_proto_ros.simulation.commands import Change, MoveString, TieString

MOMENTS = (0.02, 0.03, 0.04)
BODY = make_body(2.0, np.zeros(3), np.diag(MOMENTS))
ARM = (0.1, 0.15, 0.2)
DURATION_NS = SECOND // 20


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("rate", [2e4, 0.99 * FASTEST / 2])
def test_a_spin_soon_goes_as_fast_as_its_torque_keeps_up(rate, accuracy):
    damping, torque, spin, time = rate * MOMENTS[2], 3.0 * rate * MOMENTS[2], 20.0, DURATION_NS * 1e-9
    simulation = flight(
        BODY, integrator="auto", accuracy=accuracy, initial=spinning((0, 0, spin)), angular_damping=damping
    )
    simulation.submit(wrench("body@com", torque=(0, 0, torque)))
    row = simulation.advance(DURATION_NS).row
    with mp.workdps(40):
        slow, fast = mpf(torque) / mpf(damping), mpf(damping) / mpf(MOMENTS[2])
        kept = mp.exp(-fast * mpf(time))
        angle = slow * mpf(time) + (spin - slow) * (1 - kept) / fast
        half = [float(mp.sin(angle / 2)), float(mp.cos(angle / 2))]
        speed = float(slow + (spin - slow) * kept)
    # A step's floor of rounding is 32 ε.
    allowed = accuracy * time + simulation.steps * 32.0 * 2.0**-52
    assert 2.0 * np.abs(row[5:7] - half).max() <= allowed
    assert abs(row[12] - speed) / max(speed, 1.0) <= allowed
    assert not row[[3, 4, 10, 11]].any()


def test_a_user_who_damps_a_toy_by_one_newton_metre_second_still_flies():
    toy = make_body(0.15, np.zeros(3), np.diag((5e-5, 6e-5, 1e-4)))
    simulation = flight(toy, integrator="auto", initial=spinning((1.0, 2.0, 3.0)), angular_damping=1.0)
    assert np.abs(simulation.advance(SECOND // 100).angular_velocity_body).max() <= 1e-9


def tied(**settings):
    return StringSettings(attached=True, attach=ARM, rest_length=0.5, timeout_ns=0, **settings)


REFUSED = {
    "angular_damping": ({"angular_damping": 2e4}, 1e4),
    "linear_damping": ({"linear_damping": 4e6}, 1e6),
    "string.stiffness": ({"string": tied(stiffness=1e13)}, None),
    "string.frequency": ({"string": tied(frequency=1e6)}, None),
    "string.damping_ratio": ({"string": tied(frequency=1e3, damping_ratio=1e4)}, None),
}


@pytest.mark.parametrize("mass", [2.0, 0.1, 0.125, 0.185])
@pytest.mark.parametrize("parameter", REFUSED)
def test_what_is_too_fast_is_refused_with_the_most_that_this_body_takes(parameter, mass):
    """Three digits of the limit, rounded down."""
    body = make_body(mass, np.zeros(3), 0.5 * mass * np.diag(MOMENTS))
    changes, most = REFUSED[parameter]
    with pytest.raises(CommandRefused) as refusal:
        flight(body, integrator="auto", **changes)
    assert (refusal.value.reason, refusal.value.field) == ("integrator", parameter)
    said = float(refusal.value.accepted.split()[2])
    assert most is None or mass != 2.0 or said == most
    # It is taken, and a hair more isn't.
    name = parameter.removeprefix("string.")
    taken, refused = (
        {name: part * said} if name == parameter else {"string": changes["string"]._replace(**{name: part * said})}
        for part in (1.0, 1.01)
    )
    flight(body, integrator="auto", **taken)
    with pytest.raises(CommandRefused):
        flight(body, integrator="auto", **refused)
    # Fixed steps are the user's own choice.
    flight(body, integrator="rk4", **changes)


def test_tying_and_changing_in_flight_are_refused_and_counted():
    settings = tied(stiffness=1e13)._replace(attached=False)
    setup = flight_setup(BODY, integrator="auto", string=settings)
    simulation = flight(BODY, integrator="auto", string=settings)
    simulation.submit(MoveString((0.0, 0.0, 1.0)), 1000)
    simulation.submit(Change({}, lambda: changed(setup, angular_damping=1e6)), 2000)
    simulation.submit(Change({}, lambda: changed(setup, string=settings._replace(stiffness=10.0))), 3000)
    simulation.submit(MoveString((0.0, 0.0, 1.0)), 4000)
    simulation.submit(Change({}, lambda: changed(setup, string=settings)), 5000)
    # At the COM a string of 1e11 N/m swings the body slowly enough, at ARM it doesn't.
    simulation.submit(TieString("mesh", (0.0, 0.0, 0.0)), 6000)
    softer = settings._replace(stiffness=3e11)
    simulation.submit(Change({}, lambda: changed(setup, string=softer)), 7000)
    simulation.submit(TieString("mesh", ARM), 8000)
    simulation.advance(10_000)
    assert simulation.refused == {"integrator": 4}
    assert simulation.string is not None and simulation.string.attach == (0.0, 0.0, 0.0)
    assert simulation.string.stiffness == 3e11
    fixed = flight(BODY, integrator="rk4", string=settings)
    fixed.submit(MoveString((0.0, 0.0, 1.0)), 1000)
    fixed.submit(Change({}, lambda: changed(setup, integrator="auto")), 2000)
    fixed.advance(10_000)
    assert fixed.refused == {"integrator": 1}
