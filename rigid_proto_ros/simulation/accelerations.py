# SPDX-License-Identifier: MIT
"""Accelerations at one state, from the equations of motion and not from differences: what an accelerometer needs."""

from __future__ import annotations

import numpy as np

from ..base.rotation import Numbers, cross, times, transposed_times
from ..motion.loads import LoadSum
from ..motion.state import State
from ..motion.string import Tied
from .setup import Setup


def accelerations(setup: Setup, loads: LoadSum, string: Tied | None, state: State) -> tuple[np.ndarray, np.ndarray]:
    """COM acceleration (3,) [m/s², world] and angular acceleration (3,) [rad/s², body axes] under what acts now.

    v' = g + (F − c v)/m and ω' = I⁻¹(τ − c_ω ω − ω × I ω): Goldstein, Classical Mechanics (2002), section 5.5.
    """
    body, R, w = setup.body, state.rotation, state.angular_velocity_body
    force = loads.force_world + times(R, loads.force_body) - setup.linear_damping * state.linear_velocity
    MR = np.stack([times(loads.moment, R[:, k]) for k in range(3)], axis=1)
    torque = (
        loads.torque_body
        + transposed_times(R, loads.torque_world)
        + np.array([MR[1, 2] - MR[2, 1], MR[2, 0] - MR[0, 2], MR[0, 1] - MR[1, 0]])
        - setup.angular_damping * w
    )
    if string is not None:
        pull = string.pull(body, state)
        force = force + pull
        torque = torque + cross(string.arm(body), transposed_times(R, pull))
    if setup.gyroscopic:
        torque = torque - cross(w, times(body.inertia, w))
    return setup.gravity + force / body.mass, body.angular_acceleration(torque)


def specific_force(setup: Setup, loads: LoadSum, string: Tied | None, state: State, point: Numbers) -> np.ndarray:
    """What an accelerometer at ``point`` (3,) [m, body axes from the COM] shows (3,) [m/s², body axes]:
    Rᵀ(a − g) + ω' × r + ω × (ω × r).
    """
    linear, angular = accelerations(setup, loads, string, state)
    w = state.angular_velocity_body
    return transposed_times(state.rotation, linear - setup.gravity) + cross(angular, point) + cross(w, cross(w, point))
