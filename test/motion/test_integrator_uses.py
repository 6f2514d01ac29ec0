# SPDX-License-Identifier: MIT
"""What docs/physics.md says that the integrators which auto takes seldom or never are good for."""

import numpy as np
import pytest
from weak_loads import exact_flow

from rigid_proto_ros.base.rotation import multiply
from rigid_proto_ros.motion import problem as of
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.variables import STORED

MOMENTS = np.array((1.0, 2.0, 3.0))
AXIS = np.array((0.3, 1.0, -0.2)) / np.linalg.norm((0.3, 1.0, -0.2))


def segment(spin, torque_world, moments=MOMENTS):
    p, y = np.zeros(of.SIZE), np.zeros(STORED)
    p[of.MOMENTS : of.MOMENTS + 3] = moments
    p[of.MASS] = p[of.LENGTH] = p[of.GYROSCOPIC] = 1.0
    p[of.TORQUE_WORLD : of.TORQUE_WORLD + 3] = torque_world
    p[of.HAS_WORLD_TORQUE] = float(any(torque_world))
    y[3], y[4:7] = 1.0, spin * AXIS
    return p, y


def flown(name, p, y, step, duration):
    y, steps = y.copy(), round(duration / step)
    assert INTEGRATORS[name].kernel(y, p, step, steps) == steps
    return y


def angle(a, b):
    return 2.0 * min(np.linalg.norm(a[:4] - b[:4]), np.linalg.norm(a[:4] + b[:4]))


def test_semi_implicit_euler_gains_energy_that_nothing_gives():
    p, y = segment(6.0, (0.0, 0.0, 0.0))

    def gain(step):
        after = flown("semi_implicit_euler", p, y, step, 10.0)
        return (MOMENTS * after[4:7] ** 2).sum() / (MOMENTS * y[4:7] ** 2).sum() - 1.0

    # Measured 1.27 and 0.0404.
    assert 1.2 < gain(1.0 / 60.0) < 1.35
    assert 0.035 < gain(1e-3) < 0.045


def test_splittings_need_fewer_evaluations_than_dop853_under_moderate_loads():
    p, y = segment(100.0, (0.5, 0.3, 0.8))
    exact = exact_flow(y, p, 1e-9, 10**9)

    def error(name, step):
        return angle(flown(name, p, y, step, 1.0), exact)

    # Evaluations: 100 and 1200, 600 and 2400. Measured 1.3e-5 and 3.1e-5, 4.1e-9 and 8.1e-8 rad.
    assert INTEGRATORS["dop853"].evaluations == 12
    assert error("free_body_strang", 1e-2) < 0.6 * error("dop853", 1e-2)
    assert error("free_body_4", 1e-2) < 0.1 * error("dop853", 5e-3)
    # Measured 1.7e-2 and 2.0e-2, 6.8e-4 and 8.6e-4 rad.
    assert error("rkmk4", 5e-3) < error("rk4", 5e-3) < 2.0 * error("rkmk4", 5e-3)
    assert error("rkmk4", 2.5e-3) < error("rk4", 2.5e-3) < 2.0 * error("rkmk4", 2.5e-3)


def test_rkmk4_errs_by_the_change_of_the_spin_and_rk4_by_the_spin():
    def errors(moments, torque, step):
        p, y = segment(10.0, torque, moments)
        exact = flown("dop853", p, y, 1e-3, 10.0)
        return [angle(flown(name, p, y, step, 10.0), exact) for name in ("rk4", "rkmk4")]

    # |ω|h = 1. A ball, whose spin stays: measured 4.8e-2 rad and rounding.
    quaternion, group = errors((2.0, 2.0, 2.0), (0.0, 0.0, 0.0), 0.1)
    assert quaternion > 0.04
    assert group < 1e-12
    # Moments 1, 1.1, 1.2 without load and under a weak one: measured 4.7e-2 and 1.5e-4, 4.8e-2 and 1.2e-4 rad.
    for torque in ((0.0, 0.0, 0.0), (5e-3, 3e-3, 8e-3)):
        quaternion, group = errors((1.0, 1.1, 1.2), torque, 0.1)
        assert quaternion > 100.0 * group


@pytest.mark.parametrize("name", ["rk4", "rkmk4"])
def test_a_start_turned_in_the_world_gives_the_same_motion_turned(name):
    p, y = segment(10.0, (0.0, 0.0, 0.0))
    turn = np.array((0.2, -0.4, 0.4, 0.8))
    turned = y.copy()
    turned[:4] = turn
    after, turned_after = flown(name, p, y, 0.05, 10.0), flown(name, p, turned, 0.05, 10.0)
    assert angle(turned_after, np.array(multiply(*turn, *after[:4]))) < 1e-12
    assert np.array_equal(turned_after[4:7], after[4:7])
