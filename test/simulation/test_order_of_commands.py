# SPDX-License-Identifier: MIT
"""Commands of one instant act by kind, and those of one topic as they arrived."""

import random

import numpy as np
import pytest
from command_rig import COMMANDS, RosClient, inertia_message, point_message, wrench_message
from flights import SECOND, wrench

from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.scene.scenario import make_scenario
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


def hundred_commands(seed: int = 3) -> list[tuple[str, dict]]:
    """(topic, message), all stamped for the same nanosecond: wrenches, pokes, impulses, strings, inertias, changes."""
    numbers = random.Random(seed)

    def triple(size):
        return [numbers.uniform(-size, size) for _ in range(3)]

    commands: list[tuple[str, dict]] = []
    for _ in range(30):
        frame = numbers.choice(("world", "body", f"vertex/{numbers.randrange(20)}", "world@origin"))
        commands.append(("wrench", wrench_message(WHEN, frame, triple(0.01), triple(1e-5))))
    for _ in range(50):
        option = numbers.choice(("", ";duration=0.2", ";impulse"))
        size = 1e-4 if option == ";impulse" else 0.01
        frame = f"{numbers.choice(('world', 'body'))}@vertex/{numbers.randrange(20)}{option}"
        commands.append(("poke", wrench_message(WHEN, frame, triple(size), triple(size * 0.01))))
    for _ in range(8):
        commands.append(("string/target", point_message(WHEN, "world", triple(0.3))))
        commands.append(("string/attach", point_message(WHEN, "body", triple(0.1))))
    for _ in range(2):
        moments = sorted(numbers.uniform(1e-5, 2e-5) for _ in range(3))
        commands.append(
            (
                "inertia/set",
                inertia_message(WHEN, "", 0.02, triple(0.01), (moments[0], 0, 0, moments[1], 0, moments[2])),
            )
        )
    commands.append(("schedule", {"data": f"{{t: {WHEN / 1e9}, set: {{gravity: [0.0, 0.0, -1.0]}}}}"}))
    commands.append(("schedule", {"data": f"{{t: {WHEN / 1e9}, service: clear_wrench}}"}))
    assert len(commands) == 100
    return commands


@pytest.fixture(scope="module")
def clients(commanded):
    """Four processes that publish commands."""
    made = [RosClient(commanded.environment, commanded.node) for _ in range(4)]
    for client in made:
        client.send("forget", topics=[])
    for client in made:
        client.answer()
    for client in made:
        client.advertise(*COMMANDS)
    yield made
    for client in made:
        client.close()


CLIENT_OF = {"wrench": 0, "poke": 1, "string/target": 2, "string/attach": 3, "inertia/set": 0, "schedule": 1}
"""Which process publishes a topic."""


def flown_by_four(rig, clients, seed: int) -> tuple[bytes, list[str], str]:
    """The state after the same hundred commands, each topic's in its order and the topics mixed by seed, and the kinds
    as applied.
    """
    commands = mixed(hundred_commands(), lambda command: command[0], seed)
    rig.restore()
    rig.start_over(paused=True)
    before = rig.sent
    # All four at once: arrival is interleaved by the machine.
    jobs = [(clients[CLIENT_OF[topic]], topic, message) for topic, message in commands]
    for client, topic, message in jobs:
        client.send("publish", topic=client.name(topic), messages=[message])
    for client, _, _ in jobs:
        client.answer()
    rig.sent = before + len(commands)
    rig.until_received(rig.sent)
    rig.pause(False)
    pose, twist = rig.state_at(END)
    p, q = pose["pose"]["position"], pose["pose"]["orientation"]
    v, w = twist["twist"]["linear"], twist["twist"]["angular"]
    row = np.array([p["x"], p["y"], p["z"], q["x"], q["y"], q["z"], q["w"], *v.values(), *w.values()])
    applied = [event for event in rig.events() if event["time_ns"] == WHEN]
    return State(END, row).sha256(), [event["kind"] for event in applied], applied[-1]["sha256"]


def mixed(commands: list, topic_of, seed: int) -> list:
    """The commands in a random order in which those of one topic keep theirs."""
    topics = [topic_of(command) for command in commands]
    random.Random(seed).shuffle(topics)
    queues = {topic: iter([c for c in commands if topic_of(c) == topic]) for topic in topics}
    return [next(queues[topic]) for topic in topics]


@pytest.mark.slow
def test_a_hundred_equal_stamped_commands_from_four_processes_give_one_state_however_topics_mix(rig, clients):
    """Two mixtures: one state hash (of pose and twist as published), one chain of events."""
    rig.set(wrench_timeout=0.0)
    first, kinds, chain = flown_by_four(rig, clients, 1)
    order = {
        kind: rank
        for rank, kinds_ in enumerate(
            (("set", "clear_wrench"), ("inertia",), ("string_attach",), ("string_target",), ("wrench",), ("poke",))
        )
        for kind in kinds_
    }
    ranks = [order[kind] for kind in kinds]
    assert ranks == sorted(ranks)
    assert len(kinds) == 100
    second, kinds_again, chain_again = flown_by_four(rig, clients, 2)
    assert second == first
    assert (kinds_again, chain_again) == (kinds, chain)


def core_commands() -> list:
    """Of every rank some, as the node makes them from messages."""
    scenario = make_scenario(SCENE)
    numbers = random.Random(8)
    commands = [
        ClearWrench(),
        Change({"g": 1}, lambda: scenario.with_changes({"gravity": [0, 0, -2.0]}).setup),
    ]
    commands.append(
        Change(
            {"i": 1},
            lambda: scenario.with_inertia(0.02, (0, 0, 0), (1e-5, 0, 0, 2e-5, 0, 2.5e-5), False).setup,
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
    sums = [simulation._load_sum().force_body.tobytes() for simulation in (with_others, alone)]
    assert sums[0] == sums[1]
