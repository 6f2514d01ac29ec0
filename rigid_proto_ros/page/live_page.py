# SPDX-License-Identifier: MIT
"""The page of a running node. A child process (watchers.py) handles sockets, so that neither its speed nor its failure
affects the physics thread. The physics thread only copies a state, about thirty times a second while a page is visible,
and queues events. Slow pipes, a slow child and slow browsers block other threads only.

A picture consists of scene number, number of loads of the body, whether there is a ghost, and number of loads of the
ghost (4 numbers of 4 bytes), then the body's FLIGHT (simulation/flight.py) and its acting loads, LOAD_ROW each, and the
same of the ghost. The page has the same kernels, hence the same records, and draws from them.
"""

from __future__ import annotations

import base64
import json
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

from ..base.bundled import body_names
from ..base.errors import InputError
from ..base.interrupts import with_this_package
from ..live.live_simulation import LiveSimulation
from ..parameters.declarations import PARAMETERS, READ_ONLY, parameter_named
from ..scene.scenario import Scenario, make_scenario
from ..scene.script import entry_of
from ..simulation.commands import Command, MoveString, ReleaseString
from ..simulation.observer import (
    Acted,
    BodyChanged,
    Event,
    Observer,
    Published,
    Refused,
    Reset,
    SceneChanged,
)
from .bundle import built_page
from .data import is_of_page, page_version
from .file import FORM, mesh_numbers
from .watchers import (
    ANSWERS,
    BROADCAST,
    COMMAND,
    LOG,
    LOOKING,
    PICTURE,
    read_frame,
    write_frame,
)

PICTURE_S = 1 / 30
"""Period of pictures while a page is visible [s]."""

STARTING_S = 20.0
"""Timeout of the child's start [s]."""

MOST_MESH = 24_000_000
"""Largest mesh as text [bytes]; a larger mesh isn't shown."""

MOST_EVENTS = 1024
"""Capacity of the event queue; when it is full, the oldest events are dropped."""

KEPT = ("record", "publish_rate", "publish_clock", "publish_tf", "imu_contact", "schedule_horizon", "real_time_factor")
"""Parameters that keep their values when another scene is started; they affect the observation, not the motion."""

ENTRY = frozenset({"at", "force", "push", "torque", "axes", "duration", "slot", "impulse", "angular_impulse"})
KINDS = frozenset({"wrench", "string", "set", "state", "service"})
"""Keys that a page's script entry may have; time and repetition are not among them."""

_HEAD = struct.Struct("<4I")


class _EventQueue(Observer):
    """Queues observer events on the physics thread. looking: whether a page is visible; only then are events queued."""

    takes = frozenset({BodyChanged, SceneChanged, Acted, Refused, Reset})

    def __init__(self) -> None:
        self.events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self.scene_changed = True
        self.looking = False

    def on(self, event: Event) -> None:
        """Queue the event, or note that the scene has changed."""
        if isinstance(event, BodyChanged | SceneChanged):
            self.scene_changed = True
        elif self.looking:
            self.events.append(event)


class _GhostWatcher(Observer):
    """Takes states, because the simulation computes the scene's ghost only for an observer of states."""

    takes = frozenset({Published})


