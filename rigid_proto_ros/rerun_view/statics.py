# SPDX-License-Identifier: MIT
"""What a stream is sent once, or when the body changes: scene, mesh, styles, shapes of the inertia."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr

from ..simulation.observer import BodySnapshot
from . import appearance
from . import entities as e
from .columns import one_time
from .inertia_shapes import PrincipalFrame, bounding_box
from .load_arrows import PARTS, load_entity
from .motion_picture import TRAIL_RADIUS
from .streams import Stream
from .surface_normals import shaded_surface

AXIS_LENGTH = 0.25
"""In body sizes."""

INVISIBLE = 1e-9
"""A scale that nobody sees; the viewer refuses 0, which has no inverse."""

LIVE_NUMBERS_MAX = 4_000_000
"""[bytes] of a mesh's exact numbers that viewers are sent too; larger ones would push the flight out of
the live server.
"""

WIRE_RADIUS = 0.0025
"""In the view's units: the viewer scales all that is drawn but the wires of boxes and ellipsoids."""

VIEW_PER_REACH = 1.7
"""A body that turns about an end needs more room than one that turns about its middle, where this would be 2."""


@dataclass
class Scene:
    """The scene as text, the mesh as loaded, and the surface that is drawn: vertices, triangles, normals."""

    text: str
    vertices: np.ndarray | None
    triangles: np.ndarray | None
    mesh_sha256: str

    def __post_init__(self) -> None:
        self.surface: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self.points = np.zeros((0, 3)) if self.vertices is None else self.vertices
        if self.vertices is not None and self.triangles is not None and len(self.triangles):
            self.surface = shaded_surface(self.vertices, self.triangles)

    def with_mesh(self, vertices: np.ndarray | None, triangles: np.ndarray | None, mesh_sha256: str) -> Scene:
        """Another mesh under the same parameters."""
        return Scene(self.text, vertices, triangles, mesh_sha256)

    def with_text(self, text: str) -> Scene:
        """The same mesh under other parameters."""
        other = copy(self)
        other.text = text
        return other

    def size(self, body: BodySnapshot) -> float:
        """A length [m] that stands for the body: the diagonal of its box, or of the box of equal inertia."""
        if self.surface is not None:
            extent = np.ptp(self.points, axis=0) * np.abs(body.scale)
        else:
            extent = PrincipalFrame.of(np.asarray(body.inertia, dtype=float)).box_sides(body.mass)
        return float(np.linalg.norm(extent)) or 1.0

    def farthest_point(self, body: BodySnapshot) -> np.ndarray | None:
        """The vertex (3,) farthest from the COM [m, body axes from the COM], whose path is drawn."""
        if self.surface is None:
            return None
        at = self.points * body.scale - body.center_of_mass
        return at[np.argmax(np.einsum("ij,ij->i", at, at))]

    def view_size(self, body: BodySnapshot, boxed: bool = False) -> float:
        """The length [m] that views must keep in sight: bodies are shown around their COM, wherever it lies.
        boxed: the bounding box too.
        """
        tip = self.farthest_point(body)
        if boxed and self.surface is not None:
            centre, half = bounding_box(self.points, body.scale, body.center_of_mass)
            tip = np.abs(centre) + half
        reach = 0.0 if tip is None else float(np.linalg.norm(tip))
        return max(self.size(body), VIEW_PER_REACH * reach)


def drawn_mesh(surface: tuple[np.ndarray, np.ndarray, np.ndarray], colour: tuple[int, ...]) -> Any:
    """The surface in one colour, in mesh coordinates."""
    vertices, triangles, normals = surface
    return rr.Mesh3D(
        vertex_positions=vertices, triangle_indices=triangles, vertex_normals=normals, albedo_factor=colour
    )


def numbered(entity: str, number: int) -> str:
    """The entity of the run's mesh with this number. A static mesh can't be replaced, so each has an entity."""
    return f"{entity}_{number + 1}" if number else entity


def mesh_entity(number: int) -> str:
    """Where the run's mesh with this number is drawn."""
    return numbered(e.BODY_MESH, number)


