# SPDX-License-Identifier: MIT
"""What body and ghost are called, written beside them: the upper one's name above the two, the lower one's below, each
with a line to a point of its own, so that the names are apart from every side and say which body they mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..picture.style import BODY_COLOUR, GHOST_COLOUR
from .poke_mark import UNWRITTEN

AWAY = 0.9
"""Of the body's radius, from a COM to its name: nearer than the tip of any arrow, where another name is."""

SWAP = 0.5
"""Of the body's radius that the lower one must be the higher before the two change places: names don't tremble."""

DARKER = 0.7
"""Brightness of a line against its body's, before which it is seen."""

ABOVE, BELOW = "bottom-right", "top-right"
"""Where the text is from its point; that of L's arrow is on the right of its own."""


class PairNames:
    """Labels and lines of body and ghost, in the picture's units."""

    def __init__(self, scene: Any) -> None:
        self._body_is_upper = True
        self._labels: list[Any] = []
        self._lines: list[Any] = []
        for whose, colour, anchor in (("body", BODY_COLOUR, ABOVE), ("ghost", GHOST_COLOUR, BELOW)):
            self._labels.append(scene.add_label(f"/names/{whose}", UNWRITTEN, visible=False, anchor=anchor))
            dark = tuple(round(DARKER * c) for c in colour)
            none = np.zeros((1, 2, 3))
            self._lines.append(
                scene.add_line_segments(f"/names/{whose}_line", none, dark, thickness=0.006, visible=False)
            )

    @property
    def shown(self) -> bool:
        """Whether the names are in the picture."""
        return bool(self._labels[0].visible)

    def hide(self) -> None:
        """No ghost, or it isn't to be shown."""
        self._set_visible(False)

    def show(self, names: Sequence[str], coms: np.ndarray, points: np.ndarray, radius: float) -> None:
        """Names of body and ghost, their COMs (2, 3), and the point (2, 3) of each that its line leads to, all as they
        are drawn; radius: of the body.
        """
        higher = float(coms[0, 2] - coms[1, 2]) * (1.0 if self._body_is_upper else -1.0)
        if higher < -SWAP * radius:
            self._body_is_upper = not self._body_is_upper
        for k, (label, line, name) in enumerate(zip(self._labels, self._lines, names, strict=True)):
            above = (k == 0) == self._body_is_upper
            place = coms[k] + np.array([0.0, 0.0, AWAY * radius if above else -AWAY * radius])
            ends = np.array([[place, points[k]]])
            if not np.array_equal(line.points, ends):
                label.position, line.points = place, ends
            for attribute, value in (("text", name), ("anchor", ABOVE if above else BELOW)):
                if getattr(label, attribute) != value:
                    setattr(label, attribute, value)
        self._set_visible(True)

    def _set_visible(self, visible: bool) -> None:
        for node in (*self._labels, *self._lines):
            if node.visible != visible:
                node.visible = visible
