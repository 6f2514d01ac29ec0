# SPDX-License-Identifier: MIT
"""A scene that a flight changes to has the body and the rules of a flight that begins with it; what is refused changes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from random_scenes import random_scene

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.motion.problem import PROBLEM
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import NO_SLOT, PULSE
from rigid_proto_ros.simulation.effects import APPLY, CUT
from rigid_proto_ros.simulation.flight import FLIGHT
from rigid_proto_ros.simulation.flight_arrays import FlightArrays
from rigid_proto_ros.simulation.setup import Setup

MS = 1_000_000
RULES = (
    *("accuracy", "degree", "step_ns", "timeout_ns", "poke_ns", "string_timeout_ns"),
    *("integrator", "supports", "chooses"),
)
"""Fields of a flight that are a scene's for commands and segments to come."""


def setups(seeds: range) -> Iterator[Setup]:
    """Of random scenes that aren't refused."""
    for seed in seeds:
        try:
            yield make_scenario(random_scene(seed).values).setup
        except InputError:
            continue


def flown(setup: Setup) -> FlightArrays:
    """A flight of 2 ms under a force at the centre of mass."""
    arrays = FlightArrays()
    arrays.start_over(setup)
    load = np.array([0.0, 0.0, 0.0, 0.0, 0.0, *(setup.body.mass * np.array([0.1, 0.2, 0.3])), *[0.0] * 6])
    arrays.put([(0, 5 * MS, PULSE, NO_SLOT, load.tobytes())])
    arrays.call(APPLY, 0)
    arrays.call(CUT, 0)
    assert arrays.fly(2 * MS)
    return arrays


def content(record: np.record, names: tuple[str, ...] = FLIGHT.names) -> dict[str, bytes]:
    return {name: np.asarray(record[name]).tobytes() for name in names}


def differing(one: dict[str, bytes], other: dict[str, bytes]) -> list[str]:
    return [name for name in one if one[name] != other[name]]


@pytest.mark.parametrize("first", range(0, 120, 20))
def test_a_change_gives_the_body_and_the_rules_that_a_new_flight_begins_with(first: int) -> None:
    changed = 0
    for old, new in pairwise(setups(range(first, first + 20))):
        arrays = flown(old)
        before = content(arrays.flight)
        try:
            arrays.check_change(old, new)
        except CommandRefused as judged:
            with pytest.raises(CommandRefused) as refused:
                arrays.change(old, new)
            assert str(refused.value) == str(judged)
            assert differing(before, content(arrays.flight)) == []
            continue
        assert differing(before, content(arrays.flight)) == []
        arrays.change(old, new)
        changed += 1
        names = ("body", *RULES)
        assert differing(content(new.flight, names), content(arrays.flight, names)) == []
        common = PROBLEM.names
        assert differing(content(new.flight.common, common), content(arrays.flight.common, common)) == []
        # Time, and what has been counted, goes on.
        assert arrays.time_ns == 2 * MS and arrays.flight.start_ns == 2 * MS
    assert changed >= 5


@pytest.mark.parametrize("first", range(120, 240, 40))
def test_a_change_there_and_back_gives_the_bits_of_before(first: int) -> None:
    """Of the body's numbers; a state that has followed the centre of mass away and back comes within rounding."""
    for old, new in pairwise(setups(range(first, first + 40))):
        arrays = flown(old)
        before, row = content(arrays.flight, ("body", *RULES)), arrays.row.copy()
        try:
            arrays.change(old, new)
            arrays.change(new, old)
        except CommandRefused:
            continue
        assert differing(before, content(arrays.flight, ("body", *RULES))) == []
        assert arrays.row == pytest.approx(row, rel=1e-11, abs=1e-11)
