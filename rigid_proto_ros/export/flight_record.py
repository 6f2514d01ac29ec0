# SPDX-License-Identifier: MIT
"""A flight as an export takes it: what changed and the states, as told by a simulation or a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import InputError
from ..scene.offline import OfflineRun
from ..scene.scenario import Scenario, publication_ns
from ..session.recorded_session import RecordedSession
from ..session.replay import Resimulation, resimulation
from ..simulation.commands import Command
from ..simulation.observer import (
    BodyChanged,
    BodySnapshot,
    Event,
    GhostChanged,
    GhostPublished,
    LoadBegan,
    MeshChanged,
    Observer,
    Published,
    Started,
    StringChanged,
)

Source = Callable[[Observer], OfflineRun | Resimulation]
"""Makes the flight anew, with an observer that has it fly its ghost too."""

FRAMES_MAX = 4_000_000

AGREES = 1e-4
"""In m and of a quaternion's parts: how near a flight made anew must come to a recorded state to be taken for it."""


@dataclass
class States:
    """times_ns [ns], ascending, and rows (13,) in STATE_FIELDS order."""

    times_ns: list[int] = field(default_factory=list)
    rows: list[np.ndarray] = field(default_factory=list)

    def add(self, time_ns: int, row: np.ndarray) -> None:
        """Of two states at one time, as a bag may hold them, the first is kept."""
        if not self.times_ns or time_ns > self.times_ns[-1]:
            self.times_ns.append(time_ns)
            self.rows.append(np.array(row, dtype=float))

    def between(self, after_ns: float, until_ns: float) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) and rows (n, 13) from beyond the first to the second, both [ns]."""
        begin, end = np.searchsorted(self.times_ns, [after_ns, until_ns], side="right")
        return np.array(self.times_ns[begin:end], np.int64), np.array(self.rows[begin:end]).reshape(-1, 13)


class FlightRecord(Observer):
    """One run. changes: what isn't a state, in the order in which it was told; states of the body and of its ghost."""

    takes = frozenset(
        {*(Started, MeshChanged, BodyChanged, GhostChanged, StringChanged, LoadBegan), *(Published, GhostPublished)}
    )

    def __init__(self) -> None:
        self.changes: list[Event] = []
        self.states = States()
        self.ghosts = States()

    def on(self, event: Event) -> None:
        """Keep it."""
        match event:
            case Published(time_ns, row):
                self.states.add(time_ns, row)
            case GhostPublished(time_ns, row):
                self.ghosts.add(time_ns, row)
            case _:
                self.changes.append(event)

    @property
    def times_ns(self) -> np.ndarray:
        """Times (n,) int64 [ns] of the states; raises InputError where there are none."""
        if not self.states.times_ns:
            raise InputError("session", "it has no states to export")
        return np.array(self.states.times_ns, dtype=np.int64)

    @property
    def rows(self) -> np.ndarray:
        """The states (n, 13) in STATE_FIELDS order."""
        return np.array(self.states.rows).reshape(-1, 13)

    def bodies(self, kind: type[BodyChanged | GhostChanged]) -> list[tuple[int, BodySnapshot]]:
        """(time_ns, body) of each change of the body or of the ghost."""
        return [(event.time_ns, event.body) for event in self.changes if isinstance(event, kind)]


def frames(record: FlightRecord, source: Source | None, fps: float) -> tuple[FlightRecord, str]:
    """The flight at ``fps`` pictures a second, at impulses, and at both sides of each change of what is drawn; and what
    to say of it.

    source: None for a flight that can't be made anew; then its recorded states are the frames, as they are where it
    isn't the recorded one, as may be on another kind of processor.
    """
    if source is None:
        return record, "the session can't be simulated again: its states are the frames"
    start_ns, end_ns = int(record.times_ns[0]), int(record.times_ns[-1])
    count = int((end_ns - start_ns) * 1e-9 * fps) + 1
    if count > FRAMES_MAX:
        raise InputError("--fps", fps, f"at most {FRAMES_MAX} frames of the simulation")
    times = {start_ns + publication_ns(k, fps) for k in range(count)} | {end_ns}
    for event in record.changes:
        if isinstance(event, LoadBegan) and event.load.kind == "impulse":
            times.add(event.time_ns)
        elif event.time_ns > start_ns and not isinstance(event, LoadBegan):
            times |= {event.time_ns, event.time_ns + 1}
    look = _Look(source)
    made = FlightRecord()
    made.changes = record.changes
    recorded = dict(zip(record.states.times_ns, record.states.rows, strict=True))
    for time_ns in sorted(times | recorded.keys()):
        if not start_ns <= time_ns <= end_ns:
            continue
        row, ghost = look.at(time_ns)
        if row is None:
            break  # a recorded command that can't be taken, or a motion that stopped
        if time_ns in recorded and np.abs(row[:7] - recorded[time_ns][:7]).max() > AGREES:
            return record, "simulated again here the motion isn't the recorded one: its states are the frames"
        if time_ns in times:
            made.states.add(time_ns, row)
            if ghost is not None:
                made.ghosts.add(time_ns, ghost)
    return made, f"{len(made.states.rows)} frames, {fps:g} a second"


class _Look(Observer):
    """Looks at a flight that is made anew; looking changes no bit of the motion."""

    takes = frozenset({GhostPublished, GhostChanged})

    def __init__(self, source: Source) -> None:
        self._ghost: np.ndarray | None = None
        self._run = source(self)

    def on(self, event: Event) -> None:
        """Keep where the ghost is."""
        if isinstance(event, GhostPublished):
            self._ghost = event.row.copy()

    def at(self, time_ns: int) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Rows (13,) of body and ghost; None where there is none."""
        run = self._run
        try:
            run.advance(time_ns)
        except InputError:
            return None, None
        if run.simulation.failure:
            return None, None
        self._ghost = None
        if run.ghost is not None:
            run.ghost.advance(time_ns)
        return run.simulation.state.row, self._ghost


def source_of_scene(scenario: Scenario, script: list[Command]) -> Source:
    """The flight of a scene and its script."""
    return lambda observer: OfflineRun(scenario, script, observer)


def source_of_session(session: RecordedSession, given: Scenario | None = None) -> Source | None:
    """The flight of a session; None for one that lacks what it would take to simulate it again."""
    if given is not None or session.missing:
        return None

    def again(observer: Observer) -> Resimulation:
        flight = resimulation(session, observer)
        flight.begin_ghost()
        return flight

    return again
