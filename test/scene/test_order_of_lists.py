# SPDX-License-Identifier: MIT
"""Commands of one instant: entries of lists and scripts act in the order in which they are listed, then single messages by kind,
those of one topic as they arrived.
"""

from __future__ import annotations

import itertools
import random
from dataclasses import replace
from functools import partial

import pytest
from flights import SECOND, EventLines, wrench

from rigid_proto_ros.scene.scenario import make_scenario, with_inertia
from rigid_proto_ros.scene.scenario_run import Ghost, OfflineRun
from rigid_proto_ros.scene.script import expand_script
from rigid_proto_ros.session.recorded_session import decode_event
from rigid_proto_ros.simulation.commands import Change, Command, ThrusterCommand
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
    {"state": {"position": [0.1, 0.0, 0.0]}},
]


def kinds(told: EventLines) -> list[str]:
    return [decode_event(line, 1)[1] for line in told.lines]


def commands(entries: list[dict]) -> list[Command]:
    run = OfflineRun(make_scenario(SCENE))
    read = expand_script([{"t": 1.0, **entry} for entry in entries])
    return [
        replace(command, apply=partial(run.setup_of, command)) if isinstance(command, Change) else command
        for command in read
    ]


@pytest.mark.parametrize("seed", range(5))
def test_a_script_acts_in_its_own_order_and_not_by_kind(seed: int) -> None:
    entries = random.Random(seed).sample(DONE, len(DONE))
    lines = EventLines()
    OfflineRun(make_scenario(SCENE), expand_script([{"t": 1.0, **entry} for entry in entries]), lines).advance(
        2 * SECOND
    )
    assert kinds(lines) == [command.kind for command in expand_script([{"t": 0.0, **entry} for entry in entries])]


def test_lists_act_first_as_they_arrived_then_single_messages_by_kind_whatever_arrives_first() -> None:
    found, scenario = set(), make_scenario(SCENE)
    content = {"mass": 0.02, "com": (0, 0, 0), "tensor": (1e-5, 0, 0, 2e-5, 0, 2.5e-5), "relative": False}
    inertia = Change(content, lambda: with_inertia(scenario, content).setup, "inertia")
    for order in itertools.permutations(range(3)):
        lines = EventLines()
        simulation = Simulation(make_scenario(SCENE).setup, lines)
        own = commands(DONE)
        parts = [
            [(own[0], (2, 0)), (own[1], (2, 1))],
            [(own[4], (1, 0)), (own[6], (1, 1)), (own[2], (1, 2))],
            [
                (command, None)
                for command in (own[8], own[4], own[3], inertia, own[0], own[6], own[1], own[5], own[7], own[9])
            ],
        ]
        for k in order:
            for command, listed in parts[k]:
                simulation.submit(command, SECOND, listed)
        found.add(simulation.advance(2 * SECOND).sha256())
        lists = ["poke", "clear_wrench", "string_target", "poke", "set"]
        changes = ["clear_wrench", "set", "string_release", "state"]
        assert kinds(lines) == [*lists, *changes, "inertia", "string_attach", "wrench", "wrench", "poke", "poke"]
        assert not simulation.refused
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


@pytest.mark.parametrize("at_ns", [0, SECOND // 2], ids=["now", "scheduled"])
@pytest.mark.parametrize("last", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0)])
def test_the_last_wrench_and_the_last_forces_of_thrusters_that_arrive_are_those_that_hold(last, at_ns):
    scene = {**SCENE, "wrench_timeout": 0.0, "thrusters.a": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]}
    simulation = Simulation(make_scenario(scene).setup)
    for force in ((1.0, 0.0, 0.0), last):
        simulation.submit(wrench("world", force), at_ns)
        simulation.submit(ThrusterCommand((force[0],)), at_ns)
    simulation.advance(2 * SECOND)
    acting = [load.load.force for load in simulation.acting if load.shown_kind == "wrench"]
    assert acting == ([last] if any(last) else [])
    assert [load.load.force[0] for load in simulation.acting if load.shown_kind == "thruster"] == [x for x in last if x]


def test_the_total_wrench_does_not_depend_on_who_ended_before():
    """Pulses summed afresh: after some have ended, the sum is that of the rest alone, to the bit."""
    setup = make_scenario({**SCENE, "initial.angular_velocity": [0.0, 0.0, 0.0]}).setup
    with_others, alone = Simulation(setup), Simulation(setup)

    for force, duration in (((1e9, 0.1, -3e7), 1e-3), ((0.1, 0.2, 0.3), 2.0), ((-1e9, 7.7, 1e8), 1e-3)):
        with_others.submit(wrench(f"body;duration={duration}", force, held=False))
    alone.submit(wrench("body;duration=2.0", (0.1, 0.2, 0.3), held=False))
    with_others.advance(SECOND)
    alone.advance(SECOND)
    sums = [simulation.flight.sums.tobytes() for simulation in (with_others, alone)]
    assert sums[0] == sums[1]
