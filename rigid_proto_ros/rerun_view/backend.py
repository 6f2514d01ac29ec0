# SPDX-License-Identifier: MIT
"""A Rerun recording of a run, and the backend that draws the picture into it.

Timelines: ``sim_time`` (simulated time since the run's start) and ``ros_time`` (wall clock when the row was queued).

Two tasks use private functions of the SDK (tried with rerun-sdk 0.41.0), because the public ones leak:
``rr.send_blueprint`` keeps a stream of every layout forever, two threads and a third of a megabyte each, and threads
and memory of closed recordings are kept until the process ends.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
import rerun_bindings
from rerun.recording_stream import RecordingStream

from ..base.provenance import cpu, versions
from ..base.vectors import FloatArray, IntArray, Points, Vector3
from ..picture import style
from ..picture.backend import Backend, DrawnMesh
from ..picture.style import Colour

APPLICATION_ID = "rigid_proto_ros"
"""Application ID of live streams; viewers keep one layout for all recordings of an application."""

SIM_TIME = "sim_time"
ROS_TIME = "ros_time"

SCENE = "session/scene"
"""The present parameters."""
EVENTS = "events"
"""The event log, in words."""
REFUSALS = "log/refusals"
ACCURACY = "log/accuracy"
"""Why the motion is held to less than its accuracy."""

TAKEN_S = 0.05
"""Timeout of flushing half a second of data [s]; a stream that exceeds it is behind, because a viewer doesn't read."""

ONE_AT_A_TIME = threading.Lock()
"""Held while recordings are created or cleaned up. Some of these functions wait for the library's own lock without
releasing Python's GIL, which the holder may wait for (a deadlock was seen once, with two recorded files).
"""

LINE, BAND, CLEAR = 1.5, 7.0, 110
"""Widths of plotted lines, and opacity of sums (style.WHOLES): a sum is a wide band, so that a part that is equal to it
stays visible.
"""

INVISIBLE = 1e-9
"""Scale of a hidden mesh; the viewer refuses 0, which has no inverse."""


class Stream:
    """A Rerun recording: one run of the simulation, with simulated time from 0.

    meshes: hashes of the meshes sent, by part; each is sent once, since viewers keep them. shown: number of the visible
    mesh by part, from 1; 0 for none. forgets: the receiver drops the oldest temporal data but no static data, so meshes
    are logged as temporal and are sent again by ``describe``. styled: by entity, the key for which its style was sent.
    arranged: a layout was sent. behind: data sent hasn't been taken yet, so no more should be sent; missed: data was
    left out meanwhile.
    """

    def __init__(self, sink: Any, recording_id: str, name: str, application_id: str = APPLICATION_ID) -> None:
        self.application_id = application_id
        self.meshes: dict[str, list[bytes]] = {}
        self.shown: dict[str, int] = {}
        self.styled: dict[str, float] = {}
        self.arranged = self.behind = self.missed = self.forgets = False
        with ONE_AT_A_TIME:
            self.recording = rr.RecordingStream(application_id, recording_id=recording_id)
        rr.set_sinks(sink, recording=self.recording)
        self.recording.send_recording_name(name)
        made_with = [f"{package} {version}" for package, version in versions("rerun-sdk").items()]
        self.recording.send_property("made_with", rr.AnyValues(versions=made_with, cpu=cpu()))
        for view in (style.WORLD, style.POINSOT):
            self.log_static(view, rr.ViewCoordinates.RIGHT_HAND_Z_UP)

    def send(self, entity: str, times: list[Any], *parts: Any) -> None:
        """Log columns of an entity at the given time columns."""
        columns = [column for part in parts for column in part]
        rr.send_columns(entity, indexes=times, columns=columns, recording=self.recording)

    def log_static(self, entity: str, value: Any) -> None:
        """Log a static value. It keeps its order with later data, whereas rr.log would queue it until a flush, and
        columns would overtake it.
        """
        self.log(entity, [], value)

    def log(self, entity: str, times: list[Any], value: Any) -> None:
        """Log a value at one time, given as time columns."""
        batches = value.as_component_batches()
        self.send(entity, times, [batch.partition([len(batch.as_arrow_array())]) for batch in batches])

    def send_layout(self, layout: Any) -> None:
        """Send the blueprint with which a viewer opens."""
        self.arranged = True
        with ONE_AT_A_TIME:
            native = rerun_bindings.new_blueprint(
                application_id=self.application_id, make_default=False, make_thread_default=False, default_enabled=True
            )
        stream = RecordingStream._from_native(native)  # noqa: SLF001 (see above)
        stream.set_time("blueprint", sequence=0)
        layout._log_to_stream(stream)  # noqa: SLF001 (see above)
        messages = stream.memory_recording().storage
        rerun_bindings.send_blueprint(messages, True, True, recording=self.recording.to_native())
        stream.disconnect()

    def flush(self) -> None:
        """Flush, and note whether the stream is behind; a server waits for its slowest viewer, which would block later
        data.
        """
        try:
            self.recording.flush(timeout_sec=TAKEN_S)
            self.behind = False
        except RuntimeError:
            self.behind = True

    def leave(self) -> threading.Thread:
        """Close the recording on a thread, because the library waits without limit for a viewer that doesn't read, and
        sometimes for a writer that has died.
        """
        leaving = threading.Thread(target=self.recording.disconnect, name="rerun leaving", daemon=True)
        leaving.start()
        return leaving


