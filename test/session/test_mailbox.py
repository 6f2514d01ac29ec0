# SPDX-License-Identifier: MIT
"""The mailbox between the stepping thread and a recorder: everything in order, memory bounded, nobody waits for ever."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_proto_ros.session import mailbox
from rigid_proto_ros.session.mailbox import BLOCK_ROWS, BLOCKS_WAITING_MAX, Mailbox


def test_rows_and_notes_come_out_in_the_order_in_which_they_went_in():
    box = Mailbox()
    for k in range(BLOCK_ROWS + 3):
        box.put(k, np.full(13, float(k)))
        if k in (1, BLOCK_ROWS):
            box.note(k)
    first, second = box.take(), box.take()
    assert (first.count, second.count) == (BLOCK_ROWS, 3)
    assert [(n.after_rows, n.event) for n in first.notes + second.notes] == [(2, 1), (1, BLOCK_ROWS)]
    times = np.concatenate([first.times, second.times[:3]])
    rows = np.concatenate([first.rows, second.rows[:3]])
    assert (times == np.arange(BLOCK_ROWS + 3)).all() and (rows[:, 12] == times).all()
    assert box.take() is None


def test_a_recorder_that_is_stuck_is_given_up_and_what_waits_has_no_gap(monkeypatch):
    monkeypatch.setattr(mailbox, "PATIENCE_S", 0.02)
    given_up = []
    box = Mailbox(lambda: given_up.append(True))
    row = np.zeros(13)
    for k in range(2 * BLOCKS_WAITING_MAX * BLOCK_ROWS + 5):
        box.put(k, row)
    assert given_up == [True]
    taken = []
    while (block := box.take()) is not None:
        taken.append(block.times[: block.count].copy())
    assert (np.concatenate(taken) == np.arange(BLOCKS_WAITING_MAX * BLOCK_ROWS)).all()


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
