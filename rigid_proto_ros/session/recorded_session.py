# SPDX-License-Identifier: MIT
"""A recorded flight, in memory or in a file: its states and events, its mesh, found by hash, and its resimulation from
scene and events, also for an observer.
"""

from __future__ import annotations

import hashlib
import json
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.rotation import rotate, rotate_inverse
from ..base.vectors import FloatArray, IntArray, StateRow
from ..mesh.reading import Mesh, load_mesh, read_mesh
from ..parameters.declarations import Parameters, convert_all
from ..scene.command_codec import frame_names, of_event
from ..scene.scenario import Scenario, make_scenario, mesh_sha256_of
from ..scene.scenario_run import ScenarioRun, notify_start
from ..scene.scene_file import read_scene_text
from ..simulation.commands import Change, Command
from ..simulation.observer import BodyChanged, Observer, Published
from ..simulation.setup import Setup
from ..simulation.simulation import TIMEOUTS
from .messages import PROJECTIONS

ROUNDING = 1e-12
"""Tolerance, relative to 1 + |velocity|, of converting a velocity to a topic's axes and back."""

SAME = 1e-6
"""Largest difference between equal poses [m, and of quaternion components]."""


class Events(Protocol):
    """The events of one run in order: (simulated time [ns], line as logged). Each iteration reads them again."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[tuple[int, str]]: ...


class States:
    """The states of one run in order of time: simulated time [ns], topic and row. Each iteration reads them again. This
    base class has none.

    In a recording, a row is what the topic published (``messages.PROJECTIONS``). In a run in memory, the topic is ""
    and the row is the state row, in the order of ``STATE_FIELDS`` in simulation/observer.py. topics: topics with
    states; count: number of different times; first_ns, end_ns: first and last time.
    """

    topics: tuple[str, ...] = ()
    count = first_ns = end_ns = 0

    def __iter__(self) -> Iterator[tuple[int, str, Sequence[float]]]:
        return iter(())


class StateRows(States):
    """State rows, or the rows of one topic, in memory. times: (n,) int64 [ns, simulated], ascending; rows: (n, k)
    float64.
    """

    def __init__(self, times: IntArray, rows: FloatArray) -> None:
        self.times, self.rows, self.count = times, rows, len(times)
        if self.count:
            self.topics, self.first_ns, self.end_ns = ("",), int(times[0]), int(times[-1])

    def __len__(self) -> int:
        return self.count

    def __iter__(self) -> Iterator[tuple[int, str, Sequence[float]]]:
        return ((time_ns, "", row.tolist()) for time_ns, row in zip(self.times.tolist(), self.rows, strict=True))


@dataclass
class RecordedSession:
    """One recorded run.

    scene: the parameters at the run's start, as a parameter file. events: (time_ns, JSON line) in order, lines as
    logged. states: the published states. complete: the file was closed properly. scenes: texts of the scene topic since
    the run's start, in order. node_name: prefix of the topic names. missing: topics that verification needs and the
    recording lacks. attachments: (name, bytes) of attached files; made_with: the processor, and versions by package;
    accuracy_floor: why the motion is held to less than its accuracy, if recorded; logged_timeouts: kinds of timeouts
    with events (simulation.TIMEOUTS), fewer in recordings of earlier versions; folder: the folder of the session.
    """

    scene: str = ""
    events: Events = field(default_factory=list)
    states: States = field(default_factory=States)
    complete: bool = True
    scenes: list[str] = field(default_factory=list)
    node_name: str = "rigid_body"
    missing: tuple[str, ...] = ()
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    made_with: dict[str, str] = field(default_factory=dict)
    accuracy_floor: str = ""
    logged_timeouts: Collection[str] = TIMEOUTS
    folder: Path | None = None

    @property
    def lines(self) -> list[str]:
        """The event lines as logged."""
        return [line for _, line in self.events]

    @property
    def mesh_sha256(self) -> str:
        """SHA-256 of the mesh file at the run's start; empty without a mesh."""
        return mesh_sha256_of(self.scene)

    @property
    def end_ns(self) -> int:
        """Simulated time [ns] of the last state; 0 without states."""
        return self.states.end_ns

    def state_rows(self) -> Iterator[tuple[int, FloatArray]]:
        """Yield time [ns] and state row (13,) of every state. A recording gives one row per time, combined from its
        topics; velocities that weren't published are 0.
        """
        for time_ns, published in groupby(self.states, key=itemgetter(0)):
            rows = {}
            for _, topic, row in published:
                if topic:
                    rows[topic] = row
                else:
                    yield time_ns, np.asarray(row)
            if "pose" in rows or "odom" in rows:
                yield time_ns, _combined(rows)

    @cached_property
    def _rows(self) -> StateRows:
        if isinstance(self.states, StateRows):
            return self.states
        times, numbers = array("q"), array("d")
        for time_ns, row in self.state_rows():
            times.append(time_ns)
            numbers.extend(row)
        return StateRows(np.frombuffer(times, np.int64), np.frombuffer(numbers).reshape(-1, 13))

    @property
    def times(self) -> IntArray:
        """Times (n,) [ns] of ``state_rows``, cached in memory together with ``rows``."""
        return self._rows.times

    @property
    def rows(self) -> FloatArray:
        """Rows (n, 13) of ``state_rows``."""
        return self._rows.rows

    @cached_property
    def published(self) -> dict[str, StateRows]:
        """Times and rows by topic, cached in memory."""
        found = {topic: (array("q"), array("d")) for topic in self.states.topics}
        for time_ns, topic, row in self.states:
            found[topic][0].append(time_ns)
            found[topic][1].extend(row)
        return {
            topic: StateRows(np.frombuffer(times, np.int64), np.frombuffer(numbers).reshape(len(times), -1))
            for topic, (times, numbers) in found.items()
        }


