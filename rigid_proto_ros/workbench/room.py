# SPDX-License-Identifier: MIT
"""What surrounds the body in the picture: a floor that takes its shadow, a wall where it falls, the camera.

The light is viser's own. A recording's player puts it on again whenever it loops, whatever the recording says.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import viser

from ..base.vectors import Vector3
from ..picture.surface import BOX_CORNERS
from ..simulation.setup import Setup
from .drawing import move
from .readouts import nice_step

Colour = tuple[int, int, int]

FIELD_OF_VIEW = math.radians(35.0)

VIEW = np.array([0.50, -0.80, 0.34]) / math.sqrt(0.50**2 + 0.80**2 + 0.34**2)
"""Direction from the body to the camera, at first."""

BODY_FILLS, PATH_FILLS = 0.62, 0.9
"""Of the picture's height: the body's longest diagonal, so that the body as it stands fills a third, and the path of
one that falls.
"""

BLUE = (16, 60, 110)
"""Of buttons on white; viser lightens it by half. Its own has less than the contrast of 4.5 that small letters need."""

CELLS = 4.0
"""About so many cells of the floor's grid to a unit."""

SLOPE = math.tan(0.5 * FIELD_OF_VIEW)

LEASH = 0.2
"""Body sizes that the body may move from where it is expected before the picture follows; so deep is the floor."""

GRID: dict[str, Any] = {
    "infinite_grid": True,
    # The floor's lines behind a wall that one sees through would be a second grid in the first.
    "plane_opacity": 1.0,
    "fade_from": "origin",
    "fade_strength": 1.5,
    "cell_thickness": 0.6,
    "section_thickness": 0.9,
}

LEAST_FALL_S, LONGEST_FALL_S = 0.6, 1.5
"""[s] Of the flight of a body that falls, which the picture has room for."""

SKY_ROWS = 64


class Theme(NamedTuple):
    """Colours of a page. shadow: opacity."""

    floor: Colour
    wall: Colour
    cell: Colour
    section: Colour
    sky: Colour
    shadow: float


LIGHT = Theme((236, 236, 238), (244, 245, 247), (220, 220, 224), (202, 202, 208), (250, 251, 253), 0.32)
DARK = Theme((44, 47, 52), (36, 38, 43), (58, 62, 68), (72, 77, 84), (26, 28, 32), 0.5)


def fall_s(setup: Setup) -> float:
    """How long [s] a body that falls stays in sight: until it is as high as at first."""
    rise, pull = -float(setup.initial[7:10] @ setup.gravity), float(setup.gravity @ setup.gravity)
    return min(max(2.0 * rise / pull, LEAST_FALL_S), LONGEST_FALL_S) if pull else LONGEST_FALL_S


def distance_to_see(half_sides: Vector3) -> float:
    """How far off a camera sees all of a box with these half sides (3,), in a picture as high as wide."""
    right = np.cross(-VIEW, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    corners = half_sides * BOX_CORNERS
    beside = np.abs(corners @ np.column_stack([right, np.cross(right, -VIEW)])).max(axis=1)
    return float((corners @ VIEW + beside / (PATH_FILLS * SLOPE)).max())


class Room:
    """Lengths are the picture's units: one is the body's size. The floor stays below the picture's middle while its
    lines stand still in the world. cell: between lines of its grid. far: the camera's distance, in that from which a
    body alone is seen.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._scene = scene = server.scene
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        self._floor = scene.add_grid("/room/floor", **GRID)
        self._wall = scene.add_grid("/room/wall", plane="xz", **GRID)
        self.paint(False)
        self.furnish(1.0, np.full(3, -0.5), np.full(3, 0.5), False)

    def paint(self, dark: bool) -> None:
        """Light or dark, all of it."""
        theme = DARK if dark else LIGHT
        brand = None if dark else BLUE
        self._server.gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="large", dark_mode=dark, brand_color=brand
        )
        for grid in (self._floor, self._wall):
            grid.cell_color, grid.section_color = theme.cell, theme.section
        self._floor.plane_color, self._floor.shadow_opacity = theme.floor, theme.shadow
        self._wall.plane_color = theme.wall
        share = np.linspace(0.0, 1.0, SKY_ROWS)[:, np.newaxis] ** 2
        rows = (1.0 - share) * np.array(theme.sky) + share * np.array(theme.floor)
        self._scene.set_background_image(np.repeat(rows[:, np.newaxis].astype(np.uint8), 4, axis=1))

    def furnish(self, size_m: float, low: Vector3, high: Vector3, falls: bool) -> None:
        """For a body of this size [m] that will be between two corners (3,) [units, from the picture's middle]."""
        half_sides = 0.5 * (high - low)
        self._middle = 0.5 * (low + high)
        self._reach = np.maximum(half_sides - 0.5, LEASH)
        self._floor_height = float(low[2]) - LEASH
        nearest = 0.5 / BODY_FILLS / SLOPE
        distance = max(nearest, distance_to_see(half_sides))
        self.far = distance / nearest
        # From further off, thin lines would flicker where they lie close together.
        self.cell = nice_step(size_m * self.far / CELLS) / size_m
        for grid in (self._floor, self._wall):
            grid.cell_size, grid.section_size, grid.fade_distance = self.cell, 5.0 * self.cell, 3.0 * distance
        self._wall.visible = falls
        self._distance = distance
        camera = self._server.initial_camera
        camera.position, camera.look_at, camera.fov = self._middle + distance * VIEW, self._middle, FIELD_OF_VIEW
        for client in self._server.get_clients().values():
            self.look(client)

    def look(self, client: viser.ClientHandle) -> None:
        """Let this page see all that is expected; in a picture that is higher than wide, from further off."""
        camera = client.camera
        narrow = max(1.0, camera.image_height / max(camera.image_width, 1))
        with client.atomic():
            camera.position, camera.look_at = self._middle + narrow * self._distance * VIEW, self._middle

    def follow(self, position: Vector3, origin: Vector3, unit: float) -> Vector3:
        """The world point (3,) [m] at the picture's middle, for a body there, so that it stays in sight."""
        away = position - (origin + unit * self._middle)
        return origin + away - np.clip(away, -unit * self._reach, unit * self._reach)

    def place(self, origin: Vector3, unit: float) -> None:
        """The picture's middle is at the world point ``origin`` (3,) [m], one of its units is ``unit`` [m]."""
        x, y, z = (-np.asarray(origin) / unit) % (5.0 * self.cell)
        move(self._floor, np.array([x, y, self._floor_height]))
        if not self._wall.visible:
            return
        behind = self._middle[1] + 1.5 + float(np.linalg.norm(self._reach))
        move(self._wall, np.array([x, behind, z]))
