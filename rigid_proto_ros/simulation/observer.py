# SPDX-License-Identifier: MIT
"""What a running simulation tells to whoever watches it: a viewer, a recorder, a topic, a test; and the log of it all.

Events come from the thread that steps the body; an observer buffers them and returns at once. ``Observer`` itself is
the null object.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.vectors import Attitude, Points, StateRow, Triangles, Vector, Vector3
from .commands import Command

if TYPE_CHECKING:
    from ..motion.body import Body
    from ..motion.loads import Load
    from ..motion.string import StringState
    from .commands import WrenchCommand
    from .setup import Setup

STATE_FIELDS = (
    *("position.x", "position.y", "position.z"),
    *("orientation.x", "orientation.y", "orientation.z", "orientation.w"),
    *("linear_velocity.x", "linear_velocity.y", "linear_velocity.z"),
    *("angular_velocity_body.x", "angular_velocity_body.y", "angular_velocity_body.z"),
)
"""Order of a state row: COM position [m, world], attitude xyzw (body to world), COM velocity [m/s, world], angular
velocity [rad/s, body axes]."""


@dataclass(frozen=True)
class ShownLoad:
    """One command as it acts: ``kind`` is ``wrench``, ``poke``, ``impulse`` or ``thruster``.

    point (3,) [m, body axes from the COM] is where the force attacks; force [N or N s] and torque about that point
    [N m or N m s] are in ``axes``, ``world`` or ``body``.
    """

    kind: str
    axes: str
    point: Vector3
    force: Vector3
    torque: Vector3


def shown_load(kind: str, load: Load, body: Body) -> ShownLoad:
    """A load as observers are told of it."""
    axes = "world" if load.axes == "world" else "body"
    force = np.asarray(load.force) if axes == "world" else load.own_force(body)
    return ShownLoad(kind, axes, load.arm(body), force, np.asarray(load.torque))


class Started(NamedTuple):
    """A run begins: the scene as parameter-file text; vertices (n, 3) [mesh coordinates], triangles (m, 3)."""

    scene: str
    vertices: Points | None
    triangles: Triangles | None
    mesh_sha256: str
    time_ns: int = 0


class Reset(NamedTuple):
    """Simulated time starts again at 0."""

    time_ns: int = 0


class Published(NamedTuple):
    """A state at the time of a publication; ``row`` (13,) float64 in STATE_FIELDS order is reused: copy it."""

    time_ns: int
    row: StateRow


class SceneChanged(NamedTuple):
    """The parameters in force from ``time_ns`` on, as parameter-file text."""

    time_ns: int
    scene: str


class BodyChanged(NamedTuple):
    """The body is the one of this setup from ``time_ns`` on; comes once at the start and again at every change. rotor:
    momentum of its flywheel at that time [N m s, body axes], which the setup's torque drives from then on.
    """

    time_ns: int
    setup: Setup
    rotor: Vector = (0.0, 0.0, 0.0)


class MeshChanged(NamedTuple):
    """The body is drawn as this mesh from ``time_ns`` on; comes before the BodyChanged of the same change."""

    time_ns: int
    vertices: Points | None
    triangles: Triangles | None
    mesh_sha256: str


class LoadBegan(NamedTuple):
    """A wrench or poke begins to act; an impulse acts at this instant and has no end."""

    time_ns: int
    load_id: int
    load: ShownLoad


class LoadEnded(NamedTuple):
    """The load with this id acts no longer."""

    time_ns: int
    load_id: int


class Applied(NamedTuple):
    """A wrench or poke took effect: the command, the load that it came to, the body it acts on, and how that lay then
    (4,) xyzw.
    """

    time_ns: int
    command: WrenchCommand
    load: Load
    body: Body
    attitude: Attitude


class Acted(NamedTuple):
    """A command has acted, of whatever kind."""

    time_ns: int
    command: Command


class StringChanged(NamedTuple):
    """The string is tied like this from ``time_ns`` on, or not at all; comes again at every target. arm (3,) [m, body
    axes]: from the COM to its knot.
    """

    time_ns: int
    string: StringState | None
    arm: Vector3 | None


class Logged(NamedTuple):
    """One JSON line of the event log (command, parameter change, service), as applied."""

    time_ns: int
    line: str


class Refused(NamedTuple):
    """A command was refused."""

    time_ns: int
    reason: str
    message: str


class AccuracyFloor(NamedTuple):
    """Why, since start or reset, the motion is held to less than its accuracy; empty while it isn't."""

    time_ns: int
    floor: str


