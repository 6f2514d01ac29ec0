# SPDX-License-Identifier: MIT
"""The interface through which a picture is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.vectors import FloatArray, IntArray, Points, Vector3
from .style import Colour


class DrawnMesh(NamedTuple):
    """A surface in single precision: vertices (p, 3), triangles (m, 3) and unit normals (p, 3)."""

    vertices: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    normals: NDArray[np.float32]


class Backend:
    """Null object, and the interface: override what is drawn.

    Parts are named by paths (style.py), a tree of frames: what is below a part moves with it. Lengths are in metres.
    ``begin`` says of which n states the calls that follow are. counts (n,) is how many of the m arrows, lines, points
    or labels belong to each of them, in order; none end those of the state before. A backend that shows the present
    alone takes what belongs to the last state.
    """

    def begin(self, times_ns: IntArray) -> None:
        """Simulated times (n,) [ns], ascending."""

    def resize(self, size: float) -> None:
        """A length [m] that stands for the body: widths in STYLES are in it."""

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """A surface that is fixed in the part's frame, in place of the one before; None for none."""

    def place(
        self,
        name: str,
        positions: Points | None = None,
        attitudes: FloatArray | None = None,
        scale: Vector3 | None = None,
    ) -> None:
        """The part's frame: positions (n, 3), attitudes (n, 4) xyzw, scale (3,) that stays; None leaves it out."""

    def arrows(self, name: str, counts: IntArray, vectors: Points, origins: Points | None = None) -> None:
        """Vectors (m, 3) from origins (m, 3), or from the frame's."""

    def lines(
        self, name: str, counts: IntArray, strips: Sequence[Points], colours: Sequence[Colour] | None = None
    ) -> None:
        """m strips (p, 3) of p points each; colours of each, or the style's."""

    def points(self, name: str, counts: IntArray, positions: Points) -> None:
        """Positions (m, 3); those of a trail are one of each state, and the path goes through them."""

    def labels(self, name: str, counts: IntArray, positions: Points, texts: Sequence[str]) -> None:
        """m texts at positions (m, 3)."""

    def scalars(self, name: str, values: FloatArray) -> None:
        """Plotted values (n, k), named by SERIES."""
