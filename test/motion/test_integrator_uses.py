# SPDX-License-Identifier: MIT
"""What docs/physics.md says that the integrators which auto takes seldom or never are good for."""

import numpy as np
from one_segment import new_control

from rigid_proto_ros.base.records import new_record
from rigid_proto_ros.motion.integrators import INTEGRATORS, series_steps
from rigid_proto_ros.motion.integrators.series_steps import MAX_DEGREE
from rigid_proto_ros.motion.problem import PROBLEM
from rigid_proto_ros.motion.variables import VARIABLES

MOMENTS = np.array((1.0, 2.0, 3.0))
AXIS = np.array((0.3, 1.0, -0.2)) / np.linalg.norm((0.3, 1.0, -0.2))


def segment(spin, torque_world, moments=MOMENTS):
    p, y = new_record(PROBLEM), np.zeros(VARIABLES)
    p.moments = moments
    p.mass = p.length = p.gyroscopic = 1.0
    p.torque_world = torque_world
    p.has_world_torque = float(any(torque_world))
    y[3], y[4:7] = 1.0, spin * AXIS
    return p, y


def flown(name, p, y, step, duration):
    y, steps = y.copy(), round(duration / step)
    assert INTEGRATORS[name].kernel(y, p, step, steps) == steps
    return y


def exact_flow(y, p, accuracy, h_ns):
    """Variables after h_ns by the power series of the whole motion at a rate a thousandth of the accuracy."""
    control = new_control(1e-3 * accuracy, MAX_DEGREE)
    room, following, y = series_steps.motion_workspace(MAX_DEGREE), np.zeros(VARIABLES), y.copy()
    far = series_steps.motion_steps(y, p, control, following, room, h_ns, False)
    assert not control.failed
    if far < h_ns:
        assert series_steps.motion_steps(y, p, control, following, room, h_ns - far, True) == h_ns - far
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


def test_the_splitting_needs_fewer_evaluations_than_dop853_under_moderate_loads():
    p, y = segment(100.0, (0.5, 0.3, 0.8))
    exact = exact_flow(y, p, 1e-9, 10**9)

    def error(name, step):
        return angle(flown(name, p, y, step, 1.0), exact)

    # Evaluations: 100 and 1200. Measured 1.3e-5 and 3.1e-5.
    assert INTEGRATORS["dop853"].evaluations == 12
    assert error("free_body_strang", 1e-2) < 0.6 * error("dop853", 1e-2)
