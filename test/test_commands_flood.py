# SPDX-License-Identifier: MIT
"""Floods of commands: all received, or the loss told."""

import signal

import pytest
from command_rig import RosClient, wrench_message

HARMLESS = wrench_message(0, "world", (0.0, 0.0, 1e-9))


def flood(rig, count: int, messages: int, rate: float) -> tuple[int, dict]:
    """``count`` processes send ``messages`` each on one topic at ``rate``; how many were sent, and what counters gained."""
    clients = [RosClient(rig.environment, rig.node) for _ in range(count)]
    try:
        for client in clients:
            client.send("advertise", topic=rig.name("wrench"), type="WrenchStamped")
        for client in clients:
            client.answer()
        before = rig.counters()
        for client in clients:
            client.send("repeat", topic=rig.name("wrench"), content=HARMLESS, count=messages, rate=rate)
        for client in clients:
            client.answer()
        for client in clients:
            client.do("acknowledged", topic=rig.name("wrench"))
        rig.diagnostics(2)
        gained = rig.gained(before, "wrench_received")
    finally:
        for client in clients:
            client.close()
    rig.sent += gained.get("wrench_received", 0)
    return count * messages, gained


def all_arrived_or_told(sent: int, gained: dict) -> None:
    assert "refused_total" not in gained
    if gained["wrench_received"] != sent:
        assert gained.get("queue_full", 0) > 0, gained
    assert gained["wrench_received"] <= sent


def test_ten_clients_at_a_thousand_messages_a_second_are_all_heard_or_a_full_queue_is_told(rig):
    all_arrived_or_told(*flood(rig, 10, 200, 1000.0))


@pytest.mark.stress
def test_ten_clients_at_a_thousand_messages_a_second_for_half_a_minute(rig):
    all_arrived_or_told(*flood(rig, 10, 30_000, 1000.0))


def test_with_the_node_held_up_the_loss_of_one_publisher_is_counted_exactly(commanded, rig):
    """Stopped while 12 000 messages go out, far more than any queue holds: received and gaps add up to what was sent."""
    # Of all publishers on this topic only the fixture's own is left.
    count = 12_000
    before = rig.counters()
    rig.publish("poke", wrench_message(0, "world;impulse", (0.0, 0.0, 1e-9)))
    rig.until_received(rig.sent)
    rig.node_process.process.send_signal(signal.SIGSTOP)
    try:
        rig.do(
            "repeat", topic=rig.name("poke"), content=wrench_message(0, "world;impulse", (0.0, 0.0, 1e-9)), count=count
        )
    finally:
        rig.node_process.process.send_signal(signal.SIGCONT)
    rig.do("acknowledged", topic=rig.name("poke"))
    # The last one shows what was lost before it.
    rig.do("repeat", topic=rig.name("poke"), content=wrench_message(0, "world;impulse", (0.0, 0.0, 1e-9)), count=1)
    rig.do("acknowledged", topic=rig.name("poke"))
    rig.diagnostics(2)
    gained = rig.gained(before, "poke_received")
    assert gained["poke_received"] + gained.get("sequence_gaps", 0) == count + 2
    assert gained.get("sequence_gaps", 0) > 0
    rig.sent += gained["poke_received"] - 1
