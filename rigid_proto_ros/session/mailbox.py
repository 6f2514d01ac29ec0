# SPDX-License-Identifier: MIT
"""Where the stepping thread leaves states and other events, and the flushing thread fetches them in order."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_wall_ns = time.time_ns

BLOCK_ROWS = 4096
BLOCKS_WAITING_MAX = 16
"""Full blocks that may wait. Beyond these (65 000 rows: a minute at 1 kHz) the producer waits for the flusher, which
only a run faster than real time reaches: the file keeps every row, and memory stays bounded."""

PATIENCE_S = 10.0
"""A flusher that got nothing done for so long, with all blocks full or at the end, won't: the simulation goes on, or
ends, and what waits is lost."""


@dataclass
class Note:
    """Something that happened after the block's first ``after_rows`` rows: an Event, or what the consumer is asked."""

    after_rows: int
    wall_ns: int
    event: Any


@dataclass
class Block:
    """States of the body and of its ghost in the order of their publication, with what happened between them.

    handed_over: by the producer, full or in a hurry, so that others follow it; else it was taken while it was filling.
    """

    count: int = 0
    handed_over: bool = False
    times: np.ndarray = field(default_factory=lambda: np.empty(BLOCK_ROWS, np.int64))
    walls: np.ndarray = field(default_factory=lambda: np.empty(BLOCK_ROWS, np.int64))
    rows: np.ndarray = field(default_factory=lambda: np.empty((BLOCK_ROWS, 13)))
    ghosts: np.ndarray = field(default_factory=lambda: np.empty(BLOCK_ROWS, np.bool_))
    notes: list[Note] = field(default_factory=list)


class Mailbox:
    """One producer, one consumer. ``put`` copies a row in about a microsecond.

    on_given_up() is called, from the producer's thread, when the consumer is stuck and everything is thrown away from
    then on.
    """

    def __init__(self, on_given_up: Callable[[], None] = lambda: None) -> None:
        self._on_given_up = on_given_up
        self._moved_at = time.monotonic()
        self._given_up = False
        # The plain lock itself on the hot path: a Condition's own enter and exit cost more than the copy.
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._filling = Block()
        self._waiting: deque[Block] = deque()
        self._closed = False
        self._woken = False
        self._hurried = False

    def put(self, time_ns: int, row: np.ndarray, ghost: bool = False) -> None:
        """Copy one state row (13,) of the body, or of its ghost."""
        with self._lock:
            block = self._filling
            i = block.count
            block.times[i] = time_ns
            block.walls[i] = _wall_ns()
            block.rows[i] = row
            block.ghosts[i] = ghost
            block.count = i + 1
            if self._hurried or i + 1 == BLOCK_ROWS:
                self._hand_over()

    def note(self, event: Any) -> None:
        """Note what happened after the rows put so far."""
        with self._changed:
            self._filling.notes.append(Note(self._filling.count, _wall_ns(), event))

    def hurry(self) -> None:
        """Hand the next row over at once, with all that comes before it: how a run begins should be on
        disk from its start.
        """
        with self._lock:
            self._hurried = True

    def _hand_over(self) -> None:
        self._hurried = False
        while len(self._waiting) >= BLOCKS_WAITING_MAX and not self._closed and not self._given_up:
            rest = self._moved_at + PATIENCE_S - time.monotonic()
            if rest <= 0.0:
                self._given_up = True
                self._on_given_up()
            self._changed.wait(max(0.0, rest))
        if not self._closed and not self._given_up:
            self._filling.handed_over = True
            self._waiting.append(self._filling)
        self._filling = Block()
        self._changed.notify_all()

    def take(self) -> Block | None:
        """The oldest block, or what has been put since; None when empty."""
        with self._changed:
            self.moved()
            if self._waiting:
                block = self._waiting.popleft()
                self._changed.notify_all()
            elif not self._given_up and (self._filling.count or self._filling.notes):
                block = self._filling
                self._filling = Block()
            else:
                block = None
            return block

    def moved(self) -> None:
        """The consumer got something done: as long as it does, a disk is slow, or the machine busy, and no more."""
        self._moved_at = time.monotonic()

    def emptied_by(self, thread: threading.Thread) -> bool:
        """Wait, after ``close``, for the end of the consumer's thread; False when it does nothing for PATIENCE_S."""
        while thread.is_alive() and time.monotonic() < self._moved_at + PATIENCE_S:
            thread.join(max(0.0, self._moved_at + PATIENCE_S - time.monotonic()))
        return not thread.is_alive()

    def wait(self, seconds: float) -> None:
        """Return after ``seconds``, or at once when a block is full, on ``wake`` and when the mailbox is closed."""
        with self._changed:
            if not self._closed and not self._waiting and not self._woken:
                self._changed.wait(seconds)
            self._woken = False

    def wake(self) -> None:
        """End the consumer's ``wait``."""
        with self._changed:
            self._woken = True
            self._changed.notify_all()

    def close(self) -> None:
        """Wake both sides; what is inside can still be taken. A producer that waited no longer does."""
        with self._changed:
            self._closed = True
            self.moved()
            self._changed.notify_all()

    @property
    def closed(self) -> bool:
        """Whether ``close`` was called."""
        return self._closed
