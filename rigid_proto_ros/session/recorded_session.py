# SPDX-License-Identifier: MIT
"""A recorded flight, in memory or in a file; the mesh that it flew, found by its hash; and the flight computed anew
from its scene and its events, and told to an observer once more.
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
"""What the way of a velocity into a topic's axes and back changes, of it and of 1."""

SAME = 1e-6
"""[m, and of a quaternion's parts] How near a computed state must be to a recorded one to be the same."""


class Events(Protocol):
    """The events of one run, read anew by each pass over them: (time [ns, simulated], line as logged), in order."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[tuple[int, str]]: ...


class States:
    """The states of one run, read anew by each pass over them: time [ns, simulated], topic and row, in the order of
    time. These are none.

    Of a recording a row is what the topic published (``messages.PROJECTIONS``); of a run in memory the topic is "" and
    the row the state's own, in ``simulation/observer.py``'s ``STATE_FIELDS`` order. topics: those with any states;
    count: how many times there are; first_ns, end_ns: the first and the last.
    """

    topics: tuple[str, ...] = ()
    count = first_ns = end_ns = 0

    def __iter__(self) -> Iterator[tuple[int, str, Sequence[float]]]:
        return iter(())


class StateRows(States):
    """States, or what one topic published of them, in memory: times (n,) int64 [ns, simulated], ascending, and rows
    (n, k) float64.
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
    """One run, as its recording holds it.

    scene: the parameters at the run's start as a params file. events: (time_ns, JSON line) in order, lines as logged.
    states: those that were published. complete: the file was finished properly. scenes: the texts of the scene topic
    from the run's start on, in order. node_name: what stands before the topics' names. missing: topics that a check
    would need. attachments: (name, bytes) of files inside; made_with: the processor, and versions by package;
    accuracy_floor: why the motion is held to less than its accuracy, as an .mcap of ours says it; logged_timeouts:
    of what the events have timeouts (simulation.TIMEOUTS), which those of earlier versions lack; folder: where the
    session lies.
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
        """The event lines as logged, in memory."""
        return [line for _, line in self.events]

    @property
    def mesh_sha256(self) -> str:
        """Hash of the mesh's file that the run began with; empty without one."""
        return mesh_sha256_of(self.scene)

    @property
    def end_ns(self) -> int:
        """Simulated time [ns] of the last state; 0 without states."""
        return self.states.end_ns

    def state_rows(self) -> Iterator[tuple[int, FloatArray]]:
        """Time [ns] and state row (13,) of every state, one after another; of a recording one a time, put together from
        what was published, in which velocities that weren't are 0.
        """
        for time_ns, published in groupby(self.states, key=itemgetter(0)):
            shown = {}
            for _, topic, row in published:
                if topic:
                    shown[topic] = row
                else:
                    yield time_ns, np.asarray(row)
            if "pose" in shown or "odom" in shown:
                yield time_ns, _put_together(shown)

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
        """Times (n,) [ns] of ``state_rows``, in memory from then on, as are ``rows``."""
        return self._rows.times

    @property
    def rows(self) -> FloatArray:
        """State rows (n, 13) of ``state_rows``."""
        return self._rows.rows

    @cached_property
    def published(self) -> dict[str, StateRows]:
        """What each topic published, in memory from then on."""
        found = {topic: (array("q"), array("d")) for topic in self.states.topics}
        for time_ns, topic, row in self.states:
            found[topic][0].append(time_ns)
            found[topic][1].extend(row)
        return {
            topic: StateRows(np.frombuffer(times, np.int64), np.frombuffer(numbers).reshape(len(times), -1))
            for topic, (times, numbers) in found.items()
        }


def _put_together(shown: dict[str, Sequence[float]]) -> FloatArray:
    """A state row (13,) from what the topics published of one state."""
    state = np.zeros(13)
    if "odom" in shown:
        odom = shown["odom"]
        state[:7] = odom[:7]
        state[7:10], state[10:13] = rotate(*odom[3:7], *odom[7:10]), odom[10:13]
    if "pose" in shown:
        state[:7] = shown["pose"]
    if "twist" in shown:
        twist = shown["twist"]
        state[7:10], state[10:13] = twist[:3], rotate_inverse(*state[3:7].tolist(), *twist[3:6])
    return state


