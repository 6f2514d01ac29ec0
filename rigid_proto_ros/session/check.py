# SPDX-License-Identifier: MIT
"""Is a recording what it says? Its chain of events, and every state computed anew, to the bit; and where they part."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.provenance import cpu, versions
from ..simulation.event_log import EventLog
from ..simulation.observer import Event, Logged, Observer
from .messages import FIELDS, PROJECTIONS
from .recorded_session import RecordedSession
from .replay import Resimulation, as_published, mesh_finder, resimulation, session_scenario
from .runs import decode_event


class NotVerifiableError(InputError):
    """The recording holds no start and no reset to compute it from, or no states to compare."""


@dataclass(frozen=True)
class Difference:
    """The first place where the recording and the new computation part. command: the last one that acted before it,
    with its number from 1; empty where none did, or where the difference is in the commands. tampered: a command was
    changed after it was recorded, which no machine or version explains.
    """

    time_ns: int
    what: str
    command: str = ""
    tampered: bool = False

    def __str__(self) -> str:
        return f"at {self.time_ns / 1e9:.9g} s: {self.what}"


class _Lines(Observer):
    takes = frozenset({Logged})

    def __init__(self) -> None:
        self.lines: list[str] = []

    def on(self, event: Event) -> None:
        if isinstance(event, Logged):
            self.lines.append(event.line)


def verify(session: RecordedSession, progress: Callable[[float], None] = lambda _: None) -> Difference | None:
    """Compare the chain of events, then every event and every state with a new computation, bit for bit.

    Returns the first difference, or None. Raises InputError for a session that can't be decoded, or lacks what a check
    needs: the topics named, or its beginning.
    """
    _check_verifiable(session)
    recorded = session.lines
    events = [decode_event(line, number) for number, line in enumerate(recorded, 1)]
    broken = broken_link(recorded)
    if broken is not None:
        if broken == 1 and not _begins_at_its_start(session, events):
            raise _began_later(session)
        line = recorded[broken - 1]
        return Difference(events[broken - 1][0], f"command {broken} isn't what its hash says: {line}", tampered=True)
    lines = _Lines()
    again = resimulation(session, lines)
    states = list(_states_in_order(session))
    if not states:
        raise NotVerifiableError(
            "--verify", "a recording without states", "one with states: there is nothing to verify"
        )
    compared = 0
    for count, (time_ns, name, row) in enumerate(states):
        try:
            computed = again.advance(time_ns)
        except CommandRefused as refusal:
            return _not_taken(again, lines, recorded, refusal)
        difference = _line_difference(recorded, lines.lines, compared)
        if difference is not None:
            return difference
        compared = len(lines.lines)
        if again.simulation.failure and again.simulation.time_ns != time_ns:
            return Difference(time_ns, again.simulation.failure)
        difference = _row_difference(
            time_ns, count + 1, name, row, as_published(session, again.scenario.parameters, name, time_ns, computed)
        )
        if difference is not None:
            if count == 0 and not recorded and time_ns > 0:
                # Nothing in it says that it is complete.
                raise _began_later(session)
            return replace(difference, command=_command_before(events, recorded, time_ns))
        if count % 1000 == 0:
            progress(count / len(states))
    return _what_follows(again, lines, recorded, events)


def _check_verifiable(session: RecordedSession) -> None:
    """Raises InputError where there is nothing to compare, or nothing to compute it from."""
    if next(_states_in_order(session), None) is None:
        lacks = ", ".join(session.missing) or "states"
        accepted = "states from a start or reset on; without them there is nothing to verify"
        raise NotVerifiableError("--verify", f"a recording without {lacks}", accepted)
    if session.missing:
        accepted = "a recording that holds them from a start or reset on"
        raise InputError("--verify", f"a recording without {', '.join(session.missing)}", accepted)


def made_with_table(session: RecordedSession) -> list[tuple[str, str, str]]:
    """What the recording says that it was made with, and the same here: (name, recorded, here); "none" where a package
    isn't installed. Empty for a recording that doesn't say.
    """
    here = {"cpu": cpu(), **versions(*(name for name in session.made_with if name != "began"))}
    return [(name, was, here.get(name, "none")) for name, was in session.made_with.items() if name != "began"]


def broken_link(lines: Sequence[str]) -> int | None:
    """Number of the first event line, from 1, that doesn't fit the hashes of the chain, or None."""
    log = EventLog()
    for number, line in enumerate(lines, 1):
        time_ns, kind, content = decode_event(line, number)
        if log.append(time_ns, kind, content) != line:
            return number
    return None


