# SPDX-License-Identifier: MIT
"""Meshes written, read and judged for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigid_proto_ros.mass.from_mesh import PASSING, MeshBody, mesh_body
from rigid_proto_ros.mesh.reading import Mesh, load_mesh


def load(folder: Path, name: str, data: bytes) -> Mesh:
    """The mesh of a file with these bytes."""
    (folder / name).write_bytes(data)
    return load_mesh(str(folder / name))


def body(surface: tuple[np.ndarray, np.ndarray], polygon_starts: np.ndarray | None = None, **options) -> MeshBody:
    """Vertices (n, 3) and triangles (m, 3), judged anew: nothing of them is kept."""
    return mesh_body(Mesh("made", f"/{PASSING}/made.obj", *surface, polygon_starts, "made"), **options)


def codes(made: MeshBody) -> dict[str, str]:
    """What was found, and how grave it is."""
    return {finding.code: finding.severity for finding in made.verdict.findings}


def volume(of: Mesh | MeshBody) -> float:
    """Of the solid."""
    return (mesh_body(of) if isinstance(of, Mesh) else of).moments.moments("solid").measure
