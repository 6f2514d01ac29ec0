# SPDX-License-Identifier: MIT
"""The chain of events is the same whether somebody reads its lines as they happen or asks for its hash at the end."""

import json

import pytest
from flights import SECOND, EventLines, Heard, flight, flight_setup, wrench

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.simulation import observer
from rigid_proto_ros.simulation.commands import ClearWrench, MoveString, ReleaseString, TieString
from rigid_proto_ros.simulation.observer import Acted, Logged, Observer, Observers
from rigid_proto_ros.simulation.simulation import Simulation

BODY = make_body(2.0, (0.0, 0.0, 0.0), ((1.6, 0.15, -0.1), (0.15, 2.1, 0.2), (-0.1, 0.2, 2.9)))


class Reader(EventLines):
    """Keeps the lines of events while ``listening``."""

    listening = True

    def wants(self, kind: type) -> bool:
        return kind is Logged and self.listening


def commanded(count: int):
    simulation = flight(BODY)
    for number in range(count):
        simulation.submit(wrench("body", (0.1, 0.2 * number, 0.0)), number * SECOND // 1000)
    return simulation


def test_no_line_is_written_for_nobody(monkeypatch):
    def written(*_):
        raise AssertionError("a line was written")

    monkeypatch.setattr(observer.EventLog, "append", written)
    simulation = commanded(20)
    simulation.advance(SECOND)
    assert simulation.events.count == 20


def test_events_chained_later_give_the_hash_of_those_chained_at_once(monkeypatch):
    monkeypatch.setattr(observer, "MOST_NOTED", 7)
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


def test_commands_that_acted_are_told_as_they_were_given_in_their_order_whoever_reads_lines():
    commands = [
        wrench("body", (0.1, 0.0, 0.0)),
        TieString("mesh", (0.0, 0.0, 0.0)),
        MoveString((0.0, 0.0, 1.0)),
        wrench("body", (0.0, 0.1, 0.0)),
        ReleaseString(),
        ClearWrench(),
    ]
    for listening in (False, True):
        simulation, heard, reader = flight(BODY), Heard(Acted), Reader()
        reader.listening = listening
        simulation.watch(Observers(heard, reader))
        for number, command in enumerate(commands):
            simulation.submit(command, number * SECOND // 100)
        simulation.advance(SECOND)
        assert [(event.time_ns, event.command) for event in heard.events] == [
            (number * SECOND // 100, command) for number, command in enumerate(commands)
        ]


def test_a_simulation_without_an_observer_chains_nothing_however_many_events_there_are(monkeypatch):
    """A chained event costs several times what the command does."""

    def chained(*_):
        raise AssertionError("an event was chained")

    monkeypatch.setattr(observer.EventLog, "_chain", chained)
    monkeypatch.setattr(observer, "MOST_NOTED", 7)
    alone = Simulation(flight_setup(BODY))
    for number in range(20):
        alone.submit(wrench("body", (0.1, 0.2 * number, 0.0)), number * SECOND // 1000)
    alone.advance(SECOND)
    assert alone.events.count == 20
    # It says so, and gives no hash of a part.
    with pytest.raises(RuntimeError, match="no chain of events was kept"):
        _ = alone.events.sha256


def test_events_that_are_chained_are_never_flown_over():
    setup, push = flight_setup(BODY), wrench("body", (0.1, 0.0, 0.0))
    alone, observed = Simulation(setup), Simulation(setup, Observer())
    assert alone.fly(setup, [push], SECOND) and not observed.fly(setup, [push], SECOND)
    observed.reset()
    observed.submit(push, 0, (0, 1))
    assert observed.advance(SECOND).row.tobytes() == alone.state.row.tobytes()
    assert observed.events.count == 2  # the reset and the wrench