def hide_mesh(stream: Stream, time_ns: int, wall_ns: int, number: int) -> None:
    """Draw a mesh no more from ``time_ns`` on: too small to be seen, since a static mesh can't be cleared."""
    nowhere = rr.Transform3D.columns(translation=[[0.0, 0.0, 0.0]], scale=[[INVISIBLE] * 3])
    stream.send(mesh_entity(number), one_time(time_ns, wall_ns), nowhere)


def send_scene(stream: Stream, scene: Scene, mesh_number: int) -> None:
    """The scene's text and the mesh, once as drawn and once as the numbers themselves.

    With the numbers the flight can be computed again from the recording alone.
    """
    stream.log_static(e.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    stream.log_static(e.POINSOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    stream.log_static(e.SCENE, rr.TextDocument(scene.text, media_type="text/plain"))
    send_mesh(stream, scene, mesh_number)


def send_mesh(stream: Stream, scene: Scene, number: int) -> None:
    """The mesh of a run that already had ``number`` others."""
    if scene.surface is None or scene.vertices is None or scene.triangles is None:
        return
    stream.log_static(mesh_entity(number), drawn_mesh(scene.surface, (*appearance.BODY_COLOUR, 255)))
    if stream.may_skip and scene.vertices.nbytes + scene.triangles.nbytes > LIVE_NUMBERS_MAX:
        return
    stream.log_static(
        numbered(e.SESSION_MESH, number),
        rr.AnyValues(
            sha256=scene.mesh_sha256,
            vertices=np.ascontiguousarray(scene.vertices, dtype=np.float64).ravel(),
            triangles=np.ascontiguousarray(scene.triangles, dtype=np.int64).ravel(),
        ),
    )


def send_styles(stream: Stream, size: float) -> None:
    """Colours, names and thicknesses for a body of this size [m]."""
    for entity, series in e.SERIES.items():
        names, colours = zip(*series, strict=True)
        stream.log_static(entity, rr.SeriesLines(names=names, colors=colours, widths=[1.5] * len(names)))
        if stream.may_skip and entity != e.STRING_ENERGY:  # which is drawn among the other energies
            unseen = rr.SeriesLines(names=["", ""], colors=[(0, 0, 0, 0)] * 2)
            stream.log_static(e.axis_ends(entity), unseen)
    axes = np.eye(3) * AXIS_LENGTH * size
    stream.log_static(
        e.BODY_AXES,
        rr.Arrows3D(vectors=axes, colors=[appearance.RED, appearance.GREEN, appearance.BLUE], radii=0.006 * size),
    )
    for trail, colour in ((e.TRAIL, appearance.POINT_TRAIL_COLOUR), (e.COM_TRAIL, appearance.TRAIL_COLOUR)):
        stream.log_static(trail, rr.Points3D.from_fields(colors=colour, radii=TRAIL_RADIUS * size))
    for kind, colour in e.LOAD_COLOURS.items():
        for part in PARTS:
            arrow_colour = colour if part == "force" else e.TORQUE_COLOUR
            style = rr.Arrows3D.from_fields(colors=arrow_colour, radii=0.012 * size)
            stream.log_static(load_entity(kind, part), style)
    stream.log_static(e.STRING, rr.LineStrips3D.from_fields(radii=0.0035 * size))
    stream.log_static(e.STRING_LINE, rr.LineStrips3D.from_fields(colors=appearance.YELLOW, radii=0.0025 * size))
    stream.log_static(e.HAND, rr.Points3D.from_fields(colors=appearance.STRING_COLOUR, radii=0.02 * size))
    _arrow_style(stream, e.ANGULAR_VELOCITY, appearance.OMEGA_COLOUR, 0.009 * size, "ω")
    _arrow_style(stream, e.MOMENTUM, appearance.MOMENTUM_COLOUR, 0.009 * size, "L")
    line = WIRE_RADIUS
    wire = rr.components.FillMode.MajorWireframe
    style = rr.Boxes3D.from_fields(colors=appearance.GREY, radii=line, fill_mode=wire)
    stream.log_static(e.BOUNDING_BOX, style)
    stream.log_static(e.INERTIA_BOX, rr.Boxes3D.from_fields(colors=appearance.YELLOW, radii=line, fill_mode=wire))
    stream.log_static(e.GHOST_BOX, rr.Boxes3D.from_fields(colors=appearance.GHOST_COLOUR, radii=line, fill_mode=wire))
    stream.log_static(
        e.INERTIA_ELLIPSOID, rr.Ellipsoids3D.from_fields(colors=appearance.GREEN, line_radii=0.6 * line, fill_mode=wire)
    )
    _send_poinsot_styles(stream)


def _send_poinsot_styles(stream: Stream) -> None:
    """The construction has the same size for every body."""
    translucent = rr.components.FillMode.TransparentFillMajorWireframe
    ellipsoid = rr.Ellipsoids3D.from_fields(colors=(*appearance.BLUE, 255), line_radii=0.003, fill_mode=translucent)
    stream.log_static(e.POINSOT_ELLIPSOID, ellipsoid)
    stream.log_static(e.POINSOT_POLHODE, rr.LineStrips3D.from_fields(colors=appearance.YELLOW, radii=0.012))
    stream.log_static(e.POINSOT_SEPARATRIX, rr.LineStrips3D.from_fields(colors=appearance.RED, radii=0.007))
    plane = rr.Boxes3D.from_fields(colors=(95, 98, 112, 255), radii=0.003, fill_mode=translucent)
    stream.log_static(e.POINSOT_PLANE, plane)
    stream.log_static(e.POINSOT_HERPOLHODE, rr.Points3D.from_fields(colors=appearance.ORANGE, radii=0.009))
    _arrow_style(stream, e.POINSOT_OMEGA, appearance.OMEGA_COLOUR, 0.025, "ω")
    _arrow_style(stream, e.POINSOT_MOMENTUM, appearance.MOMENTUM_COLOUR, 0.02, "L")


def _arrow_style(stream: Stream, entity: str, colour: tuple[int, ...], radius: float, label: str) -> None:
    stream.log_static(entity, rr.Arrows3D.from_fields(colors=colour, radii=radius, labels=label, show_labels=True))


def send_view(stream: Stream, time_ns: int, wall_ns: int, size: float) -> None:
    """Views of the body keep this length [m] in sight from ``time_ns`` on."""
    stream.send(e.VIEW, one_time(time_ns, wall_ns), rr.Transform3D.columns(scale=[[size] * 3]))


def send_body(
    stream: Stream, time_ns: int, wall_ns: int, body: BodySnapshot, scene: Scene | None, mesh_number: int
) -> None:
    """The body from ``time_ns`` on: where the mesh hangs, its boxes and ellipsoid, its numbers."""
    times = one_time(time_ns, wall_ns)
    mesh_place = rr.Transform3D.columns(translation=[-body.center_of_mass], scale=[body.scale])
    stream.send(mesh_entity(mesh_number), times, mesh_place)
    if scene is not None and scene.surface is not None:
        centre, half = bounding_box(scene.points, body.scale, body.center_of_mass)
        stream.send(e.BOUNDING_BOX, times, rr.Boxes3D.columns(centers=[centre], half_sizes=[half]))
    frame = PrincipalFrame.of(np.asarray(body.inertia, dtype=float))
    turn = rr.Transform3D.columns(mat3x3=[frame.axes])
    box = rr.Boxes3D.columns(half_sizes=[0.5 * frame.box_sides(body.mass)])
    ellipsoid = rr.Ellipsoids3D.columns(half_sizes=[frame.ellipsoid_semi_axes(body.mass)])
    stream.send(e.INERTIA_BOX, times, [*box, *turn])
    stream.send(e.INERTIA_ELLIPSOID, times, [*ellipsoid, *turn])
    numbers: dict[str, Any] = {
        "mass": [float(body.mass)],
        "center_of_mass": np.asarray(body.center_of_mass, dtype=np.float64),
        "inertia": np.asarray(body.inertia, dtype=np.float64).ravel(),
        "scale": np.asarray(body.scale, dtype=np.float64),
        "gravity": np.asarray(body.gravity, dtype=np.float64),
        "inertia_model": [body.inertia_model],
        "integrator": [body.integrator],
        "gyroscopic": [bool(body.gyroscopic)],
    }
    columns = [c for name, v in numbers.items() for c in rr.AnyValues.columns(**{name: v}).partition([len(v)])]
    stream.send(e.SESSION_BODY, times, columns)