class LivePage:
    """Serves the page until ``close`` or the end of this process. port: None for the first free port from the default
    on. say(line): logs a line. address: the owner's address; guests: the address for others in the network, or "".

    Raises InputError if the page can't be built or the port can't be opened.
    """

    def __init__(
        self,
        live: LiveSimulation,
        port: int | None,
        host: str,
        say: Callable[[str], None],
    ) -> None:
        self._live, self._say = live, say
        self._queue, self._ghost_watcher, self._watches_ghost = _EventQueue(), _GhostWatcher(), False
        # Sent before the next picture, or at once while no page is visible.
        self._answers: deque[dict[str, Any]] = deque()
        self._due, self._closed = threading.Event(), False
        self._scene_number = 0
        self._mesh_sha256: str | None = None
        self._pace: dict[str, Any] = {}
        self._last = b""
        self._holds = False
        self._writing = threading.Lock()
        about = {"name": live.name, "version": page_version()}
        listen = {"host": host, "port": port, "default": PARAMETERS["workbench_port"].default}
        settings = {"page": str(built_page()), "about": about, **listen}
        self._child = subprocess.Popen(
            [sys.executable, "-m", "rigid_proto_ros.page.watchers", json.dumps(settings)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=with_this_package(),
        )
        self.address, self.guests = self._listens()
        threading.Thread(target=self._read, name="page commands", daemon=True).start()
        live.add_observer(self._queue)
        threading.Thread(target=self._send, name="page pictures", daemon=True).start()

    def _listens(self) -> tuple[str, str]:
        """Wait until the child listens; returns the addresses for the owner and for others. Raises InputError."""
        assert self._child.stdout is not None
        timeout = threading.Timer(STARTING_S, self._child.kill)
        timeout.start()
        frame = read_frame(self._child.stdout)
        timeout.cancel()
        found = {} if frame is None else json.loads(frame[1])
        if "address" in found:
            return found["address"], found["guests"]
        self.close()
        raise InputError(*found.get("refused", ("workbench_port", "the page's process doesn't start")))

    def close(self) -> None:
        """Close all pages."""
        self._closed = True
        self._due.set()
        # Killed, since it has no state to save, and a thread may be blocked writing to it.
        self._child.kill()
        self._child.wait()

    # To the pages

    def _put(self, kind: int, content: bytes | Mapping[str, Any] | Sequence[Any]) -> None:
        text = content if isinstance(content, bytes) else json.dumps(content).encode()
        with self._writing, suppress(OSError, ValueError):  # the child has ended, which the reading thread reports
            assert self._child.stdin is not None
            write_frame(self._child.stdin, kind, text)

    def _broadcast(self, key: str, content: Any) -> None:
        self._put(BROADCAST, {key: content})

    def _send(self) -> None:
        """Send answers, and, while a page is visible, changes and pictures."""
        with suppress(InputError):  # the simulation has ended
            while not self._closed:
                if self._answers:
                    self._put(ANSWERS, [self._answers.popleft() for _ in range(len(self._answers))])
                if not self._queue.looking:
                    self._due.wait()
                    self._due.clear()
                    continue
                self._broadcast_changes()
                picture = self._live.call(self._picture)
                if picture != self._last:
                    self._last = picture
                    self._put(PICTURE, picture)
                time.sleep(PICTURE_S)

    def _picture(self) -> bytes:
        """The picture of the present state; called on the physics thread."""
        loop = self._live.loop
        simulation, ghost = loop.simulation, loop.ghost
        body, beside, loads = simulation.memory, b"", 0
        if ghost is not None and self._live.scenario.ghost is not None:
            if not ghost.simulation.failure:
                ghost.simulation.advance(simulation.time_ns)
            beside, loads = ghost.simulation.memory, len(ghost.simulation.acting)
        head = _HEAD.pack(self._scene_number, len(simulation.acting), bool(beside), loads)
        return head + body + beside

    def _broadcast_changes(self) -> None:
        loop = self._live.loop
        factor = float(self._live.scenario.parameters.real_time_factor)
        pace = {"paused": loop.paused, "rate": factor, "failure": loop.simulation.failure}
        if self._queue.scene_changed:
            self._queue.scene_changed = False
            self._live.call(self._take_scene)
            self._broadcast_scene()
        if pace != self._pace:
            self._pace = pace
            self._broadcast("time", pace)
        events = self._queue.events
        done: list[dict[str, Any]] = []
        while events:
            event = events.popleft()
            match event:
                case Reset():
                    done.clear()
                    self._broadcast("reset", True)
                case Refused(message=message):
                    self._broadcast("said", message)
                case Acted(time_ns, command):
                    done += _as_entry(time_ns, command)
        if done:
            self._broadcast("done", done)

    def _take_scene(self) -> None:
        """Take the scene of the following pictures; called on the physics thread."""
        self._scenario: Scenario = self._live.scenario
        self._scene_number += 1

    def _broadcast_scene(self) -> None:
        scenario = self._scenario
        body_mesh = scenario.body_mesh
        sha256 = body_mesh.mesh.sha256 if body_mesh is not None else ""
        if sha256 != self._mesh_sha256:
            self._mesh_sha256 = sha256
            is_bundled = scenario.parameters.mesh in body_names()
            mesh = None if body_mesh is None or is_bundled else mesh_numbers(body_mesh, _shown_name(scenario))
            if mesh is not None and len(mesh["vertices"]) + len(mesh["triangles"]) > MOST_MESH:
                mesh = None
                self._say(f"the page doesn't show a mesh of more than {MOST_MESH // 1_000_000} MB")
            self._broadcast("mesh", mesh)
        values = {name: value for name, value in scenario.parameters.named().items() if _is_settable(name)}
        values["mesh"] = _shown_name(scenario)
        record = base64.b64encode(scenario.setup.scene.tobytes()).decode()
        ghost = scenario.ghost
        of_ghost = base64.b64encode(ghost.scene.tobytes()).decode() if ghost is not None else ""
        scene = {"number": self._scene_number, "form": FORM, "values": values, "record": record, "ghost": of_ghost}
        self._watch_ghost(ghost is not None)
        self._broadcast("scene", scene)

    def _watch_ghost(self, on: bool) -> None:
        if on == self._watches_ghost:
            return
        self._watches_ghost = on
        if not on:
            self._live.remove_observer(self._ghost_watcher)
            return
        self._live.add_observer(self._ghost_watcher)

        def begin() -> None:
            # At time 0 the ghost has missed no command and can start now; later it starts at the next reset.
            if self._live.loop.ghost is None and self._live.loop.simulation.time_ns == 0:
                self._live.loop.begin_ghost()

        self._live.call(begin)

    # From the pages

    def _read(self) -> None:
        assert self._child.stdout is not None
        while (frame := read_frame(self._child.stdout)) is not None:
            kind, content = frame
            if kind == COMMAND:
                self._execute(json.loads(content))
            elif kind == LOOKING:
                self._set_looking(json.loads(content))
            elif kind == LOG:
                self._say(content.decode())
        self._set_looking(False)
        if not self._closed:
            self._say("the page's process has ended, and the node goes on without it")
        if self._holds:
            with suppress(InputError):  # the simulation has ended
                self._release()

    def _set_looking(self, looking: bool) -> None:
        self._queue.looking = looking
        self._last = b""  # a page that becomes visible needs a picture
        self._due.set()

    def _execute(self, command: Mapping[str, Any]) -> None:
        """Execute a page's command. Entries are posted without waiting for their result: a drag sends sixty per second,
        and waiting for another thread takes as long as the entry itself.
        """
        try:
            match command:
                case {"entry": {"string": "release"}}:
                    self._release()
                case {"entry": entry}:
                    check_entry(entry, self._live.scenario.parameters.mesh)
                    self._holds |= "string" in entry
                    acts = self._live.scheduling(json.dumps([{"t": 0, **entry}]))
                    self._live.post(acts).add_done_callback(lambda acted: self._answer_entry(command, acted))
                    return
                case {"begin": values}:
                    self._begin(values)
                case {"time": "pause" | "resume" as what}:
                    self._live.pause(what == "pause")
                case {"time": "step"}:
                    self._live.step()
                case {"time": "reset"}:
                    self._live.reset()
        except Exception as error:  # sent to the page; later commands are still executed
            self._answer(command, error)
        else:
            self._answer(command)

    def _answer_entry(self, command: Mapping[str, Any], acted: Future[None]) -> None:
        if not acted.cancelled():  # cancelled when the simulation ends
            self._answer(command, acted.exception())

    def _answer(self, command: Mapping[str, Any], error: BaseException | None = None) -> None:
        refusal = None if error is None else str(error)
        if not (error is None or isinstance(error, InputError)):  # a bug
            traceback.print_exception(error)
            refusal = f"{type(error).__name__}: {error}"
        self._answers.append({"watcher": command["watcher"], "answer": command["id"], "refusal": refusal})
        if not self._queue.looking:
            self._due.set()

    def _release(self) -> None:
        self._holds = False
        self._live.submit(ReleaseString())

    def _begin(self, values: Mapping[str, Any]) -> None:
        """Start another scene; parameters of the node keep their values."""
        check_values(values, "")
        in_force = self._live.scenario.parameters.named()
        own = {name: in_force[name] for name in in_force if name in KEPT or _is_of_the_node(name)}
        scenario = make_scenario({**values, **own})
        was_paused = self._live.paused
        # Paused while the scene is replaced, so that the new scene starts exactly at its time 0.
        self._live.pause(True)
        try:
            self._live.begin(scenario)
        finally:
            self._live.pause(was_paused)


def _as_entry(time_ns: int, command: Command) -> list[dict[str, Any]]:
    """A command that has acted, as script entries; moves of the string's end are in the pictures instead."""
    if isinstance(command, MoveString):
        return []
    with suppress(InputError):  # not expressible as an entry
        return [{"t": time_ns / 1e9, **entry_of(command)}]
    return []


def check_entry(entry: Mapping[str, Any], mesh: str) -> None:
    """Raises InputError for an entry that a page may not send. mesh: the present one's name."""
    unknown = sorted(entry.keys() - ENTRY - KINDS)
    if unknown:
        raise InputError("entry", unknown[0], f"of a page: {', '.join(sorted(ENTRY | KINDS))}")
    if entry.get("service", "clear_wrench") != "clear_wrench":
        raise InputError("service", entry["service"], "clear_wrench")
    if isinstance(entry.get("set"), Mapping):
        check_values(entry["set"], mesh)


def check_values(values: Mapping[str, Any], mesh: str) -> None:
    """Raises InputError for values that a page may not set."""
    for name, value in values.items():
        if not _is_settable(name):
            raise InputError(name, value, "a parameter of body and motion; others are set at the node")
        if name == "mesh" and value not in ("", mesh, *body_names()):
            raise InputError(
                name, value, f"a bundled body, one of {', '.join(body_names())}; files are opened at the node"
            )


def _is_settable(name: str) -> bool:
    """Whether pages show and may set this parameter. Only ``mesh`` names a file, and pages may only name
    bundled ones.
    """
    return is_of_page(name) or name == "real_time_factor"


def _shown_name(scenario: Scenario) -> str:
    """The mesh's name without its folder."""
    return scenario.parameters.mesh.replace("\\", "/").rpartition("/")[2]


def _is_of_the_node(name: str) -> bool:
    """Whether a parameter belongs to the running program and not to the scene."""
    return parameter_named(name).changes == READ_ONLY and not name.startswith(("contacts.", "thrusters."))
