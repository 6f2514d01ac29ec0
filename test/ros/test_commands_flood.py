# SPDX-License-Identifier: MIT
"""Floods of commands: all received, or the loss told."""

import itertools
import math
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_rig import wrench_message
from ros_client import RosClient
from ros_process import from_source

FLOOD = wrench_message(0, "nowhere")
"""Counted and refused at once: nothing that acts is told to anybody."""
LAST = wrench_message(0, "", (math.nan, 0.0, 0.0))
"""Refused for another reason: who has counted that has taken all that reached it of what its publisher sent before."""

HELD_UP_S = 10.0
"""The middleware gives up a process that says nothing for 20 s, and counts nothing that it misses from then on."""

COUNTERS = ("wrench_received", "poke_received", "messages_lost", "queue_full", "refused_nonfinite")


def greet(client, publishers: list[str]) -> None:
    """One message of each is taken and acknowledged: the middleware counts what a publisher loses from then on."""
    client.repeat(publishers, FLOOD, 1)
    client.acknowledged(*publishers)


def all_known_or_told(rig, before: dict[str, int], sent: int, publishers: int, told: bool = True) -> dict[str, int]:
    """Wait until what was sent is accounted for: received or counted as lost, or else, where that may be, a full queue
    is told. The last message of each publisher is LAST.
    """
    gained: dict[str, int] = {}

    def known() -> int:
        report = rig.all_diagnostics(last=1)[-1]
        gained.update({key: int(report[key]) - before[key] for key in COUNTERS})
        return gained["wrench_received"] + gained["poke_received"] + gained["messages_lost"]

    def accounted_for() -> bool:
        # On a busy machine the middleware may give a stopped node up; then it counts the last ones as lost, too.
        return known() >= sent or (told and gained["queue_full"] > 0 and gained["refused_nonfinite"] == publishers)

    try:
        rig.until(accounted_for, "account of all")
    except AssertionError as error:
        raise AssertionError(f"{error}; they are {gained}") from None
    rig.diagnostics()
    assert known() == sent or (told and known() < sent and gained["queue_full"] > 0), gained
    # A report that finds more lost, or a queue that was full, is a warning that says so.
    for earlier, later in itertools.pairwise(rig.all_diagnostics()):
        for key, words in (("messages_lost", "lost in transit"), ("queue_full", "may have been lost")):
            assert later[key] == earlier[key] or (later["level"] == 1 and words in later["message"])
    rig.sent += gained["wrench_received"] + gained["poke_received"]
    return gained


@pytest.mark.parametrize("messages", [200, pytest.param(30_000, marks=pytest.mark.stress)])
def test_ten_publishers_at_a_thousand_messages_a_second_are_all_heard_or_a_full_queue_is_told(rig, messages):
    with RosClient(rig.environment, rig.node) as client:
        names = [f"wrench#{k}" for k in range(10)]
        client.advertise(*names)
        before = rig.counters()
        greet(client, names)
        client.repeat(names, FLOOD, messages, 1000.0)
        client.repeat(names, LAST, 1)
        all_known_or_told(rig, before, 10 * (messages + 2), 10)


GUEST = """
import os, signal, sys
from ros_client import RosClient
from test_commands_flood import FLOOD
with RosClient(dict(os.environ), "/rigid_body") as guest:
    guest.advertise("poke")
    guest.repeat(["poke"], FLOOD, 5)
    guest.acknowledged("poke")
    if sys.argv[1] == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
"""


def test_publishers_that_leave_or_are_killed_beside_another_count_as_no_loss(rig):
    before, sent = rig.counters(), 0
    environment = from_source(rig.environment)
    environment["PYTHONPATH"] += f"{os.pathsep}{Path(__file__).parent}"
    guests = [subprocess.Popen([sys.executable, "-c", GUEST, end], env=environment) for end in ("leaves", "killed")]
    while any(guest.poll() is None for guest in guests):
        rig.repeat(["poke"], FLOOD, 30, 300.0)
        sent += 30
    assert [guest.returncode for guest in guests] == [0, -signal.SIGKILL]
    rig.repeat(["poke"], FLOOD, 30)
    sent += 5 + 5 + 30
    rig.sent += sent
    assert rig.gained(before, "poke_received") == dict.fromkeys(
        ("poke_received", "refused_total", "refused_frame"), sent
    )


@contextmanager
def held_up(rig):
    """The node's process stopped: nothing is taken from its queues."""
    rig.node_process.process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        rig.node_process.process.send_signal(signal.SIGCONT)


SENT = 3_500
"""By each publisher: the node's side holds some hundreds of them although it is stopped."""


@pytest.mark.parametrize("kept", [1_000, 2_600])
def test_with_the_node_held_up_losses_are_counted_exactly_or_a_full_queue_is_told(rig, kept):
    """Two publishers send more than the ``kept`` messages that each holds for a reader that doesn't answer: together
    they are fewer than the node's own queue holds, or more.
    """
    names = ["poke#1", "poke#2"]

    def send_all(client: RosClient) -> tuple[dict[str, int], bool]:
        """The counters before, and whether the node was held up for so short that all is accounted for."""
        rig.sent = int(rig.diagnostics()["commands_received"])
        client.advertise(*names, depth=kept)
        before = rig.counters()
        greet(client, names)
        with held_up(rig):
            start = time.monotonic()
            client.repeat(names, FLOOD, SENT)
            return before, time.monotonic() - start < HELD_UP_S

    for _ in range(5):
        with RosClient(rig.environment, rig.node) as client:
            before, accountable = send_all(client)
            if accountable:
                judge(rig, client, names, kept, before)
                return
    pytest.fail(f"the machine is so busy that the node was held up for more than {HELD_UP_S:g} s, five times")


def judge(rig, client: RosClient, names: list[str], kept: int, before: dict[str, int]) -> None:
    """What the node has counted of all that was sent."""
    client.acknowledged(*names)
    # The last of each shows what was lost before it.
    client.repeat(names, LAST, 1)
    # Where the node's own queue has room for all that was kept, none but what the middleware counts is lost.
    gained = all_known_or_told(rig, before, 2 * (SENT + 2), 2, told=2 * kept > 5_000)
    assert gained["messages_lost"] > 0 or gained["queue_full"] > 0
