# SPDX-License-Identifier: MIT
"""Flights as a motion capture would see them: made by the simulation's own kernels, with noise from a
seeded generator.
"""

from __future__ import annotations

import numpy as np

from rigid_proto_ros.identify import measurements as ms
from rigid_proto_ros.identify import rotations as rot
from rigid_proto_ros.identify import shooting as sh
from rigid_proto_ros.identify import trajectories as tr
from rigid_proto_ros.identify.unknowns import Values
from rigid_proto_ros.motion.loads import Load

MOCAP = (0.5e-3, np.radians(0.2))
"""Of position [m] and attitude [rad], each component."""
PHONE = (0.005, 0.05)
"""Of a phone's rates [rad/s] and accelerations [m/s²] at 200 Hz, each component."""


def values_of(mass, com, inertia, gravity=(0.0, 0.0, 0.0), damping=(0.0, 0.0)) -> Values:
    """All that is known of a body."""
    com, inertia, damping, gravity = (np.array(one, float) for one in (com, inertia, damping, gravity))
    return Values(mass, com, inertia, damping, gravity, {}, np.zeros(3), np.zeros(3), np.zeros(3))


def load_history(*pokes) -> ms.LoadHistory:
    """Loads from (begin [s], duration [s] or 0 for an impulse, axes, point in the tracked frame or None,
    force, torque).
    """
    rows = []
    for begin, duration, axes, point, force, torque in pokes:
        row = Load(axes, point, tuple(force), tuple(torque)).row
        rows.append((round(begin * 1e9), round(begin * 1e9) + round(duration * 1e9), row))
    return ms.load_history(rows)


def flown(values, start, times_s, load=None):
    """Samples (m, SAMPLE) of a flight from the tracked frame's start (13,) at time 0."""
    times_ns = np.round(np.asarray(times_s) * 1e9).astype(np.int64)
    wrenches = (load or ms.load_history()).within(0, int(times_ns[-1]) + 1)
    samples, good = tr.fly_rows(*sh.flown_rows(np.asarray(start, float)[None], [values]), times_ns, wrenches)
    assert good.all()
    return times_ns, samples[0]


def mocap(
    values, start, rng, seconds=5.0, rate=100.0, load=None, noise=MOCAP, topic="/mocap/pose"
) -> ms.MeasuredFlight:
    """A flight whose pose was measured."""
    times, samples = flown(values, start, np.arange(0.0, seconds, 1.0 / rate), load)
    com = values.center_of_mass
    position = samples[:, :3] - rot.turned(samples[:, 3:7], com) + noise[0] * rng.standard_normal((len(times), 3))
    attitude = rot.product(samples[:, 3:7], rot.exponential(noise[1] * rng.standard_normal((len(times), 3))))
    series = (ms.Series(topic, ms.POSITION, times, position), ms.Series(topic, ms.ATTITUDE, times, attitude))
    return ms.MeasuredFlight("flight", series, load or ms.load_history(), tuple(values.gravity))


def tumbling(rate=(0.4, 6.0, 0.3), velocity=(0.3, -0.2, 3.0)) -> np.ndarray:
    """A start (13,)."""
    return np.array([0.1, 0.2, 1.0, 0.0, 0.0, 0.0, 1.0, *velocity, *rate])


def with_imu(
    values, start, rng, seconds=3.0, load=None, offset_s=0.0, place=(0.0, 0.0, 0.0), bias=(0.0, 0.0)
) -> ms.MeasuredFlight:
    """The same flight with an IMU as a phone's on it, whose clock is behind by ``offset_s``; bias: of its
    rates and accelerations.
    """
    flight = mocap(values, start, rng, seconds, load=load)
    times, samples = flown(values, start, np.arange(0.02, seconds - 0.05, 0.005) + offset_s, load)
    rate = samples[:, 10:13] + bias[0] + PHONE[0] * rng.standard_normal((len(times), 3))
    arm = np.asarray(place) - values.center_of_mass
    w, angular = samples[:, 10:13], samples[:, 16:19]
    felt = samples[:, 13:16] + np.cross(angular, arm) + np.cross(w, np.cross(w, arm))
    felt = felt + bias[1] + PHONE[1] * rng.standard_normal(felt.shape)
    stamps = times - round(offset_s * 1e9)
    imu = (
        ms.Series("/imu", ms.RATE, stamps, rate),
        ms.Series("/imu", ms.ACCELERATION, stamps, felt),
    )
    return ms.MeasuredFlight("flight", (*flight.series, *imu), flight.load_history, flight.gravity)
