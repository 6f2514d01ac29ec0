# SPDX-License-Identifier: MIT
"""The mesh at its pose as a visualization_msgs/Marker, for RViz, Foxglove and bags."""

from __future__ import annotations

import struct
import time
from pathlib import Path

import numpy as np

from ..base.rotation import matrix_from_quaternion, times
from ..base.vectors import Points, Vector3
from ..live.pacing import Stamps
from ..mesh.reading import Mesh
from ..mesh.solids import box_surface
from ..motion.body import Body
from ..picture.style import BODY_COLOUR
from ..scene import cdr
from ..scene.scenario import BodyMesh
from ..scene.scenario_run import ScenarioRun
from ..simulation.setup import Setup

PERIOD_S = 1.0 / 30.0
"""Shortest period between two markers [s of wall time]."""

MOST_TRIANGLES = 5000
"""Largest number of triangles sent in a marker, 0.36 MB. For a larger mesh the marker names the file, and for larger
parts it shows their boxes.
"""

TRIANGLE_LIST, MESH_RESOURCE, ADD = 11, 10, 0
"""Constants of visualization_msgs/Marker."""


def _boxes_of_parts(mesh: Mesh) -> Points:
    """Corners (3 k, 3) of the triangles of the box around each part; none of a mesh without parts."""
    corners, start = [np.empty((0, 3))], 0
    for part in mesh.parts:
        end = start + len(part.mesh.vertices)
        vertices, triangles = box_surface(mesh.vertices[start:end])
        corners.append(vertices[triangles.ravel()])
        start = end
    return np.concatenate(corners)


class BodyMarker:
    """The marker of one body, as bytes. frames: names of the world and body frames."""

    def __init__(self, frames: tuple[str, str], stamps: Stamps) -> None:
        self._frames = frames
        self._stamps = stamps
        self._setup: Setup | None = None
        self._message = bytearray()
        self._pose_at = 0
        self._origin: Vector3 = np.zeros(3)
        self._next_s = 0.0

    def message(self, run: ScenarioRun, time_ns: int, row: list[float]) -> bytes | None:
        """The message at a time and state (13,); None without a mesh, or within PERIOD_S of the last message."""
        now_s, body_mesh, setup = time.monotonic(), run.scenario.body_mesh, run.simulation.setup
        if body_mesh is None or now_s < self._next_s:
            return None
        self._next_s = max(self._next_s + PERIOD_S, now_s)
        if setup is not self._setup:
            self._setup = setup
            self._make(body_mesh, setup.body)
        place = np.array(row[:3]) + times(matrix_from_quaternion(np.array(row[3:7])), self._origin)
        struct.pack_into("<iI", self._message, 4, *self._stamps.of(time_ns))
        struct.pack_into("<7d", self._message, self._pose_at, *place.tolist(), *row[3:7])
        return bytes(self._message)

    def _make(self, body_mesh: BodyMesh, body: Body) -> None:
        """Pack all but stamp and pose. Sent corners are relative to the centre of mass, a file's to the mesh origin."""
        mesh, com = body_mesh.mesh, body.center_of_mass
        is_small = len(mesh.triangles) <= MOST_TRIANGLES
        listed = is_small or bool(mesh.parts)
        shown = mesh.vertices[mesh.triangles.ravel()] if is_small else _boxes_of_parts(mesh)
        corners = shown * body.scale - com
        self._origin = np.zeros(3) if listed else -com
        layout = cdr.Layout()
        layout.pack("iI", 0, 0)
        for name in self._frames:  # the message's frame, and the marker's namespace
            layout.string(name)
        layout.pack("3i", 0, TRIANGLE_LIST if listed else MESH_RESOURCE, ADD)
        self._pose_at = layout.pack("7d", *(0.0,) * 7)
        layout.pack("3d", *((1.0,) * 3 if listed else (body.scale * mesh.unit).tolist()))
        layout.pack("4f", *(part / 255 for part in BODY_COLOUR), 1.0)
        layout.pack("iI", 0, 0)  # lifetime: forever
        layout.pack("?", False)  # frame_locked
        layout.pack("I", len(corners))
        if listed:
            layout.pack(f"{corners.size}d", *corners.ravel().tolist())
        layout.pack("I", 0)  # colours of corners
        layout.string("")  # texture: its resource, then stamp, frame, format and bytes
        layout.pack("iI", 0, 0)
        for _ in range(2):
            layout.string("")
        layout.pack("2I", 0, 0)  # texture: bytes and coordinates
        layout.string("")  # text
        layout.string("" if listed else Path(mesh.path).as_uri())
        layout.string("")  # embedded mesh: name and bytes
        layout.pack("I", 0)
        layout.pack("?", False)  # mesh_use_embedded_materials
        self._message = layout.data
