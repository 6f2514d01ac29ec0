# SPDX-License-Identifier: MIT
"""Tracks of body, ghost and string, frame by frame, for files of other tools."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray, Points, Vector3
from ..picture import style
from ..picture.backend import Backend, DrawnMesh
from ..picture.picture import Picture
from ..picture.style import Colour
from .flight_record import FlightRecord

BODIES = {"body": style.BODY, "ghost": style.GHOST}
"""Moving parts of the picture, by their names in a file."""
MESHES = {style.BODY: style.BODY_MESH, style.GHOST: style.GHOST_MESH}

WANTED = frozenset({style.GHOST, style.GHOST_MESH, style.STRING})


@dataclass(frozen=True)
class Track:
    """A body at times_ns (n,): positions (n, 3) [m] and unit quaternions (n, 4). surface: its mesh, or None;
    mesh_places [m], mesh_scales (n, 3): the mesh in the body's frame, scale 0 where it isn't shown.
    """

    times_ns: IntArray
    positions: Points
    attitudes: FloatArray
    mesh_places: Points
    mesh_scales: Points
    surface: DrawnMesh | None


class Tracks(Backend):
    """Collects what is drawn. size: the smallest of the body's sizes [m]. string: by time, its free end and knot (2,
    3), or None.
    """

    def __init__(self) -> None:
        self.size = 0.0
        self.string: dict[int, Points | None] = {}
        self._surfaces: dict[str, DrawnMesh] = {}
        self._mesh_in_force: dict[str, tuple[Vector3, Vector3]] = {}
        self._drawn: dict[str, list[tuple[IntArray, Points, FloatArray, Points, Points]]] = {}
        self._times = np.zeros(0, np.int64)

    def begin(self, times_ns: IntArray) -> None:
        """Set the times (n,) [ns] of the following calls."""
        self._times = times_ns

    def resize(self, size: float) -> None:
        """Keep the smallest size."""
        self.size = min(size, self.size or size)

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Keep the mesh, and the time from which an ended ghost is hidden. Raises InputError if the mesh changes, or
        the body's is removed, in flight.
        """
        if name == style.GHOST_MESH and style.GHOST in self._drawn:
            _, positions, attitudes, _, scales = self._drawn[style.GHOST][-1]
            if surface is None or not scales.any():
                nothing = np.zeros((1, 3))
                self._drawn[style.GHOST].append((self._times, positions[-1:], attitudes[-1:], nothing, nothing))
        gone = surface is None and name == style.BODY_MESH and name in self._surfaces
        if gone or (surface is not None and self._surfaces.setdefault(name, surface) is not surface):
            reason = f"the mesh changes at {self._times[0] / 1e9:.9g} s"
            raise InputError("session", reason, "a simulation without a change of mesh, for --gltf and --usd")

    def place(
        self,
        name: str,
        positions: Points | None = None,
        attitudes: FloatArray | None = None,
        scale: Vector3 | None = None,
    ) -> None:
        """Keep the pose of a mesh relative to its body, or the body's frames."""
        if name in MESHES.values() and positions is not None and scale is not None:
            self._mesh_in_force[name] = positions[0], scale
        elif name in MESHES and positions is not None and attitudes is not None:
            in_force = self._mesh_in_force.get(MESHES[name], (np.zeros(3), np.ones(3)))
            meshes = [np.tile(value, (len(positions), 1)) for value in in_force]
            unit = attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)
            self._drawn.setdefault(name, []).append((self._times, positions, unit, *meshes))
            self.string |= dict.fromkeys(self._times.tolist()) if name == style.BODY else {}

    def lines(
        self,
        name: str,
        counts: IntArray,
        strips: Sequence[Points],
        colours: Sequence[Colour] | None = None,  # noqa: ARG002 (a backend gets it)
    ) -> None:
        """Keep the ends of the string."""
        if name == style.STRING:
            rest = iter(strips)
            for time_ns, count in zip(self._times.tolist(), counts.tolist(), strict=True):
                self.string[time_ns] = next(rest)[[0, -1]] if count else None

    def track(self, part: str) -> Track | None:
        """The track of a part in BODIES; None if it isn't drawn."""
        if part not in self._drawn:
            return None
        times_ns, *rest = map(np.concatenate, zip(*self._drawn[part], strict=True))
        positions, attitudes, places, scales = rest
        return Track(times_ns, positions, attitudes, places, scales, self._surfaces.get(MESHES[part]))


def tracks_of(record: FlightRecord) -> Tracks:
    """The tracks of a flight. A state at the time of a change is the one before the change, and is drawn so."""
    tracks = Tracks()
    picture = Picture(tracks, WANTED.__contains__, rate=1_000_000_000)
    times_ns, rows = record.times_ns, record.rows
    ghost_times_ns = np.array(list(record.ghosts), np.int64)
    ghost_rows = np.array(list(record.ghosts.values())).reshape(-1, 13)
    drawn = ghosts_drawn = 0
    for event in [*record.changes, None]:
        last_ns = np.inf if event is None else event.time_ns
        if last_ns > times_ns[0]:
            end, ghosts_end = (
                np.searchsorted(times_ns, last_ns, "right"),
                np.searchsorted(ghost_times_ns, last_ns, "right"),
            )
            picture.draw(times_ns[drawn:end], rows[drawn:end])
            if picture.ghost is not None:
                picture.draw_ghost(ghost_times_ns[ghosts_drawn:ghosts_end], ghost_rows[ghosts_drawn:ghosts_end])
            drawn, ghosts_drawn = end, ghosts_end
        if event is not None:
            picture.on(event)
    return tracks
