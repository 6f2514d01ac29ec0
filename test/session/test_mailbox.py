# SPDX-License-Identifier: MIT
"""The mailbox between the stepping thread and a recorder: everything in order, memory bounded, nobody waits for ever."""

from __future__ import annotations

import numpy as np

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