class GhostChanged(NamedTuple):
    """A second body that gets the same commands is the one of this setup from ``time_ns`` on; None: it is no longer
    shown.
    """

    time_ns: int
    setup: Setup | None


class GhostPublished(NamedTuple):
    """One state of the ghost, after the body's own of the same time; ``row`` as in Published."""

    time_ns: int
    row: StateRow


Event = (
    Started
    | Reset
    | Published
    | SceneChanged
    | BodyChanged
    | MeshChanged
    | LoadBegan
    | LoadEnded
    | Applied
    | Acted
    | StringChanged
    | Logged
    | Refused
    | AccuracyFloor
    | GhostChanged
    | GhostPublished
)


class Observer:
    """Null object, and the interface. takes: the kinds of events that it does anything with; others it ignores."""

    takes: frozenset[type] = frozenset()

    def wants(self, kind: type) -> bool:
        """Whether it would do anything with an event of this kind now; without anybody who does, none is made."""
        return kind in self.takes

    def on(self, event: Event) -> None:
        """An event has happened."""

    def close(self) -> None:
        """No more events follow; whatever is buffered goes out."""


class Observers(Observer):
    """Several observers as one."""

    def __init__(self, *observers: Observer) -> None:
        self._observers = observers
        self.takes = frozenset().union(*(observer.takes for observer in observers))
        self._taking = {kind: [o for o in observers if kind in o.takes] for kind in self.takes}

    def wants(self, kind: type) -> bool:
        """Whether one of them does."""
        return any(observer.wants(kind) for observer in self._taking.get(kind, ()))

    def on(self, event: Event) -> None:
        """To each that takes such events, in their order."""
        for observer in self._taking.get(type(event), ()):
            observer.on(event)

    def close(self) -> None:
        """Each closes."""
        for observer in self._observers:
            observer.close()


# The log of everything that happened to the body
#
# A line is a JSON object with ``time_ns`` (simulated), ``kind``, ``content`` and ``sha256``: the hash of all lines
# since the start or the last reset, this one included, each taken without its own ``sha256`` and ended by a newline.


MOST_NOTED = 10_000
"""Events that may wait to be chained: some megabytes."""


class EventLog:
    """Counts and chains the events of one run. Those that nobody reads as they happen are chained when somebody
    asks; one that isn't ``chained`` only counts until its first line is asked for, and has no hash then if events came
    before.
    """

    def __init__(self, chained: bool = True) -> None:
        self.chained = chained
        self.reset()

    def reset(self) -> None:
        """Start a new chain."""
        self.count = 0
        self._hash: Any = None  # made when the first line is chained
        self._noted: list[tuple[int, Command | tuple[str, dict[str, Any]]]] = []

    @property
    def sha256(self) -> str:
        """Hash of the chain so far, in hex."""
        self._need_chain()
        self._chain_noted()
        return self._hash.hexdigest() if self._hash else hashlib.sha256().hexdigest()

    def append(self, time_ns: int, kind: str, content: Mapping[str, Any]) -> str:
        """Add an event and return its line."""
        self._need_chain()
        self._chain_noted()
        self.count += 1
        line = self._chain(time_ns, kind, content)
        return f'{line[:-1]}, "sha256": "{self._hash.hexdigest()}"}}'

    def note(self, time_ns: int, event: Command | tuple[str, dict[str, Any]]) -> None:
        """Add an event whose line nobody wants now: a command that has acted, or kind and content of another one."""
        self.count += 1
        if not self.chained:
            return
        self._noted.append((time_ns, event))
        if len(self._noted) >= MOST_NOTED:
            self._chain_noted()

    def _need_chain(self) -> None:
        if not self.chained and self.count:
            raise RuntimeError("no chain of events was kept: the simulation began without an observer")
        self.chained = True

    def _chain_noted(self) -> None:
        noted, self._noted = self._noted, []
        for time_ns, event in noted:
            kind, content = event if isinstance(event, tuple) else (event.kind, event.content)
            self._chain(time_ns, kind, content)

    def _chain(self, time_ns: int, kind: str, content: Mapping[str, Any]) -> str:
        line = json.dumps({"time_ns": time_ns, "kind": kind, "content": content})
        self._hash = self._hash or hashlib.sha256()
        self._hash.update((line + "\n").encode())
        return line
