# SPDX-License-Identifier: MIT
"""The 3D picture: the body, what acts on it, its trails, and the floor.

The picture shows the world point ``origin`` at its middle and ``unit`` metres as one, so that a nut and a satellite
fill the page alike and single precision is enough anywhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import viser

from ..picture.plot_range import nice_step
from ..picture.string import string_curves
from ..picture.style import FORCE_COLOUR, HAND_COLOUR, STRING_COLOUR
from ..scene.scenario import Scenario
from .body_view import BodyView, Switches, body_corners, set_visible
from .followed_loads import Hit
from .motion_arrows import MotionArrows
from .poke_mark import PokeMark
from .soft_shadow import SoftShadow
from .surroundings import FLOOR, Surroundings
from .trails import COM_TRAIL, POINT_TRAIL, Trails

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

HINTS = {"Contacts": "Names of the lesson's contacts, while no ghost is shown"}
"""Of switches that don't say it all."""

ZOOM = (0.15, 1.2)
"""Body sizes in the picture's units between which a body may grow or shrink before the picture is scaled anew."""

BELOW_FLOOR = 2e-3
"""Picture units that the shadow lies below the floor. Above it, a browser that draws the shadow first would leave out
the floor's lines around it; at one height they would flicker.
"""

LEASH = 0.2
"""Body sizes that the body may move from the picture's middle before the picture follows."""

CAMERA = (1.45, -2.45, 1.2)
"""Where a page looks from at first, in the picture's units."""


