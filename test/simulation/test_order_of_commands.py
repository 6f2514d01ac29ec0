# SPDX-License-Identifier: MIT
"""Commands of one instant act in one order, whoever sent them and whenever they came."""

import itertools
import random

import numpy as np
import pytest
from command_rig import COMMANDS, RosClient, inertia_message, point_message, wrench_message
from flights import SECOND

from rigid_proto_ros.messages import cdr
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import (
    Change,
    ClearWrench,
    MoveString,
    Rank,
    TieString,
    WrenchCommand,
)
from rigid_proto_ros.simulation.simulation import Simulation

WHEN = SECOND // 2
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
        client.send("topics")
    for client in made:
        client.answer()
    for client in made:
        client.advertise(*COMMANDS)
    yield made
    for client in made:
        client.close()


def flown_by_four(rig, clients, seed: int) -> tuple[bytes, list[str], str]:
    """The state after the same hundred commands dealt to four processes and shuffled by seed, and the kinds as applied."""
    commands = hundred_commands()
    random.Random(seed).shuffle(commands)
    rig.restore()
    rig.start_over(paused=True)
    before = rig.sent
    # All four at once: arrival is interleaved by the machine.
    jobs = [
        (client, topic, message) for (topic, message), client in zip(commands, itertools.cycle(clients), strict=False)
    ]
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


@pytest.mark.slow
def test_a_hundred_equal_stamped_commands_from_four_processes_in_any_order_give_one_state(rig, clients):
    """Two shuffles: one state hash (of pose and twist as published), one chain of events."""
    rig.set(wrench_timeout=0.0)
    first, kinds, chain = flown_by_four(rig, clients, 1)
    order = {
        kind: rank
        for rank, kinds_ in enumerate(
            (("set", "clear_wrench"), ("inertia",), ("string_attach", "string_target"), ("wrench",), ("poke",))
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
        ClearWrench(b"clear"),
        Change({"g": 1}, lambda: scenario.with_changes({"gravity": [0, 0, -2.0]}).setup, b"set"),
    ]
    commands.append(
        Change(
            {"i": 1},
            lambda: scenario.with_inertia(0.02, (0, 0, 0), (1e-5, 0, 0, 2e-5, 0, 2.5e-5), False).setup,
            b"i",
            "inertia",
            Rank.INERTIA,
        )
    )
    for _ in range(10):
        point = [numbers.uniform(-0.3, 0.3) for _ in range(3)]
        commands.append(MoveString(tuple(point), message=cdr.stamped_doubles(0, "world", point)))
        commands.append(TieString("mesh", tuple(point), message=cdr.stamped_doubles(0, "body/mesh", point)))
        for held, frame in ((True, "world@vertex/3"), (False, "body@vertex/7"), (False, "world;impulse")):
            force = tuple(numbers.uniform(-0.01, 0.01) for _ in range(3))
            message = cdr.wrench_stamped(0, frame, force, (0, 0, 0))
            commands.append(WrenchCommand(held, parse_frame(frame), force, (0.0, 0.0, 0.0), 0, frame, message))
    return commands


@pytest.mark.parametrize("at_ns", [0, WHEN], ids=["now", "scheduled"])
def test_fifty_orders_of_arrival_give_one_state_hash_and_one_chain_of_events(at_ns):
    hashes, chains = set(), set()
    for seed in range(50):
        commands = core_commands()
        random.Random(seed).shuffle(commands)
        simulation = Simulation(make_scenario(SCENE).setup)
        for command in commands:
            simulation.submit(command, at_ns)
        hashes.add(simulation.advance(END).sha256())
        chains.add(simulation.events.sha256)
        assert not simulation.refused
    assert len(hashes) == len(chains) == 1
    assert Simulation(make_scenario(SCENE).setup).advance(END).sha256() not in hashes


def test_the_total_wrench_does_not_depend_on_who_ended_before():
    """Pulses summed afresh: after some have ended, the sum is that of the rest alone, to the bit."""
    setup = make_scenario({**SCENE, "initial.angular_velocity": [0.0, 0.0, 0.0]}).setup
    with_others, alone = Simulation(setup), Simulation(setup)

    def poke(force, duration):
        frame = f"body;duration={duration}"
        return WrenchCommand(False, parse_frame(frame), force, (0.0, 0.0, 0.0), 0, frame, frame.encode())

    for force, duration in (((1e9, 0.1, -3e7), 1e-3), ((0.1, 0.2, 0.3), 2.0), ((-1e9, 7.7, 1e8), 1e-3)):
        with_others.submit(poke(force, duration))
    alone.submit(poke((0.1, 0.2, 0.3), 2.0))
    with_others.advance(SECOND)
    alone.advance(SECOND)
    sums = [simulation._load_sum().force_body.tobytes() for simulation in (with_others, alone)]
    assert sums[0] == sums[1]
