# SPDX-License-Identifier: MIT
"""COLLADA (.dae) through pycollada: the geometry of the scene, without looks, lights and motion."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree

from ..base.errors import MeshError, is_missing
from .assembly import Assembly

_LIBRARIES = ("images", "effects", "materials", "cameras", "lights", "animations", "animation_clips", "controllers")
_UNUSED = (*(f"library_{kind}" for kind in _LIBRARIES), "bind_material", "instance_camera", "instance_light", "extra")
"""Elements that no triangle depends on. pycollada drops a geometry whose material it can't read."""


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _geometry_alone(data: bytes, name: str) -> bytes:
    """The document without what isn't geometry."""
    root = ElementTree.fromstring(data)
    for parent in list(root.iter()):
        for child in list(parent):
            if _tag(child) in _UNUSED:
                parent.remove(child)
            elif _tag(child) == "instance_controller":
                raise MeshError(name, f"{child.get('url')} deforms its mesh; apply skin or morph before the export")
            elif _tag(child) in ("convex_mesh", "spline", "brep", "ph", "skew"):
                raise MeshError(name, f"it has <{_tag(child)}>", "triangles and polygons without holes, not skewed")
    return ElementTree.tostring(root)


def add_collada(data: bytes, assembly: Assembly) -> float:
    """Add the geometry of the scene in a file's bytes, in its unit; returns the metres in that unit.

    Raises MeshError, or pycollada's errors.
    """
    try:
        import collada
    except ImportError:
        raise MeshError(assembly.name, is_missing("pycollada", "meshes")) from None
    document = collada.Collada(io.BytesIO(_geometry_alone(data, assembly.name)))
    if document.scene is None:
        raise MeshError(assembly.name, "the file has no scene that says which of its geometry is to be shown")
    for bound in document.scene.objects("geometry"):
        for primitive in bound.original.primitives:
            if isinstance(primitive, collada.polylist.Polylist):
                primitive = primitive.triangleset()
            if isinstance(primitive, collada.triangleset.TriangleSet) and primitive.vertex is not None:
                assembly.add(primitive.vertex, primitive.vertex_index, bound.matrix, f"geometry {bound.original.id}")
    return 1.0 if document.assetInfo.unitmeter is None else float(document.assetInfo.unitmeter)