def _combined(rows: dict[str, Sequence[float]]) -> FloatArray:
    """A state row (13,) from the topics' rows of one state."""
    state = np.zeros(13)
    if "odom" in rows:
        odom = rows["odom"]
        state[:7] = odom[:7]
        state[7:10], state[10:13] = rotate(*odom[3:7], *odom[7:10]), odom[10:13]
    if "pose" in rows:
        state[:7] = rows["pose"]
    if "twist" in rows:
        twist = rows["twist"]
        state[7:10], state[10:13] = twist[:3], rotate_inverse(*state[3:7].tolist(), *twist[3:6])
    return state


def decode_event(line: str, number: int) -> tuple[int, str, dict[str, Any]]:
    """Time [ns], kind and content of a line of the event log; raises InputError with the event's number."""
    try:
        event = json.loads(line)
        time_ns, kind, content = event["time_ns"], event["kind"], event["content"]
        if type(time_ns) is int and 0 <= time_ns < 1 << 63 and isinstance(kind, str) and isinstance(content, dict):
            return time_ns, kind, content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError(f"event {number}", line[:80], "a JSON line with time_ns, kind and content")


def find_mesh(session: RecordedSession, name: str, sha256: str) -> Mesh:
    """The mesh whose file has this SHA-256: searched by name, then in the session's folder, then in its attachments.
    Raises MeshError.
    """
    places = [name]
    if session.folder is not None:
        places.append(str(session.folder / Path(name).name))
    for place in places:
        try:
            mesh = load_mesh(place)
        except InputError:
            continue
        if mesh.sha256 == sha256:
            return mesh
    for file_name, data in session.attachments:
        if hashlib.sha256(data).hexdigest() == sha256:
            return read_mesh(data, Path(Path(file_name).name))
    raise MeshError(
        "mesh", name, f"the file with SHA-256 {sha256}, there or in the session's folder; the recording lacks it"
    )


# Resimulation


def recorded_parameters(session: RecordedSession) -> Parameters:
    """The parameters at the session's start; the defaults if it has no scene."""
    scene = read_scene_text(session.scene, "the recorded scene").values if session.scene else {}
    return Parameters().replaced(scene)


def session_scenario(session: RecordedSession) -> Scenario:
    """The scenario at the session's start, with the mesh of the recorded hash (``find_mesh``). Raises InputError."""
    if not session.scene:
        raise InputError("session", "the recording has no scene; give one with --scene FILE")
    values = read_scene_text(session.scene, "the recorded scene").values
    if not session.mesh_sha256:
        return make_scenario(values)
    name = str(values.get("mesh", ""))
    return make_scenario(values, find_mesh(session, name, session.mesh_sha256))


