# SPDX-License-Identifier: MIT
"""The paths of the centre of mass and of one point of the body over the last seconds of simulated time."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..motion.body import Body
from ..motion.surface import Surface
from ..picture.style import POINT_TRAIL_COLOUR, TRAIL_COLOUR

LASTS_S = 4.0
"""[s, simulated] Length of a path."""

POINTS = 300
"""Of one path, always: it goes to every page some times a second, and viser loses the colours of lines
whose number changes.
"""

DRAWN_S = 0.1
"""[s] Between two drawings."""

COM_TRAIL, POINT_TRAIL = "Path of the COM", "Path of a point"
COLOURS = {COM_TRAIL: TRAIL_COLOUR, POINT_TRAIL: POINT_TRAIL_COLOUR}
BACKGROUND = np.array([255.0, 255.0, 255.0])
"""What the old end of a path fades to."""


def farthest_point(surface: Surface, body: Body) -> np.ndarray:
    """The vertex (3,) farthest from the COM [mesh coordinates]: the point whose path tells most of the motion."""
    away = surface.vertices * body.scale - body.center_of_mass
    return surface.vertices[int(np.argmax(np.einsum("ij,ij->i", away, away)))].copy()


class Trails:
    """Remembers where COM and point were, and draws it. ``forget`` at a reset, or when the body jumps.

    point (3,) [mesh coordinates]: whose path it is; None for the vertex farthest from the COM.
    """

    def __init__(self, scene: Any) -> None:
        self._frame = scene.add_frame("/trails", show_axes=False)
        none = np.zeros((POINTS - 1, 2, 3))
        self._lines = {
            name: scene.add_line_segments(f"/trails/{k}", none, _faded(colour), thickness=0.012, visible=False)
            for k, (name, colour) in enumerate(COLOURS.items())
        }
        self._shown = dict.fromkeys(COLOURS, False)
        self._states: deque[tuple[int, np.ndarray]] = deque()
        self._due_s = 0.0
        self._base = np.zeros(3)
        self.point: np.ndarray | None = None

    def switch(self, name: str, shown: bool) -> None:
        """Show or hide one of COLOURS."""
        self._shown[name] = shown
        self._due_s = 0.0

    def forget(self) -> None:
        """The paths begin anew."""
        self._states.clear()
        self._due_s = 0.0

    def add(self, time_ns: int, row: np.ndarray) -> None:
        """A state (13,) [position, attitude xyzw, ...]; kept for as long as a path lasts."""
        if self._states and time_ns <= self._states[-1][0]:
            if time_ns == self._states[-1][0]:
                return
            self._states.clear()
        self._states.append((time_ns, np.array(row[:7])))
        while self._states[0][0] < time_ns - LASTS_S * 1e9:
            self._states.popleft()

    def paths(self, until_ns: int, body: Body, surface: Surface | None) -> dict[str, np.ndarray]:
        """The paths that are switched on, up to a moment, by name: points (n, 3) [m, world]."""
        rows = [row for time_ns, row in self._states if time_ns <= until_ns]
        if len(rows) < 2:
            return {}
        every = -(-len(rows) // POINTS)
        rows = rows[::-every][::-1]  # the last one is always among them
        found = {}
        if self._shown[COM_TRAIL]:
            found[COM_TRAIL] = np.array([row[0:3] for row in rows])
        if self._shown[POINT_TRAIL] and surface is not None:
            point = farthest_point(surface, body) if self.point is None else self.point
            arm = point * body.scale - body.center_of_mass
            found[POINT_TRAIL] = np.array([row[0:3] + matrix_from_quaternion(row[3:7]) @ arm for row in rows])
        return found

    def draw(
        self,
        now_s: float,
        until_ns: int,
        body: Body,
        surface: Surface | None,
        origin: np.ndarray,
        unit: float,
    ) -> None:
        """Draw the paths up to a moment; ``origin`` (3,) and ``unit`` [m] are the picture's."""
        if now_s >= self._due_s:
            self._due_s = now_s + DRAWN_S
            paths = self.paths(until_ns, body, surface)
            if paths:
                # Relative to a point of their own, so that they can be moved on without being sent again.
                self._base = next(iter(paths.values()))[-1]
            for name, line in self._lines.items():
                path = paths.get(name)
                if path is not None:
                    drawn = np.zeros((POINTS, 3))
                    drawn[-len(path) :] = (path - self._base) / unit
                    drawn[: -len(path)] = drawn[-len(path)]  # a path that is still short begins with nothing
                    line.points = np.stack([drawn[:-1], drawn[1:]], axis=1)
                if line.visible != (path is not None):
                    line.visible = path is not None
        self._frame.position = (self._base - origin) / unit


def _faded(colour: tuple[int, int, int]) -> np.ndarray:
    """Colours (POINTS - 1, 2, 3) of a path's pieces, the oldest end nearly that of the background."""
    share = np.linspace(0.1, 1.0, POINTS)[:, np.newaxis]
    fading = (share * np.array(colour) + (1.0 - share) * BACKGROUND).astype(np.uint8)
    return np.stack([fading[:-1], fading[1:]], axis=1)
