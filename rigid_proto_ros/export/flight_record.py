# SPDX-License-Identifier: MIT
"""The input of an export: the changes and states of a simulation or of a recorded session."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray, StateRow
from ..scene.scenario import Scenario, publication_ns
from ..scene.scenario_run import OfflineRun
from ..session.recorded_session import RecordedSession, Resimulation, resimulation
from ..simulation.commands import Command
from ..simulation.observer import (
    BodyChanged,
    Event,
    GhostChanged,
    GhostPublished,
    LoadBegan,
    LoadEnded,
    MeshChanged,
    Observer,
    Published,
    Started,
    StringChanged,
)
from ..simulation.setup import Setup

Source = Callable[[Observer], OfflineRun | Resimulation]
"""Creates the simulation again at its start, with this observer, and with its ghost."""

FRAMES_MAX = 4_000_000

AGREES = 1e-4
"""Largest difference of a resimulated pose from the recorded one [m, and of quaternion components]."""


class FlightRecord(Observer):
    """One run. changes: all events but states, in order. states, ghosts: rows (13,) of the body and of its ghost by
    time [ns], ascending. end_ns: end of the flight [ns], if known to be later than the last state.
    """

    takes = frozenset(
        {
            *(Started, MeshChanged, BodyChanged, GhostChanged, StringChanged, LoadBegan, LoadEnded),
            *(Published, GhostPublished),
        }
    )

    def __init__(self) -> None:
        self.changes: list[Event] = []
        self.states: dict[int, StateRow] = {}
        self.ghosts: dict[int, StateRow] = {}
        self.end_ns = 0

    def on(self, event: Event) -> None:
        """Keep the event; of two states of the same time, which a bag may have, the first."""
        match event:
            case Published(time_ns, row):
                self.states.setdefault(time_ns, np.array(row, dtype=float))
            case GhostPublished(time_ns, row):
                self.ghosts.setdefault(time_ns, np.array(row, dtype=float))
            case _:
                self.changes.append(event)

    @property
    def times_ns(self) -> IntArray:
        """Times (n,) [ns] of the states; raises InputError if there are none."""
        if not self.states:
            raise InputError("session", "it has no states to export")
        return np.array(list(self.states), dtype=np.int64)

    @property
    def rows(self) -> FloatArray:
        """The states (n, 13) in STATE_FIELDS order."""
        return np.array(list(self.states.values())).reshape(-1, 13)

    def setups(self, kind: type[BodyChanged | GhostChanged]) -> list[Setup]:
        """Setups of the body, or of the ghost, at the start and after each change."""
        return [event.setup for event in self.changes if isinstance(event, kind) and event.setup is not None]


def frames(record: FlightRecord, source: Source | None, fps: float) -> tuple[FlightRecord, str]:
    """The flight at ``fps`` frames per second and at impulses, and a line to print.

    The frames are simulated again. The recorded states are the frames instead if source is None, or if the resimulation
    differs from them, as it may on another kind of processor.
    """
    if source is None:
        return record, "the session can't be simulated again: the recorded states are used as frames"
    start_ns, end_ns = int(record.times_ns[0]), max(int(record.times_ns[-1]), record.end_ns)
    count = int((end_ns - start_ns) * 1e-9 * fps) + 1
    if count > FRAMES_MAX:
        raise InputError("--fps", fps, f"at most {FRAMES_MAX} frames of the simulation")
    times = {start_ns + publication_ns(k, fps) for k in range(count)} | {end_ns}
    for event in record.changes:
        if isinstance(event, LoadBegan) and event.load.kind == "impulse" and start_ns <= event.time_ns <= end_ns:
            times.add(event.time_ns)
    made, observed = FlightRecord(), FlightRecord()
    made.changes = record.changes
    run = source(observed)
    for time_ns in sorted(times):
        try:
            run.advance(time_ns)
        except InputError:
            break  # a recorded command that can't be taken
        if run.simulation.failure:
            break
        row = run.simulation.state.row
        if time_ns in record.states and np.abs(row[:7] - record.states[time_ns][:7]).max() > AGREES:
            return record, "the motion isn't reproduced on this machine: the recorded states are used as frames"
        made.states[time_ns] = row.copy()
        if run.ghost is not None:
            run.ghost.advance(time_ns)
    made.ghosts = {time_ns: row for time_ns, row in observed.ghosts.items() if time_ns in made.states}
    return made, f"{len(made.states)} frames, {fps:g} a second"


def source_of_scene(scenario: Scenario, script: list[Command]) -> Source:
    """The source of a scene with a script."""
    return lambda observer: OfflineRun(scenario, script, observer)


def source_of_session(session: RecordedSession, given: Scenario | None = None) -> Source | None:
    """The source of a session's motion; None if the session lacks the data needed to simulate it again."""
    if given is not None or session.missing:
        return None

    def resimulate(observer: Observer) -> Resimulation:
        flight = resimulation(session, observer)
        flight.begin_ghost()
        return flight

    return resimulate
