# SPDX-License-Identifier: MIT
"""The motion depends on commands and their times alone: not on how it was asked for."""

from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.scenario import publication_ns
from rigid_proto_ros.simulation.commands import WrenchCommand

SECOND = 10**9
SCENE = read_scene("t_handle")
END_NS = SECOND // 2


def command(held: bool, frame: str, force, torque=(0.0, 0.0, 0.0), stamp_ns: int = SECOND // 5) -> WrenchCommand:
    return WrenchCommand(held, parse_frame(frame), force, torque, frame, stamp_ns=stamp_ns)


COMMANDS = (
    command(True, "world@tip", (0.1, 0.02, 0.0)),
    command(True, "body", (0.0, 0.0, 0.01), (1e-4, 0.0, 0.0)),
    command(False, "world@left", (0.3, 0.1, 0.7)),
    command(False, "normal@vertex/5", (0.1, 0.0, 0.0)),
    command(False, "world;impulse", (1e-3, 3e-3, 7e-3)),
)


def final_hash(commands, looks=()) -> str:
    simulation = OfflineRun(SCENE).simulation
    for given_command in commands:
        simulation.submit(given_command, given_command.stamp_ns)
    for time_ns in looks:
        simulation.advance(time_ns)
    return simulation.advance(END_NS).sha256()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, END_NS), max_size=40))
def test_the_portions_of_advance_leave_no_trace(looks):
    assert final_hash(COMMANDS, sorted(looks)) == final_hash(COMMANDS)


@given(st.floats(1e-6, 1e4), st.integers(0, 10**7))
def test_publication_times_are_rounded_exactly(rate, k):
    exact = k * SECOND / Fraction(rate)
    assert abs(publication_ns(k, rate) - exact) <= Fraction(1, 2)


def test_publication_times_of_well_known_rates():
    assert [publication_ns(k, 3.0) for k in range(4)] == [0, 333_333_333, 666_666_667, SECOND]
    assert publication_ns(10**9 * 60, 60.0) == 10**18


def test_the_quaternion_is_never_flipped():
    simulation = OfflineRun(SCENE).simulation
    before = simulation.advance(0).orientation_xyzw.copy()
    # Twelve turns and more: q crosses its own negative many times.
    for k in range(1, 800):
        q = simulation.advance(10_000_000 * k).orientation_xyzw.copy()
        assert float(np.dot(q, before)) > 0.99
        before = q
