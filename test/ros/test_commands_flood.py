# SPDX-License-Identifier: MIT
"""Floods of commands: all received, or the loss told."""

import signal
from contextlib import contextmanager

import pytest
from command_rig import Commanded, wrench_message
from conftest import held_domain
from ros_client import RosClient


@pytest.fixture(scope="module")
def commanded(ros_environment, tmp_path_factory):
    """A node of these tests' own."""
    with held_domain() as domain:
        rig = Commanded({**ros_environment, "ROS_DOMAIN_ID": str(domain)}, tmp_path_factory.mktemp("flooded"))
        yield rig
        rig.close()


HARMLESS = wrench_message(0, "world", (0.0, 0.0, 1e-9))
PUSH = wrench_message(0, "world;impulse", (0.0, 0.0, 1e-9))
LAST = wrench_message(0, "nowhere")
"""Refused: who has counted the refusal has taken all that its publisher sent before."""

COUNTERS = ("wrench_received", "poke_received", "messages_lost", "queue_full", "refused_total")


def greet(client, publishers: list[str], message: dict) -> None:
    """One message of each is taken and acknowledged: the middleware counts what a publisher loses from then on."""
    client.repeat(publishers, message, 1)
    client.acknowledged(*publishers)


def gained_when(rig, before: dict[str, int], condition) -> dict[str, int]:
    """What the counters rose by, once that fulfils the condition."""
    found = {}

    def gained():
        report = rig.all_diagnostics(last=1)[-1]
        found.update({key: int(report[key]) - before[key] for key in COUNTERS})
        return condition(found) and dict(found)

    try:
        return rig.until(gained, "the counters")
    except AssertionError as error:
        raise AssertionError(f"{error}; they are {found}") from None


def taken(gained: dict[str, int]) -> int:
    return gained["wrench_received"] + gained["poke_received"]


def all_known_or_told(rig, before: dict[str, int], sent: int, publishers: int, told: bool = True) -> dict[str, int]:
    """Wait until what was sent is accounted for: received or counted as lost, or else, where that may be, a full queue
    is told. The last message of each publisher is LAST.
    """

    def accounted_for(gained) -> bool:
        if gained["refused_total"] < publishers:
            return False
        return taken(gained) + gained["messages_lost"] >= sent or (told and gained["queue_full"] > 0)

    gained = gained_when(rig, before, accounted_for)
    known = taken(gained) + gained["messages_lost"]
    assert gained["refused_total"] == publishers
    assert known == sent or (told and known < sent and gained["queue_full"] > 0), gained
    rig.sent += taken(gained)
    return gained


def flood(rig, publishers: int, messages: int) -> None:
    """So many publishers send ``messages`` each on one topic, 1000 a second."""
    with RosClient(rig.environment, rig.node) as client:
        names = [f"wrench#{k}" for k in range(publishers)]
        client.advertise(*names)
        before = rig.counters()
        greet(client, names, HARMLESS)
        client.repeat(names, HARMLESS, messages, 1000.0)
        client.repeat(names, LAST, 1)
        all_known_or_told(rig, before, publishers * (messages + 2), publishers)


def test_ten_publishers_at_a_thousand_messages_a_second_are_all_heard_or_a_full_queue_is_told(rig):
    flood(rig, 10, 200)


@pytest.mark.stress
def test_ten_publishers_at_a_thousand_messages_a_second_for_half_a_minute(rig):
    flood(rig, 10, 30_000)


@contextmanager
def held_up(rig):
    """The node's process stopped: nothing is taken from its queues."""
    rig.node_process.process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        rig.node_process.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize(("publishers", "kept"), [(2, 1_000), (2, 5_000)])
def test_with_the_node_held_up_losses_are_counted_exactly_or_a_full_queue_is_told(rig, publishers, kept):
    """Each sends far more than the ``kept`` messages that it holds for a reader that doesn't answer."""
    names = [f"poke#{k} of {publishers}, {kept}" for k in range(publishers)]
    rig.advertise(*names, depth=kept)
    before = rig.counters()
    greet(rig, names, PUSH)
    with held_up(rig):
        rig.repeat(names, PUSH, 7_000)
    rig.acknowledged(*names)
    # The last of each shows what was lost before it.
    rig.repeat(names, LAST, 1)
    # Where the node's own queue has room for all that was kept, none but what the middleware counts is lost.
    gained = all_known_or_told(rig, before, publishers * 7_002, publishers, told=publishers * kept > 5_000)
    assert gained["messages_lost"] > 0 or gained["queue_full"] > 0
