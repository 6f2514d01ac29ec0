# SPDX-License-Identifier: MIT
"""Verify a recording: check its chain of events, recompute every state bit for bit, and find the first difference."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.provenance import cpu, versions
from ..base.vectors import FloatArray
from ..simulation.observer import Event, EventLog, Logged, Observer
from .messages import FIELDS, PROJECTIONS
from .recorded_session import RecordedSession, Resimulation, decode_event, resimulation


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
    states = _states_in_order(session)
    if not states:
        lacks = ", ".join(session.missing) or "states"
        accepted = "states from a start or reset on; without them there is nothing to verify"
        raise NotVerifiableError("--verify", f"a recording without {lacks}", accepted)
    if session.missing:
        accepted = "a recording that holds them from a start or reset on"
        raise InputError("--verify", f"a recording without {', '.join(session.missing)}", accepted)
    first_ns, recorded = states[0][0], session.lines
    began_later = NotVerifiableError(
        "--verify",
        f"a recording that begins at {first_ns / 1e9:.9g} s, in the middle of a run",
        "one that begins at a start or a reset",
    )
    decoded = [decode_event(line, number) for number, line in enumerate(recorded, 1)]
    times_ns = [time_ns for time_ns, _, _ in decoded]
    if (broken := broken_link(recorded)) is not None:
        # The change that begins a recording is told in it: at time 0 too, behind what was done before.
        switched_on = any(kind == "set" and told.get("record") and not time_ns for time_ns, kind, told in decoded)
        if broken == 1 and (first_ns > 0 or switched_on):
            raise began_later
        what = f"command {broken} doesn't match its hash: {recorded[broken - 1]}"
        return Difference(times_ns[broken - 1], what, tampered=True)
    computed = _Lines()
    again = resimulation(session, computed)
    compared = 0
    for count, (time_ns, name, row) in enumerate(states):
        difference, state = _advance(again, time_ns, computed.lines, recorded, compared)
        if difference is not None:
            return difference
        compared = len(computed.lines)
        if again.simulation.failure and again.simulation.time_ns != time_ns:
            return Difference(time_ns, again.simulation.failure)
        if what := _difference_now(again, count + 1, name, row, state):
            if count == 0 and not recorded and first_ns > 0:
                raise began_later
            # At its own time a command acts after the state.
            before = sum(acted_ns < time_ns for acted_ns in times_ns)
            return Difference(time_ns, what, f"command {before}: {recorded[before - 1]}" if before else "")
        if count % 1000 == 0:
            progress(count / len(states))
    end_ns = max(again.simulation.time_ns, again.end_ns)
    difference, _ = _advance(again, end_ns, computed.lines, recorded, compared)
    missing = len(computed.lines)
    if difference is None and missing < len(recorded):
        return Difference(times_ns[missing], f"command {missing + 1} did not act: {recorded[missing]}")
    return difference


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


def _advance(
    again: Resimulation, time_ns: int, computed: Sequence[str], recorded: Sequence[str], compared: int
) -> tuple[Difference | None, FloatArray]:
    """The state computed at ``time_ns``, or the first difference in the commands up to there, of which ``compared``
    were alike.
    """
    refused = None
    try:
        row = again.advance(time_ns)
    except CommandRefused as refusal:
        row, refused = np.empty(0), refusal
    for number, line in enumerate(computed[compared:], compared + 1):
        if number > len(recorded):
            return Difference(json.loads(line)["time_ns"], f"a command that wasn't recorded: {line}"), row
        if line != recorded[number - 1]:
            what = f"command {number} differs: {recorded[number - 1]} recorded, {line} computed"
            return Difference(json.loads(recorded[number - 1])["time_ns"], what), row
    if refused is not None:
        what = f"command {len(computed) + 1} was applied in the recording, but is refused here: {refused}"
        return Difference(again.simulation.time_ns, what), row
    return None, row


def _states_in_order(session: RecordedSession) -> list[tuple[int, str, FloatArray]]:
    """Time, topic ("" for the state itself) and row of everything to compare, in the order of time; of one instant the
    last of each topic.
    """
    streams = {"": (session.times, session.rows)}
    if session.published:
        streams = {name: (published.times, published.rows) for name, published in session.published.items()}
    merged = [
        (int(t), name, row) for name, (times, rows) in streams.items() for t, row in zip(times, rows, strict=True)
    ]
    last = {(time_ns, name): (time_ns, name, row) for time_ns, name, row in merged}
    return sorted(last.values(), key=lambda state: state[0])


def _difference_now(again: Resimulation, number: int, name: str, recorded: FloatArray, computed: FloatArray) -> str:
    """See ``_row_difference``. While time stands, states are published behind commands of that instant, too."""
    found = difference = _row_difference(number, name, recorded, computed)
    while difference and again.act_next():
        difference = _row_difference(number, name, recorded, again.simulation.state.row)
    return difference and found


def _row_difference(number: int, name: str, recorded: FloatArray, computed: FloatArray) -> str:
    """How the ``number``-th state differs, by the variable that differs most; empty where it doesn't."""
    if name:
        computed = np.array(PROJECTIONS[name](computed.tolist()))
    if computed.tobytes() == recorded.tobytes():
        return ""
    different = np.flatnonzero(computed.view(np.uint64) != np.ascontiguousarray(recorded).view(np.uint64))
    worst = different[np.argmax(np.abs(computed - recorded)[different])]
    where = f"state {number}, {name + ' ' if name else ''}{FIELDS[name][worst]}"
    return f"{where} differs: {float(recorded[worst])!r} recorded, {float(computed[worst])!r} computed"
