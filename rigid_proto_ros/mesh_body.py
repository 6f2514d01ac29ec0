# SPDX-License-Identifier: MIT
"""From a mesh to its moments: the verdict first, then repair or a stand-in where they are asked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_proto_ros.core.errors import InputError
from rigid_proto_ros.core.mass_properties import MeshMoments
from rigid_proto_ros.core.mesh_topology_verdict import Verdict, judge_surface
from rigid_proto_ros.mesh_io import Mesh, load_mesh

FALLBACKS = ("", "hull", "box")
"""What stands in for a surface that bounds no solid: nothing (refuse), its convex hull, or its bounding box."""


@dataclass(frozen=True)
class MeshBody:
    """A mesh, the verdict on it, and its moments; ``vertices`` and ``triangles`` are those the moments were taken of
    (repaired ones when repair was asked for and needed)."""

    mesh: Mesh
    verdict: Verdict
    moments: MeshMoments

    @property
    def vertices(self) -> np.ndarray:
        """Vertices (n, 3) in mesh coordinates; repair appends to the file's, never renumbers them."""
        return self.moments.vertices

    @property
    def triangles(self) -> np.ndarray:
        """Triangles (m, 3)."""
        return self.moments.triangles


def mesh_body(mesh: Mesh | str, *, repair: bool = False, fallback: str = "") -> MeshBody:
    """The moments of a mesh (or of the one that a path, URI or bundled name stands for) with its verdict.

    A surface that bounds no solid is not refused here: asking its moments for the solid, or for a mass from a density,
    raises MeshError with the reason and the flags that help. ``repair`` welds, drops duplicates, orients (cavities stay
    cavities) and caps holes first; ``fallback`` "hull" or "box" lets that shape stand in for what is still open.
    """
    if fallback not in FALLBACKS:
        raise InputError("mesh_fallback", fallback, "'' (refuse), hull or box")
    if isinstance(mesh, str):
        mesh = load_mesh(mesh)
    verdict, _ = judge_surface(mesh.vertices, mesh.triangles, mesh.polygon_starts)
    moments = MeshMoments(
        mesh.vertices,
        mesh.triangles,
        mesh.polygon_starts,
        closed=verdict.closed,
        closed_reason=verdict.reason,
        name=mesh.name,
    )
    return MeshBody(mesh, verdict, moments)
