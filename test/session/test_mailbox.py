# SPDX-License-Identifier: MIT
"""The mailbox between the stepping thread and a recorder: everything in order, memory bounded, nobody waits for ever."""

from __future__ import annotations

import itertools
import sys
import time
from threading import Thread

import numpy as np
import pytest

from rigid_proto_ros.session import mailbox
from rigid_proto_ros.session.mailbox import BATCH, MOST_WAITING, Mailbox
from rigid_proto_ros.simulation.observer import Published, Reset


def test_events_come_out_in_the_order_in_which_they_went_in_and_states_are_copied():
    box, row = Mailbox(), np.zeros(13)
    for k in range(BATCH + 3):
        row[:] = k
        box.put(Reset(k) if k in (1, BATCH) else Published(k, row))
    events = [event for events in box.take() for _, event in events]
    assert [event.time_ns for event in events] == list(range(BATCH + 3))
    assert [event.time_ns for event in events if isinstance(event, Reset)] == [1, BATCH]
    assert all((event.row == event.time_ns).all() for event in events if isinstance(event, Published))


def test_what_is_told_has_the_walls_time_in_the_order_in_which_it_was_told_though_that_clock_is_set_back(monkeypatch):
    box, began_ns = Mailbox(), time.time_ns()
    box.put(Reset(0))
    monkeypatch.setattr(mailbox.time, "time_ns", lambda: began_ns - 10**12)
    box.put(Reset(1))
    (((first_ns, first), (second_ns, second)),) = box.take()
    assert (first.time_ns, second.time_ns) == (0, 1)
    assert abs(first_ns - began_ns) < 10**10 and first_ns <= second_ns


def test_a_recorder_that_is_stuck_is_given_up_and_what_waits_has_no_gap(monkeypatch):
    monkeypatch.setattr(mailbox, "PATIENCE_S", 0.02)
    given_up = []
    box = Mailbox(lambda: given_up.append(True))
    for k in range(MOST_WAITING + 5):
        box.put(Reset(k))
    assert given_up == [True]
    taken = [event.time_ns for events in box.take() for _, event in events]
    assert taken == list(range(MOST_WAITING))


def test_an_interrupt_anywhere_in_put_leaves_the_mailbox_to_its_consumer(monkeypatch):
    """Raised, as by a signal's handler, at each line, call and return of what ``put`` runs, one after the other."""
    monkeypatch.setattr(mailbox, "BATCH", 1)
    interrupted = 0
    for step in itertools.count():
        box, left = Mailbox(), itertools.count(step, -1)

        def interrupt(*_, left=left):
            if next(left) == 0:
                raise KeyboardInterrupt
            return interrupt

        tracer = sys.gettrace()
        sys.settrace(interrupt)
        try:
            box.put(Reset(0))
        except KeyboardInterrupt:
            interrupted += 1
        finally:
            sys.settrace(tracer)
        consumer = Thread(target=lambda box=box: (box.wait(60.0), list(box.take())), daemon=True)
        consumer.start()
        waker = Thread(target=box.close, daemon=True)
        waker.start()
        consumer.join(5.0)
        assert not consumer.is_alive()
        if interrupted == step:
            break
    assert interrupted > 10


class Consumer:
    """A thread on a clock of its own: each wait for it takes as long as it may, and it gets something done meanwhile."""

    def __init__(self, box: Mailbox, monkeypatch, moves: int) -> None:
        self.now_s, self.box, self.moves = 0.0, box, moves
        monkeypatch.setattr(mailbox.time, "monotonic", lambda: self.now_s)

    def is_alive(self) -> bool:
        return self.moves != 0

    def join(self, timeout: float) -> None:
        self.now_s += timeout
        if self.moves > 0:
            self.moves -= 1
            self.box.moved()


@pytest.mark.parametrize(("moves", "emptied"), [(0, True), (7, True), (-1, False)])
def test_at_the_end_a_consumer_is_waited_for_as_long_as_it_gets_something_done(monkeypatch, moves, emptied):
    box = Mailbox()
    consumer = Consumer(box, monkeypatch, moves)
    box.close()
    assert box.emptied_by(consumer) == emptied
    assert consumer.now_s == pytest.approx(mailbox.PATIENCE_S * abs(moves))
