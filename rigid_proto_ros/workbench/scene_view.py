# SPDX-License-Identifier: MIT
"""The 3D picture: the body, what shows its inertia, the string, forces, the ghost.

The picture shows the world point ``origin`` at its middle and ``unit`` metres as one, so that a nut and a satellite fill
the page alike and single precision is enough anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from ..appearance import (
    AXES_COLOURS,
    BODY_COLOUR,
    FORCE_COLOUR,
    GHOST_COLOUR,
    HAND_COLOUR,
    MOMENTUM_COLOUR,
    OMEGA_COLOUR,
    STRING_COLOUR,
)
from ..core.inertia_tensor import equimomental_shapes
from ..core.rotation import quaternion_from_matrix
from ..core.surface import Surface
from ..rerun_view.surface_normals import shaded_surface
from ..scenario import Scenario
from .acting import Hit
from .poke_mark import PokeMark
from .trails import COM_TRAIL, POINT_TRAIL, Trails

BOUNDS_COLOUR = (90, 90, 90)

SWITCHES = {
    "See through the body": False,
    "COM": True,
    "Principal axes": False,
    "Body axes": False,
    "World axes": False,
    "Inertia ellipsoid": False,
    "Box of equal inertia": False,
    "Bounding box": False,
    "String": True,
    "Forces": True,
    "Angular momentum L": True,
    "Angular velocity ω": False,
    "Ghost": True,
    COM_TRAIL: False,
    POINT_TRAIL: False,
    "Grid": True,
}
"""What can be shown beside the body, and whether it is at first."""

COM_SIZE = 0.025
"""Radius of the centre of mass as drawn, in body sizes."""

SEE_THROUGH = 0.45
"""Opacity of a body that one can look into."""

GRID_CELLS = 40
CAMERA = (1.3, -2.2, 1.1)
"""Where a page looks from at first, in the picture's units."""


