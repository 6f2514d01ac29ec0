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
    """The interface, and a null object: override the methods of the parts to be drawn.

    Parts are named by paths (style.py), a tree of frames: children move with their parent. Lengths are in metres.
    ``begin`` sets the n states of the following calls. counts (n,): number of the m arrows, lines, points or labels
    that belong to each state, in order; 0 removes those of the state before. A backend that shows only the present uses
    those of the last state.
    """

    def begin(self, times_ns: IntArray) -> None:
        """Set the simulated times (n,) [ns], ascending, of the following calls."""

    def resize(self, size: float) -> None:
        """Set the body's size [m], the unit of widths in STYLES."""

    def mesh(self, name: str, surface: DrawnMesh | None) -> None:
        """Set the surface that is fixed in the part's frame; None for none."""

    def place(
        self,
        name: str,
        positions: Points | None = None,
        attitudes: FloatArray | None = None,
        scale: Vector3 | None = None,
    ) -> None:
        """Set the part's frame: positions (n, 3), attitudes (n, 4) xyzw, and a scale (3,) for all; None: not set."""

    def arrows(self, name: str, counts: IntArray, vectors: Points, origins: Points | None = None) -> None:
        """Draw vectors (m, 3) at origins (m, 3), or at the frame's origin."""

    def lines(
        self, name: str, counts: IntArray, strips: Sequence[Points], colours: Sequence[Colour] | None = None
    ) -> None:
        """Draw m line strips (p, 3) of p points each; colours: one per strip, or the style's."""

    def points(self, name: str, counts: IntArray, positions: Points) -> None:
        """Draw points at positions (m, 3); a trail has one per state, joined by its path."""

    def labels(self, name: str, counts: IntArray, positions: Points, texts: Sequence[str]) -> None:
        """Draw m texts at positions (m, 3)."""

    def scalars(self, name: str, values: FloatArray) -> None:
        """Plot values (n, k), named by SERIES."""
