# SPDX-License-Identifier: MIT
"""Commands of one instant act by kind, and those of one topic as they arrived."""

import random

import pytest
from flights import SECOND, wrench

from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario, with_inertia
from rigid_proto_ros.simulation.commands import (
    Change,
    ClearWrench,
    MoveString,
    ThrusterCommand,
    TieString,
    WrenchCommand,
)
from rigid_proto_ros.simulation.simulation import Simulation

WHEN = SECOND // 2
ZERO = (0.0, 0.0, 0.0)
END = 3 * SECOND // 2
SCENE = {
    "mesh": "t_handle",
    "density": 7850.0,
    "integrator": "rk4",
    "initial.angular_velocity": [0.5, -2.0, 3.0],
    "string.timeout": 0.3,
}


def mixed(commands: list, topic_of, seed: int) -> list:
    """The commands in a random order in which those of one topic keep theirs."""
    topics = [topic_of(command) for command in commands]
    random.Random(seed).shuffle(topics)
    queues = {topic: iter([c for c in commands if topic_of(c) == topic]) for topic in topics}
    return [next(queues[topic]) for topic in topics]


def core_commands() -> list:
    """Of every rank some, as the node makes them from messages."""
    scenario = make_scenario(SCENE)
    inertia = {"mass": 0.02, "com": (0, 0, 0), "tensor": (1e-5, 0, 0, 2e-5, 0, 2.5e-5), "relative": False}
    numbers = random.Random(8)
    commands = [
        ClearWrench(),
        Change({"g": 1}, lambda: scenario.with_changes({"gravity": [0, 0, -2.0]}).setup),
    ]
    commands.append(
        Change(
            {"i": 1},
            lambda: with_inertia(scenario, inertia).setup,
            "inertia",
        )
    )
    for _ in range(10):
        point = [numbers.uniform(-0.3, 0.3) for _ in range(3)]
        commands.append(MoveString(tuple(point)))
        commands.append(TieString("mesh", tuple(point)))
        for held, frame in ((True, "world@vertex/3"), (False, "body@vertex/7"), (False, "world;impulse")):
            force = tuple(numbers.uniform(-0.01, 0.01) for _ in range(3))
            commands.append(WrenchCommand(held, parse_frame(frame), force, (0.0, 0.0, 0.0), frame))
    return commands


@pytest.mark.parametrize("at_ns", [0, WHEN], ids=["now", "scheduled"])
def test_ten_mixtures_of_topics_give_one_state_hash_and_one_chain_of_events(at_ns):
    hashes, chains = set(), set()
    for seed in range(10):
        commands = mixed(core_commands(), lambda command: command.rank, seed)
        simulation = Simulation(make_scenario(SCENE).setup)
        for command in commands:
            simulation.submit(command, at_ns)
        hashes.add(simulation.advance(END).sha256())
        chains.add(simulation.events.sha256)
        assert not simulation.refused
    assert len(hashes) == len(chains) == 1
    assert Simulation(make_scenario(SCENE).setup).advance(END).sha256() not in hashes


@pytest.mark.parametrize("at_ns", [0, WHEN], ids=["now", "scheduled"])
@pytest.mark.parametrize("last", [ZERO, (0.3, 0.0, 0.0)])
def test_the_last_wrench_and_the_last_forces_of_thrusters_that_arrive_are_those_that_hold(last, at_ns):
    scene = {**SCENE, "wrench_timeout": 0.0, "thrusters.a": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]}
    simulation = Simulation(make_scenario(scene).setup)
    for force in ((1.0, 0.0, 0.0), last):
        simulation.submit(wrench("world", force), at_ns)
        simulation.submit(ThrusterCommand((force[0],)), at_ns)
    simulation.advance(END)
    acting = [load.load.force for load in simulation.acting if load.shown_kind == "wrench"]
    assert acting == ([] if last == ZERO else [last])
    assert [load.load.force[0] for load in simulation.acting if load.shown_kind == "thruster"] == [x for x in last if x]


def test_the_total_wrench_does_not_depend_on_who_ended_before():
    """Pulses summed afresh: after some have ended, the sum is that of the rest alone, to the bit."""
    setup = make_scenario({**SCENE, "initial.angular_velocity": [0.0, 0.0, 0.0]}).setup
    with_others, alone = Simulation(setup), Simulation(setup)

    def poke(force, duration):
        frame = f"body;duration={duration}"
        return WrenchCommand(False, parse_frame(frame), force, (0.0, 0.0, 0.0), frame)

    for force, duration in (((1e9, 0.1, -3e7), 1e-3), ((0.1, 0.2, 0.3), 2.0), ((-1e9, 7.7, 1e8), 1e-3)):
        with_others.submit(poke(force, duration))
    alone.submit(poke((0.1, 0.2, 0.3), 2.0))
    with_others.advance(SECOND)
    alone.advance(SECOND)
    sums = [simulation.flight.sums.tobytes() for simulation in (with_others, alone)]
    assert sums[0] == sums[1]