def _what_follows(again: Resimulation, lines: _Lines, recorded: list[str], events: list) -> Difference | None:
    """Events behind the last state."""
    try:
        if events:
            again.advance(max(again.simulation.time_ns, max(time_ns for time_ns, _, _ in events) + 1))
    except CommandRefused as refusal:
        return _not_taken(again, lines, recorded, refusal)
    difference = _line_difference(recorded, lines.lines)
    if difference is None and len(lines.lines) < len(recorded):
        missing = len(lines.lines)
        difference = Difference(events[missing][0], f"command {missing + 1} did not act: {recorded[missing]}")
    return difference


def _states_in_order(session: RecordedSession) -> Iterator[tuple[int, str, np.ndarray]]:
    """Time, topic ("" for the state itself) and row of everything to compare, in the order of time."""
    streams = {"": (session.times, session.rows)}
    if session.published:
        streams = {name: (published.times, published.rows) for name, published in session.published.items()}
    merged = [
        (int(t), name, row) for name, (times, rows) in streams.items() for t, row in zip(times, rows, strict=True)
    ]
    yield from sorted(merged, key=lambda state: state[0])


def _row_difference(
    time_ns: int, number: int, name: str, recorded: np.ndarray, computed: np.ndarray
) -> Difference | None:
    """How the ``number``-th state differs, by the variable that differs most."""
    if name:
        computed = np.array(PROJECTIONS[name](computed.tolist()))
    if computed.tobytes() == recorded.tobytes():
        return None
    pairs = list(zip(recorded.tolist(), computed.tolist(), strict=True))
    worst = max(range(len(pairs)), key=lambda k: (abs(pairs[k][1] - pairs[k][0]), _ulps(*pairs[k])))
    was, now = pairs[worst]
    where = f"state {number}, {name + ' ' if name else ''}{FIELDS[name][worst]}"
    return Difference(time_ns, f"{where} differs by {_ulps(was, now)} ulp: {was!r} recorded, {now!r} computed")


def _ulps(a: float, b: float) -> int:
    """How many doubles b lies from a."""
    first, second = (struct.unpack("<q", struct.pack("<d", x))[0] for x in (a, b))
    first, second = (bits if bits >= 0 else -(bits & (2**63 - 1)) for bits in (first, second))
    return abs(first - second)


def _command_before(events: list, recorded: Sequence[str], time_ns: int) -> str:
    """The last command that acted before a state: at its own time, commands act after it."""
    before = [number for number, event in enumerate(events, 1) if event[0] < time_ns]
    if not before:
        return ""
    last = max(before, key=lambda number: (events[number - 1][0], number))
    return f"command {last}: {recorded[last - 1]}"


def _line_difference(recorded: Sequence[str], computed: Sequence[str], begin: int = 0) -> Difference | None:
    pairs = zip(computed[begin:], recorded[begin:], strict=False)
    for number, (ours, theirs) in enumerate(pairs, begin + 1):
        if ours != theirs:
            time_ns, _, _ = decode_event(theirs, number)
            return Difference(time_ns, f"command {number} differs: {theirs} recorded, {ours} computed")
    if len(computed) > len(recorded):
        line = computed[len(recorded)]
        return Difference(json.loads(line)["time_ns"], f"a command that wasn't recorded: {line}")
    return None


def _not_taken(again: Resimulation, lines: _Lines, recorded: list[str], refusal: CommandRefused) -> Difference:
    earlier = _line_difference(recorded, lines.lines)
    number = len(lines.lines) + 1
    return earlier or Difference(
        again.simulation.time_ns, f"command {number} was applied in the recording, but is refused here: {refusal}"
    )


def _begins_at_its_start(session: RecordedSession, events: list) -> bool:
    """Whether the first state is that of the scene before anything happened to it."""
    first = next(_states_in_order(session), None)
    if first is None or first[0] > events[0][0]:
        return False
    time_ns, name, row = first
    again = Resimulation(session_scenario(session), [], None, mesh_finder(session), session.node_name)
    told = as_published(session, again.scenario.parameters, name, time_ns, again.advance(time_ns))
    return _row_difference(time_ns, 1, name, row, told) is None


def _began_later(session: RecordedSession) -> NotVerifiableError:
    first = min((state[0] for state in _states_in_order(session)), default=0)
    return NotVerifiableError(
        "--verify", f"a recording that begins at {first / 1e9:.9g} s", "one that begins at a start or a reset"
    )
