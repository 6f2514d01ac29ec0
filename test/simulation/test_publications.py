# SPDX-License-Identifier: MIT
"""Times of publication, and the quaternion from one to the next."""

from fractions import Fraction

import numpy as np
import pytest
from flights import SECOND, Heard
from hypothesis import given
from hypothesis import strategies as st

from rigid_proto_ros.scene.scenario import publication_ns, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.simulation.observer import Published

SCENE = read_scene("t_handle")


@given(st.floats(1e-6, 1e4), st.integers(0, 10**7))
def test_publication_times_are_rounded_exactly(rate, k):
    exact = k * SECOND / Fraction(rate)
    assert abs(publication_ns(k, rate) - exact) <= Fraction(1, 2)


def test_publication_times_of_well_known_rates():
    assert [publication_ns(k, 3.0) for k in range(4)] == [0, 333_333_333, 666_666_667, SECOND]
    assert publication_ns(10**9 * 60, 60.0) == 10**18


@pytest.mark.parametrize("portions", [1, 100])
@pytest.mark.parametrize(
    ("before", "rate", "after"),
    [
        (10.0, 20.0, [1.0, 1.05, 1.1, 1.15, 1.2]),
        (10.0, 5.0, [1.0, 1.2]),
        (10.0, 50.0, [0.96 + 0.02 * k for k in range(13)]),
        (0.5, 10.0, [1.0, 1.1, 1.2]),
        (10.0, 1000.0, [0.951 + 0.001 * k for k in range(250)]),
    ],
)
def test_a_rate_that_a_script_changes_holds_from_then_on(
    before: float, rate: float, after: list, portions: int
) -> None:
    told = Heard(Published)
    script = expand_script([{"t": 0.95, "set": {"publish_rate": rate}}])
    run = OfflineRun(read_scene("t_handle", {"publish_rate": before}), script, told)
    for k in range(1, portions + 1):
        assert run.advance(12 * SECOND // 10 * k // portions)
    until = [k / before for k in range(10) if k / before < 0.95]
    assert [event.time_ns * 1e-9 for event in told.events] == pytest.approx(until + after)


def test_the_quaternion_is_never_flipped():
    simulation = OfflineRun(SCENE).simulation
    before = simulation.advance(0).orientation_xyzw.copy()
    # Twelve turns and more: q crosses its own negative many times.
    for k in range(1, 800):
        q = simulation.advance(10_000_000 * k).orientation_xyzw.copy()
        assert float(np.dot(q, before)) > 0.99
        before = q
