# SPDX-License-Identifier: MIT
"""The order of what a script does at one instant.

A script's commands of equal time act by rank (changes and services, string, wrench, poke) and then by the bytes of their
messages. What hands did in one instant, a paused one above all, acted in ranks too, but changes in the order they were made.
A change can be spelled so that its message has a length, and with it a place, of its own: numbers may be written as text, and
text may end in blanks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ..core.setup import Setup
from ..poke_script import MAX_SCHEDULE_LENGTH, ScriptCommand, expand_script
from ..scenario import yaml_value

RANKS = {
    "set": 0,
    "string_release": 0,
    "clear_wrench": 0,
    "string_attach": 2,
    "string_target": 2,
    "wrench": 3,
    "poke": 4,
}
"""As core.commands.Rank has them; an inertia message becomes a change."""


@dataclass(frozen=True)
class Entry:
    """One entry of a script without its time. kind: as the event log calls it. setups: before and after a change."""

    kind: str
    what: dict
    setups: tuple[Setup, Setup] | None = None

    def content(self, time_ns: int) -> dict:
        """The whole entry."""
        return {"t": time_ns / 1e9, **self.what}

    def command(self, time_ns: int) -> ScriptCommand:
        """The one command that it expands to."""
        (command,) = expand_script([self.content(time_ns)])
        return command

    @property
    def rank(self) -> int:
        """Its place among the kinds at one instant."""
        return RANKS[self.kind]

    @property
    def impulsive(self) -> bool:
        """Whether it acts on the velocities at once."""
        return "impulse" in self.what or "angular_impulse" in self.what


def in_order(entries: list[tuple[int, Entry]]) -> tuple[list[tuple[int, Entry]], list[str]]:
    """The entries, spelled so that they act in a script in this very order, and a note on what can't be had."""
    ordered: list[tuple[int, Entry]] = []
    notes: list[str] = []
    for time_ns, group in groupby(entries, key=lambda timed: timed[0]):
        instant = [entry for _, entry in group]
        if len(instant) > 1:
            instant = _spelled(_target_first(_without_overruled(instant)), time_ns)
            if not _keeps_order(instant, time_ns):
                notes.append(f"at {time_ns / 1e9:.9g} s commands acted in an order that a script can't keep")
        ordered += [(time_ns, entry) for entry in instant]
    return ordered, notes


def _message(entry: Entry, time_ns: int) -> bytes:
    return entry.command(time_ns).message(time_ns)


def _keeps_order(instant: list[Entry], time_ns: int) -> bool:
    """Whether all act in this order, as far as it matters: impulses act at once, and pulses sum up for later."""
    keys = [(entry.rank, entry.impulsive, _message(entry, time_ns)) for entry in instant]
    return all([k for k in keys if k[1] == part] == sorted(k for k in keys if k[1] == part) for part in (False, True))


def _without_overruled(instant: list[Entry]) -> list[Entry]:
    """Without what the next command of the instant undoes to the bit: a slider moved while the body is paused."""
    kept: list[Entry] = []
    for entry in instant:
        while kept and _overrules(entry, kept[-1]):
            previous = kept.pop()
            if entry.setups and previous.setups:
                entry = replace(entry, setups=(previous.setups[0], entry.setups[1]))
        kept.append(entry)
    return kept


def _target_first(instant: list[Entry]) -> list[Entry]:
    """With a single new target before the knot it goes with, as a script has them: the knot's k and c are settled by where the
    free end is, and that is the same before and after a target that it only begins to move to.
    """
    strings = [entry for entry in instant if entry.rank == RANKS["string_target"]]
    targets = [entry for entry in strings if entry.kind == "string_target"]
    string_set = any(name.startswith("string.") for entry in instant if entry.setups for name in entry.what["set"])
    if len(targets) != 1 or len(strings) == 1 or string_set:
        return instant
    knot = next(entry for entry in reversed(strings) if entry.kind == "string_attach")
    before = [entry for entry in instant if entry.rank < RANKS["string_target"]]
    after = [entry for entry in instant if entry.rank > RANKS["string_target"]]
    return [*before, *targets, knot, *after]


def _overrules(later: Entry, earlier: Entry) -> bool:
    if later.kind != earlier.kind:
        return False
    if later.kind in ("wrench", "string_attach", "string_release", "clear_wrench"):
        return True
    if later.kind != "set":
        return False
    names = earlier.what["set"].keys()
    if not names <= later.what["set"].keys() or any(name.startswith(("string.", "mesh")) for name in names):
        return False
    before, between = earlier.setups
    after = later.setups[1]
    return not any(_moves_com(a, b) for a, b in ((before, between), (between, after), (before, after)))


def _moves_com(old: Setup, new: Setup) -> bool:
    """Whether position and velocity go along with the COM, with a rounding each time."""
    return old.geometry == new.geometry and not np.array_equal(old.body.center_of_mass, new.body.center_of_mass)


def _spelled(instant: list[Entry], time_ns: int) -> list[Entry]:
    """With the changes and services among them in the order of their messages, where lengths allow it."""
    if _keeps_order(instant, time_ns):
        return instant
    spelled: list[Entry] = []
    last = (-1, -1)
    for number, entry in enumerate(instant):
        if entry.kind == "set":
            fixed = next((e for e in instant[number:] if e.rank == 0 and e.kind != "set"), None)
            room = _place(_message(fixed, time_ns)) if fixed else (256, 0)
            spelling = _spelled_between(entry, time_ns, last, room)
            if spelling is None:
                return instant
            entry, last = spelling
        elif entry.rank == 0:
            last = max(last, _place(_message(entry, time_ns)))
        spelled.append(entry)
    return spelled


def _place(message: bytes) -> tuple[int, int]:
    """What decides first between messages of one kind: the text's length as its bytes stand, the low one first."""
    return message[4], message[5]


def _spelled_between(entry: Entry, time_ns: int, after: tuple, before: tuple) -> tuple[Entry, tuple[int, int]] | None:
    """The change with a message that lies between two places, and its own place; None without room."""
    spelling = _Spelling(entry)
    shortest = len(_message(spelling.padded(0), time_ns)) - 8
    for low, high in _places(after, before, shortest):
        blanks = low + 256 * high - shortest
        if blanks >= 0:
            return spelling.padded(blanks), (low, high)
    return None


def _places(after: tuple[int, int], before: tuple[int, int], shortest: int) -> Iterator[tuple[int, int]]:
    """Places between two others, those of short messages first, each with a low byte of its own while these last."""
    yield from ((low, 0) for low in range(max(after[0] + 1, shortest), before[0]))
    yield from ((low, 1) for low in range(after[0] + 1, before[0]))
    yield from ((after[0], high) for high in range(after[1] + 1, MAX_SCHEDULE_LENGTH // 256 - 1))


class _Spelling:
    """A change with one of its numbers as text that may end in blanks."""

    def __init__(self, entry: Entry) -> None:
        self._entry = entry
        changes = entry.what["set"]
        numbers = [n for n, value in changes.items() if isinstance(value, (float, list))]
        if numbers:
            self._name, self._value = numbers[-1], changes[numbers[-1]]
        else:
            # One that is set to what it is: no change at all.
            self._name, self._value = "poke_duration", entry.setups[1].poke_duration_ns / 1e9

    def padded(self, blanks: int) -> Entry:
        text = yaml_value(self._value) + " " * blanks
        return replace(self._entry, what={"set": {**self._entry.what["set"], self._name: text}})
