# SPDX-License-Identifier: MIT
"""What a running simulation tells to whoever watches it: a viewer, a recorder, a test.

The producer calls these methods from the thread that steps the body; an implementation buffers and returns at once.
``Observer`` itself is the null object: a run that nobody watches calls nothing else.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ..motion.body import Body
    from ..motion.loads import Load
    from .commands import WrenchCommand

STATE_FIELDS = (
    *("position.x", "position.y", "position.z"),
    *("orientation.x", "orientation.y", "orientation.z", "orientation.w"),
    *("linear_velocity.x", "linear_velocity.y", "linear_velocity.z"),
    *("angular_velocity_body.x", "angular_velocity_body.y", "angular_velocity_body.z"),
)
"""Order of a state row: COM position [m, world], attitude xyzw (body to world), COM velocity [m/s, world], angular
velocity [rad/s, body axes]."""


@dataclass(frozen=True)
class BodySnapshot:
    """The body as it is from some simulated time on.

    mass [kg], center_of_mass (3,) [m, mesh axes, after ``scale``], inertia (3, 3) [kg m², about the COM, body axes],
    scale (3,), gravity (3,) [m/s², world], inertia_model by name, integrator by name, gyroscopic as configured.
    """

    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray
    scale: np.ndarray
    gravity: np.ndarray
    inertia_model: str
    integrator: str
    gyroscopic: bool = True


@dataclass(frozen=True)
class ShownLoad:
    """One command as it acts: ``kind`` is ``wrench``, ``poke``, ``impulse`` or ``thruster``.

    point (3,) [m, body axes from the COM] is where the force attacks; force [N or N s] and torque about that point
    [N m or N m s] are in ``axes``, ``world`` or ``body``.
    """

    kind: str
    axes: str
    point: np.ndarray
    force: np.ndarray
    torque: np.ndarray


@dataclass(frozen=True)
class ShownString:
    """A tied string. attach (3,) [m, body axes from the COM] is the knot; the free end goes evenly from ``origin`` at
    begin_ns to ``target`` at end_ns (3,) [m, world] and stays there. stiffness [N/m], damping [N s/m], rest_length [m];
    a ``bilateral`` one also pushes.
    """

    attach: np.ndarray
    origin: np.ndarray
    target: np.ndarray
    begin_ns: int
    end_ns: int
    stiffness: float
    damping: float
    rest_length: float
    bilateral: bool

    def free_end(self, times_ns: np.ndarray) -> np.ndarray:
        """Places (n, 3) [m, world] of the free end at times (n,) [ns]."""
        lasts_ns = self.end_ns - self.begin_ns
        done = np.clip((times_ns - self.begin_ns) / lasts_ns, 0.0, 1.0) if lasts_ns > 0 else np.ones(len(times_ns))
        return self.origin + done[:, np.newaxis] * (np.asarray(self.target, dtype=float) - self.origin)


class Observer:
    """Null object, and the interface: override what is of interest."""

    def started(self, scene: str, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str) -> None:
        """A run begins: the scene as parameter-file text; vertices (n, 3) [mesh coordinates], triangles (m, 3)."""

    def scene_changed(self, time_ns: int, scene: str) -> None:
        """The parameters in force from ``time_ns`` on, as parameter-file text; also right after ``started``."""

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        """The body is this one from ``time_ns`` on; called once at the start and again at every change."""

    def mesh_changed(
        self, time_ns: int, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str
    ) -> None:
        """The body is drawn as this mesh from ``time_ns`` on; before the ``body_changed`` of the same change."""

    def state(self, time_ns: int, row: np.ndarray) -> None:
        """One published state; ``row`` (13,) float64 in STATE_FIELDS order is reused by the caller: copy it."""

    def load_began(self, time_ns: int, load_id: int, load: ShownLoad) -> None:
        """A wrench or poke begins to act; an impulse acts at this instant and has no end."""

    def load_ended(self, time_ns: int, load_id: int) -> None:
        """The load with this id acts no longer."""

    def applied(self, time_ns: int, command: WrenchCommand, load: Load, body: Body, attitude: np.ndarray) -> None:
        """A wrench or poke took effect: the WrenchCommand, the Load that it came to, the Body it acts on, and how
        that lay then (4,) xyzw.
        """

    def string_changed(self, time_ns: int, string: ShownString | None) -> None:
        """The string is tied like this from ``time_ns`` on, or not at all; again at every target."""

    def event(self, time_ns: int, line: str) -> None:
        """One JSON line of the event log (command, parameter change, service), as applied."""

    def wants_events(self) -> bool:
        """Whether it would do anything with the line of an event now; without anybody who does, none is written."""
        return listens(self, "event")

    def refused(self, time_ns: int, reason: str, message: str) -> None:
        """A command was refused."""

    def status(self, time_ns: int, track: str, value: str) -> None:
        """From ``time_ns`` on ``track`` is ``value``, such as motion: flying, sleeping, paused; string: taut, slack."""

    def effort(self, time_ns: int, steps: int, force_evaluations: int) -> None:
        """What the motion has cost since start or reset, some times a simulated second."""

    def ghost_began(self, time_ns: int, ghost: BodySnapshot) -> None:
        """A second body that gets the same commands is this one from ``time_ns`` on."""

    def ghost_state(self, time_ns: int, row: np.ndarray) -> None:
        """One state of the ghost, after the body's own of the same time; ``row`` as for ``state``."""

    def reset(self) -> None:
        """Simulated time starts again at 0."""

    def close(self) -> None:
        """No more calls follow; whatever is buffered goes out."""


class Observers(Observer):
    """Several observers as one; a method that only one of them implements is that one's own."""

    def __init__(self, *observers: Observer) -> None:
        self._observers = observers
        for name in _METHODS:
            methods = [getattr(observer, name) for observer in observers if listens(observer, name)]
            if len(methods) == 1:
                setattr(self, name, methods[0])
            elif methods:
                setattr(self, name, _in_turn(methods))

    def wants_events(self) -> bool:
        """Whether one of them does."""
        return any(observer.wants_events() for observer in self._observers)


def listens(observer: Observer, method: str) -> bool:
    """Whether the observer does anything with a method of the interface."""
    return method in methods_used_by(observer)


def methods_used_by(observer: Observer) -> frozenset[str]:
    """The methods of the interface that the observer does anything with, among other names."""
    of_its_kind = _methods_of(type(observer))  # type: ignore[arg-type]  # a protocol's class has a hash as every class has
    own = vars(observer)
    return of_its_kind.union(own) if own else of_its_kind


def ignores_events(observer: Observer) -> bool:
    """Whether the observer never wants the line of an event."""
    asked = type(observer).wants_events is not Observer.wants_events
    return not asked and "event" not in methods_used_by(observer)


@functools.cache
def _methods_of(kind: type[Observer]) -> frozenset[str]:
    """The methods of the interface that a kind of observer has of its own."""
    return frozenset(name for name in _METHODS if getattr(kind, name) is not getattr(Observer, name))


def _in_turn(methods: Sequence[Callable[..., None]]) -> Callable[..., None]:
    def call(*arguments: Any) -> None:
        for method in methods:
            method(*arguments)

    return call


_METHODS = [name for name in vars(Observer) if not name.startswith("_") and name != "wants_events"]
