# SPDX-License-Identifier: MIT
"""Formats that this package has no reader for, through trimesh: each part placed as the file's scene says."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from ..base.errors import MeshError
from .assembly import Assembly

_ARCHIVES = ("zip", "bz2", "tar.bz2", "tar.gz", "zae")


def other_formats() -> tuple[str, ...]:
    """Endings that trimesh, as it is installed, reads."""
    import trimesh

    return tuple(sorted(set(trimesh.available_formats()) - set(_ARCHIVES)))


def add_by_trimesh(data: bytes, suffix: str, assembly: Assembly) -> float:
    """Add what trimesh reads of a file's bytes; returns the metres in its unit, 1 if it says none.

    Vertices stay as the file has them: nothing is merged or sorted. Raises MeshError for a file that shows something
    else than triangles, for which the rest would stand in silence, and trimesh's errors.
    """
    import trimesh

    load: Any = trimesh.load_scene
    scene = load(io.BytesIO(data), file_type=suffix, process=False, maintain_order=True, skip_materials=True)
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            raise MeshError(assembly.name, f"{name} is a {type(part).__name__}", "triangles alone")
        assembly.add(np.asarray(part.vertices), np.asarray(part.faces), np.asarray(matrix), name)
    return 1.0 if scene.units is None else float(trimesh.units.unit_conversion(scene.units, "meters"))