class SceneView:
    """The picture that all pages show; its methods run on the page's thread. follows: whether it keeps
    the body in view.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = scene = server.scene
        self.unit = 1.0
        self.origin = np.zeros(3)
        self.follows = True
        self._position = np.zeros(3)
        self.switches = Switches(SWITCHES)
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        scene.configure_default_lights(cast_shadow=False)
        server.initial_camera.position = CAMERA
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        server.initial_camera.fov = math.radians(40.0)
        self.body = BodyView(scene, self.switches)
        self._surroundings = Surroundings(scene)
        self._shadow = SoftShadow(scene, "/grid/shadow")
        self._world_axes = scene.add_frame(
            "/world", axes_length=0.8, axes_radius=0.008, origin_radius=0.0, visible=False
        )
        for axis, direction in zip("xyz", np.eye(3), strict=True):
            scene.add_label(f"/world/{axis}", axis, position=0.85 * direction)
        self.switches.govern("World axes", [self._world_axes])
        none = np.zeros((1, 2, 3))
        self._string = scene.add_line_segments("/string/line", none, STRING_COLOUR, thickness=0.012, visible=False)
        self.hand = scene.add_icosphere("/string/hand", 0.018, HAND_COLOUR, visible=False)
        thick: dict[str, Any] = {"shaft_radius": 0.013, "head_radius": 0.034, "head_length": 0.09, "visible": False}
        self._loads = scene.add_arrows("/forces", none, FORCE_COLOUR, **thick)
        self._poke = PokeMark(scene, FORCE_COLOUR)
        self._motion = MotionArrows(scene)
        self.trails = Trails(scene)

    @property
    def radius(self) -> float:
        """Half the body's size [m]."""
        return self.body.radius

    def switch(self, name: str, shown: bool) -> None:
        """Show or hide one of SWITCHES."""
        if name == "See through the body":
            self.body.see_through(shown)
        if name in (COM_TRAIL, POINT_TRAIL):
            self.trails.switch(name, shown)
        if name == "Grid":
            self._surroundings.switch(shown)
        self.switches.switch(name, shown)

    def set_body(self, scenario: Scenario, zoom: bool) -> bool:
        """Draw the body anew where it changed; returns whether the pointer meets another node now. ``zoom`` makes it
        fill the picture, else it does so only where it would be lost or too large to be seen."""
        replaced = self.body.is_new(scenario)
        size = float(np.linalg.norm(np.diff(body_corners(scenario), axis=0)))
        if zoom or replaced or not ZOOM[0] <= size / self.unit <= ZOOM[1]:
            self.unit = nice_step(size)
        self.body.set_body(scenario, self.unit)
        if replaced:
            self._shadow.of(scenario.setup.surface)
        return replaced

    # Every frame

    def centre(self) -> None:
        """The picture's middle is where the body is."""
        self.origin = self._position.copy()

    def follow(self, position: np.ndarray, held: bool) -> None:
        """The body is there (3,) [m]; the picture's middle follows where it has come too far from it,
        unless it is ``held``.
        """
        self._position = position
        away = position - self.origin
        distance, leash = float(np.linalg.norm(away)), LEASH * 2.0 * self.radius
        if self.follows and not held and distance > leash:
            self.origin = self.origin + away * (1.0 - leash / distance)

    def place(self, row: np.ndarray, now_s: float) -> None:
        """Move the body to a state's pose (13,)."""
        at = self._drawn(row[0:3])
        self.body.place(at, row[3:7])
        if self.switches.shown("Grid"):
            below = np.array([at[0], at[1], FLOOR - BELOW_FLOOR])
            self._shadow.draw(now_s, row[3:7], *self.body.placement, self.radius / self.unit, below)
        else:
            self._shadow.hide()

    def place_surroundings(self, falls: bool) -> None:
        """Floor, wall and world axes stand still in the world while the picture follows the body. falls:
        there is gravity.
        """
        self._world_axes.position = -(self.origin / self.unit)
        self._surroundings.place(self.origin, self.unit, falls)

    def draw_trails(self, now_s: float, until_ns: int, scenario: Scenario) -> None:
        """The paths of COM and point up to a moment of the flight."""
        setup = scenario.setup
        self.trails.draw(now_s, until_ns, setup.body, setup.surface, self.origin, self.unit)

    def show_string(self, ends: tuple[np.ndarray, np.ndarray] | None, slack_length: float, gravity: np.ndarray) -> None:
        """From the knot to the hand, both in the world; None for no string. slack_length [m] and gravity (3,): as
        ``string_curves`` has them.
        """
        shown = ends is not None and self.switches.shown("String")
        if ends is not None and shown:
            knot, hand = ends
            curve = self._drawn(string_curves(hand[np.newaxis], knot[np.newaxis], slack_length, gravity)[0])
            self._string.points = np.stack([curve[:-1], curve[1:]], axis=1)
            self.hand.position = curve[0]
        set_visible(self._string, shown)
        set_visible(self.hand, shown)

    def show_loads(self, arrows: Sequence[tuple[np.ndarray, np.ndarray]]) -> None:
        """Forces: point of attack and drawn vector, both in the world [m]."""
        arrows = [(p, v) for p, v in arrows if float(np.abs(v).max()) > 0.02 * self.unit]
        shown = bool(arrows) and self.switches.shown("Forces")
        if shown:
            self._loads.points = np.array([[self._drawn(p), self._drawn(p + v)] for p, v in arrows])
        set_visible(self._loads, shown)

    def show_hit(self, hit: Hit | None) -> None:
        """Where the last poke hit, and how hard; None for no poke."""
        if hit is None or not self.switches.shown("Forces"):
            self._poke.hide()
        else:
            size = 2.0 * self.radius / self.unit
            self._poke.show(self._drawn(hit.point), hit.direction, hit.text, hit.age, size)

    def show_motion(self, position: np.ndarray, momentum: np.ndarray, omega: np.ndarray) -> dict[str, str]:
        """L [kg m²/s] and ω [rad/s], both (3,) in world axes, at the COM; returns what each arrow's
        length stands for.
        """
        shown = (self.switches.shown("Angular momentum L"), self.switches.shown("Angular velocity ω"))
        return self._motion.show(self._drawn(position), momentum, omega, 2.0 * self.radius, self.unit, shown)

    def show_ghost(self, row: np.ndarray | None, center_of_mass: np.ndarray, names: tuple[str, str]) -> None:
        """The ghost at a state's pose, or nowhere; see BodyView.place_ghost."""
        if row is None or not self.switches.shown("Ghost"):
            self.body.hide_ghost()
        else:
            self.body.place_ghost(self._drawn(row[0:3]), row[3:7], center_of_mass, names)

    def _drawn(self, world_point: np.ndarray) -> np.ndarray:
        return (np.asarray(world_point) - self.origin) / self.unit
