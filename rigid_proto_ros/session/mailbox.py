# SPDX-License-Identifier: MIT
"""A queue from the stepping thread to a writing thread, and observers that write events on such a thread, in order."""

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
"""Capacity of the queue in events, a minute of states at 1 kHz. When it is full the stepping thread waits, which
happens only in runs faster than real time: no state is lost, and memory stays bounded.
"""

BATCH = 4096
"""Largest number of events taken at a time."""

STALLED_S = 0.9
"""A write that takes longer than this [s] is reported; with a report each second, within two seconds."""

LOOK_AGAIN_S = 0.002
"""Polling period of a producer that waits for space in the queue [s]."""

PATIENCE_S = 10.0
"""A consumer that makes no progress for this long [s], while the queue is full or being closed, is considered stuck:
the simulation continues, or ends, and queued events are lost.
"""

TimedEvent = tuple[int, Event]
"""An event and the time at which it was queued: the wall time [ns] when the mailbox was made plus the monotonic time
since, so it never decreases.
"""

_logger = logging.getLogger(__name__)


class Mailbox:
    """A queue with one producer and one consumer. ``put`` takes about two microseconds and holds no lock: a signal's
    exception may be raised within it, and within a Condition, as in queue.Queue, it could leave the lock held forever.

    on_given_up() is called on the producer's thread when the consumer is stuck; from then on all events are discarded.
    """

    def __init__(self, on_given_up: Callable[[], None] = lambda: None) -> None:
        self.closed = False
        self._on_given_up = on_given_up
        self._given_up = False
        self._moved_at = time.monotonic()
        self._wall_offset_ns = time.time_ns() - time.monotonic_ns()
        self._idle = False
        self._waiting: deque[TimedEvent] = deque()
        self._wake: queue.SimpleQueue[None] = queue.SimpleQueue()

    def put(self, event: Event) -> None:
        """Queue an event; copies a state's row, which the simulation reuses."""
        if self._given_up or self.closed:
            return
        if isinstance(event, Published | GhostPublished):
            event = type(event)(event.time_ns, event.row.copy())
        timed = time.monotonic_ns() + self._wall_offset_ns, event
        if len(self._waiting) >= MOST_WAITING and not self._has_space():
            self._given_up = True
            self._on_given_up()
            return
        self._waiting.append(timed)
        if len(self._waiting) >= BATCH:
            self.wake()

    def _has_space(self) -> bool:
        """Wait for space in the queue; False if there is none within PATIENCE_S."""
        end_s = time.monotonic() + PATIENCE_S
        while (full := len(self._waiting) >= MOST_WAITING) and time.monotonic() < end_s:
            time.sleep(LOOK_AGAIN_S)
        return not full

    @property
    def waiting(self) -> int:
        """Number of queued events."""
        return len(self._waiting)

    def take(self) -> Iterator[list[TimedEvent]]:
        """Yield the events queued now, not those that arrive meanwhile, in batches of at most BATCH."""
        rest = len(self._waiting)
        while rest:
            self.moved()
            count = min(BATCH, rest)
            yield [self._waiting.popleft() for _ in range(count)]
            rest -= count

    def moved(self) -> None:
        """Record progress of the consumer; while it makes progress it is slow, but not stuck."""
        self._moved_at = time.monotonic()

    def wait(self, seconds: float) -> None:
        """Wait for ``seconds``, or until BATCH events are queued, ``close`` or ``wake``."""
        self._idle = True
        with suppress(queue.Empty):
            self._wake.get(timeout=seconds)
        self.moved()
        self._idle = False

    @property
    def stalled(self) -> str:
        """A message if the consumer has made no progress for longer than STALLED_S; empty otherwise or if
        it is idle.
        """
        stuck_s = 0.0 if self._idle else time.monotonic() - self._moved_at
        return "" if stuck_s < STALLED_S else f"nothing could be written for {stuck_s:.1f} s"

    def wake(self) -> None:
        """End the consumer's ``wait``."""
        if self._wake.empty():
            self._wake.put(None)

    def close(self) -> None:
        """Refuse further events; queued events can still be taken."""
        self.closed = True
        self.moved()
        self.wake()

    def emptied_by(self, thread: threading.Thread) -> bool:
        """After ``close``, wait for the consumer's thread to end; False if it makes no progress for PATIENCE_S."""
        while thread.is_alive() and (rest_s := self._moved_at + PATIENCE_S - time.monotonic()) > 0.0:
            thread.join(rest_s)
        return not thread.is_alive()


class WritingObserver(Observer):
    """An observer that writes its events on its own thread, every ``period_s`` and at the end. Errors of writing don't
    affect the simulation.

    place: the file or address that it writes to, for messages. on_error(line) is called, on another thread, when
    writing has failed for good; ``error`` keeps the line. A subclass starts ``_thread`` when it is ready.
    """

    purpose = "recording"
    period_s: float

    def __init__(self, place: str, on_error: Callable[[str], None] | None) -> None:
        self.error = ""
        self.place, self._on_error = place, on_error or _logger.error
        self._mailbox = Mailbox(lambda: self._report_failure("nothing can be written to the disk any more"))
        self._thread = threading.Thread(target=self._write_until_closed, name=self.purpose, daemon=True)

    def on(self, event: Event) -> None:
        """Queue an event, on the stepping thread; a state is copied."""
        if type(event) in self.takes:
            self._mailbox.put(event)

    def close(self) -> None:
        """Write what is buffered, and finish."""
        if self._mailbox.closed:
            return
        self._mailbox.close()
        if not self._mailbox.emptied_by(self._thread):
            self._report_failure("the last states could not be written")

    @property
    def stalled(self) -> str:
        """A message if writing is stalled; empty otherwise."""
        stalled = "" if self.error or not self._thread.is_alive() else self._mailbox.stalled
        return stalled and f"{self.purpose} {self.place}: {stalled}"

    def _report_failure(self, reason: str) -> None:
        self.error = ": ".join(filter(None, (f"{self.purpose} stopped", self.place, reason)))
        self._on_error(self.error)

    # The writing thread

    def _write_until_closed(self) -> None:
        closing = False
        while not closing:
            closing = self._mailbox.closed
            try:
                self._write_waiting()
                if closing:
                    self._finish()
            except Exception as error:
                self._give_up(error)
            if not closing:
                self._mailbox.wait(self.period_s)

    def _write_waiting(self) -> None:
        """Write the events in the mailbox, or discard them after a failure."""
        raise NotImplementedError

    def _finish(self) -> None:
        """Close the output, after all events have been written."""
        raise NotImplementedError

    def _give_up(self, error: Exception) -> None:
        """Handle a failed write: release the output and continue without it."""
        raise NotImplementedError
