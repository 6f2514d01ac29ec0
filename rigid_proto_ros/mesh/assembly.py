# SPDX-License-Identifier: MIT
"""Parts of a scene, each placed by a matrix, as one surface."""

from __future__ import annotations

import numpy as np

from ..base.errors import MeshError


class Assembly:
    """Collects the placed parts of the file ``name``; raises MeshError beyond ``max_triangles``."""

    def __init__(self, name: str, max_triangles: int) -> None:
        self.name = name
        self.max_triangles = max_triangles
        self._vertices: list[np.ndarray] = []
        self._triangles: list[np.ndarray] = []
        self._count = 0
        self._room = max_triangles

    def add(self, vertices: np.ndarray, triangles: np.ndarray, matrix: np.ndarray, part: str) -> None:
        """Append ``part``: vertices (n, 3) as matrix (4, 4) places them, and triangles (m, 3), turned where it mirrors.

        Raises MeshError for a triangle that names a vertex that the part doesn't have.
        """
        triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
        wrong = triangles[(triangles < 0) | (triangles >= len(vertices))]
        if len(wrong):
            raise MeshError(self.name, f"{part} uses vertex {wrong[0]}, but it has only {len(vertices)}")
        self._room -= len(triangles)
        if self._room < 0 or self._count + len(vertices) > 3 * self.max_triangles + 3:
            raise MeshError(
                self.name, f"it has more than {self.max_triangles} triangles; --max-triangles raises the limit"
            )
        linear, shift = matrix[:3, :3], matrix[:3, 3]
        with np.errstate(all="ignore"):  # the verdict refuses what isn't finite
            x, y, z = np.asarray(vertices, dtype=np.float64).T[:, :, None]
            # Summed in a fixed order: BLAS would pick one by processor.
            self._vertices.append(x * linear[:, 0] + y * linear[:, 1] + z * linear[:, 2] + shift)
        if np.linalg.det(linear) < 0.0:
            triangles = triangles[:, [0, 2, 1]]
        self._triangles.append(triangles + self._count)
        self._count += len(vertices)

    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (n, 3) and triangles (m, 3) of all parts, in the order in which they were added."""
        if not self._vertices:
            return np.empty((0, 3)), np.empty((0, 3), np.int64)
        return np.concatenate(self._vertices), np.concatenate(self._triangles)