def mesh_finder(session: RecordedSession) -> Callable[[str], Mesh | None]:
    """A function to call for each change of the mesh, in order: it returns the mesh of this name as recorded at that
    change, by the hashes in the scenes, since a file's content may change under the same name; None for a name that
    isn't in any scene.
    """
    recorded: list[tuple[str, str]] = []
    for scene in (session.scene, *session.scenes) if session.scenes else ():
        sha256 = mesh_sha256_of(scene)
        named = str(read_scene_text(scene, "a recorded scene").values.get("mesh", "")), sha256
        if not recorded or (sha256 and named != recorded[-1]):
            recorded.append(named)
    place = 0

    def find(name: str) -> Mesh | None:
        nonlocal place
        places = [k for k, (other, _) in enumerate(recorded) if other == name]
        if not places:
            return None
        # The next scene of this name, unless the present mesh is set again; the last one if scenes are missing.
        later = [k for k in places if k > place]
        if later and (place not in places or later[0] == place + 1):
            place = later[0]
        elif place not in places:
            place = places[-1]
        return find_mesh(session, name, recorded[place][1])

    return find


_Waiting = tuple[int, str, dict[str, Any], Command | None, int]
"""Time [ns], kind, content, command (None for a mark) and number of an event."""


def decoded_events(
    event_lines: Iterable[str], frames: tuple[str, str]
) -> Iterator[tuple[int, int, str, dict[str, Any], Command | None]]:
    """Yield number from 1, time [ns], kind, content and command (None for a mark) of lines of the event log. frames:
    names of the world and body frames. Raises InputError for a line that can't be decoded.
    """
    for number, line in enumerate(event_lines, 1):
        time_ns, kind, content = decode_event(line, number)
        try:
            if kind == "set":
                convert_all(content)
            command = None if kind == "timeout" else of_event(kind, content, frames)
        except InputError as error:
            raise InputError(f"event {number}, {error.field}", error.received, error.accepted) from None
        yield number, time_ns, kind, content, command


class _Upcoming:
    """An iterator as a queue of which only the first item is held."""

    def __init__(self, items: Iterator[_Waiting]) -> None:
        self._items = items
        self._first = next(items, None)

    def __bool__(self) -> bool:
        return self._first is not None

    def __getitem__(self, index: int) -> _Waiting:
        assert index == 0 and self._first is not None
        return self._first

    def popleft(self) -> _Waiting:
        first, self._first = self[0], next(self._items, None)
        return first


def _leap_of(kind: str, content: Mapping[str, Any]) -> int:
    """The forward jump of simulated time by an event of the log [ns], or 0."""
    by_ns = content.get("by_ns", 0) if kind == "jump" else 0
    return max(by_ns, 0) if type(by_ns) is int else 0


class Resimulation(ScenarioRun):
    """Simulates a session again from its events; each command is submitted at its recorded time. Raises InputError for
    events that can't be decoded.

    event_lines: in order of time, read along with the motion. mesh_of(name): returns the mesh of a change, or None to
    load it. logged_timeouts: kinds of timeouts that the events include; earlier versions lack some. end_ns: time at
    which all events read so far have acted.
    """

    def __init__(
        self,
        scenario: Scenario,
        event_lines: Iterable[str],
        observer: Observer | None = None,
        mesh_of: Callable[[str], Mesh | None] = lambda _: None,
        node_name: str = "rigid_body",
        logged_timeouts: Collection[str] = TIMEOUTS,
    ) -> None:
        super().__init__(scenario, observer)
        self.simulation.logged_timeouts = logged_timeouts
        self.frames = frame_names(scenario.parameters, node_name)
        self._mesh_of = mesh_of
        self.end_ns = 0
        self._waiting = _Upcoming(self._events_to_apply(event_lines))

    def _events_to_apply(self, event_lines: Iterable[str]) -> Iterator[_Waiting]:
        for number, time_ns, kind, content, command in decoded_events(event_lines, self.frames):
            # A mark precedes the commands of its time, which the recording may not include any more.
            acts = command is not None or kind == "timeout"
            self.end_ns = max(self.end_ns, time_ns + acts + _leap_of(kind, content))
            # The simulation generates timeouts itself, in the right order.
            if kind != "timeout":
                yield time_ns, kind, content, command, number

    @property
    def all_read(self) -> bool:
        """Whether all events have been read."""
        return not self._waiting

    def finish(self) -> StateRow:
        """Advance until all events have acted; returns the state row there."""
        while not self.all_read:
            self.advance(self.end_ns)
        return self.advance(max(self.end_ns, self.simulation.time_ns))

    def advance(self, until_ns: int) -> StateRow:
        """Advance the body to ``until_ns``; returns its state row, before the commands of that time act.

        Raises CommandRefused for a recorded command that can't be taken.
        """
        while self._waiting:
            time_ns, kind, content, command, _ = self._waiting[0]
            # Marks at ``until_ns`` precede the commands of that time.
            made_there = time_ns == until_ns and command is None and not _leap_of(kind, content)
            if time_ns >= until_ns and not made_there:
                break
            self._take_next()
        return self.simulation.advance(until_ns).row

    def _take_next(self) -> None:
        time_ns, kind, content, command, number = self._waiting.popleft()
        self.simulation.advance(max(time_ns, self.simulation.time_ns))
        if command is None:
            self.simulation.act()  # the commands before it
            if by_ns := _leap_of(kind, content):
                self.simulation.leap(by_ns)
            else:
                self.simulation.log(kind, content)
        else:
            # Commands of one time act in the order of the log.
            self.take(command, time_ns, (0, number))

    def act_next(self) -> bool:
        """Apply the next event of the present time, as recorded while paused; False if there is none."""
        if not self._waiting or self._waiting[0][0] > self.simulation.time_ns or _leap_of(*self._waiting[0][1:3]):
            return False
        self._take_next()
        self.simulation.act()
        return True

    def setup_of(self, command: Change, at_hand: Scenario | None = None) -> Setup:
        """Apply a change with the mesh as it was recorded; returns the setup."""
        mesh = self._mesh_of(command.content["mesh"]) if command.content.get("mesh") else None
        if mesh is None:
            return super().setup_of(command, at_hand)
        return self.replace(self.scenario.with_changes(command.content, mesh))


