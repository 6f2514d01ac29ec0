# SPDX-License-Identifier: MIT
"""The body in the picture: its mesh, what shows its inertia, its contacts, and the ghost drawn through it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import viser

from ..base.rotation import matrix_from_quaternion, quaternion_from_matrix
from ..mass.tensor import equimomental_shapes
from ..motion.surface import Surface
from ..picture.style import AXES_COLOURS, BODY_COLOUR, GHOST_COLOUR, MOMENTUM_COLOUR
from ..picture.surface import shaded_surface
from ..scene.scenario import Scenario
from .pair_names import PairNames

BOUNDS_COLOUR = (90, 90, 90)

COM_SIZE = 0.025
"""Radius of the centre of mass as drawn, in body sizes."""

GHOST_OPACITY = 0.4
SEE_THROUGH = 0.45
"""Opacity of a body that one can look into."""

LOOK_AGAIN_S = 0.25
"""[s] Between two looks of the browsers at whether the pointer is still on a body that moves."""

LAST_LOOK_S = 2.0 * LOOK_AGAIN_S
"""[s] Looks go on for so long after a movement: the one before may have come before the body was drawn at its place."""

Wxyz = tuple[float, float, float, float]


class Switches:
    """What can be shown in the picture, by name, and the nodes that a switch shows or hides."""

    def __init__(self, initially: Mapping[str, bool]) -> None:
        self._shown = dict(initially)
        self._nodes: dict[str, list[Any]] = {name: [] for name in initially}

    def shown(self, name: str) -> bool:
        """Whether it is switched on."""
        return self._shown[name]

    def nodes(self, name: str) -> list[Any]:
        """The nodes that this switch governs."""
        return self._nodes[name]

    def govern(self, name: str, nodes: Iterable[Any]) -> None:
        """The switch shows and hides these nodes from now on."""
        self._nodes[name] = list(nodes)
        for node in self._nodes[name]:
            set_visible(node, self._shown[name])

    def switch(self, name: str, shown: bool) -> None:
        """Turn it on or off."""
        self._shown[name] = shown
        for node in self._nodes[name]:
            set_visible(node, shown)


class BodyView:
    """Nodes of body and ghost. Lengths on the page are in the picture's units of ``unit`` metres.

    mesh: the node that the pointer meets; com: that of the centre of mass.
    """

    def __init__(self, scene: viser.SceneApi, switches: Switches) -> None:
        self._scene = scene
        self._switches = switches
        self.mesh: Any = None
        self.com: Any = None
        self.radius = 0.5
        self._unit = 1.0
        self._drawn_mesh: Any = None
        self._ghost: Any = None
        self._surface: Surface | None = None
        self._shape: tuple[Any, ...] = ()
        self._scale, self._center_of_mass = np.ones(3), np.zeros(3)
        self._middle = np.zeros(3)
        self._far_points = np.zeros((2, 3))
        self._look_due_s, self._look_odd = 0.0, False
        self._look_until_s, self._last_pose = 0.0, np.zeros(7)
        self._frame = scene.add_frame("/body", show_axes=False)
        self._ghost_frame = scene.add_frame("/ghost", show_axes=False, visible=False)
        self._names = PairNames(scene)
        self._axes = scene.add_frame("/body/own_axes", axes_radius=0.008, origin_radius=0.0, visible=False)
        self._axes_labels = [scene.add_label(f"/body/own_axes/{axis}", f"body {axis}") for axis in "xyz"]
        switches.govern("Body axes", [self._axes])
        self._contacts: dict[str, tuple[float, ...]] = {}
        self._mesh_name = self._contacts_mesh = ""
        self._contact_labels: dict[str, Any] = {}

    def is_new(self, scenario: Scenario) -> bool:
        """Whether the scenario's surface isn't the one that is drawn."""
        return self.mesh is None or scenario.setup.surface is not self._surface

    def set_body(self, scenario: Scenario, unit: float) -> None:
        """Draw the scenario's body, anew where it changed."""
        body, surface = scenario.setup.body, scenario.setup.surface
        box, ellipsoid = equimomental_shapes(body.mass, body.principal_moments)
        corners = body_corners(scenario)
        self.radius = 0.5 * float(np.linalg.norm(corners[1] - corners[0]))
        self._unit = unit
        replaced = self.is_new(scenario)
        if replaced:
            self._surface = surface
            if surface is not None:
                # Drawn vertices are relative to it: single precision is enough then, however far out the mesh lies.
                self._middle = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
            self._make_meshes(surface)
        if surface is not None:
            offset = (self._middle * body.scale - body.center_of_mass) / unit
            scale = tuple((body.scale / unit).tolist())
        else:
            offset, scale = np.zeros(3), tuple((ellipsoid / unit).tolist())
        turned = (1.0, 0.0, 0.0, 0.0) if surface is not None else wxyz(body.principal_quaternion)
        for mesh in (self.mesh, self._drawn_mesh, self._ghost):
            mesh.scale, mesh.position, mesh.wxyz = scale, offset, turned
        self._scale, self._center_of_mass = body.scale, body.center_of_mass
        shape = (body.inertia.tobytes(), body.center_of_mass.tobytes(), *scale)
        if replaced or shape != self._shape:
            self._shape = shape
            self._draw_inertia(scenario, box, ellipsoid, corners)
            self._far_points = _far_points(surface, body.scale, body.center_of_mass, self.radius)
        self._place_contacts(str(scenario.parameters.mesh))

    def _make_meshes(self, surface: Surface | None) -> None:
        """The nodes of body and ghost: mesh coordinates about the middle of the box, to be scaled by the node itself.

        The pointer meets the mesh as it is, whose outline under the pointer is whole; what is drawn has its vertices
        split where edges are sharp, and an outline made of it would be torn there.
        """
        scene = self._scene
        drawn_apart = self._drawn_mesh if self._drawn_mesh is not self.mesh else None
        if surface is None:
            self.mesh = self._drawn_mesh = scene.add_icosphere("/body/mesh", 1.0, BODY_COLOUR, subdivisions=4)
            self._ghost = scene.add_icosphere(
                "/ghost/mesh", 1.0, GHOST_COLOUR, opacity=GHOST_OPACITY, cast_shadow=False
            )
        else:
            whole = surface.vertices - self._middle
            vertices, triangles, _ = shaded_surface(whole, surface.triangles)
            style: dict[str, Any] = {"color": BODY_COLOUR, "side": "double"}
            if len(vertices) == len(whole):
                self.mesh = self._drawn_mesh = scene.add_mesh_simple("/body/mesh", vertices, triangles, **style)
            else:
                unseen: dict[str, Any] = {"opacity": 0.0, "cast_shadow": False, "receive_shadow": False, **style}
                self.mesh = scene.add_mesh_simple("/body/mesh", whole, surface.triangles, **unseen)
                self._drawn_mesh = scene.add_mesh_simple("/body/drawn", vertices, triangles, **style)
            self._ghost = scene.add_mesh_simple(
                "/ghost/mesh", vertices, triangles, color=GHOST_COLOUR, opacity=GHOST_OPACITY, side="double"
            )
        if drawn_apart is not None and self._drawn_mesh is self.mesh:
            drawn_apart.remove()  # the body before had sharp edges, this one has none: no node takes its place
        self.see_through(self._switches.shown("See through the body"))

    def see_through(self, seen_through: bool) -> None:
        """Whether one can look into the body."""
        if self.mesh is None:
            return
        if self._drawn_mesh is self.mesh:
            self.mesh.opacity = SEE_THROUGH if seen_through else None
        else:
            self.mesh.opacity = SEE_THROUGH if seen_through else 0.0
            self._drawn_mesh.visible = not seen_through

    def look_again(self, now_s: float) -> None:
        """Have the browsers look whether the pointer is still on a body that moves. They do so where the pointer moves,
        and when something about the node changes: so its colour does, by less than can be seen. Each such change has
        them draw for a quarter of a second, so that there is none while the body is at rest.
        """
        pose = np.concatenate([self._frame.position, self._frame.wxyz])
        if not np.array_equal(pose, self._last_pose):
            self._last_pose, self._look_until_s = pose, now_s + LAST_LOOK_S
        if self.mesh is not None and self._look_due_s <= now_s <= self._look_until_s:
            self._look_due_s = now_s + LOOK_AGAIN_S
            red, green, blue = BODY_COLOUR
            self._look_odd = not self._look_odd
            self.mesh.color = (red, green, blue + self._look_odd)

    def _draw_inertia(self, scenario: Scenario, box: np.ndarray, ellipsoid: np.ndarray, corners: np.ndarray) -> None:
        body, unit, scene = scenario.setup.body, self._unit, self._scene
        size = 2.0 * self.radius / unit
        self._axes.axes_length = 0.7 * size
        for label, direction in zip(self._axes_labels, np.eye(3), strict=True):
            label.position = 0.75 * size * direction
        turned = wxyz(quaternion_from_matrix(body.principal_axes))
        axes = np.zeros((3, 2, 3))
        # All end outside the body, or the shortest would lie inside a rod.
        lengths = 1.0 + 0.35 * np.sqrt(body.principal_moments / body.principal_moments[2])
        axes[:, 1] = np.diag(self.radius / unit * lengths)
        arrows = scene.add_arrows(
            "/body/axes",
            axes,
            np.array(AXES_COLOURS),
            wxyz=turned,
            shaft_radius=0.008,
            head_radius=0.022,
            head_length=0.06,
        )
        labels = [
            scene.add_label(f"/body/axis{k + 1}", f"I{'₁₂₃'[k]}", position=end)
            for k, end in enumerate(axes[:, 1] * 1.08 @ body.principal_axes.T)
        ]
        self.com = scene.add_icosphere("/body/com", COM_SIZE * size, (30, 30, 30))
        semi_axes = tuple((ellipsoid / unit).tolist())
        solid = scene.add_icosphere("/body/ellipsoid", 1.0, MOMENTUM_COLOUR, scale=semi_axes, wxyz=turned, opacity=0.3)
        equal = scene.add_box("/body/box", GHOST_COLOUR, tuple((box / unit).tolist()), wxyz=turned, opacity=0.3)
        for node in self._switches.nodes("Bounding box"):
            node.remove()
        bounds: list[Any] = []
        if scenario.setup.surface is not None:
            edges = _box_edges((corners - body.center_of_mass) / unit)
            bounds = [scene.add_line_segments("/body/bounds", edges, BOUNDS_COLOUR, thickness=0.005)]
        for name, nodes in (
            ("COM", [self.com]),
            ("Principal axes", [arrows, *labels]),
            ("Inertia ellipsoid", [solid]),
            ("Box of equal inertia", [equal]),
            ("Bounding box", bounds),
        ):
            self._switches.govern(name, nodes)

    # Contacts

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
        self._place_contacts(self._mesh_name)

    def _place_contacts(self, mesh: str) -> None:
        self._mesh_name = mesh
        for name, label in self._contact_labels.items():
            label.position = (np.array(self._contacts[name]) * self._scale - self._center_of_mass) / self._unit
        self._govern_contacts()

    def _govern_contacts(self) -> None:
        """Their names are written on the body; while it has one itself beside its ghost's, there would be too many."""
        written = self._mesh_name == self._contacts_mesh and not self._names.shown
        if not written:
            for label in self._contact_labels.values():
                set_visible(label, False)
        self._switches.govern("Contacts", self._contact_labels.values() if written else ())

    # Every frame

    def place(self, at: np.ndarray, quaternion_xyzw: np.ndarray) -> None:
        """Move the body to a point of the picture (3,), in this attitude."""
        self._frame.position = at
        self._frame.wxyz = wxyz(quaternion_xyzw)

    @property
    def placement(self) -> tuple[np.ndarray, np.ndarray]:
        """Scale (3,) of mesh coordinates to the picture's units, and the COM (3,) in these."""
        return self._scale / self._unit, self._center_of_mass / self._unit

    def hide_ghost(self) -> None:
        """No ghost, or it isn't to be shown."""
        set_visible(self._ghost_frame, False)
        if self._names.shown:
            self._names.hide()
            self._govern_contacts()

    def place_ghost(
        self, at: np.ndarray, quaternion_xyzw: np.ndarray, center_of_mass: np.ndarray, names: tuple[str, str]
    ) -> None:
        """The ghost's COM at a point of the picture (3,), in this attitude; its COM (3,) in scaled mesh coordinates.
        names: of body and ghost. Call it after ``place``.
        """
        self._ghost_frame.position = at
        self._ghost_frame.wxyz = wxyz(quaternion_xyzw)
        if self._surface is not None:
            self._ghost.position = (self._middle * self._scale - center_of_mass) / self._unit
        set_visible(self._ghost_frame, True)
        coms, apart = np.array([self._frame.position, at]), center_of_mass - self._center_of_mass
        w, x, y, z = self._frame.wxyz
        attitudes = matrix_from_quaternion(np.array([(x, y, z, w), quaternion_xyzw]))
        points = self._far_points - np.array([np.zeros(3), apart])
        drawn = coms + np.einsum("kij,kj->ki", attitudes, points) / self._unit
        were_shown = self._names.shown
        self._names.show(names, coms, drawn, self.radius / self._unit)
        if not were_shown:
            self._govern_contacts()


