# SPDX-License-Identifier: MIT
"""Where the stepping thread leaves events, and the thread that writes them fetches them in order."""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from ..simulation.observer import Event, GhostPublished, Published

MOST_WAITING = 65536
"""Events that may wait, a minute of states at 1 kHz. Then the stepping thread waits for the other, which only a run
faster than real time reaches: the file keeps every state, and memory stays bounded.
"""

BATCH = 4096
"""Events that are fetched at a time."""

STALLED_S = 0.9
"""A write that takes longer is told of: a report comes once a second, and a stalled file is to be told within two."""

LOOK_AGAIN_S = 0.002
"""How often a producer that found no place looks for one."""

PATIENCE_S = 10.0
"""A writer that fetches nothing for so long, with all places taken or at the end, won't: the simulation goes on, or
ends, and what waits is lost."""

Noted = tuple[int, Event]
"""An event and when it was told: the wall's time [ns], as it goes on from when the mailbox was made. It is never set
back, so that what is sorted by it keeps its order.
"""


class Mailbox:
    """One producer, one consumer. ``put`` takes about two microseconds, and holds no lock: a signal's exception may be
    raised within it, and within a Condition, as of a queue.Queue, that can leave the lock taken for ever.

    on_given_up() is called, from the producer's thread, when the consumer is stuck and everything is thrown away from
    then on.
    """

    def __init__(self, on_given_up: Callable[[], None] = lambda: None) -> None:
        self.closed = False
        self._on_given_up = on_given_up
        self._given_up = False
        self._moved_at = time.monotonic()
        self._wall_offset_ns = time.time_ns() - time.monotonic_ns()
        self._idle = False
        self._waiting: deque[Noted] = deque()
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()

    def put(self, event: Event) -> None:
        """Take an event; a state, whose row is reused, is copied."""
        if self._given_up or self.closed:
            return
        if isinstance(event, Published | GhostPublished):
            event = type(event)(event.time_ns, event.row.copy())
        noted = time.monotonic_ns() + self._wall_offset_ns, event
        if len(self._waiting) >= MOST_WAITING and not self._has_place():
            self._given_up = True
            self._on_given_up()
            return
        self._waiting.append(noted)
        if len(self._waiting) >= BATCH:
            self.wake()

    def _has_place(self) -> bool:
        """Wait for a place; False when there is none within PATIENCE_S."""
        end_s = time.monotonic() + PATIENCE_S
        while (full := len(self._waiting) >= MOST_WAITING) and time.monotonic() < end_s:
            time.sleep(LOOK_AGAIN_S)
        return not full

    def take(self) -> list[Noted]:
        """The oldest events, BATCH at most; none when it is empty."""
        self.moved()
        return [self._waiting.popleft() for _ in range(min(BATCH, len(self._waiting)))]

    def moved(self) -> None:
        """The consumer got something done: as long as it does, a disk is slow, or the machine busy, and no more."""
        self._moved_at = time.monotonic()

    def wait(self, seconds: float) -> None:
        """Return after ``seconds``, or at once when the mailbox is filling up, is closed, or on ``wake``."""
        self._idle = True
        with suppress(queue.Empty):
            self._wake.get(timeout=seconds)
        self.moved()
        self._idle = False

    @property
    def stalled(self) -> str:
        """Says that the consumer has got nothing done for longer than STALLED_S; empty while it does, or waits."""
        stuck_s = 0.0 if self._idle else time.monotonic() - self._moved_at
        return "" if stuck_s < STALLED_S else f"nothing could be written for {stuck_s:.1f} s"

    def wake(self) -> None:
        """End the consumer's ``wait``."""
        if self._wake.empty():
            self._wake.put(None)

    def close(self) -> None:
        """Nothing more is taken; what is inside can still be fetched."""
        self.closed = True
        self.moved()
        self.wake()

    def emptied_by(self, thread: threading.Thread) -> bool:
        """Wait, after ``close``, for the end of the consumer's thread; False when it does nothing for PATIENCE_S."""
        while thread.is_alive() and (rest_s := self._moved_at + PATIENCE_S - time.monotonic()) > 0.0:
            thread.join(rest_s)
        return not thread.is_alive()