def resimulation(
    session: RecordedSession, observer: Observer | None = None, lines: Iterable[str] | None = None
) -> Resimulation:
    """The session's resimulation, at its start. lines: the session's event lines, if the caller iterates over them
    itself. Raises InputError, also later on reaching an event that can't be decoded.
    """
    lines = (line for _, line in session.events) if lines is None else lines
    mesh_of, scenario = mesh_finder(session), session_scenario(session)
    return Resimulation(scenario, lines, observer, mesh_of, session.node_name, session.logged_timeouts)


def check_playable(session: RecordedSession, given: Scenario | None = None) -> None:
    """Raise InputError for a session that can't be played: it has no scene and none is given, or its events can't be
    decoded.
    """
    if given is not None:
        return
    if session.missing or not session.scene:
        raise InputError("session", ", ".join(session.missing) or "no scene", "--scene FILE, to draw it")
    frames = frame_names(session_scenario(session).parameters, session.node_name)
    for _ in decoded_events((line for _, line in session.events), frames):
        pass


def _begins_at_start(session: RecordedSession) -> bool:
    """Whether the resimulation from the start reaches the first recorded state. If not, the recording was started
    later, and the ghost's earlier motion is unknown.
    """
    time_ns, row = next(session.state_rows(), (0, None))
    if row is None or time_ns == 0:
        return True
    try:
        computed = resimulation(session).advance(time_ns)
    except InputError:
        return False
    return bool(np.abs(computed[:7] - row[:7]).max() < SAME)


def _alike(topics: list[str], one: list[float], other: list[float]) -> bool:
    """Whether these topics would publish the same rows for both states, up to rounding."""
    return all(
        abs(a - b) <= ROUNDING * (1.0 + abs(b))
        for topic in topics
        for a, b in zip(PROJECTIONS[topic](one), PROJECTIONS[topic](other), strict=True)
    )


def play(
    session: RecordedSession,
    observer: Observer,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda _done, _total: None,
    all_events: bool = False,
) -> None:
    """Send the session to ``observer``, from its start to its last state, or with ``all_events`` to its last event;
    progress(sent, total) is called with numbers of states.

    given: the scene of a session that lacks it; then only states are sent. Raises InputError for events that can't be
    decoded, and for a session without a scene.
    """
    again = None
    if given is not None or session.missing:
        if given is None:
            raise InputError("session", ", ".join(session.missing), "--scene FILE, to draw it")
        notify_start(observer, given)
        observer.on(BodyChanged(0, given.setup, given.parameters.rotor.momentum))
    else:
        again = resimulation(session, observer)
        again.announce()
        if again.scenario.ghost is not None and _begins_at_start(session):
            again.begin_ghost()
    topics = [topic for topic in session.states.topics if topic]
    for count, (time_ns, row) in enumerate(session.state_rows()):
        progress(count, session.states.count)
        if again is None:
            observer.on(Published(time_ns, row))
            continue
        try:
            computed = again.advance(time_ns)
        except InputError:
            # A recorded command is refused here: from now on only the recorded states are sent.
            computed = row
        # Topics may lack velocities or digits: prefer the computed state if it matches the recorded one.
        again.publish(time_ns, computed if topics and _alike(topics, computed.tolist(), row.tolist()) else row)
    if again is not None and all_events:
        with suppress(InputError):
            again.finish()
