# SPDX-License-Identifier: MIT
"""Hostile numbers, one by one and together: forces from 1e-308 up, steps from a nanosecond to 1000 s, spins from 1e-200.

Each flight ends right, refused, or stopped in its last good state with a reason; never in NaN and never in an exception.
"""

import numpy as np
import pytest
from flights import StringSettings, flight, wrench

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.loads import ANGULAR_DAMPING, STRING

TENSOR = np.array([[1.3, 0.2, -0.1], [0.2, 2.0, 0.3], [-0.1, 0.3, 2.9]])
ROW = np.array([0.0, 0.0, 0.0, 0.1, -0.2, 0.3, 0.9, 0.4, 0.1, -0.3, 0.9, 1.3, -0.6])
ROW[3:7] /= np.linalg.norm(ROW[3:7])


def sane_end(simulation):
    """What may be published: finite, a unit quaternion; stopped only with a reason."""
    row = simulation.state.row
    assert np.isfinite(row).all()
    assert abs(np.linalg.norm(row[3:7]) - 1.0) < 1e-14
    if simulation.failure:
        assert "1e+100" in simulation.failure or "not finite" in simulation.failure
    return simulation.failure


@pytest.mark.parametrize("frame", ["world@point/.1,.2,.3", "body@point/.1,.2,.3"])
@pytest.mark.parametrize("spin", [2e6, 1e7, 5e7])
def test_a_spin_whose_series_squared_would_overflow_is_flown_in_steps_as_long_as_possible(spin, frame):
    simulation = flight(
        make_body(2.0, np.zeros(3), TENSOR),
        integrator="auto",
        accuracy=1e-14,
        initial=np.array([*ROW[:10], *(spin * np.array([0.3, 0.9, -0.2]))]),
    )
    simulation.submit(wrench(frame, (1.0, 2.0, 3.0)), 0)
    simulation.advance(20_000)
    assert not simulation.failure
    # Measured 1.37 to 1.48 rad a step; the shortest step is a nanosecond.
    assert spin * 20e-6 / simulation.steps > 0.3


HOSTILE_FRAMES = ("world", "body", "world@point/.1,.2,.3", "body@point/.1,-.2,.3")


def magnitude(rng, low, high):
    return 10.0 ** rng.uniform(low, high)


FOLLOWED = 1e5
"""rad/s and 1/s that auto follows whatever the direction."""


def hostile_flight(name, seed, followed=False):
    """followed: with damping and string cut down to rates that auto follows."""
    rng, integrator = np.random.default_rng(seed), INTEGRATORS[name]
    moments = np.sort(rng.uniform(0.5, 1.0, 3)) * magnitude(rng, -9, 9)
    body = make_body(magnitude(rng, -9, 9), (0.0, 0.0, 0.0), np.diag(moments))
    row = np.zeros(13)
    row[0:3] = rng.normal(size=3) * magnitude(rng, -9, 9)
    row[6] = 1.0
    row[7:10] = rng.normal(size=3) * magnitude(rng, -200, 9)
    row[10:13] = rng.normal(size=3) * rng.choice((0.0, magnitude(rng, -200, 6)))
    string = StringSettings()
    if STRING in integrator.supports and rng.random() < 0.5:
        string = StringSettings(
            attached=True,
            attach=tuple(rng.normal(size=3) * magnitude(rng, -3, 1)),
            target=tuple(row[0:3] + rng.normal(size=3) * magnitude(rng, -3, 1)),
            stiffness=magnitude(rng, -12, 6) * body.mass,
            damping_ratio=rng.choice((0.0, 0.1, 1.0)),
            rest_length=rng.choice((0.0, 0.5)),
            bilateral=bool(rng.random() < 0.5),
        )
    step_s, gravity = magnitude(rng, -9, 3), np.array((0.0, 0.0, -9.81)) * rng.integers(0, 2)
    linear = rng.choice((0.0, magnitude(rng, -12, 9)))
    angular = rng.choice((0.0, magnitude(rng, -12, 9))) if ANGULAR_DAMPING in integrator.supports else 0.0
    if followed:
        linear, angular = min(linear, FOLLOWED * body.mass), min(angular, FOLLOWED * body.principal_moments[0])
        yields = 1.0 / body.mass + sum(r * r for r in string.attach) / body.principal_moments[0]
        most = min(FOLLOWED**2 / yields, (0.5 * FOLLOWED / yields) ** 2 / body.mass)
        string = string._replace(stiffness=min(string.stiffness, most))
    return rng, flight(
        body,
        integrator=name,
        step_s=step_s,
        initial=row,
        gravity=gravity,
        linear_damping=linear,
        angular_damping=angular,
        string=string,
    )


def check_hostile_flight(name, seed):
    try:
        rng, simulation = hostile_flight(name, seed)
    except CommandRefused as refusal:
        assert (name, refusal.reason) == ("auto", "integrator")
        if "away from the knot" in str(refusal):
            return
        assert "for this body" in str(refusal)
        rng, simulation = hostile_flight(name, seed, followed=True)
    step_ns = int(simulation.flight.step_ns)
    force, torque = (
        tuple(rng.normal(size=3) * magnitude(rng, -300, 300 if rng.random() < 0.3 else 6)) for _ in range(2)
    )
    try:
        simulation.submit(wrench(str(rng.choice(HOSTILE_FRAMES)), force, torque))
    except CommandRefused as refusal:
        assert refusal.reason in ("integrator", "magnitude")
    # auto resolves whatever is fast, so its flight is short where something is.
    longest = 10 * step_ns if name != "auto" else min(10 * step_ns, 10**4)
    for _ in range(3):
        until = simulation.time_ns + int(rng.integers(1, longest + 1))
        state = simulation.advance(until)
        if sane_end(simulation):
            return
        assert state.time_ns == until


@pytest.mark.parametrize("seeds", [range(40), pytest.param(range(1000, 4000), marks=pytest.mark.stress)])
@pytest.mark.parametrize("name", INTEGRATORS)
def test_extremes_end_in_a_state_a_refusal_or_a_stop(name, seeds):
    for seed in seeds:
        check_hostile_flight(name, seed)
