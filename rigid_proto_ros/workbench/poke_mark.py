# SPDX-License-Identifier: MIT
"""Where the last poke hit and how hard: a ring that widens and fades, and a label. A poke along the view
is an arrow seen end-on.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

INNER, OUTER = 0.03, 0.042
"""Radii of the ring as it begins, in body sizes."""

WIDENS = 0.5
"""Of its first radius, until it is gone."""

LIFTED = 0.02
"""Body sizes before the surface, towards where the force comes from: on a curved part the ring would sink in."""

ABOVE = 0.06
"""Body sizes from the point up to the label."""

SIDES = 40

UNWRITTEN = "-"
"""A label's text before it is first shown: one that is empty as it is made stays empty in viser 1.1,
whatever it is given.
"""


class PokeMark:
    """One ring and one label in the picture. Lengths are in the picture's units."""

    def __init__(self, scene: Any, colour: tuple[int, int, int]) -> None:
        vertices, triangles = annulus()
        self._ring: Any = scene.add_mesh_simple(
            "/poke/ring", vertices, triangles, color=colour, side="double", opacity=1.0, visible=False
        )
        self._label: Any = scene.add_label("/poke/label", UNWRITTEN, visible=False, anchor="bottom-center")

    def show(self, point: np.ndarray, direction: np.ndarray, text: str, age: float, size: float) -> None:
        """At ``point`` (3,), lying across the force's unit ``direction`` (3,). age: 0 when it hit, 1 when it is
        forgotten. size: of the body.
        """
        self._ring.position = point - LIFTED * size * direction
        self._ring.wxyz = from_z_to(direction)
        self._ring.scale = size * (1.0 + WIDENS * age)
        self._ring.opacity = 1.0 - age
        if self._label.text != text:
            self._label.text = text
        self._label.position = point + np.array([0.0, 0.0, ABOVE * size])
        self._switch(True)

    def hide(self) -> None:
        """No poke, or it isn't to be shown."""
        self._switch(False)

    def _switch(self, visible: bool) -> None:
        for handle in (self._ring, self._label):
            if handle.visible != visible:
                handle.visible = visible


def annulus() -> tuple[np.ndarray, np.ndarray]:
    """A flat ring about z for a body of size 1: vertices (2 SIDES, 3), triangles (2 SIDES, 3)."""
    angles = np.linspace(0.0, 2.0 * math.pi, SIDES, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)])
    k = np.arange(SIDES)
    following = (k + 1) % SIDES
    halves = [np.column_stack([k, SIDES + k, SIDES + following]), np.column_stack([k, SIDES + following, following])]
    return np.concatenate([INNER * circle, OUTER * circle]), np.concatenate(halves)


def from_z_to(direction: np.ndarray) -> tuple[float, float, float, float]:
    """A turn (wxyz) that takes z to a unit vector (3,), by the shortest way."""
    x, y, z = (float(c) for c in direction)
    if z < -1.0 + 1e-12:
        return 0.0, 1.0, 0.0, 0.0
    w = math.sqrt(0.5 * (1.0 + z))
    return w, -0.5 * y / w, 0.5 * x / w, 0.0
