# SPDX-License-Identifier: MIT
"""What the body is seen against: a floor with a scale bar, and a wall that shows how fast it falls.

The floor goes with the picture, so a falling body keeps it below; its lines are those of the world, and so are those of
the wall, whose heights are written beside them. Neither is ground: nothing collides.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..picture.style import GREY
from .motion_arrows import length_text
from .poke_mark import UNWRITTEN

CELL, SECTION = 0.5, 2.5
"""Between thin and thick lines, in the picture's units."""

FLOOR, WALL = -0.8, 2.5
"""Where they are from the picture's middle: below it, and behind it as a page looks at first."""

WIDTH, HEIGHT = 20.0, 10.0
"""Of floor and wall."""

LEFT_FLOOR = 0.5
"""Picture units up or down from where it began after which a body is seen against the wall."""

BAR = np.array([[-0.5 * CELL, 0.9, FLOOR], [0.5 * CELL, 0.9, FLOOR]])
"""The scale bar: as long as a cell, on the floor behind the body."""


class Surroundings:
    """Floor, wall and scale bar of the picture."""

    def __init__(self, scene: Any) -> None:
        lines: dict[str, Any] = {"cell_size": CELL, "section_size": SECTION}
        self._floor = scene.add_grid("/grid/floor", width=WIDTH, height=WIDTH, shadow_opacity=0.0, **lines)
        self._wall = scene.add_grid(
            "/grid/wall", width=WIDTH, height=HEIGHT, plane="xz", shadow_opacity=0.0, visible=False, **lines
        )
        self._heights = [
            scene.add_label(f"/grid/height{k}", UNWRITTEN, visible=False, anchor="center-right", font_screen_scale=0.8)
            for k in range(2)
        ]
        self._bar = scene.add_line_segments("/grid/bar", BAR[np.newaxis], GREY, thickness=0.025)
        self._bar_label = scene.add_label("/grid/bar_label", UNWRITTEN, position=BAR[1], anchor="center-left")
        self._shown = True

    def switch(self, shown: bool) -> None:
        """Show or hide all of it."""
        self._shown = shown
        for handle in (self._floor, self._bar, self._bar_label):
            handle.visible = shown
        if not shown:
            self._show_wall(False)

    def place(self, origin: np.ndarray, unit: float, falls: bool) -> None:
        """The picture's middle is at the world point ``origin`` (3,), one of its units is ``unit`` [m] long. falls:
        there is gravity.
        """
        text = length_text(CELL * unit)
        if self._bar_label.text != text:
            self._bar_label.text = text
        middle = np.asarray(origin) / unit
        x, y = (-middle[:2]) % SECTION
        self._floor.position = (x, y, FLOOR)
        if self._shown:
            seen = falls or abs(float(middle[2])) > LEFT_FLOOR
            self._show_wall(seen)
            if seen:
                self._place_wall(x, float(middle[2]), unit)

    def _place_wall(self, x: float, height: float, unit: float) -> None:
        self._wall.position = (x, WALL, -height % SECTION)
        first = math.ceil((height - 0.5 * SECTION) / SECTION)
        for k, label in enumerate(self._heights):
            line = SECTION * (first + k)
            label.position = (-1.6, WALL, line - height)
            text = f"z = {line * unit:.6g} m"
            if label.text != text:
                label.text = text

    def _show_wall(self, visible: bool) -> None:
        for handle in (self._wall, *self._heights):
            if handle.visible != visible:
                handle.visible = visible
