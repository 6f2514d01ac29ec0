# SPDX-License-Identifier: MIT
"""The 3D picture: the body, what shows its inertia, the string, forces, the ghost.

The picture shows the world point ``origin`` at its middle and ``unit`` metres as one, so that a nut and a satellite fill
the page alike and single precision is enough anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import viser

from ..base.rotation import quaternion_from_matrix
from ..mass.tensor import equimomental_shapes
from ..motion.surface import Surface
from ..rerun_view.appearance import (
    AXES_COLOURS,
    BODY_COLOUR,
    FORCE_COLOUR,
    GHOST_COLOUR,
    HAND_COLOUR,
    MOMENTUM_COLOUR,
    STRING_COLOUR,
)
from ..rerun_view.plot_range import nice_step
from ..rerun_view.surface_normals import shaded_surface
from ..scene.scenario import Scenario
from .acting import Hit
from .motion_arrows import MotionArrows
from .poke_mark import UNWRITTEN, PokeMark
from .soft_shadow import SoftShadow
from .surroundings import FLOOR, Surroundings
from .trails import COM_TRAIL, POINT_TRAIL, Trails, farthest_point

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
    "Contacts": True,
    "Grid": True,
}
"""What can be shown beside the body, and whether it is at first."""

COM_SIZE = 0.025
"""Radius of the centre of mass as drawn, in body sizes."""

GHOST_OPACITY = 0.4
SEE_THROUGH = 0.45
"""Opacity of a body that one can look into."""

ZOOM = (0.15, 1.2)
"""Body sizes in the picture's units between which a body may grow or shrink before the picture is scaled anew."""

LOOK_AGAIN_S = 0.25
"""[s] Between two looks of the browsers at whether the pointer is still on a body that moves."""

ABOVE_FLOOR = 2e-3
"""Picture units that the shadow lies above the floor, whose lines would flicker through it."""

