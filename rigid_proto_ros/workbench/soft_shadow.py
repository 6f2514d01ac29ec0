# SPDX-License-Identifier: MIT
"""The body's shadow on the floor, straight below it, as under a bright sky: soft at its edge.

It is the density of points of the surface seen from above, drawn as a small picture. The shadows that viser's lights
can cast take a browser without a graphics card as long again as all the rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.rotation import matrix_from_quaternion
from ..motion.surface import Surface

POINTS = 4000
"""Of the surface: enough to fill the cells that a body covers."""

CELLS = 40
"""Of the picture, along each side."""

SPAN = 2.6
"""Side of the picture in radii of the body: what is beyond the body is the soft edge."""

DARKEST = 90
"""Opacity of 255 below the middle of a body."""

DRAWN_S = 0.1
"""[s] Between two drawings."""


class SoftShadow:
    """Shadow of one surface."""

    def __init__(self, scene: Any, name: str) -> None:
        self._node = scene.add_image(
            name, np.zeros((CELLS, CELLS, 4), np.uint8), 1.0, 1.0, format="png", visible=False, cast_shadow=False
        )
        self._points = np.zeros((0, 3))
        self._due_s = 0.0

    def of(self, surface: Surface | None) -> None:
        """The body has this surface now."""
        self._points = np.zeros((0, 3)) if surface is None else sampled(surface.vertices, surface.triangles)
        self._due_s = 0.0

    def draw(
        self,
        now_s: float,
        attitude_xyzw: np.ndarray,
        scale: np.ndarray,
        offset: np.ndarray,
        radius: float,
        at: np.ndarray,
    ) -> None:
        """Below the body at an attitude. The surface's points are times ``scale`` (3,) less ``offset`` (3,) in body
        axes from the COM; ``radius`` is half the body's size, ``at`` (3,) below the COM on the floor; all in the
        picture's units.
        """
        if not len(self._points):
            self.hide()
            return
        self._node.position = at
        if now_s >= self._due_s:
            self._due_s = now_s + DRAWN_S
            points = (self._points * scale - offset) @ matrix_from_quaternion(attitude_xyzw).T
            # Beyond its middle a body reaches farther from its COM than half its size.
            side = SPAN * max(radius, float(np.abs(points[:, :2]).max()) / 1.1)
            self._node.image = shadow_picture(points[:, :2] / side)
            self._node.render_width = self._node.render_height = side
        if not self._node.visible:
            self._node.visible = True

    def hide(self) -> None:
        """No shadow."""
        if self._node.visible:
            self._node.visible = False


def sampled(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Points (POINTS, 3) spread evenly over a surface, always the same ones."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    bounds = np.cumsum(areas)
    random = np.random.default_rng(0)
    chosen = np.searchsorted(bounds, (np.arange(POINTS) + random.random(POINTS)) / POINTS * bounds[-1])
    chosen = np.minimum(chosen, len(triangles) - 1)
    u, v = random.random((2, POINTS, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    return a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]


def shadow_picture(places: np.ndarray) -> np.ndarray:
    """Black RGBA (CELLS, CELLS, 4) as opaque as it lies under points (n, 2) in -0.5..0.5: rows from +y
    down, columns along x.
    """
    cells = np.floor((places + 0.5) * CELLS).astype(int)
    inside = ((cells >= 0) & (cells < CELLS)).all(axis=1)
    columns, rows = cells[inside].T
    counts = np.bincount((CELLS - 1 - rows) * CELLS + columns, minlength=CELLS * CELLS).reshape(CELLS, CELLS)
    cover = np.minimum(counts, 1).astype(float)
    for _ in range(2):
        for axis in (0, 1):
            cover = (np.roll(cover, 1, axis) + cover + np.roll(cover, -1, axis)) / 3.0
    picture = np.zeros((CELLS, CELLS, 4), np.uint8)
    picture[..., 3] = np.round(DARKEST * cover)
    return picture