def _far_points(surface: Surface | None, scale: np.ndarray, center_of_mass: np.ndarray, radius: float) -> np.ndarray:
    """Two points (2, 3) [m, from the COM] of a body, far from the COM and from each other."""
    if surface is None:
        return radius * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    vertices = surface.vertices * scale - center_of_mass
    distances = np.einsum("ij,ij->i", vertices, vertices)
    first = vertices[int(np.argmax(distances))]
    away = vertices - first
    second = vertices[int(np.argmax(np.minimum(distances, np.einsum("ij,ij->i", away, away))))]
    return np.array([first, second])


def body_corners(scenario: Scenario) -> np.ndarray:
    """Two opposite corners (2, 3) [m, scaled mesh coordinates] of the box around the body; without a mesh of the
    ellipsoid of equal inertia, about the COM.
    """
    body, surface = scenario.setup.body, scenario.setup.surface
    if surface is None:
        _, ellipsoid = equimomental_shapes(body.mass, body.principal_moments)
        return np.array([-ellipsoid, ellipsoid])
    corners = np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]) * body.scale
    return np.sort(corners, axis=0)


def _box_edges(corners: np.ndarray) -> np.ndarray:
    """The twelve edges (12, 2, 3) of the box between two corners (2, 3)."""
    ends = [(k, k | 1 << axis) for axis in range(3) for k in range(8) if not k >> axis & 1]
    return np.array([[[corners[k >> axis & 1, axis] for axis in range(3)] for k in pair] for pair in ends])


def wxyz(q_xyzw: Iterable[float]) -> Wxyz:
    """A quaternion in viser's order."""
    x, y, z, w = (float(c) for c in q_xyzw)
    return w, x, y, z


def set_visible(node: Any, visible: bool) -> None:
    """Show or hide a node; one that is so already isn't sent anew."""
    if node.visible != visible:
        node.visible = visible
