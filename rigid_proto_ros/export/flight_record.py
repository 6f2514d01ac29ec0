# SPDX-License-Identifier: MIT
"""What an export needs of a flight: an observer that keeps its states, bodies, meshes, ghost and string."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.errors import InputError
from ..picture.surface import shaded_surface
from ..simulation.observer import (
    BodyChanged,
    BodySnapshot,
    Event,
    GhostChanged,
    LoadBegan,
    LoadEnded,
    MeshChanged,
    Observer,
    Published,
    ShownString,
    Started,
    StringChanged,
)


@dataclass(frozen=True)
class DrawnBody:
    """The body from ``time_ns`` on, drawn as mesh number ``mesh`` of the record; −1 without a mesh."""

    time_ns: int
    mesh: int
    body: BodySnapshot


@dataclass(frozen=True)
class DrawnMesh:
    """vertices (n, 3) [mesh coordinates] and triangles (m, 3), wound outward."""

    vertices: np.ndarray
    triangles: np.ndarray

    @cached_property
    def centre(self) -> np.ndarray:
        """The middle (3,) of its box [mesh coordinates]."""
        return 0.5 * (self.vertices.min(axis=0) + self.vertices.max(axis=0))

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points, triangles and normals as ``shaded_surface`` has them, about the centre: single precision has no
        digits for a mesh far from its origin.
        """
        return shaded_surface(self.vertices - self.centre, self.triangles)


class FlightRecord(Observer):
    """One run as arrays, kept while it is told.

    bodies and ghosts: each DrawnBody in the order of time. strings: (time_ns, ShownString or None). breaks: times [ns]
    at which a load begins or ends, where velocities may jump.
    """

    takes = frozenset({Started, MeshChanged, BodyChanged, GhostChanged, Published, LoadBegan, LoadEnded, StringChanged})

    def __init__(self) -> None:
        self.bodies: list[DrawnBody] = []
        self.ghosts: list[DrawnBody] = []
        self.meshes: list[DrawnMesh] = []
        self.strings: list[tuple[int, ShownString | None]] = []
        self.breaks: list[int] = []
        self._mesh = -1
        self._times: list[int] = []
        self._rows: list[np.ndarray] = []

    @property
    def times_ns(self) -> np.ndarray:
        """Times (n,) int64 [ns] of the states; raises InputError where there are none."""
        if not self._times:
            raise InputError("session", "it has no states to export")
        return np.array(self._times, dtype=np.int64)

    @property
    def rows(self) -> np.ndarray:
        """The states (n, 13) in STATE_FIELDS order."""
        return np.array(self._rows).reshape(-1, 13)

    def on(self, event: Event) -> None:
        """Keep it. Of two states at one time, as a bag may hold them, the first is kept."""
        match event:
            case Published(time_ns, row):
                if not self._times or time_ns > self._times[-1]:
                    self._times.append(time_ns)
                    self._rows.append(np.array(row, dtype=float))
            case Started(vertices=vertices, triangles=triangles) | MeshChanged(vertices=vertices, triangles=triangles):
                self._take_mesh(vertices, triangles)
            case BodyChanged(time_ns, body):
                self.bodies.append(DrawnBody(time_ns, self._mesh, body))
            case GhostChanged(time_ns, body):
                self.ghosts.append(DrawnBody(time_ns, self._mesh, body))
            case LoadBegan(time_ns=time_ns) | LoadEnded(time_ns=time_ns):
                self.breaks.append(time_ns)
            case StringChanged(time_ns, string):
                self.strings.append((time_ns, string))

    def _take_mesh(self, vertices: np.ndarray | None, triangles: np.ndarray | None) -> None:
        self._mesh = -1
        if vertices is not None and triangles is not None and len(triangles):
            self._mesh = len(self.meshes)
            self.meshes.append(DrawnMesh(np.array(vertices, dtype=float), np.array(triangles)))
