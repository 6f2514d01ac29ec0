# SPDX-License-Identifier: MIT
"""The picture as columns of Rerun: many states a call, a part's style once, its mesh once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from ..picture import style
from ..picture.backend import Backend, DrawnMesh
from ..picture.style import Colour
from . import rrd_file as e
from .streams import Stream

INVISIBLE = 1e-9
"""A scale that nobody sees; the viewer refuses 0, which has no inverse."""


def time_columns(times_ns: np.ndarray, walls_ns: np.ndarray) -> list[Any]:
    """Both timelines: simulated times (n,) and wall clock times (n,), in ns."""
    return [
        rr.TimeColumn(e.SIM_TIME, duration=np.asarray(times_ns, np.int64).astype("timedelta64[ns]")),
        rr.TimeColumn(e.ROS_TIME, timestamp=np.asarray(walls_ns, np.int64).astype("datetime64[ns]")),
    ]


def scalar_columns(values: np.ndarray) -> Any:
    """Scalars of the rows of values (n, k)."""
    return rr.Scalars.columns(scalars=np.ascontiguousarray(values).ravel()).partition([values.shape[1]] * len(values))


def mesh_entity(name: str, number: int) -> str:
    """Where the run's mesh of a part with this number, from 1, is logged: a static mesh can't be replaced."""
    return name if number == 1 else f"{name}_{number}"


class RerunBackend(Backend):
    """Draws on ``streams``. ``clock`` says at which wall clock times the states were taken.

    plotted: the least and the largest value of each plot, by name. paths: where each trail ends.
    """

    def __init__(self) -> None:
        self.streams: Sequence[Stream] = ()
        self.plotted: dict[str, tuple[float, float]] = {}
        self.paths: dict[str, np.ndarray] = {}
        self._size = 1.0
        self._clock = np.zeros(1, np.int64), np.zeros(1, np.int64)
        self._times: list[Any] = []
        self._count = 0

    def clock(self, times_ns: np.ndarray, walls_ns: np.ndarray) -> None:
        """Wall clock times (n,) [ns] of the simulated times (n,) [ns] that follow."""
        self._clock = times_ns, walls_ns

    def send(self, entity: str, *columns: Any) -> None:
        """Log columns of an entity at the times of ``begin``."""
        for stream in self.streams:
            stream.send(entity, self._times, [column for part in columns for column in part])

    def begin(self, times_ns: np.ndarray) -> None:
        """What follows is of these times (n,) [ns]."""
        known, walls = self._clock
        self._times = time_columns(times_ns, walls[np.minimum(np.searchsorted(known, times_ns), len(known) - 1)])
        self._count = len(times_ns)

    def resize(self, size: float) -> None:
        """Widths are in this length [m]; streams are sent them as they come to the parts."""
        self._size = size

    def _style(self, name: str, archetype: Any) -> None:
        """Log how a part looks to the streams that don't know it, or know it of another size."""
        size = self._size if name.startswith(style.WORLD) else 1.0
        for stream in self.streams:
            if stream.styled.get(name) != size:
                stream.styled[name] = size
                own = style.STYLES[name]
                stream.log_static(name, archetype.from_fields(colors=list(own.colours), radii=own.width * size))

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Log a mesh once a run, and hide the one before from now on."""
        for stream in self.streams:
            number, known = stream.meshes.get(name, (0, None))
            if known is surface:
                continue
            if known is not None:
                stream.send(mesh_entity(name, number), self._times, _nowhere())
            if surface is None:
                continue
            stream.meshes[name] = number + 1, surface
            entity, own = mesh_entity(name, number + 1), style.STYLES[name]
            if number:
                stream.send(entity, time_columns(np.zeros(1, np.int64), self._clock[1][:1]), _nowhere())
            drawn = rr.Mesh3D(
                vertex_positions=surface.vertices,
                triangle_indices=surface.triangles,
                vertex_normals=surface.normals,
                albedo_factor=(*own.colours[0], round(255 * own.opacity)),
            )
            stream.log_static(entity, drawn)

    def place(
        self,
        name: str,
        positions: np.ndarray | None = None,
        attitudes: np.ndarray | None = None,
        scale: np.ndarray | None = None,
    ) -> None:
        """Log transforms."""
        scales = None if scale is None else np.tile(scale, (self._count, 1))
        columns = rr.Transform3D.columns(translation=positions, quaternion=attitudes, scale=scales)
        for stream in self.streams:
            number, _ = stream.meshes.get(name, (1, None))
            stream.send(mesh_entity(name, number), self._times, columns)

    def arrows(self, name: str, counts: np.ndarray, vectors: np.ndarray, origins: np.ndarray | None = None) -> None:
        """Log arrows."""
        self._style(name, rr.Arrows3D)
        self.send(name, rr.Arrows3D.columns(vectors=vectors, origins=origins).partition(counts))

    def lines(
        self, name: str, counts: np.ndarray, strips: Sequence[np.ndarray], colours: Sequence[Colour] | None = None
    ) -> None:
        """Log line strips."""
        self._style(name, rr.LineStrips3D)
        self.send(name, rr.LineStrips3D.columns(strips=_arrow_strips(strips), colors=colours).partition(counts))

    def points(self, name: str, counts: np.ndarray, positions: np.ndarray) -> None:
        """Log points; of a trail the straight way from each to the next one."""
        if name in (style.TRAIL, style.COM_TRAIL):
            before = self.paths.get(name, positions[0])
            self.paths[name] = positions[-1].copy()
            self.lines(name, counts, list(np.stack([np.vstack([before, positions[:-1]]), positions], axis=1)))
            return
        self._style(name, rr.Points3D)
        self.send(name, rr.Points3D.columns(positions=positions).partition(counts))

    def labels(self, name: str, counts: np.ndarray, positions: np.ndarray, texts: Sequence[str]) -> None:
        """Log labels as points of no size, below the part; those of loads change, others are logged once."""
        entity, changes = f"{name}/label", name.startswith(style.LOADS)
        for stream in self.streams:
            if entity not in stream.styled and len(texts):
                stream.styled[entity] = 0.0
                colour, known = style.STYLES[name].colours[0], None if changes else texts[0]
                look = rr.Points3D.from_fields(colors=colour, radii=0.0, labels=known, show_labels=True)
                stream.log_static(entity, look)
        labels = list(texts) if changes else None
        self.send(entity, rr.Points3D.columns(positions=positions, labels=labels).partition(counts))

    def scalars(self, name: str, values: np.ndarray) -> None:
        """Log plotted values, and keep their range."""
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high = self.plotted.get(name, (np.inf, -np.inf))
            self.plotted[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
        for stream in self.streams:
            if stream.styled.get(name) != values.shape[1]:
                stream.styled[name] = values.shape[1]
                names, colours = zip(*style.SERIES[name][: values.shape[1]], strict=True)
                stream.log_static(name, rr.SeriesLines(names=names, colors=colours, widths=[1.5] * len(names)))
        self.send(name, scalar_columns(values))


def _arrow_strips(strips: Sequence[np.ndarray]) -> Any:
    """Strips (p, 3) as the library has them; made by itself, a strip costs it .1 ms."""
    points = np.concatenate([np.zeros((0, 3)), *strips]).astype(np.float32)
    ends = np.cumsum([0, *map(len, strips)], dtype=np.int32)
    kind = rr.components.LineStrip3DBatch([]).as_arrow_array().type
    return pa.ListArray.from_arrays(ends, pa.FixedSizeListArray.from_arrays(points.ravel(), type=kind.value_type), kind)


def _nowhere() -> Any:
    return rr.Transform3D.columns(translation=[[0.0, 0.0, 0.0]], scale=[[INVISIBLE] * 3])
