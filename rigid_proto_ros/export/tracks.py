# SPDX-License-Identifier: MIT
"""The picture as tracks: what a file for other tools holds of it, by part and time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..picture import style
from ..picture.backend import Backend, DrawnMesh
from ..picture.style import Colour
from .flight_record import FlightRecord

PARTS = {
    "ghost": (style.GHOST, style.GHOST_MESH),
    "string": (style.STRING,),
    "trail": (style.COM_TRAIL,),
}
"""What may be drawn beside the body, and the picture's parts that it is."""


@dataclass
class Track:
    """A part's frame at times_ns (n,): positions (n, 3) [m], attitudes (n, 4) xyzw, and scales (n, 3) of those that are
    given one.
    """

    times_ns: list[np.ndarray] = field(default_factory=list)
    positions: list[np.ndarray] = field(default_factory=list)
    attitudes: list[np.ndarray] = field(default_factory=list)
    scales: list[np.ndarray] = field(default_factory=list)


@dataclass(frozen=True)
class MeshSteps:
    """One mesh of a part: from each of times_ns (n,) on it has the scales and positions (n, 3), scale 0 while another
    one is drawn.
    """

    surface: DrawnMesh
    times_ns: np.ndarray
    scales: np.ndarray
    positions: np.ndarray


class Tracks(Backend):
    """Keeps what is drawn. string: per time the points (p, 3) of the string, or None; trail: points (m, 3)."""

    def __init__(self) -> None:
        self.size = 0.0
        """The least of the body's sizes [m]."""
        self.string: dict[int, np.ndarray | None] = {}
        self._places: dict[str, Track] = {}
        self._meshes: dict[str, list[tuple[int, DrawnMesh | None]]] = {}
        self._trail: list[np.ndarray] = []
        self._times = np.zeros(0, np.int64)

    def begin(self, times_ns: np.ndarray) -> None:
        """What follows is of these times (n,) [ns]."""
        self._times = times_ns

    def resize(self, size: float) -> None:
        """Keep the least."""
        self.size = min(size, self.size or size)

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Another mesh from now on."""
        self._meshes.setdefault(name, []).append((int(self._times[0]), surface))

    def place(
        self,
        name: str,
        positions: np.ndarray | None = None,
        attitudes: np.ndarray | None = None,
        scale: np.ndarray | None = None,
    ) -> None:
        """Keep the part's frame."""
        track = self._places.setdefault(name, Track())
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
        """Keep the string."""
        if name == style.STRING:
            rest = iter(strips)
            for time_ns, count in zip(self._times.tolist(), counts.tolist(), strict=True):
                self.string[time_ns] = next(rest) if count else None

    def points(self, name: str, counts: np.ndarray, positions: np.ndarray) -> None:  # noqa: ARG002 (a backend gets it)
        """Keep the path of the centre of mass."""
        if name == style.COM_TRAIL:
            self._trail.append(positions)

    @property
    def trail(self) -> np.ndarray:
        """Its points (m, 3) [m]."""
        return np.concatenate(self._trail) if self._trail else np.zeros((0, 3))

    def poses(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (n,) [ns], positions (n, 3) and attitudes (n, 4) of a body; of none there are none."""
        track = self._places.get(name, Track())
        if not track.times_ns:
            return np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4))
        return np.concatenate(track.times_ns), np.concatenate(track.positions), np.concatenate(track.attitudes)

    def meshes(self, name: str) -> list[MeshSteps]:
        """The meshes of a part, in the order in which they are drawn."""
        drawn = self._meshes.get(name, [])
        track = self._places.get(name)
        if track is None:
            return []
        times_ns, positions, scales = (np.concatenate(part) for part in (track.times_ns, track.positions, track.scales))
        # Of several at one time the last counts.
        last = np.append(times_ns[1:] > times_ns[:-1], True)
        times_ns, positions, scales = times_ns[last], positions[last], scales[last]
        found = []
        for k, (begin_ns, surface) in enumerate(drawn):
            end_ns = drawn[k + 1][0] if k + 1 < len(drawn) else np.inf
            shown = (times_ns >= begin_ns) & (times_ns < end_ns)
            if surface is not None and shown.any():
                steps = np.where(shown[:, np.newaxis], scales, 0.0)
                found.append(MeshSteps(surface, times_ns, steps, positions))
        return found


def tracks_of(record: FlightRecord, parts: Sequence[str]) -> Tracks:
    """The flight with these of PARTS."""
    tracks = Tracks()
    record.draw(tracks, frozenset(name for part in parts for name in PARTS[part]))
    return tracks
