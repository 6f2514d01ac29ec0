# SPDX-License-Identifier: MIT
"""Entries of lists and scripts act in the order in which they are listed, before all single messages of their instant."""

from __future__ import annotations

import itertools
import random

import pytest
from flights import SECOND, EventLines

from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import Ghost, OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.session.recorded_session import decode_event
from rigid_proto_ros.simulation.commands import Change, Command
from rigid_proto_ros.simulation.observer import Observer
from rigid_proto_ros.simulation.simulation import Simulation

SCENE = {"mesh": "t_handle", "density": 7850.0, "integrator": "rk4", "initial.angular_velocity": [0.5, -2.0, 3.0]}
DONE = [
    {"at": {"vertex": 3}, "impulse": [0.0, 0.0, 0.001]},
    {"set": {"density": 9000.0}},
    {"string": {"target": [0.1, 0.0, 0.2]}},
    {"string": {"attach": [0.0, 0.0, 0.07]}},
    {"at": {"vertex": 7}, "impulse": [0.0, 0.002, 0.0]},
    {"wrench": {"at": "com", "torque": [0.0, 1e-5, 0.0]}},
    {"service": "clear_wrench"},
    {"string": "release"},
    {"wrench": {"at": "com", "force": [0.0, 0.0, 1e-2]}},
]


def kinds(told: EventLines) -> list[str]:
    return [decode_event(line, 1)[1] for line in told.lines]


def commands(entries: list[dict]) -> list[Command]:
    run = OfflineRun(make_scenario(SCENE))
    read = expand_script([{"t": 1.0, **entry} for entry in entries])
    return [run.bound(command) if isinstance(command, Change) else command for command in read]


@pytest.mark.parametrize("seed", range(5))
def test_a_script_acts_in_its_own_order_and_not_by_kind(seed: int) -> None:
    entries = random.Random(seed).sample(DONE, len(DONE))
    lines = EventLines()
    OfflineRun(make_scenario(SCENE), expand_script([{"t": 1.0, **entry} for entry in entries]), lines).advance(
        2 * SECOND
    )
    assert kinds(lines) == [command.kind for command in expand_script([{"t": 0.0, **entry} for entry in entries])]


def test_lists_act_first_as_they_arrived_then_single_messages_by_kind_whatever_arrives_first() -> None:
    found = set()
    for order in itertools.permutations(range(3)):
        lines = EventLines()
        simulation = Simulation(make_scenario(SCENE).setup, lines)
        own = commands(DONE)
        parts = [
            [(own[0], (2, 0)), (own[1], (2, 1))],
            [(own[4], (1, 0)), (own[6], (1, 1)), (own[2], (1, 2))],
            [(own[8], None), (own[3], None), (own[1], None)],
        ]
        for k in order:
            for command, listed in parts[k]:
                simulation.submit(command, SECOND, listed)
        found.add(simulation.advance(2 * SECOND).sha256())
        assert kinds(lines) == [
            "poke",
            "clear_wrench",
            "string_target",
            "poke",
            "set",
            "set",
            "string_attach",
            "wrench",
        ]
    assert len(found) == 1


def test_a_ghost_takes_a_change_at_its_place_among_the_entries_of_its_list() -> None:
    scenario = make_scenario({**SCENE, "ghost.integrator": "rk4"})
    run = OfflineRun(scenario, expand_script([{"t": 1.0, **entry} for entry in DONE]), Observer())
    assert isinstance(run.ghost, Ghost)
    run.advance(2 * SECOND)
    # The same tensor and integrator: the same motion, if all acts in the same order.
    assert run.ghost.simulation.state.sha256() == run.simulation.state.sha256()


def test_loads_are_summed_in_the_order_in_which_they_began_to_act() -> None:
    script = [
        {"t": 0.1, "at": {"vertex": 3}, "force": [0.1, 0.2, 0.3], "duration": 5.0},
        {"t": 0.2, "wrench": {"at": {"vertex": 5}, "force": [0.7, -0.1, 0.05]}},
        {"t": 0.3, "at": {"vertex": 9}, "force": [-0.3, 0.11, 0.01], "duration": 5.0},
    ]
    run = OfflineRun(make_scenario({**SCENE, "wrench_timeout": 0.0}), expand_script(script))
    run.advance(SECOND)
    kinds = [acting.load.force for acting in run.simulation.acting]
    assert kinds == [(0.1, 0.2, 0.3), (0.7, -0.1, 0.05), (-0.3, 0.11, 0.01)]
