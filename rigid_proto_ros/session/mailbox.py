# SPDX-License-Identifier: MIT
"""Where the stepping thread leaves events, and observers whose own thread fetches and writes them in order."""

from __future__ import annotations

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress

from ..simulation.observer import Event, GhostPublished, Observer, Published

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

_logger = logging.getLogger(__name__)


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

    @property
    def waiting(self) -> int:
        """How many events wait."""
        return len(self._waiting)

    def take(self) -> Iterator[list[Noted]]:
        """What waits now, not what arrives meanwhile, BATCH events at most a time."""
        rest = len(self._waiting)
        while rest:
            self.moved()
            count = min(BATCH, rest)
            yield [self._waiting.popleft() for _ in range(count)]
            rest -= count

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


class WritingObserver(Observer):
    """An observer that writes what it is told on a thread of its own: every ``period_s``, and at the end. What goes
    wrong there doesn't reach the flight.

    place: what it writes to, for its messages. on_error gets one line when it has stopped because nothing can be
    written, from another thread; ``error`` keeps it. A subclass starts ``_thread`` when it is ready.
    """

    purpose = "recording"
    period_s: float

    def __init__(self, place: str, on_error: Callable[[str], None] | None) -> None:
        self.error = ""
        self.place, self._on_error = place, on_error or _logger.error
        self._mailbox = Mailbox(lambda: self._tell_end("nothing can be written to the disk any more"))
        self._thread = threading.Thread(target=self._write_until_closed, name=self.purpose, daemon=True)

    def on(self, event: Event) -> None:
        """Take an event from the stepping thread; a state is copied."""
        if type(event) in self.takes:
            self._mailbox.put(event)

    def close(self) -> None:
        """Write what is buffered, and finish."""
        if self._mailbox.closed:
            return
        self._mailbox.close()
        if not self._mailbox.emptied_by(self._thread):
            self._tell_end("the last states could not be written")

    @property
    def stalled(self) -> str:
        """Says that what is written isn't taken; empty while it is."""
        stalled = "" if self.error or not self._thread.is_alive() else self._mailbox.stalled
        return stalled and f"{self.purpose} {self.place}: {stalled}"

    def _tell_end(self, reason: str) -> None:
        self.error = ": ".join(filter(None, (f"{self.purpose} stopped", self.place, reason)))
        self._on_error(self.error)

    # The writing thread

    def _write_until_closed(self) -> None:
        closing = False
        while not closing:
            closing = self._mailbox.closed
            try:
                self._write_what_waits()
                if closing:
                    self._finish()
            except Exception as error:
                self._give_up(error)
            if not closing:
                self._mailbox.wait(self.period_s)

    def _write_what_waits(self) -> None:
        """Write what is in the mailbox, or throw it away where nothing can be written any more."""
        raise NotImplementedError

    def _finish(self) -> None:
        """Everything has been written."""
        raise NotImplementedError

    def _give_up(self, error: Exception) -> None:
        """Writing has failed: go on without."""
        raise NotImplementedError