def decode_event(line: str, number: int) -> tuple[int, str, dict[str, Any]]:
    """time_ns, kind and content of a line of the event log; raises InputError naming the event by number."""
    try:
        event = json.loads(line)
        time_ns, kind, content = event["time_ns"], event["kind"], event["content"]
        if type(time_ns) is int and 0 <= time_ns < 1 << 63 and isinstance(kind, str) and isinstance(content, dict):
            return time_ns, kind, content
    except (ValueError, KeyError, TypeError, RecursionError):
        pass
    raise InputError(f"event {number}", line[:80], "a JSON line with time_ns, kind and content")


def find_mesh(session: RecordedSession, name: str, sha256: str) -> Mesh:
    """The mesh whose file has this hash: by its name, beside the session, or from the session's attachments. Raises
    MeshError naming it.
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


# Computed anew


def recorded_parameters(session: RecordedSession) -> Parameters:
    """The parameters that the session began with; those of the default where it has no scene."""
    scene = read_scene_text(session.scene, "the recorded scene").values if session.scene else {}
    return Parameters().replaced(scene)


def session_scenario(session: RecordedSession) -> Scenario:
    """The scenario that the session began with; the mesh by name if its content is the same, else the recorded one."""
    if not session.scene:
        raise InputError("session", "the recording has no scene; give one with --scene FILE")
    values = read_scene_text(session.scene, "the recorded scene").values
    if not session.mesh_sha256:
        return make_scenario(values)
    name = str(values.get("mesh", ""))
    return make_scenario(values, find_mesh(session, name, session.mesh_sha256))


def mesh_finder(session: RecordedSession) -> Callable[[str], Mesh | None]:
    """Called for each change of the mesh, one after another: the mesh of this name that was flown then, as the scenes
    say, since a file may change while its name stays; None for a name that none speaks of.
    """
    flown: list[tuple[str, str]] = []
    for scene in (session.scene, *session.scenes) if session.scenes else ():
        sha256 = mesh_sha256_of(scene)
        named = str(read_scene_text(scene, "a recorded scene").values.get("mesh", "")), sha256
        if not flown or (sha256 and named != flown[-1]):
            flown.append(named)
    place = 0

    def find(name: str) -> Mesh | None:
        nonlocal place
        places = [k for k, (other, _) in enumerate(flown) if other == name]
        if not places:
            return None
        # The next scene of this name, unless the mesh in force is set once more; the last one where scenes are missing.
        later = [k for k in places if k > place]
        if later and (place not in places or later[0] == place + 1):
            place = later[0]
        elif place not in places:
            place = places[-1]
        return find_mesh(session, name, flown[place][1])

    return find


_Waiting = tuple[int, str, dict[str, Any], Command | None, int]
"""time_ns, kind, content, command (None for a mark) and number of an event."""


def decoded_events(
    event_lines: Iterable[str], frames: tuple[str, str]
) -> Iterator[tuple[int, int, str, dict[str, Any], Command | None]]:
    """Number from 1, time_ns, kind, content and command (None for a mark) of lines of the event log. frames: names of
    the world's and the body's. Raises InputError for those that can't be decoded.
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
    """The items of an iterator as a queue, of which only the first one has been made."""

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
    """How far an event of the log took simulated time ahead at once [ns]."""
    by_ns = content.get("by_ns", 0) if kind == "jump" else 0
    return max(by_ns, 0) if type(by_ns) is int else 0