CAMERA = (1.45, -2.45, 1.2)
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
        self._ghost: Any = None
        self._shown = dict(SWITCHES)
        self._radius = 0.5
        self._drawn_body: tuple = ()
        self._scale, self._center_of_mass = np.ones(3), np.zeros(3)
        self._middle = np.zeros(3)
        self._handles: dict[str, list] = {name: [] for name in SWITCHES}
        self._surface: Surface | None = None
        self._drawn_mesh: Any = None
        self._look_due_s, self._look_odd = 0.0, False
        scene = self._scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(cast_shadow=False)
        server.initial_camera.position = CAMERA
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.initial_camera.fov = math.radians(40.0)
        self._body_frame = scene.add_frame("/body", show_axes=False)
        self._ghost_frame = scene.add_frame("/ghost", show_axes=False, visible=False)
        self._names = [
            scene.add_label(f"/{whose}/name", UNWRITTEN, visible=False, anchor="bottom-center")
            for whose in ("body", "ghost")
        ]
        self._tip = np.zeros(3)
        self._contacts: dict[str, tuple] = {}
        self._mesh = self._contacts_mesh = ""
        self._contact_labels: dict[str, Any] = {}
        self._surroundings = Surroundings(scene)
        self._shadow = SoftShadow(scene, "/grid/shadow")
        # Length 1 is the picture's unit; the body's own are scaled to it.
        triad: dict[str, Any] = {"axes_radius": 0.008, "origin_radius": 0.0, "visible": False}
        self._world_axes = scene.add_frame("/world", axes_length=0.8, **triad)
        self._body_axes = scene.add_frame("/body/own_axes", **triad)
        self._body_axes_labels = [scene.add_label(f"/body/own_axes/{axis}", f"body {axis}") for axis in "xyz"]
        for axis, direction in zip("xyz", np.eye(3), strict=True):
            scene.add_label(f"/world/{axis}", axis, position=0.85 * direction)
        self._handles["World axes"], self._handles["Body axes"] = [self._world_axes], [self._body_axes]
        none = np.zeros((1, 2, 3))
        self._string = scene.add_line_segments("/string/line", none, STRING_COLOUR, thickness=0.012, visible=False)
        self._hand = scene.add_icosphere("/string/hand", 0.018, HAND_COLOUR, visible=False)
        thick: dict[str, Any] = {"shaft_radius": 0.013, "head_radius": 0.034, "head_length": 0.09, "visible": False}
        self._loads = scene.add_arrows("/forces", none, FORCE_COLOUR, **thick)
        self._poke = PokeMark(scene, FORCE_COLOUR)
        self._motion = MotionArrows(scene)
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
        if name == "Grid":
            self._surroundings.switch(shown)
        for handle in self._handles[name]:
            handle.visible = shown

    def _body_opacity(self) -> None:
        if self.body is None:
            return
        seen_through = self._shown["See through the body"]
        if self._drawn_mesh is self.body:
            self.body.opacity = SEE_THROUGH if seen_through else None
        else:
            self.body.opacity = SEE_THROUGH if seen_through else 0.0
            self._drawn_mesh.visible = not seen_through

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
        if zoom or replaced or not ZOOM[0] <= size / self.unit <= ZOOM[1]:
            self.unit = nice_step(size)
        unit = self.unit
        if replaced:
            self._surface = surface
            if surface is not None:
                # Drawn vertices are relative to it: single precision is enough then, however far out the mesh lies.
                self._middle = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
            self._make_body(surface)
            self._shadow.of(surface)
        if surface is not None:
            offset = (self._middle * body.scale - body.center_of_mass) / unit
            scale = tuple((body.scale / unit).tolist())
        else:
            offset, scale = np.zeros(3), tuple((ellipsoid / unit).tolist())
        turned = (1.0, 0.0, 0.0, 0.0) if surface is not None else _wxyz(body.principal_quaternion)
        for mesh in (self.body, self._drawn_mesh, self._ghost):
            mesh.scale, mesh.position, mesh.wxyz = scale, offset, turned
        self._scale, self._center_of_mass = body.scale, body.center_of_mass
        drawn = (body.inertia.tobytes(), body.center_of_mass.tobytes(), *scale)
        if replaced or drawn != self._drawn_body:
            self._drawn_body = drawn
            self._tip = farthest_point(surface, body) if surface is not None else np.zeros(3)
            self._draw_inertia(scenario, box, ellipsoid, corners)
        self._place_contacts(str(scenario.parameters.mesh))
        return replaced

    def label_contacts(self, contacts: Mapping[str, Sequence[float]], mesh: str) -> None:
        """Write names at points (3,) [mesh coordinates] of the body, while it is this mesh."""
        for label in self._contact_labels.values():
            label.remove()
        self._contacts = {name: tuple(point) for name, point in contacts.items()}
        self._contacts_mesh = mesh
        self._contact_labels = {
            name: self._scene.add_label(f"/body/contact_{name}", name, visible=False, anchor="bottom-left")
            for name in contacts
        }
        self._place_contacts(self._mesh)

    def _place_contacts(self, mesh: str) -> None:
        self._mesh = mesh
        self._handles["Contacts"] = shown = list(self._contact_labels.values()) if mesh == self._contacts_mesh else []
        for name, label in self._contact_labels.items():
            label.position = (np.array(self._contacts[name]) * self._scale - self._center_of_mass) / self.unit
            _set_visible(label, label in shown and self._shown["Contacts"])

    def _make_body(self, surface) -> None:
        """The nodes of body and ghost: mesh coordinates about the middle of the box, to be scaled by the node itself.

        The pointer meets the mesh as it is, whose outline under the pointer is whole; what is drawn has its vertices split where
        edges are sharp, and an outline made of it would be torn there.
        """
        scene = self._scene
        if surface is None:
            self.body = self._drawn_mesh = scene.add_icosphere("/body/mesh", 1.0, BODY_COLOUR, subdivisions=4)
            self._ghost = scene.add_icosphere(
                "/ghost/mesh", 1.0, GHOST_COLOUR, opacity=GHOST_OPACITY, cast_shadow=False
            )
        else:
            whole = surface.vertices - self._middle
            vertices, triangles, _ = shaded_surface(whole, surface.triangles)
            style: dict[str, Any] = {"color": BODY_COLOUR, "side": "double"}
            if len(vertices) == len(whole):
                self.body = self._drawn_mesh = scene.add_mesh_simple("/body/mesh", vertices, triangles, **style)
            else:
                self.body = scene.add_mesh_simple(
                    "/body/mesh",
                    whole,
                    surface.triangles,
                    opacity=0.0,
                    cast_shadow=False,
                    receive_shadow=False,
                    **style,
                )
                self._drawn_mesh = scene.add_mesh_simple("/body/drawn", vertices, triangles, **style)
            self._ghost = scene.add_mesh_simple(
                "/ghost/mesh",
                vertices,
                triangles,
                color=GHOST_COLOUR,
                opacity=GHOST_OPACITY,
                side="double",
            )
        self._body_opacity()

    def look_again(self, now_s: float) -> None:
        """Have the browsers look whether the pointer is still on the body. They do so where the pointer moves, and when something
        about the node changes: so its colour does, by less than can be seen."""
        if self.body is not None and now_s >= self._look_due_s:
            self._look_due_s = now_s + LOOK_AGAIN_S
            red, green, blue = BODY_COLOUR
            self._look_odd = not self._look_odd
            self.body.color = (red, green, blue + self._look_odd)

    def _draw_inertia(self, scenario: Scenario, box, ellipsoid, corners) -> None:
        body, unit, scene = scenario.setup.body, self.unit, self._scene
        size = 2.0 * self._radius / unit
        self._body_axes.axes_length = 0.7 * size
        for label, direction in zip(self._body_axes_labels, np.eye(3), strict=True):
            label.position = 0.75 * size * direction
        turned = _wxyz(quaternion_from_matrix(body.principal_axes))
        axes = np.zeros((3, 2, 3))
        # All end outside the body, or the shortest would lie inside a rod.
        lengths = 1.0 + 0.35 * np.sqrt(body.principal_moments / body.principal_moments[2])
        axes[:, 1] = np.diag(self._radius / unit * lengths)
        see_through = {"opacity": 0.3}
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
        ends = axes[:, 1] * 1.08 @ body.principal_axes.T
        for k, end in enumerate(ends):
            label = scene.add_label(
                f"/body/axis{k + 1}", f"I{'₁₂₃'[k]}", position=end, visible=self._shown["Principal axes"]
            )
            self._handles["Principal axes"].append(label)

    # Every frame

    def place(self, row: np.ndarray, now_s: float) -> None:
        """Move the body to a state's pose (13,)."""
        self._body_frame.position = at = self._drawn(row[0:3])
        self._body_frame.wxyz = _wxyz(row[3:7])
        if self._shown["Grid"]:
            below = np.array([at[0], at[1], FLOOR + ABOVE_FLOOR])
            scale, offset = self._scale / self.unit, self._center_of_mass / self.unit
            self._shadow.draw(now_s, row[3:7], scale, offset, self._radius / self.unit, below)
        else:
            self._shadow.hide()

    def place_surroundings(self, falls: bool) -> None:
        """Floor, wall and world axes stand still in the world while the picture follows the body. falls: there is gravity."""
        self._world_axes.position = -(self.origin / self.unit)
        self._surroundings.place(self.origin, self.unit, falls)

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

    def show_motion(self, position: np.ndarray, momentum: np.ndarray, omega: np.ndarray) -> dict[str, str]:
        """L [kg m²/s] and ω [rad/s], both (3,) in world axes, at the COM; returns what each arrow's length stands for."""
        shown = (self._shown["Angular momentum L"], self._shown["Angular velocity ω"])
        return self._motion.show(self._drawn(position), momentum, omega, 2.0 * self._radius, self.unit, shown)

    def _show_arrows(self, handle, arrows, switch: str) -> None:
        arrows = [(p, v) for p, v in arrows if float(np.abs(v).max()) > 0.02 * self.unit]
        shown = bool(arrows) and self._shown[switch]
        if shown:
            handle.points = np.array([[self._drawn(p), self._drawn(p + v)] for p, v in arrows])
        _set_visible(handle, shown)

    def show_ghost(self, row: np.ndarray | None, center_of_mass: np.ndarray, names: tuple[str, str]) -> None:
        """The ghost at a state's pose, or nowhere; its COM (3,) in scaled mesh coordinates. names: of body and ghost, which
        are written at the point of each that is farthest from the body's COM."""
        shown = row is not None and self._shown["Ghost"]
        if shown:
            self._ghost_frame.position = self._drawn(row[0:3])
            self._ghost_frame.wxyz = _wxyz(row[3:7])
            if self._surface is not None:
                self._ghost.position = (self._middle * self._scale - center_of_mass) / self.unit
            tip = self._tip * self._scale
            for label, com, name in zip(self._names, (self._center_of_mass, center_of_mass), names, strict=True):
                label.position = (tip - com) / self.unit
                if label.text != name:
                    label.text = name
        _set_visible(self._ghost_frame, shown)
        for label in self._names:
            _set_visible(label, shown)

    def _drawn(self, world_point) -> np.ndarray:
        return (np.asarray(world_point) - self.origin) / self.unit


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
