# SPDX-License-Identifier: MIT
"""The chain of events is the same whether somebody reads its lines as they happen or asks for its hash at the end."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from flights import SECOND, flight, wrench

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.simulation import event_log
from rigid_proto_ros.simulation.event_log import EventLog
from rigid_proto_ros.simulation.observer import Logged, Observer, Observers

BODY = make_body(2.0, (0.0, 0.0, 0.0), ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9)))


class Reader(Observer):
    """Keeps the lines of events while ``listening``."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.listening = True

    takes = frozenset({Logged})

    def on(self, event) -> None:
        if isinstance(event, Logged):
            self.lines.append(event.line)

    def wants(self, kind: type) -> bool:
        return kind is Logged and self.listening


def commanded(count: int):
    simulation = flight(BODY)
    for number in range(count):
        simulation.submit(wrench("body", (0.1, 0.2 * number, 0.0)), number * SECOND // 1000)
    return simulation


@pytest.mark.parametrize("most_noted", [1, 7, 1000])
def test_events_chained_later_give_the_hash_of_those_chained_at_once(monkeypatch, most_noted):
    monkeypatch.setattr(event_log, "MOST_NOTED", most_noted)
    read, unread, now_and_then = commanded(50), commanded(50), commanded(50)
    reader, fickle = Reader(), Reader()
    read.watch(Observers(Observer(), reader))
    now_and_then.watch(fickle)
    for part in range(1, 11):
        fickle.listening = part % 2 == 0
        for simulation in (read, unread, now_and_then):
            simulation.advance(part * SECOND // 100)
    assert read.events.sha256 == unread.events.sha256 == now_and_then.events.sha256
    assert read.events.count == unread.events.count == now_and_then.events.count == 50
    assert len(reader.lines) == 50
    assert json.loads(reader.lines[-1])["sha256"] == unread.events.sha256
    # Lines that were read carry the whole chain, those that nobody read included.
    assert fickle.lines == [line for line in reader.lines if line in fickle.lines]
    assert 0 < len(fickle.lines) < 50


def test_no_line_is_written_for_nobody(monkeypatch):
    def written(*_):
        raise AssertionError("a line was written")

    monkeypatch.setattr(EventLog, "append", written)
    simulation = commanded(20)
    simulation.advance(SECOND)
    assert simulation.events.count == 20


def noted_hash(command) -> str:
    log = EventLog()
    log.note(12_345, command)
    return log.sha256


@pytest.mark.parametrize(
    "command",
    [
        replace(wrench("body@com"), sent='"é\\', force=(0.1, -0.0, 1e-300), torque=(1e22, 5e-324, 3.0)),
        wrench("world", (1, 2.5, 0), (0, 0, 1)),
        wrench("world", np.array([0.1, 1e16, 2.0]), np.float64([1.0, 0.0, 1e-7])),
    ],
)
def test_a_line_chained_later_is_what_json_writes(command):
    content = {"time_ns": 12_345, "kind": command.kind, "content": command.content}
    assert noted_hash(command) == hashlib.sha256((json.dumps(content) + "\n").encode()).hexdigest()
