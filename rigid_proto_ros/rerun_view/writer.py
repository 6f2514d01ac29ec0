# SPDX-License-Identifier: MIT
"""Turns states and marks into logged columns: many rows a call, derived values computed over the batch at once."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import rerun as rr

from ..core.observer import BodySnapshot, ShownLoad
from . import entities as e
from .arrows import IMPULSE_SHOWN_NS, Arrow, ArrowSamples, ArrowScale, arrows_of
from .derived import angle_to, carried_along, derive, rotation_matrices
from .layout import layout
from .mailbox import Block, Mark
from .streams import Stream
from .surface_normals import shaded_surface
from .trail import Trail

TRAIL_RADIUS = 0.004
"""In body sizes."""


class SceneWriter:
    """What one run has shown so far, and the columns that show what comes next.

    ``streams`` receive everything; ``attach`` brings a new one up to date. Not for several threads.
    """

    def __init__(self) -> None:
        self.streams: list[Stream] = []
        self._skip_live = False
        self._scene = ""
        self._vertices: np.ndarray | None = None
        self._triangles: np.ndarray | None = None
        self._mesh_sha256 = ""
        self._surface: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._body: BodySnapshot | None = None
        self.restart()

    # What holds for a whole run

    def restart(self) -> None:
        """A new run: simulated time starts again at 0; scene, mesh and body stay."""
        self.moved = False
        self.rows_written = 0
        self._last_time_ns = 0
        self._last_row: np.ndarray | None = None
        self._last_row_ns = 0
        self._momentum_at_start: np.ndarray | None = None
        self._trail = Trail()
        self._acting: dict[int, tuple[str, Arrow | None, Arrow | None]] = {}
        self._not_placed: dict[int, ShownLoad] = {}
        self._impulses_end: deque[tuple[int, int]] = deque()
        self._arrows = {(kind, part): ArrowSamples() for kind in e.LOAD_COLOURS for part in ("force", "torque")}

    def attach(self, stream: Stream) -> None:
        """Send a stream what holds at all times, and the body as it is now; then it gets whatever follows."""
        self.streams.append(stream)
        self._for_new_streams([stream])

    def start(self, scene: str, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str) -> None:
        """Take the scene and the mesh, and send them to the streams that are attached."""
        self._scene, self._mesh_sha256 = scene, mesh_sha256
        self._vertices, self._triangles = vertices, triangles
        self._surface = None
        if vertices is not None and triangles is not None and len(triangles):
            self._surface = shaded_surface(vertices, triangles)
        for stream in self.streams:
            self._send_scene(stream)

    @property
    def size(self) -> float:
        """A length [m] that stands for the body: the diagonal of its box, or of the box of equal inertia."""
        if self._body is None:
            return 1.0
        if self._vertices is not None and len(self._vertices):
            extent = np.ptp(self._vertices, axis=0) * np.abs(self._body.scale)
        else:
            principal = np.linalg.eigvalsh(self._body.inertia)
            extent = np.sqrt(np.maximum(3.0 * (principal.sum() - 2.0 * principal) / self._body.mass, 0.0) * 2.0)
        return float(np.linalg.norm(extent)) or 1.0

    def _for_new_streams(self, streams: Iterable[Stream]) -> None:
        for stream in streams:
            if self._scene or self._surface is not None:
                self._send_scene(stream)
            if self._body is not None:
                self._send_styles(stream)
                self._send_body(stream, self._last_time_ns, time.time_ns())

    def _send_scene(self, stream: Stream) -> None:
        stream.log_static(e.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        stream.log_static(e.SCENE, rr.TextDocument(self._scene, media_type="text/plain"))
        if self._surface is None:
            return
        vertices, triangles, normals = self._surface
        stream.log_static(
            e.BODY_MESH,
            rr.Mesh3D(
                vertex_positions=vertices,
                triangle_indices=triangles,
                vertex_normals=normals,
                albedo_factor=[*e.MESH_COLOUR, 255],
            ),
        )
        # The numbers themselves, so that the flight can be computed again from the recording alone.
        stream.log_static(
            e.SESSION_MESH,
            rr.AnyValues(
                sha256=self._mesh_sha256,
                vertices=np.ascontiguousarray(self._vertices, dtype=np.float64).ravel(),
                triangles=np.ascontiguousarray(self._triangles, dtype=np.int64).ravel(),
            ),
        )

    def _send_styles(self, stream: Stream) -> None:
        size = self.size
        for entity, series in e.SERIES.items():
            names, colours = zip(*series, strict=True)
            stream.log_static(entity, rr.SeriesLines(names=names, colors=colours, widths=[1.5] * len(names)))
        axes = np.eye(3) * 0.35 * size
        stream.log_static(
            e.BODY_AXES,
            rr.Arrows3D(vectors=axes, colors=[e.RED, e.GREEN, e.BLUE], radii=0.006 * size),
        )
        stream.log_static(e.TRAIL, rr.Points3D.from_fields(colors=e.TRAIL_COLOUR, radii=TRAIL_RADIUS * size))
        for kind, part in self._arrows:
            colour = e.LOAD_COLOURS[kind] if part == "force" else e.TORQUE_COLOUR
            style = rr.Arrows3D.from_fields(colors=colour, radii=0.012 * size)
            stream.log_static(f"{e.LOADS}/{kind}/{part}", style)
        stream.send_blueprint(layout(size))

    def _send_body(self, stream: Stream, time_ns: int, wall_ns: int) -> None:
        body = self._body
        times = _times(np.array([time_ns]), np.array([wall_ns]))
        stream.send(e.BODY_MESH, times, rr.Transform3D.columns(translation=[-body.center_of_mass], scale=[body.scale]))
        values = {
            "mass": [float(body.mass)],
            "center_of_mass": np.asarray(body.center_of_mass, dtype=np.float64),
            "inertia": np.asarray(body.inertia, dtype=np.float64).ravel(),
            "scale": np.asarray(body.scale, dtype=np.float64),
            "gravity": np.asarray(body.gravity, dtype=np.float64),
            "inertia_model": [body.inertia_model],
            "integrator": [body.integrator],
            "gyroscopic": [bool(body.gyroscopic)],
        }
        stream.send(
            e.SESSION_BODY,
            times,
            [column for k, v in values.items() for column in rr.AnyValues.columns(**{k: v}).partition([len(v)])],
        )

    # What happens in it

    def write(self, block: Block, on_mark: Callable[[Mark], None], skip_live: bool = False) -> None:
        """Send a block; marks that aren't about the scene (a reset, a stream that comes or goes) go to ``on_mark``.

        With ``skip_live`` the states go to files alone: viewers miss some where the machine doesn't keep up.
        """
        self._skip_live = skip_live
        texts: list[tuple[str, int, int, str, str]] = []
        rows_from = shown_from = 0

        def finish_rows(upto: int) -> None:
            nonlocal rows_from
            self._write_rows(block, rows_from, upto)
            rows_from = upto

        for mark in block.marks:
            handler = _HANDLERS.get(mark.kind)
            self._show_arrows(block, shown_from, mark.after_rows)
            shown_from = mark.after_rows
            if mark.time_ns > 0:
                self.moved = True
            self._last_time_ns = max(self._last_time_ns, mark.time_ns)
            if handler is not None:
                handler(self, mark, texts)
                continue
            finish_rows(mark.after_rows)
            self._send_arrows()
            self._send_texts(texts)
            if mark.kind == "body_changed":
                self._change_body(mark)
            elif mark.kind == "started":
                self.start(*mark.content)
            else:
                on_mark(mark)
        self._show_arrows(block, shown_from, block.count)
        finish_rows(block.count)
        self._send_arrows()
        self._send_texts(texts)

    def _change_body(self, mark: Mark) -> None:
        size_before = self.size if self._body is not None else None
        (self._body,) = mark.content
        self._scale = ArrowScale.of(self._body.mass, self.size)
        for stream in self.streams:
            if self.size != size_before:
                self._send_styles(stream)
            self._send_body(stream, mark.time_ns, mark.wall_ns)

    def _write_rows(self, block: Block, begin: int, end: int) -> None:
        """Pose, exact state and plots of rows begin..end, which all belong to the present body."""
        if begin == end:
            return
        times_ns, walls, rows = block.times[begin:end], block.walls[begin:end], block.rows[begin:end]
        n = end - begin
        times = _times(times_ns, walls)
        if self._row_streams():
            self._send_rows(e.STATE, times, rr.Scalars.columns(scalars=rows.ravel()).partition([13] * n))
            pose = rr.Transform3D.columns(translation=rows[:, 0:3], quaternion=rows[:, 3:7])
            self._send_rows(e.BODY, times, pose)
            self._send_rows(e.CENTRE, times, rr.Transform3D.columns(translation=rows[:, 0:3]))
            if self._body is not None:
                self._write_plots(times, rows)
                self._write_trail(times_ns, walls, rows)
        self.rows_written += n
        self.moved = self.moved or int(times_ns[-1]) > 0
        self._last_time_ns = max(self._last_time_ns, int(times_ns[-1]))

    def _write_plots(self, times: list[Any], rows: np.ndarray) -> None:
        derived = derive(rows, self._body)
        L = derived.angular_momentum
        if self._momentum_at_start is None:
            self._momentum_at_start = L[0].copy()
        for entity, values in (
            (e.ENERGY, derived.energies),
            (e.ANGULAR_MOMENTUM, np.column_stack([L, np.linalg.norm(L, axis=1)])),
            (e.ANGULAR_MOMENTUM_ANGLE, angle_to(self._momentum_at_start, L)[:, np.newaxis]),
            (e.ANGULAR_VELOCITY_BODY, rows[:, 10:13]),
        ):
            columns = rr.Scalars.columns(scalars=values.ravel()).partition([values.shape[1]] * len(rows))
            self._send_rows(entity, times, columns)

    def _write_trail(self, times_ns: np.ndarray, walls: np.ndarray, rows: np.ndarray) -> None:
        """Points along the path of the body's farthest vertex, close enough to look like a line."""
        if self._vertices is None or not len(self._vertices):
            return
        chosen = self._trail.choose(times_ns)
        if not len(chosen):
            return
        at = self._vertices * self._body.scale - self._body.center_of_mass
        tip = at[np.argmax(np.einsum("ij,ij->i", at, at))]
        points, counts = self._trail.between(
            times_ns[chosen], rows[chosen], tip, spacing=1.5 * TRAIL_RADIUS * self.size
        )
        columns = rr.Points3D.columns(positions=points).partition(counts)
        self._send_rows(e.TRAIL, _times(times_ns[chosen], walls[chosen]), columns)

    # Loads

    def _load_began(self, mark: Mark, _: list) -> None:
        load_id, load = mark.content
        self._not_placed[load_id] = load
        if load.kind == "impulse":
            self._impulses_end.append((mark.time_ns + IMPULSE_SHOWN_NS, load_id))
        self._sample_arrows(mark.time_ns, mark.wall_ns, load.kind)

    def _load_ended(self, mark: Mark, _: list) -> None:
        (load_id,) = mark.content
        self._sample_arrows(mark.time_ns, mark.wall_ns, self._forget_load(load_id))

    def _forget_load(self, load_id: int) -> str:
        """Returns its kind, "" if it isn't known."""
        shown, load = self._acting.pop(load_id, None), self._not_placed.pop(load_id, None)
        return shown[0] if shown else load.kind if load else ""

    def _show_arrows(self, block: Block, begin: int, end: int) -> None:
        """Arrows of the loads that act, at rows begin..end, between which no load begins or ends but impulses fade."""
        while begin < end:
            upto = end
            if self._impulses_end:
                ends_ns, load_id = self._impulses_end[0]
                upto = begin + int(np.searchsorted(block.times[begin:end], ends_ns))
            self._add_arrows(block.times[begin:upto], block.walls[begin:upto], block.rows[begin:upto])
            if upto < end:
                self._impulses_end.popleft()
                faded = self._forget_load(load_id)
                at = slice(upto, upto + 1)
                self._add_arrows(np.array([ends_ns]), block.walls[at], block.rows[at], faded)
            begin = upto
        if end:
            self._last_row, self._last_row_ns = block.rows[end - 1].copy(), int(block.times[end - 1])

    def _sample_arrows(self, time_ns: int, wall_ns: int, kind: str) -> None:
        """Arrows of one kind at a time between two states, the body carried along from the state before."""
        if self._last_row is None:
            return
        row = carried_along(self._last_row, 1e-9 * (time_ns - self._last_row_ns))
        self._add_arrows(np.array([time_ns]), np.array([wall_ns]), row[np.newaxis], kind)

    def _add_arrows(self, times_ns: np.ndarray, walls: np.ndarray, rows: np.ndarray, only: str = "") -> None:
        if not len(times_ns) or self._body is None:
            return
        if self._not_placed:
            (R,) = rotation_matrices(rows[:1, 3:7])
            for load_id, load in self._not_placed.items():
                self._acting[load_id] = (load.kind, *arrows_of(load, self._scale, R))
            self._not_placed.clear()
        for (kind, part), samples in self._arrows.items():
            if (not self._acting and not samples.showing) or only not in ("", kind):
                continue
            index = 1 if part == "force" else 2
            arrows = [shown[index] for shown in self._acting.values() if shown[0] == kind and shown[index] is not None]
            samples.add(times_ns, walls, rows, arrows)

    def _send_arrows(self) -> None:
        for (kind, part), samples in self._arrows.items():
            if not samples.times:
                continue
            counts = np.concatenate(samples.counts)
            total = int(counts.sum())
            columns = rr.Arrows3D.columns(
                vectors=np.concatenate(samples.vectors) if total else np.empty((0, 3)),
                origins=np.concatenate(samples.origins) if total else np.empty((0, 3)),
                labels=samples.labels,
            ).partition(counts)
            times = _times(np.concatenate(samples.times), np.concatenate(samples.walls))
            self._send(f"{e.LOADS}/{kind}/{part}", times, columns)
            samples.clear()

    # Words

    def _event(self, mark: Mark, texts: list) -> None:
        (line,) = mark.content
        texts.append((e.EVENTS, mark.time_ns, mark.wall_ns, line, "INFO"))
        texts.append((e.COMMAND_LOG, mark.time_ns, mark.wall_ns, _readable(line), "INFO"))

    def _refused(self, mark: Mark, texts: list) -> None:
        reason, message = mark.content
        texts.append((e.REFUSAL_LOG, mark.time_ns, mark.wall_ns, f"refused ({reason}): {message}", "WARN"))

    def _send_texts(self, texts: list[tuple[str, int, int, str, str]]) -> None:
        for entity in dict.fromkeys(text[0] for text in texts):
            lines = [text for text in texts if text[0] == entity]
            times = _times(np.array([line[1] for line in lines]), np.array([line[2] for line in lines]))
            self._send(
                entity,
                times,
                rr.TextLog.columns(text=[line[3] for line in lines], level=[line[4] for line in lines]),
            )
        texts.clear()

    def _row_streams(self) -> list[Stream]:
        return [s for s in self.streams if not (self._skip_live and s.may_skip)]

    def _send_rows(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self._row_streams():
            stream.send(entity, times, columns)

    def _send(self, entity: str, times: list[Any], columns: Any) -> None:
        for stream in self.streams:
            stream.send(entity, times, columns)


_HANDLERS = {
    "load_began": SceneWriter._load_began,
    "load_ended": SceneWriter._load_ended,
    "event": SceneWriter._event,
    "refused": SceneWriter._refused,
}


def _times(times_ns: np.ndarray, walls: np.ndarray) -> list[Any]:
    return [
        rr.TimeColumn(e.SIM_TIME, duration=np.asarray(times_ns, np.int64).astype("timedelta64[ns]")),
        rr.TimeColumn(e.ROS_TIME, timestamp=np.asarray(walls, np.int64).astype("datetime64[ns]")),
    ]


def _readable(line: str) -> str:
    """An event line for people: its kind and what it says, without the hash."""
    try:
        event = json.loads(line)
        content = event.get("content", {})
    except (ValueError, AttributeError):
        return line
    if isinstance(content, dict):
        content = ", ".join(f"{key} {_short(value)}" for key, value in content.items() if value not in ("", None))
    return f"{event.get('kind', '')} {content}".strip()


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return "[" + ", ".join(_short(item) for item in value) + "]"
    return str(value)