class Resimulation(ScenarioRun):
    """A session's simulation; its commands are submitted when their time has come, as they were then. Raises InputError
    for events that can't be decoded.

    event_lines: in the order of time, read as the flight comes to them. mesh_of(name) gives the mesh that a change
    names, or None to load it. logged_timeouts: of what there are events of timeouts, as those of earlier
    versions lack some. end_ns: when all events that have been read have acted.
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
        self._waiting = _Upcoming(self._to_come(event_lines))

    def _to_come(self, event_lines: Iterable[str]) -> Iterator[_Waiting]:
        for number, time_ns, kind, content, command in decoded_events(event_lines, self.frames):
            # A mark is made before what acts at its time, which the recording may not have come to.
            acts = command is not None or kind == "timeout"
            self.end_ns = max(self.end_ns, time_ns + acts + _leap_of(kind, content))
            # A timeout comes by itself, where it belongs: one that a change brings about comes behind that.
            if kind != "timeout":
                yield time_ns, kind, content, command, number

    @property
    def all_read(self) -> bool:
        """Whether no event waits any more."""
        return not self._waiting

    def finish(self) -> StateRow:
        """Advance to where all events have acted, at least; returns the state row there."""
        while not self.all_read:
            self.advance(self.end_ns)
        return self.advance(max(self.end_ns, self.simulation.time_ns))

    def advance(self, until_ns: int) -> StateRow:
        """Advance the body to ``until_ns``; returns its state row, before what acts at that very time.

        Raises CommandRefused for a recorded command that can't be taken.
        """
        while self._waiting:
            time_ns, kind, content, command, _ = self._waiting[0]
            # Marks at the time asked for were made before anything else could act there.
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
            # What acted at one instant acts in the order of the log, whatever rule made it.
            self.take(command, time_ns, (0, number))

    def act_next(self) -> bool:
        """Let the next event of the present instant happen, as it did while time stood; False when there is none."""
        if not self._waiting or self._waiting[0][0] > self.simulation.time_ns or _leap_of(*self._waiting[0][1:3]):
            return False
        self._take_next()
        self.simulation.act()
        return True

    def setup_of(self, command: Change, at_hand: Scenario | None = None) -> Setup:
        """Put in force what a change says, with the mesh that was flown then."""
        mesh = self._mesh_of(command.content["mesh"]) if command.content.get("mesh") else None
        if mesh is None:
            return super().setup_of(command, at_hand)
        return self.replace(self.scenario.with_changes(command.content, mesh))


def resimulation(
    session: RecordedSession, observer: Observer | None = None, lines: Iterable[str] | None = None
) -> Resimulation:
    """The session's simulation at its start; raises InputError for events that can't be decoded, when it comes to them.
    lines: the session's, where somebody else reads them, too.
    """
    lines = (line for _, line in session.events) if lines is None else lines
    mesh_of, scenario = mesh_finder(session), session_scenario(session)
    return Resimulation(scenario, lines, observer, mesh_of, session.node_name, session.logged_timeouts)


def check_playable(session: RecordedSession, given: Scenario | None = None) -> None:
    """Raise InputError for a session that can't be played: without a scene, unless one is given, or with events that
    can't be decoded.
    """
    if given is not None:
        return
    if session.missing or not session.scene:
        raise InputError("session", ", ".join(session.missing) or "no scene", "--scene FILE, to draw it")
    frames = frame_names(session_scenario(session).parameters, session.node_name)
    for _ in decoded_events((line for _, line in session.events), frames):
        pass


def _begins_at_start(session: RecordedSession) -> bool:
    """Whether the flight computed from the start comes to the first recorded state. Of a recording that was begun later
    it isn't known what a ghost did before.
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
    """Whether these topics would publish the same of both states, but for rounding."""
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
    """Tell ``observer`` the session from its start to its last state, or with ``all_events`` to its last event;
    ``progress`` is called with (states told, all states).

    given: the scene of a session that lacks it; then states alone are told. Raises InputError for events that can't be
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
            # A command that is refused here: from now on only the recorded states are shown.
            computed = row
        # A recording holds of a state what was published of it, and no more.
        again.publish(time_ns, computed if topics and _alike(topics, computed.tolist(), row.tolist()) else row)
    if again is not None and all_events:
        with suppress(InputError):
            again.finish()
