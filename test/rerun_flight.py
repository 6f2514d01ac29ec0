# SPDX-License-Identifier: MIT
"""A hand-made sequence of observer calls, and what tests of recordings and viewers share."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from flights import flight_setup

from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    LoadBegan,
    LoadEnded,
    Logged,
    Observer,
    Published,
    Refused,
    ShownLoad,
    Started,
)
from rigid_proto_ros.simulation.setup import Setup

VERTICES = np.array(
    [[x, y, z] for x in (0.0, 0.3) for y in (0.0, 0.2) for z in (0.0, 0.1)],
)
"""A brick in mesh coordinates, its corner at the origin."""

TRIANGLES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)

SCALE = np.array([2.0, 1.0, 1.0])
COM = np.array([0.3, 0.1, 0.05])
MASS = 12.0
INERTIA = np.diag([0.05, 0.37, 0.4])
GRAVITY = np.array([0.0, 0.0, -9.81])


def setup_of(mass: float = MASS, com=COM, inertia=INERTIA, scale=SCALE, gravity=GRAVITY) -> Setup:
    """What observers are told of a body."""
    return flight_setup(make_body(mass, com, inertia, scale), gravity=np.array(gravity, dtype=float))


SETUP = setup_of()
FILE = "brick.obj", b"a brick, as its file has it"
SHA256 = hashlib.sha256(FILE[1]).hexdigest()
SCENE = f"# mesh_sha256: {SHA256}\nrigid_body:\n  ros__parameters:\n    mesh: brick.obj\n"

POKE = ShownLoad("poke", "world", np.array([0.3, 0.0, 0.0]), np.array([0.0, 3.0, 0.0]), np.zeros(3))
WRENCH = ShownLoad("wrench", "body", np.zeros(3), np.array([0.0, 0.0, 2.0]), np.array([0.5, 0.0, 0.0]))

PERIOD_NS = 10_000_000


def rows(count: int, seed: int = 7) -> np.ndarray:
    """Some states (count, 13) with unit quaternions, as different from float32 numbers as numbers get."""
    made = np.cumsum(np.random.default_rng(seed).normal(size=(count, 13)) * 0.05, axis=0) + 0.1
    made[:, 3:7] /= np.linalg.norm(made[:, 3:7], axis=1, keepdims=True)
    return made


def live_view(**options: Any):
    """A view of which viewers are told, and none is started: its window would need a display."""
    from rigid_proto_ros.rerun_view.live_view import LiveView

    for display in ("DISPLAY", "WAYLAND_DISPLAY"):
        os.environ.pop(display, None)
    return LiveView("native", report=lambda _: None, **options)


def fly(observer: Observer, states: np.ndarray, setup: Setup = SETUP) -> None:
    """A run of ``states``: a poke from 200 to 400 ms, a wrench from 305 ms to the end, a refusal at 500 ms."""
    observer.on(Started(SCENE, VERTICES, TRIANGLES, SHA256))
    observer.on(BodyChanged(0, setup))
    for k, row in enumerate(states):
        time_ns = k * PERIOD_NS
        observer.on(Published(time_ns, row))
        if time_ns == 200_000_000:
            observer.on(Logged(time_ns, event_line(time_ns, "poke")))
            observer.on(LoadBegan(time_ns, 1, POKE))
        if time_ns == 300_000_000:
            observer.on(Logged(305_000_000, event_line(305_000_000, "wrench")))
            observer.on(LoadBegan(305_000_000, 2, WRENCH))
        if time_ns == 400_000_000:
            observer.on(LoadEnded(time_ns, 1))
        if time_ns == 500_000_000:
            observer.on(Refused(time_ns, "frame", "frame_id: got 'mars'; accepted: world, body"))


def event_line(time_ns: int, kind: str) -> str:
    """A line as the event log writes it."""
    content = {"stamp_ns": 0, "frame_id": "body@com;duration=0.2", "force": [0.0, 3.0, 0.0], "torque": [0.0, 0.0, 0.0]}
    return json.dumps({"time_ns": time_ns, "kind": kind, "content": content, "sha256": "00"})


WAIT_S = 180.0
"""Longer than anything takes on a machine that is busy with other things."""


def wait_for(condition: Callable[[], Any]) -> Any:
    """The first true value of ``condition()``, asked for again and again."""
    deadline = time.monotonic() + WAIT_S
    while not (value := condition()):
        assert time.monotonic() < deadline, f"no such thing within {WAIT_S} s"
        time.sleep(0.05)
    return value


def flush(observer: Observer) -> None:
    """Wait until everything so far was handed to the file and the viewers."""
    observer._write_at_s = 0.0
    own, passes = observer._write_waiting, []

    def counted() -> None:
        own()
        passes.append(1)

    observer._write_waiting = counted
    observer._mailbox.wake()
    wait_for(lambda: passes)
    observer._write_waiting = own


def record_batches(path: Path) -> Iterator[tuple[str, bool, Any]]:
    """(entity, static, pyarrow record batch) of every chunk of an .rrd file, by Rerun's own reader."""
    from rerun.chunk import RrdReader

    reader = RrdReader(path)
    (recording,) = reader.recordings()
    for chunk in reader.stream(store=recording):
        yield chunk.entity_path.lstrip("/"), chunk.is_static, chunk.to_record_batch()


def verified(path: Path) -> bool:
    """Whether Rerun's own program finds the file complete, index and all."""
    from rigid_proto_ros.rerun_view.viewers import viewer_program

    return subprocess.run([viewer_program(), "rrd", "verify", path], capture_output=True, check=False).returncode == 0


def drawn(path: Path) -> list[int]:
    """Times [ns] of the states that an .rrd file shows."""
    from rigid_proto_ros.picture.style import BODY

    return cells(path, BODY, "Transform3D:translation")[0]


def texts(path: Path, entity: str) -> list[str]:
    """Lines of a log, or documents, in an .rrd file."""
    batches = (batch for name, _, batch in record_batches(path) if name == entity)
    columns = [batch.column(name) for batch in batches for name in batch.schema.names if name.endswith(":text")]
    return [cell[0] for column in columns for cell in column.to_pylist()]


def cells(path: Path, entity: str, name: str, timeline: str = "sim_time") -> tuple[list[int], list]:
    """Times [ns] and values of a component over all chunks of an entity, what holds at all times left out."""
    times, found = [], []
    for chunk_entity, static, batch in record_batches(path):
        if chunk_entity == entity and not static and name in batch.schema.names:
            times.extend(batch.column(timeline).to_numpy(zero_copy_only=False).astype(np.int64).tolist())
            found.extend(batch.column(name).to_pylist())
    return times, found


def meshes(path: Path) -> int:
    """How often the body's mesh was logged."""
    from rigid_proto_ros.picture.style import BODY_MESH

    drawn = (batch for entity, _, batch in record_batches(path) if entity.startswith(BODY_MESH))
    return sum("Mesh3D:vertex_positions" in batch.schema.names for batch in drawn)


def child(code: str, *arguments: object) -> subprocess.Popen:
    """A Python process that runs ``code`` and imports what tests import."""
    path = os.pathsep.join([*sys.path, str(Path(__file__).parent)])
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