class SceneView:
    """The picture that all pages show; its methods run on the page's thread."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._server = server
        self.unit = 1.0
        self.origin = np.zeros(3)
        self.body: Any = None
        self.com: Any = None
        self._shown = dict(SWITCHES)
        self._radius = 0.5
        self._drawn_body: tuple = ()
        self._scale = np.ones(3)
        self._middle = np.zeros(3)
        self._handles: dict[str, list] = {name: [] for name in SWITCHES}
        self._surface: Surface | None = None
        scene = self._scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(cast_shadow=False)
        server.initial_camera.position = CAMERA
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.initial_camera.fov = math.radians(40.0)
        self._body_frame = scene.add_frame("/body", show_axes=False)
        self._ghost_frame = scene.add_frame("/ghost", show_axes=False, visible=False)
        self._grid = scene.add_grid(
            "/grid",
            width=GRID_CELLS * 0.5,
            height=GRID_CELLS * 0.5,
            cell_size=0.5,
            section_size=2.5,
            shadow_opacity=0.0,
        )
        self._handles["Grid"] = [self._grid]
        # Length 1 is the picture's unit; the body's own are scaled to it.
        triad: dict[str, Any] = {"axes_radius": 0.008, "origin_radius": 0.0, "visible": False}
        self._world_axes = scene.add_frame("/world", axes_length=0.8, **triad)
        self._body_axes = scene.add_frame("/body/own_axes", **triad)
        self._handles["World axes"], self._handles["Body axes"] = [self._world_axes], [self._body_axes]
        none = np.zeros((1, 2, 3))
        self._string = scene.add_line_segments("/string/line", none, STRING_COLOUR, thickness=0.012, visible=False)
        self._hand = scene.add_icosphere("/string/hand", 0.018, HAND_COLOUR, visible=False)
        thin: dict[str, Any] = {"shaft_radius": 0.01, "head_radius": 0.026, "head_length": 0.07, "visible": False}
        thick: dict[str, Any] = {"shaft_radius": 0.013, "head_radius": 0.034, "head_length": 0.09, "visible": False}
        self._loads = scene.add_arrows("/forces", none, FORCE_COLOUR, **thick)
        self._poke = PokeMark(scene, FORCE_COLOUR)
        self._momentum = scene.add_arrows("/momentum", none, MOMENTUM_COLOUR, **thin)
        self._omega = scene.add_arrows("/omega", none, OMEGA_COLOUR, **thin)
        self.trails = Trails(scene)

    @property
    def hand(self):
        """The ball at the string's free end."""
        return self._hand

    @property
    def radius(self) -> float:
        """Half the body's size [m]."""
        return self._radius

    def switch(self, name: str, shown: bool) -> None:
        """Show or hide one of SWITCHES."""
        self._shown[name] = shown
        if name == "See through the body":
            self._body_opacity()
        if name in (COM_TRAIL, POINT_TRAIL):
            self.trails.switch(name, shown)
        for handle in self._handles[name]:
            handle.visible = shown

    def _body_opacity(self) -> None:
        if self.body is not None:
            self.body.opacity = SEE_THROUGH if self._shown["See through the body"] else None

    # The body

    def set_body(self, scenario: Scenario, zoom: bool) -> bool:
        """Draw the body anew where it changed; returns whether ``body`` is another node of the picture now. ``zoom`` makes it
        fill the picture, else it does so only where it would be lost or too large to be seen."""
        body = scenario.setup.body
        surface = scenario.setup.surface
        replaced = self.body is None or surface is not self._surface
        box, ellipsoid = equimomental_shapes(body.mass, body.principal_moments)
        corners = _box_corners(surface, body.scale) if surface else np.array([-ellipsoid, ellipsoid])
        size = float(np.linalg.norm(corners[1] - corners[0]))
        self._radius = 0.5 * size
        if zoom or replaced or not 0.1 <= size / self.unit <= 4.0:
            self.unit = nice_length(size)
        unit = self.unit
        if replaced:
            self._surface = surface
            if surface is not None:
                # Drawn vertices are relative to it: single precision is enough then, however far out the mesh lies.
                self._middle = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
            self._make_body(surface)
        if surface is not None:
            offset = (self._middle * body.scale - body.center_of_mass) / unit
            scale = tuple((body.scale / unit).tolist())
        else:
            offset, scale = np.zeros(3), tuple((ellipsoid / unit).tolist())
        turned = (1.0, 0.0, 0.0, 0.0) if surface is not None else _wxyz(body.principal_quaternion)
        for mesh in (self.body, self._ghost):
            mesh.scale, mesh.position, mesh.wxyz = scale, offset, turned
        self._scale = body.scale
        drawn = (body.inertia.tobytes(), body.center_of_mass.tobytes(), *scale)
        if replaced or drawn != self._drawn_body:
            self._drawn_body = drawn
            self._draw_inertia(scenario, box, ellipsoid, corners)
        return replaced

    def _make_body(self, surface) -> None:
        """The nodes of body and ghost: mesh coordinates about the middle of the box, to be scaled by the node itself."""
        if surface is None:
            drawn = self._scene.add_icosphere("/body/mesh", 1.0, BODY_COLOUR, subdivisions=4)
            ghost = self._scene.add_icosphere("/ghost/mesh", 1.0, GHOST_COLOUR, opacity=0.35)
        else:
            vertices, triangles, _ = shaded_surface(surface.vertices - self._middle, surface.triangles)
            drawn = self._scene.add_mesh_simple("/body/mesh", vertices, triangles, color=BODY_COLOUR, side="double")
            ghost = self._scene.add_mesh_simple(
                "/ghost/mesh", vertices, triangles, color=GHOST_COLOUR, opacity=0.35, side="double"
            )
        self.body, self._ghost = drawn, ghost
        self._body_opacity()

    def _draw_inertia(self, scenario: Scenario, box, ellipsoid, corners) -> None:
        body, unit, scene = scenario.setup.body, self.unit, self._scene
        size = 2.0 * self._radius / unit
        self._body_axes.axes_length = 0.7 * size
        turned = _wxyz(quaternion_from_matrix(body.principal_axes))
        axes = np.zeros((3, 2, 3))
        # All end outside the body, or the shortest would lie inside a rod.
        lengths = 1.0 + 0.35 * np.sqrt(body.principal_moments / body.principal_moments[2])
        axes[:, 1] = np.diag(self._radius / unit * lengths)
        see_through = {"opacity": 0.3, "cast_shadow": False, "receive_shadow": False}
        made = {
            "COM": scene.add_icosphere("/body/com", COM_SIZE * size, (30, 30, 30)),
            "Principal axes": scene.add_arrows(
                "/body/axes",
                axes,
                np.array(AXES_COLOURS),
                wxyz=turned,
                shaft_radius=0.008,
                head_radius=0.022,
                head_length=0.06,
            ),
            "Inertia ellipsoid": scene.add_icosphere(
                "/body/ellipsoid",
                1.0,
                MOMENTUM_COLOUR,
                scale=tuple((ellipsoid / unit).tolist()),
                wxyz=turned,
                **see_through,
            ),
            "Box of equal inertia": scene.add_box(
                "/body/box", GHOST_COLOUR, tuple((box / unit).tolist()), wxyz=turned, **see_through
            ),
        }
        if scenario.setup.surface is not None:
            edges = _box_edges((corners - body.center_of_mass) / unit)
            made["Bounding box"] = scene.add_line_segments("/body/bounds", edges, BOUNDS_COLOUR, thickness=0.005)
        else:
            self._handles["Bounding box"] = []
        self.com = made["COM"]
        for name, handle in made.items():
            handle.visible = self._shown[name]
            self._handles[name] = [handle]

    # Every frame

    def place(self, row: np.ndarray) -> None:
        """Move the body to a state's pose (13,)."""
        self._body_frame.position = self._drawn(row[0:3])
        self._body_frame.wxyz = _wxyz(row[3:7])

    def place_grid(self) -> None:
        """Grid and world axes stand still in the world while the picture follows the body; the grid has no end, it moves by
        whole sections."""
        section = 2.5
        shift = -(self.origin / self.unit)
        self._world_axes.position = shift
        self._grid.position = (shift[0] % section, shift[1] % section, shift[2] - 1.2 if abs(shift[2]) < 3.0 else -1.2)

    def draw_trails(self, now_s: float, until_ns: int, scenario: Scenario) -> None:
        """The paths of COM and point up to a moment of the flight."""
        setup = scenario.setup
        self.trails.draw(now_s, until_ns, setup.body, setup.surface, self.origin, self.unit)

    def show_string(self, ends: tuple[np.ndarray, np.ndarray] | None) -> None:
        """From the knot to the hand, both in the world; None for no string."""
        shown = ends is not None and self._shown["String"]
        if shown:
            points = np.array([[self._drawn(ends[0]), self._drawn(ends[1])]])
            self._string.points = points
            self._hand.position = points[0, 1]
        _set_visible(self._string, shown)
        _set_visible(self._hand, shown)

    def show_loads(self, arrows: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Forces: point of attack and drawn vector, both in the world [m]."""
        self._show_arrows(self._loads, arrows, "Forces")

    def show_hit(self, hit: Hit | None) -> None:
        """Where the last poke hit, and how hard; None for no poke."""
        if hit is None or not self._shown["Forces"]:
            self._poke.hide()
        else:
            size = 2.0 * self._radius / self.unit
            self._poke.show(self._drawn(hit.point), hit.direction, hit.text, hit.age, size)

    def show_momentum(self, position, momentum, omega) -> None:
        """L and ω at the COM, drawn vectors [m]."""
        self._show_arrows(self._momentum, [(position, momentum)], "Angular momentum L")
        self._show_arrows(self._omega, [(position, omega)], "Angular velocity ω")

    def _show_arrows(self, handle, arrows, switch: str) -> None:
        arrows = [(p, v) for p, v in arrows if float(np.abs(v).max()) > 0.02 * self.unit]
        shown = bool(arrows) and self._shown[switch]
        if shown:
            handle.points = np.array([[self._drawn(p), self._drawn(p + v)] for p, v in arrows])
        _set_visible(handle, shown)

    def show_ghost(self, row: np.ndarray | None, center_of_mass: np.ndarray) -> None:
        """The ghost at a state's pose, or nowhere; its COM (3,) in scaled mesh coordinates."""
        shown = row is not None and self._shown["Ghost"]
        if shown:
            self._ghost_frame.position = self._drawn(row[0:3])
            self._ghost_frame.wxyz = _wxyz(row[3:7])
            if self._surface is not None:
                self._ghost.position = (self._middle * self._scale - center_of_mass) / self.unit
        _set_visible(self._ghost_frame, shown)

    def _drawn(self, world_point) -> np.ndarray:
        return (np.asarray(world_point) - self.origin) / self.unit


def nice_length(length: float) -> float:
    """1, 2 or 5 times a power of ten, the next above a length [m]."""
    power = 10.0 ** math.floor(math.log10(length))
    return next(nice for nice in (power, 2.0 * power, 5.0 * power, 10.0 * power) if nice >= length)


def _box_edges(corners: np.ndarray) -> np.ndarray:
    """The twelve edges (12, 2, 3) of the box between two corners (2, 3)."""
    ends = [(k, k | 1 << axis) for axis in range(3) for k in range(8) if not k >> axis & 1]
    return np.array([[[corners[k >> axis & 1, axis] for axis in range(3)] for k in pair] for pair in ends])


def _box_corners(surface, scale) -> np.ndarray:
    corners = np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]) * scale
    return np.sort(corners, axis=0)


def _wxyz(q_xyzw) -> tuple[float, float, float, float]:
    x, y, z, w = (float(c) for c in q_xyzw)
    return w, x, y, z


def _set_visible(handle, visible: bool) -> None:
    if handle.visible != visible:
        handle.visible = visible
