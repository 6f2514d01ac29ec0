# SPDX-License-Identifier: MIT
"""Floods of commands: all received, or the loss told."""

import signal
import time
from contextlib import contextmanager

import pytest
from command_rig import Commanded, RosClient, wrench_message
from conftest import held_domain


@pytest.fixture(scope="module")
def commanded(ros_environment, tmp_path_factory):
    """A node of these tests' own."""
    with held_domain() as domain:
        rig = Commanded({**ros_environment, "ROS_DOMAIN_ID": str(domain)}, tmp_path_factory.mktemp("flooded"))
        yield rig
        rig.close()


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

        def accounted_for() -> bool:
            """All are taken or counted as lost, or a queue was full and no more come."""
            earlier, now = rig.counters_now(), rig.counters_now()
            known = sum(now[key] - before[key] for key in ("wrench_received", "messages_lost"))
            full = now["queue_full"] > before["queue_full"]
            return known == count * messages or (full and earlier["wrench_received"] == now["wrench_received"])

        rig.until(accounted_for, "all messages, or their loss")
        gained = rig.gained(before, "wrench_received")
    finally:
        for client in clients:
            client.close()
    rig.sent += gained.get("wrench_received", 0)
    return count * messages, gained


def all_arrived_or_told(sent: int, gained: dict) -> None:
    assert "refused_total" not in gained
    known = gained["wrench_received"] + gained.get("messages_lost", 0)
    assert known == sent or (known < sent and gained.get("queue_full", 0) > 0), gained


def test_ten_clients_at_a_thousand_messages_a_second_are_all_heard_or_a_full_queue_is_told(rig):
    all_arrived_or_told(*flood(rig, 10, 200, 1000.0))


@pytest.mark.stress
def test_ten_clients_at_a_thousand_messages_a_second_for_half_a_minute(rig):
    all_arrived_or_told(*flood(rig, 10, 30_000, 1000.0))


PUSH = wrench_message(0, "world;impulse", (0.0, 0.0, 1e-9))


@contextmanager
def held_up(rig):
    """The node's process stopped: nothing is taken from its queues."""
    rig.node_process.process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        rig.node_process.process.send_signal(signal.SIGCONT)


def push(client, count: int, rate: float = 0.0) -> None:
    client.do("repeat", topic=client.name("poke"), content=PUSH, count=count, rate=rate)


def told(rig, before: dict[str, int], condition) -> dict[str, int]:
    """What the counters rose by, once that fulfils the condition."""

    found = {}

    def gained():
        report = rig.all_diagnostics(last=1)[-1]
        found.update({key: int(report[key]) - before[key] for key in ("poke_received", "messages_lost", "queue_full")})
        return condition(found) and dict(found)

    try:
        return rig.until(gained, "the counters")
    except AssertionError as error:
        raise AssertionError(f"{error}; they are {found}") from None


def test_with_the_node_held_up_the_loss_of_one_publisher_is_counted_exactly(rig):
    """12 000 messages, far more than any queue holds: received and gaps add up to what was sent, and stay so."""
    before = rig.counters()
    push(rig, 2)
    told(rig, before, lambda gained: gained["poke_received"] == 2)
    with held_up(rig):
        push(rig, 12_000)
    rig.do("acknowledged", topic=rig.name("poke"))
    # The last one shows what was lost before it.
    push(rig, 1)
    gained = told(rig, before, lambda gained: gained["poke_received"] + gained["messages_lost"] >= 12_003)
    assert gained["poke_received"] + gained["messages_lost"] == 12_003
    assert gained["messages_lost"] > 0
    rig.sent += gained["poke_received"]


def test_with_the_node_held_up_the_losses_of_two_publishers_are_counted_exactly_or_a_full_queue_is_told(rig):
    other = RosClient(rig.environment, rig.node)
    try:
        other.advertise("poke")
        before = rig.counters()
        push(other, 1)
        push(rig, 1)
        told(rig, before, lambda gained: gained["poke_received"] == 2)
        with held_up(rig):
            # Each more than a writer keeps for a reader that doesn't answer.
            push(other, 6_000)
            push(rig, 7_000)
        # The last of each shows what was lost before it.
        for client in (other, rig):
            client.do("acknowledged", topic=rig.name("poke"))
            push(client, 1)
        told(
            rig,
            before,
            lambda gained: gained["queue_full"] or gained["poke_received"] + gained["messages_lost"] >= 13_004,
        )
        time.sleep(1.0)
        gained = told(rig, before, lambda gained: True)
        known = gained["poke_received"] + gained["messages_lost"]
        # Both at once may be more than the node's own queue holds: what that drops is said without a number.
        assert known == 13_004 or (known < 13_004 and gained["queue_full"] > 0)
        assert gained["messages_lost"] > 0 or gained["queue_full"] > 0
    finally:
        other.close()
    rig.sent += gained["poke_received"]


def test_a_publisher_that_comes_and_goes_beside_another_makes_no_gaps(rig):
    """Two that send a few messages, one leaves and one is killed, while a third keeps sending: all are heard, none
    counted as lost.
    """
    before = rig.counters()
    rig.send("repeat", topic=rig.name("poke"), content=PUSH, count=1500, rate=300.0)
    for leaves in (True, False):
        guest = RosClient(rig.environment, rig.node)
        guest.advertise("poke")
        push(guest, 5)
        guest.do("acknowledged", topic=rig.name("poke"))
        if not leaves:
            guest.process.kill()
        guest.close()
    rig.answer()
    gained = told(rig, before, lambda gained: gained["poke_received"] >= 1510)
    assert gained == {"poke_received": 1510, "messages_lost": 0, "queue_full": 0}
    rig.sent += 1510
