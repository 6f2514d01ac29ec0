# SPDX-License-Identifier: MIT
"""The picture as tracks: what a file for other tools holds of body, ghost and string, by time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import InputError
from ..picture import style
from ..picture.backend import Backend, DrawnMesh
from ..picture.picture import Picture
from ..picture.style import Colour
from ..simulation.observer import BodyChanged, GhostChanged, MeshChanged, StringChanged
from .flight_record import FlightRecord

BODIES = (("body", style.BODY, style.BODY_MESH), ("ghost", style.GHOST, style.GHOST_MESH))
"""Names of what moves, the part of the picture that it is, and that of its mesh."""

WANTED = frozenset({style.GHOST, style.GHOST_MESH, style.STRING})


@dataclass
class _Track:
    """A part's frame at times_ns (n,): positions (n, 3) [m], attitudes (n, 4) xyzw, and scales (n, 3) of those that are
    given one.
    """

    times_ns: list[np.ndarray] = field(default_factory=list)
    positions: list[np.ndarray] = field(default_factory=list)
    attitudes: list[np.ndarray] = field(default_factory=list)
    scales: list[np.ndarray] = field(default_factory=list)


@dataclass(frozen=True)
class MeshSteps:
    """The mesh of a part: from each of times_ns (n,) on it has the scales and positions (n, 3)."""

    surface: DrawnMesh
    times_ns: np.ndarray
    scales: np.ndarray
    positions: np.ndarray


class Tracks(Backend):
    """Keeps what is drawn. size: the least of the body's sizes [m]. string: per time its free end and its knot (2, 3),
    or None.
    """

    def __init__(self) -> None:
        self.size = 0.0
        self.string: dict[int, np.ndarray | None] = {}
        self._places: dict[str, _Track] = {}
        self._meshes: dict[str, DrawnMesh] = {}
        self._times = np.zeros(0, np.int64)

    def begin(self, times_ns: np.ndarray) -> None:
        """What follows is of these times (n,) [ns]."""
        self._times = times_ns

    def resize(self, size: float) -> None:
        """Keep the least."""
        self.size = min(size, self.size or size)

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Keep the mesh; raises InputError for another one in flight."""
        if surface is None:
            return
        if self._meshes.setdefault(name, surface) is not surface:
            reason = f"the mesh changes at {self._times[0] / 1e9:.9g} s"
            raise InputError("session", reason, "a flight of one mesh, for --gltf and --usd")

    def place(
        self,
        name: str,
        positions: np.ndarray | None = None,
        attitudes: np.ndarray | None = None,
        scale: np.ndarray | None = None,
    ) -> None:
        """Keep the part's frame."""
        track = self._places.setdefault(name, _Track())
        track.times_ns.append(self._times)
        if positions is not None:
            track.positions.append(positions)
        if attitudes is not None:
            track.attitudes.append(attitudes)
        if scale is not None:
            track.scales.append(np.tile(scale, (len(self._times), 1)))

    def lines(
        self,
        name: str,
        counts: np.ndarray,
        strips: Sequence[np.ndarray],
        colours: Sequence[Colour] | None = None,  # noqa: ARG002 (a backend gets it)
    ) -> None:
        """Keep the ends of the string."""
        if name == style.STRING:
            rest = iter(strips)
            for time_ns, count in zip(self._times.tolist(), counts.tolist(), strict=True):
                self.string[time_ns] = next(rest)[[0, -1]] if count else None

    def poses(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,) [ns], positions (n, 3) and unit quaternions (n, 4) of a body; of none there are none."""
        track = self._places.get(name)
        if track is None:
            return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4))
        times_ns, positions, attitudes = map(np.concatenate, (track.times_ns, track.positions, track.attitudes))
        return times_ns, positions, attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)

    def mesh_steps(self, name: str) -> MeshSteps | None:
        """The mesh of a part; None of a body without one."""
        if name not in self._meshes:
            return None
        track = self._places[name]
        times_ns, positions, scales = map(np.concatenate, (track.times_ns, track.positions, track.scales))
        # Of several at one time the last counts.
        last = np.append(times_ns[1:] > times_ns[:-1], True)
        return MeshSteps(self._meshes[name], times_ns[last], scales[last], positions[last])


def tracks_of(record: FlightRecord) -> Tracks:
    """The flight's picture: body, ghost and string. At the time of a change the state is the one before it, and so is
    what is drawn.
    """
    tracks = Tracks()
    picture = Picture(tracks, WANTED.__contains__, rate=1_000_000_000)
    start_ns, drawn_ns = int(record.times_ns[0]), -1.0

    def draw(until_ns: float) -> None:
        picture.draw(*record.states.between(drawn_ns, until_ns))
        if picture.ghost is not None:
            picture.draw_ghost(*record.ghosts.between(drawn_ns, until_ns))

    for event in record.changes:
        if event.time_ns > start_ns:
            if isinstance(event, StringChanged):
                event = event._replace(time_ns=event.time_ns + 1)
            elif isinstance(event, MeshChanged | BodyChanged | GhostChanged):
                draw(event.time_ns)
                drawn_ns = event.time_ns
        picture.on(event)
    draw(np.inf)
    return tracks
