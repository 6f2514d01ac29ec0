# SPDX-License-Identifier: MIT
"""Verification of a recording: checks the hash chain of its events, recomputes every state bit for bit, and finds the
first difference. The recording is read along with the resimulation, so memory doesn't grow with its length.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.provenance import cpu, versions
from ..base.vectors import FloatArray
from ..simulation.observer import Event, EventLog, Logged, Observer
from .messages import FIELDS, PROJECTIONS
from .recorded_session import Events, RecordedSession, Resimulation, decode_event, resimulation


class NotVerifiableError(InputError):
    """The recording has no start or reset from which to compute, or no states to compare."""


@dataclass(frozen=True)
class Difference:
    """The first difference between recording and resimulation. command: the last command that acted before it, with its
    number from 1; empty if none did, or if the difference is in the commands. tampered: a command was changed after it
    was recorded, which differences of machine or versions can't explain.
    """

    time_ns: int
    what: str
    command: str = ""
    tampered: bool = False

    def __str__(self) -> str:
        return f"at {self.time_ns / 1e9:.9g} s: {self.what}"


class _BrokenChainError(Exception):
    """A recorded event doesn't match its hash. number, time_ns, line: of the event."""

    def __init__(self, number: int, time_ns: int, line: str) -> None:
        super().__init__()
        self.number, self.time_ns, self.line = number, time_ns, line


class _Recorded:
    """The recorded events as the resimulation reads them, each checked against the hash chain.

    waiting: (number from 1, time_ns, line) of events that were read but not computed yet. compared: number of the last
    event that was equal.
    """

    def __init__(self, events: Events) -> None:
        self.waiting: deque[tuple[int, int, str]] = deque()
        self.compared = 0
        self._events = events
        self._acted: deque[tuple[int, int, str]] = deque()
        self._last_before = ""

    def __iter__(self) -> Iterator[str]:
        log = EventLog()
        for number, (_, line) in enumerate(self._events, 1):
            time_ns, kind, content = decode_event(line, number)
            if log.append(time_ns, kind, content) != line:
                raise _BrokenChainError(number, time_ns, line)
            self.waiting.append((number, time_ns, line))
            yield line

    def compare(self, line: str) -> Difference | None:
        """Compare the next line with a computed one."""
        if not self.waiting:
            return Difference(json.loads(line)["time_ns"], f"a command that wasn't recorded: {line}")
        number, time_ns, recorded = self.waiting.popleft()
        if line != recorded:
            return Difference(time_ns, f"command {number} differs: {recorded} recorded, {line} computed")
        self.compared = number
        self._acted.append((number, time_ns, line))
        return None

    def last_before(self, time_ns: int) -> str:
        """The last command that acted before this time, with its number; call with ascending times."""
        while self._acted and self._acted[0][1] < time_ns:
            number, _, line = self._acted.popleft()
            self._last_before = f"command {number}: {line}"
        return self._last_before


class _Computed(Observer):
    """Collects the event lines of the resimulation until they are compared."""

    takes = frozenset({Logged})

    def __init__(self) -> None:
        self.lines: deque[str] = deque()

    def on(self, event: Event) -> None:
        if isinstance(event, Logged):
            self.lines.append(event.line)


def verify(session: RecordedSession, progress: Callable[[float], None] = lambda _: None) -> Difference | None:
    """Compare every event and every state with a resimulation, bit for bit, and check the events' hash chain. Of states
    of the same time, the last one of each topic is compared.

    Returns the first difference, or None. Raises InputError for a session that can't be decoded or is incomplete:
    topics or its beginning are missing.
    """
    states = session.states
    if not states.topics:
        lacks = ", ".join(session.missing) or "states"
        accepted = "states from a start or reset on; without them there is nothing to verify"
        raise NotVerifiableError("--verify", f"a recording without {lacks}", accepted)
    if session.missing:
        accepted = "a recording that holds them from a start or reset on"
        raise InputError("--verify", f"a recording without {', '.join(session.missing)}", accepted)
    try:
        return _first_difference(session, _Recorded(session.events), progress)
    except _BrokenChainError as broken:
        if broken.number == 1 and (states.first_ns > 0 or _switched_on_at_0(session)):
            raise _began_later(session) from None
        what = f"command {broken.number} doesn't match its hash: {broken.line}"
        return Difference(broken.time_ns, what, tampered=True)


