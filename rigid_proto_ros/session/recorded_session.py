# SPDX-License-Identifier: MIT
"""A recorded flight as plain arrays and text, whatever file it was read from; the mesh that it flew, found by its hash;
and the flight computed anew from its scene and its events, and told to an observer once more.
"""

from __future__ import annotations

import hashlib
import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, MeshError
from ..base.vectors import FloatArray, IntArray, StateRow
from ..mesh.reading import Mesh, load_mesh, read_mesh
from ..scene.command_codec import frame_names, of_event
from ..scene.parameters import Parameters, convert_all
from ..scene.scenario import Scenario, make_scenario, mesh_sha256_of
from ..scene.scenario_run import ScenarioRun, notify_start
from ..scene.scene_file import read_scene_text
from ..simulation.commands import Change, Command
from ..simulation.observer import BodyChanged, Observer, Published
from ..simulation.setup import Setup
from .messages import PROJECTIONS

SAME = 1e-6
"""[m, and of a quaternion's parts] How near a computed state must be to a recorded one to be the same."""


@dataclass(frozen=True)
class StampedRows:
    """What one topic published: times (n,) int64 [ns, simulated] and rows (n, k) float64."""

    times: IntArray
    rows: FloatArray

    def __len__(self) -> int:
        return len(self.times)


@dataclass
class RecordedSession:
    """One run, as its recording holds it.

    scene: the parameters at the run's start as a params file. events: (time_ns, JSON line) in order, lines as logged.
    refusals: (time_ns, text). times (n,) int64 [ns, simulated] and rows (n, 13) float64, exactly the published states
    in ``simulation/observer.py``'s ``STATE_FIELDS`` order. complete: the file was finished properly.

    A bag holds no state rows but what the node published of them: ``published``, by topic; ``rows`` are then found from
    those, for the eye. scenes: the texts of the scene topic from the run's start on, in order. node_name: what stands
    before the topics' names. missing: topics that a check would need. attachments: (name, bytes) of files inside;
    made_with: the processor, and versions by package; accuracy_floor: why the motion is held to less than its accuracy,
    as an .mcap of ours says it; folder: where the session lies.
    """

    scene: str = ""
    events: list[tuple[int, str]] = field(default_factory=list)
    refusals: list[tuple[int, str]] = field(default_factory=list)
    times: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    rows: FloatArray = field(default_factory=lambda: np.empty((0, 13)))
    complete: bool = True
    published: dict[str, StampedRows] = field(default_factory=dict)
    scenes: list[str] = field(default_factory=list)
    node_name: str = "rigid_body"
    missing: tuple[str, ...] = ()
    attachments: list[tuple[str, bytes]] = field(default_factory=list)
    made_with: dict[str, str] = field(default_factory=dict)
    accuracy_floor: str = ""
    folder: Path | None = None

    @property
    def lines(self) -> list[str]:
        """The event lines as logged."""
        return [line for _, line in self.events]

    @property
    def mesh_sha256(self) -> str:
        """Hash of the mesh's file that the run began with; empty without one."""
        return mesh_sha256_of(self.scene)

    @property
    def end_ns(self) -> int:
        """Simulated time [ns] of the last state; 0 without states."""
        return int(self.times[-1]) if len(self.times) else 0


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


def _leap_of(kind: str, content: Mapping[str, Any]) -> int:
    """How far an event of the log took simulated time ahead at once [ns]."""
    by_ns = content.get("by_ns", 0) if kind == "jump" else 0
    return max(by_ns, 0) if type(by_ns) is int else 0


class Resimulation(ScenarioRun):
    """A session's simulation; its commands are submitted when their time has come, as they were then. Raises InputError
    for events that can't be decoded.

    mesh_of(name) gives the mesh that a change names, or None to load it. end_ns: when all events have acted.
    """

    def __init__(
        self,
        scenario: Scenario,
        event_lines: Sequence[str],
        observer: Observer | None = None,
        mesh_of: Callable[[str], Mesh | None] = lambda _: None,
        node_name: str = "rigid_body",
    ) -> None:
        super().__init__(scenario, observer)
        # Recordings from before there were such events, of one thing or another, have none.
        logged: set[str] = set()
        self.simulation.logged_timeouts = logged
        self.frames = frame_names(scenario.parameters, node_name)
        self._mesh_of = mesh_of
        self.end_ns = 0
        waiting: list[tuple[int, str, dict[str, Any], Command | None, int]] = []
        for number, line in enumerate(event_lines, 1):
            time_ns, kind, content = decode_event(line, number)
            if kind == "timeout":
                # It comes by itself, where it belongs: one that a change brings about comes behind that.
                logged.update(content)
                self.end_ns = max(self.end_ns, time_ns + 1)
                continue
            try:
                if kind == "set":
                    convert_all(content)
                command = of_event(kind, content, self.frames)
            except InputError as error:
                raise InputError(f"event {number}, {error.field}", error.received, error.accepted) from None
            # A mark is made before what acts at its time, which the recording may not have come to.
            self.end_ns = max(self.end_ns, time_ns + (command is not None) + _leap_of(kind, content))
            waiting.append((time_ns, kind, content, command, number))
        # Stable: what happened at one instant keeps its order.
        self._waiting = deque(sorted(waiting, key=itemgetter(0)))

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


def resimulation(session: RecordedSession, observer: Observer | None = None) -> Resimulation:
    """The session's simulation at its start; raises InputError for events that can't be decoded."""
    scenario = session_scenario(session)
    return Resimulation(scenario, session.lines, observer, mesh_finder(session), session.node_name)


def _begins_at_start(session: RecordedSession) -> bool:
    """Whether the flight computed from the start comes to the first recorded state. Of a recording that was begun later
    it isn't known what a ghost did before.
    """
    if not len(session.times) or session.times.min() == 0:
        return True
    first = int(session.times.argmin())
    try:
        computed = resimulation(session).advance(int(session.times[first]))
    except InputError:
        return False
    return bool(np.abs(computed[:7] - session.rows[first, :7]).max() < SAME)


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
        observer.on(BodyChanged(0, given.setup))
    else:
        again = resimulation(session, observer)
        again.announce()
        if again.scenario.ghost is not None and _begins_at_start(session):
            again.begin_ghost()
    for count, k in enumerate(np.argsort(session.times, kind="stable").tolist()):
        progress(count, len(session.times))
        time_ns, row = int(session.times[k]), session.rows[k]
        if again is None:
            observer.on(Published(time_ns, row))
            continue
        try:
            computed = again.advance(time_ns)
        except InputError:
            # A command that is refused here: from now on only the recorded states are shown.
            computed = row
        # A bag holds of a state what was published of it, and no more.
        alike = bool(session.published) and all(
            np.allclose(PROJECTIONS[name](computed.tolist()), PROJECTIONS[name](row.tolist()), rtol=1e-12, atol=1e-12)
            for name in session.published
        )
        again.publish(time_ns, computed if alike else row)
    if again is not None and all_events:
        with suppress(InputError):
            again.advance(max(again.end_ns, again.simulation.time_ns))
