# SPDX-License-Identifier: MIT
"""A body on a string against the textbook: normal modes of the double pendulum, and the balance of work, heat and energy."""

import math

import numpy as np
import pytest
from flights import SECOND, StringSettings, flight
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.simulation.commands import MoveString, TieString

G = 9.81
MASS, INERTIA_Y, ARM, LENGTH = 1.3, 0.012, 0.15, 0.8


def normal_modes() -> tuple[np.ndarray, np.ndarray]:
    """λ (2,) and mode shapes (2, 2), columns, of string angle and body angle in a plane through the knot."""
    m, i, d, l = MASS, INERTIA_Y, ARM, LENGTH
    mass_matrix = np.array([[m * l * l, m * l * d], [m * l * d, i + m * d * d]])
    return eigh(np.diag([m * G * l, m * G * d]), mass_matrix)


def zero_crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which values, sampled evenly and densely, pass zero: cubic through the four samples around each."""
    found = []
    for k in np.flatnonzero(values[1:-2] * values[2:-1] < 0.0) + 1:
        t = times[k - 1 : k + 3] - times[k]
        roots = np.roots(np.polyfit(t / t[2], values[k - 1 : k + 3], 3))
        inside = [r.real for r in roots if abs(r.imag) < 1e-9 and 0.0 <= r.real <= 1.0]
        found.append(times[k] + inside[0] * t[2])
    return np.array(found)


@pytest.mark.parametrize("integrator", ["rk4", "auto"])
@pytest.mark.parametrize("mode", [0, 1], ids=["slow", "fast"])
def test_both_normal_modes_of_a_body_on_a_taut_string_have_their_period(mode, integrator):
    """Released at rest with 1e-3 rad in either mode; |T/T₀ − 1| ≤ 1e-5, measured 3e-7 (rk4) at most."""
    rates, shapes = normal_modes()
    shape = 1e-3 * shapes[:, mode] / np.abs(shapes[:, mode]).max()
    stiffness = 1e6
    # Stretched by its load, the string is LENGTH long.
    rest_length = LENGTH - MASS * G / stiffness
    knot = LENGTH * np.array([math.sin(shape[0]), 0.0, -math.cos(shape[0])])
    attitude = Rotation.from_rotvec([0.0, -shape[1], 0.0])
    position = knot + attitude.apply([0.0, 0.0, -ARM])
    settings = StringSettings(
        attached=True,
        attach=(0.0, 0.0, ARM),
        target=(0.0, 0.0, 0.0),
        stiffness=stiffness,
        damping_ratio=0.0,
        rest_length=rest_length,
    )
    simulation = flight(
        make_body(MASS, (0.0, 0.0, 0.0), np.diag([0.02, INERTIA_Y, 0.015])),
        integrator=integrator,
        step_s=2e-4,
        initial=[*position, *attitude.as_quat(), *[0.0] * 6],
        gravity=np.array([0.0, 0.0, -G]),
        string=settings,
        accuracy=1e-10,
    )
    period = 2.0 * math.pi / math.sqrt(rates[mode])
    sample_ns = round(period / 200 * SECOND)
    # In mode coordinates, a = Φᵀ M θ: the other mode doesn't disturb the crossings.
    m, d, l = MASS, ARM, LENGTH
    mass_matrix = np.array([[m * l * l, m * l * d], [m * l * d, INERTIA_Y + m * d * d]])
    times, amplitudes = [], []
    for k in range(200 * 6 + 20):
        state = simulation.advance(k * sample_ns)
        knot = state.position + state.rotation @ [0.0, 0.0, ARM]
        string_angle = math.atan2(knot[0], -knot[2])
        body_angle = -2.0 * math.asin(state.orientation_xyzw[1])
        times.append(k * sample_ns * 1e-9)
        amplitudes.append(shapes[:, mode] @ mass_matrix @ [string_angle, body_angle])
    crossings = zero_crossings(np.array(times), np.array(amplitudes))
    measured = 2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1)
    assert len(crossings) >= 12
    assert abs(measured / period - 1.0) <= 1e-5


def hand_position(time_s: float) -> tuple[float, float, float]:
    """A hand that circles and bobs hard enough to let the string go slack and snatch it taut."""
    return (0.3 * math.sin(5.0 * time_s), 0.3 * math.cos(4.0 * time_s), 0.4 + 0.2 * math.sin(7.0 * time_s))


@pytest.mark.parametrize(
    ("integrator", "damping_ratio", "rest_length", "bilateral"),
    [
        ("dop853", 0.1, 0.5, False),
        ("dop853", 0.1, 0.5, True),
        ("auto", 0.0, 0.5, False),
        ("auto", 0.1, 0.0, False),
        ("auto", 0.1, 0.5, True),
        ("auto", 1.5, 0.5, False),
    ],
)
def test_the_hands_work_less_the_dampers_heat_is_what_the_body_and_string_gain(
    integrator, damping_ratio, rest_length, bilateral
):
    """To 1e-9 of the largest energy exchanged, at every 10 ms of 4 s with the hand moving."""
    turn = Rotation.from_rotvec([0.3, 0.5, -0.2]).as_matrix()
    settings = StringSettings(
        frequency=15.0, damping_ratio=damping_ratio, rest_length=rest_length, bilateral=bilateral, timeout_ns=0
    )
    simulation = flight(
        make_body(0.8, (0.01, -0.02, 0.005), turn @ np.diag([0.004, 0.006, 0.009]) @ turn.T),
        integrator=integrator,
        step_s=1e-4,
        initial=[0.0, 0.0, -0.3, *Rotation.from_rotvec([0.2, -0.4, 0.1]).as_quat(), 0.1, 0.0, 0.0, 1.0, -2.0, 0.5],
        gravity=np.array([0.0, 0.0, -G]),
        string=settings,
        accuracy=1e-12,
    )
    simulation.submit(TieString("mesh", (0.08, 0.03, -0.05)))
    every_ns = 37_000_000
    for k in range(4 * SECOND // every_ns):
        simulation.submit(MoveString(hand_position(k * every_ns * 1e-9)), k * every_ns)
    # Tying at a distance stores energy at once, which no hand has worked: the balance begins a nanosecond after it.
    simulation.advance(1)
    start = simulation.kinetic_energy + simulation.potential_energy
    exchanged = []
    for time_ns in range(10_000_000, 4 * SECOND, 10_000_000):
        simulation.advance(time_ns)
        gain = simulation.kinetic_energy + simulation.potential_energy - start
        exchanged.append((gain, simulation.hand_work, simulation.string_heat))
    assert not simulation.refused
    gain, work, heat = np.transpose(exchanged)
    assert np.abs(gain - (work - heat)).max() <= 1e-9 * np.abs(exchanged).max()
    # The test is of something: the hand works, and a damper heats.
    assert np.abs(work).max() > 1.0
    assert (heat.max() > 0.1) == (damping_ratio > 0.0)