def forget_closed_recordings() -> None:
    """Free threads and memory of closed recordings. Waits until all other recordings are flushed."""
    users_own = rr.get_global_data_recording()
    try:
        with ONE_AT_A_TIME:
            rerun_bindings.flush_and_cleanup_orphaned_recordings()
    except RuntimeError:
        # Another recording of this process can't be flushed; the next call tries again.
        pass
    if users_own is not None:
        rr.set_global_data_recording(users_own)


def last_line(error: BaseException) -> str:
    """The last line of an error of the library."""
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]


# The backend


def time_columns(times_ns: IntArray, walls_ns: IntArray) -> list[Any]:
    """Both timelines: simulated times (n,) and wall clock times (n,), in ns."""
    return [
        rr.TimeColumn(SIM_TIME, duration=np.asarray(times_ns, np.int64).astype("timedelta64[ns]")),
        rr.TimeColumn(ROS_TIME, timestamp=np.asarray(walls_ns, np.int64).astype("datetime64[ns]")),
    ]


def scalar_columns(values: FloatArray) -> Any:
    """Columns of scalars from the rows of values (n, k)."""
    return rr.Scalars.columns(scalars=np.ascontiguousarray(values).ravel()).partition([values.shape[1]] * len(values))


class RerunBackend(Backend):
    """Draws into ``stream``, or nothing while it is None.

    plotted: smallest and largest value of each plot of the run, by name. on_sent() is called after each entity sent.
    """

    def __init__(self, on_sent: Callable[[], None] = lambda: None) -> None:
        self.stream: Stream | None = None
        self._on_sent = on_sent
        self._size = 1.0
        self._known = self._walls = np.zeros(1, np.int64)
        self._times: list[Any] = []
        self._count = 0
        self.restart()

    def restart(self) -> None:
        """Start another run, without plotted values and paths."""
        self.plotted: dict[str, tuple[float, float]] = {}
        self._begun = np.zeros(0, np.int64)
        self._path_ends: dict[str, Points] = {}

    def send(self, entity: str, *parts: Any) -> None:
        """Log columns of an entity at the times of ``begin``."""
        if self.stream is not None:
            self.stream.send(entity, self._times, *parts)
            self._on_sent()

    def begin(self, times_ns: IntArray, walls_ns: IntArray | None = None) -> None:
        """Set the times (n,) [ns] of the following calls; walls_ns (n,) [ns]: their wall times, None if an earlier call
        had them.
        """
        if walls_ns is None:
            walls_ns = self._walls[np.minimum(np.searchsorted(self._known, times_ns), len(self._known) - 1)]
        else:
            self._known, self._walls = times_ns, walls_ns
            self._begun = self._begun if len(self._begun) else walls_ns[:1]
        self._times = time_columns(times_ns, walls_ns)
        self._count = len(times_ns)

    def resize(self, size: float) -> None:
        """Set the unit of widths [m]; parts are styled with it when they are drawn next."""
        self._size = size

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Log a mesh once per run, and hide the previous one from now on; ``place`` follows."""
        stream = self.stream
        if stream is None:
            return
        before, known = stream.shown.get(name, 0), stream.meshes.setdefault(name, [])
        content = b"" if surface is None else _content(surface)
        number = known.index(content) + 1 if content in known else len(known) + 1 if content else 0
        if number == before and not stream.forgets:
            return
        stream.shown[name] = number
        nowhere = rr.Transform3D.columns(translation=[[0.0, 0.0, 0.0]], scale=[[INVISIBLE] * 3])
        if before and number != before:
            stream.send(_mesh_entity(name, before), self._times, nowhere)
        is_new = number > len(known)
        if surface is None or not (is_new or stream.forgets):
            return
        if is_new:
            known.append(content)
        entity, own = _mesh_entity(name, number), style.STYLES[name]
        if is_new and number > 1:
            stream.send(entity, time_columns(np.zeros(1, np.int64), self._begun), nowhere)
        drawn = rr.Mesh3D(
            vertex_positions=surface.vertices,
            triangle_indices=surface.triangles,
            vertex_normals=surface.normals,
            albedo_factor=(*own.colours[0], round(255 * own.opacity)),
        )
        stream.log(entity, self._times if stream.forgets else [], drawn)

    def place(
        self,
        name: str,
        positions: Points | None = None,
        attitudes: FloatArray | None = None,
        scale: Vector3 | None = None,
    ) -> None:
        """Log transforms."""
        scales = None if scale is None else np.tile(scale, (self._count, 1))
        columns = rr.Transform3D.columns(translation=positions, quaternion=attitudes, scale=scales)
        number = 1 if self.stream is None else self.stream.shown.get(name, 1)
        self.send(_mesh_entity(name, number or 1), columns)

    def _set_style(self, entity: str, key: float, style_of: Callable[[], Any]) -> None:
        """Log an entity's style unless it was sent for this key: a size, or the number of its columns."""
        if self.stream is not None and self.stream.styled.get(entity) != key:
            self.stream.styled[entity] = key
            self.stream.log_static(entity, style_of())

    def _draw(self, name: str, archetype: Any, counts: IntArray, **values: Any) -> None:
        """Log a part and its style."""
        size = self._size if name.startswith(style.WORLD) else 1.0
        own = style.STYLES[name]
        self._set_style(name, size, lambda: archetype.from_fields(colors=list(own.colours), radii=own.width * size))
        self.send(name, archetype.columns(**values).partition(counts))

    def arrows(self, name: str, counts: IntArray, vectors: Points, origins: Points | None = None) -> None:
        """Log arrows."""
        self._draw(name, rr.Arrows3D, counts, vectors=vectors, origins=origins)

    def lines(
        self, name: str, counts: IntArray, strips: Sequence[Points], colours: Sequence[Colour] | None = None
    ) -> None:
        """Log line strips, as Arrow arrays, since the library takes 0.1 ms to convert a strip."""
        points = np.concatenate([np.zeros((0, 3)), *strips]).astype(np.float32)
        ends = np.cumsum([0, *map(len, strips)], dtype=np.int32)
        kind = rr.components.LineStrip3DBatch([]).as_arrow_array().type
        rows = pa.FixedSizeListArray.from_arrays(points.ravel(), type=kind.value_type)
        self._draw(name, rr.LineStrips3D, counts, strips=pa.ListArray.from_arrays(ends, rows, kind), colors=colours)

    def points(self, name: str, counts: IntArray, positions: Points) -> None:
        """Log points; of a trail, the line segments between successive points."""
        if name in (style.TRAIL, style.COM_TRAIL):
            before = self._path_ends.get(name, positions[0])
            self._path_ends[name] = positions[-1].copy()
            self.lines(name, counts, list(np.stack([np.vstack([before, positions[:-1]]), positions], axis=1)))
        else:
            self._draw(name, rr.Points3D, counts, positions=positions)

    def labels(self, name: str, counts: IntArray, positions: Points, texts: Sequence[str]) -> None:
        """Log labels as points without size, below the part; texts of loads change, others are logged once."""
        entity, changes = f"{name}/label", name.startswith(style.LOADS)
        if len(texts):
            colours, known = list(style.STYLES[name].colours), None if changes else list(texts[: counts.max()])
            self._set_style(
                entity,
                0.0,
                lambda: rr.Points3D.from_fields(colors=colours, radii=0.0, labels=known, show_labels=True),
            )
        labels = list(texts) if changes else None
        self.send(entity, rr.Points3D.columns(positions=positions, labels=labels).partition(counts))

    def scalars(self, name: str, values: FloatArray) -> None:
        """Log plotted values and update their range."""
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high = self.plotted.get(name, (np.inf, -np.inf))
            self.plotted[name] = (min(low, float(finite.min())), max(high, float(finite.max())))
        series = style.SERIES[name][: values.shape[1]]
        # Bands first, because later series are drawn on top.
        order = sorted(range(len(series)), key=lambda k: series[k][0] not in style.WHOLES)
        names, colours = zip(*(series[k] for k in order), strict=True)
        widths = [BAND if name in style.WHOLES else LINE for name in names]
        colours = [(*c, CLEAR if n in style.WHOLES else 255) for n, c in zip(names, colours, strict=True)]
        self._set_style(name, len(names), lambda: rr.SeriesLines(names=names, colors=colours, widths=widths))
        self.send(name, scalar_columns(values[:, order]))


def _content(surface: DrawnMesh) -> bytes:
    """Hash of a mesh."""
    parts = (np.ascontiguousarray(part).tobytes() for part in (surface.vertices, surface.triangles))
    return hashlib.sha256(b"".join(parts)).digest()


def _mesh_entity(name: str, number: int) -> str:
    """Entity of a part's mesh with this number, from 1; each has its own, since a static mesh can't be replaced."""
    return name if number == 1 else f"{name}_{number}"