def _switched_on_at_0(session: RecordedSession) -> bool:
    """Whether the recording was switched on at time 0 after other events. The change that starts a recording is one of
    its events.
    """
    for number, (_, line) in enumerate(session.events, 1):
        time_ns, kind, content = decode_event(line, number)
        if time_ns:
            break
        if kind == "set" and content.get("record"):
            return True
    return False


def _began_later(session: RecordedSession) -> NotVerifiableError:
    return NotVerifiableError(
        "--verify",
        f"a recording that begins at {session.states.first_ns / 1e9:.9g} s, in the middle of a run",
        "one that begins at a start or a reset",
    )


def _first_difference(
    session: RecordedSession, recorded: _Recorded, progress: Callable[[float], None]
) -> Difference | None:
    states, computed = session.states, _Computed()
    again = resimulation(session, computed, recorded)
    number, number_of_states = 0, states.count * len(states.topics)
    for time_ns, published in groupby(states, key=itemgetter(0)):
        difference, state = _advance(again, time_ns, computed, recorded)
        if difference is not None:
            return difference
        if again.simulation.failure and again.simulation.time_ns != time_ns:
            return Difference(time_ns, again.simulation.failure)
        # A command acts after the state published at its time.
        command = recorded.last_before(time_ns)
        for name, row in {name: row for _, name, row in published}.items():
            number += 1
            if what := _difference_now(again, number, name, np.asarray(row), state):
                if number == 1 and not len(session.events) and states.first_ns > 0:
                    raise _began_later(session)
                return Difference(time_ns, what, command)
            if number % 1000 == 0:
                progress(number / number_of_states)
    difference, done = None, False
    while difference is None and not done:
        done = again.all_read
        difference, _ = _advance(again, max(again.simulation.time_ns, again.end_ns), computed, recorded)
    if difference is None and recorded.waiting:
        number, time_ns, line = recorded.waiting[0]
        return Difference(time_ns, f"command {number} did not act: {line}")
    return difference


def made_with_table(session: RecordedSession) -> list[tuple[str, str, str]]:
    """Processor and package versions of the recording and of this machine: (name, recorded, here); "none" if a package
    isn't installed. Empty if the recording doesn't have them.
    """
    here = {"cpu": cpu(), **versions(*(name for name in session.made_with if name != "began"))}
    return [(name, was, here.get(name, "none")) for name, was in session.made_with.items() if name != "began"]


def _advance(
    again: Resimulation, time_ns: int, computed: _Computed, recorded: _Recorded
) -> tuple[Difference | None, FloatArray]:
    """Advance to ``time_ns``; returns the first difference in the commands up to there, or None, and the state row."""
    refused = None
    try:
        row = again.advance(time_ns)
    except CommandRefused as refusal:
        row, refused = np.empty(0), refusal
    while computed.lines:
        if difference := recorded.compare(computed.lines.popleft()):
            return difference, row
    if refused is not None:
        what = f"command {recorded.compared + 1} was applied in the recording, but is refused here: {refused}"
        return Difference(again.simulation.time_ns, what), row
    return None, row


def _difference_now(again: Resimulation, number: int, name: str, recorded: FloatArray, computed: FloatArray) -> str:
    """See ``_row_difference``. While paused, states were also published after commands of the same time, so these are
    applied one by one until a state matches.
    """
    found = difference = _row_difference(number, name, recorded, computed)
    while difference and again.act_next():
        difference = _row_difference(number, name, recorded, again.simulation.state.row)
    return difference and found


def _row_difference(number: int, name: str, recorded: FloatArray, computed: FloatArray) -> str:
    """Describe how the ``number``-th state differs, by the variable that differs most; empty if it doesn't."""
    if name:
        computed = np.array(PROJECTIONS[name](computed.tolist()))
    if computed.tobytes() == recorded.tobytes():
        return ""
    different = np.flatnonzero(computed.view(np.uint64) != np.ascontiguousarray(recorded).view(np.uint64))
    worst = different[np.argmax(np.abs(computed - recorded)[different])]
    where = f"state {number}, {name + ' ' if name else ''}{FIELDS[name][worst]}"
    return f"{where} differs: {float(recorded[worst])!r} recorded, {float(computed[worst])!r} computed"
