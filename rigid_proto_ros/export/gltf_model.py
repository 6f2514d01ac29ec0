# SPDX-License-Identifier: MIT
"""The .glb that a body was read from, hung into another one as it is, with its materials and pictures.

Its parts refer to each other by their places in lists, which are moved on by what the lists hold already (glTF 2.0,
section 3). Skins, cameras and animations of its own are left out: a rigid body has none.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..mesh.locate import resolve_mesh
from ..scene.scene_file import read_scene_text
from ..simulation.observer import MeshChanged, Started
from .flight_record import FlightRecord

MAGIC = b"glTF"


def model_of(record: FlightRecord) -> tuple[bytes, np.ndarray] | None:
    """The bytes of the .glb that the body is drawn as, and the middle (3,) of its vertices' box; None where it came
    from another kind of file, where that has changed or gone, and where it isn't the only one.
    """
    drawn = [event for event in record.changes if isinstance(event, (Started, MeshChanged))]
    if len(drawn) != 1 or not isinstance(drawn[0], Started) or drawn[0].vertices is None:
        return None
    vertices = np.asarray(drawn[0].vertices, dtype=float)
    try:
        data = resolve_mesh(str(read_scene_text(drawn[0].scene).values.get("mesh", ""))).read_bytes()
    except (InputError, OSError):
        return None
    if data[:4] != MAGIC or hashlib.sha256(data).hexdigest() != drawn[0].mesh_sha256:
        return None
    return data, 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))


def add_model(gltf: Any, buffer: bytearray, model: Any) -> list[int]:
    """Add what a model's scene shows to a document (both as pygltflib has them) and to its buffer; returns the numbers
    of the scene's nodes there.
    """
    buffer += bytes(-len(buffer) % 4)
    begin = len(buffer)
    buffer += model.binary_blob() or b""
    before = {name: len(getattr(gltf, name)) for name in LISTS}

    for view in model.bufferViews:
        view.byteOffset = begin + (view.byteOffset or 0)
    for accessor in model.accessors:
        _move(accessor, "bufferView", before["bufferViews"])
        for part in (accessor.sparse.indices, accessor.sparse.values) if accessor.sparse is not None else ():
            _move(part, "bufferView", before["bufferViews"])
    _move_pictures(model, before)
    for mesh in model.meshes:
        for primitive in mesh.primitives:
            _move(primitive, "indices", before["accessors"])
            _move(primitive, "material", before["materials"])
            for named in (primitive.attributes, *(primitive.targets or ())):
                for name in list(named if isinstance(named, dict) else vars(named)):
                    _move(named, name, before["accessors"])
    for node in model.nodes:
        _move(node, "mesh", before["meshes"])
        node.children = [child + before["nodes"] for child in node.children or ()]
        node.skin = node.camera = None
    for name in LISTS:
        getattr(gltf, name).extend(getattr(model, name))
    gltf.extensionsUsed = sorted({*(gltf.extensionsUsed or ()), *(model.extensionsUsed or ())})
    gltf.extensionsRequired = sorted({*(gltf.extensionsRequired or ()), *(model.extensionsRequired or ())})
    return [root + before["nodes"] for root in model.scenes[model.scene or 0].nodes]


def _move_pictures(model: Any, before: dict[str, int]) -> None:
    for image in model.images:
        _move(image, "bufferView", before["bufferViews"])
    for texture in model.textures:
        _move(texture, "sampler", before["samplers"])
        _move(texture, "source", before["images"])
        for extension in (texture.extensions or {}).values():
            _move(extension, "source", before["images"])
    for material in model.materials:
        _move_textures(vars(material), before["textures"])


LISTS = ("bufferViews", "accessors", "images", "samplers", "textures", "materials", "meshes", "nodes")
"""Of a document, whose parts name each other by number."""


def _move(part: Any, name: str, by: int) -> None:
    """Let a part name what stands so many places farther on."""
    held = part if isinstance(part, dict) else vars(part)
    if isinstance(held.get(name), int):
        held[name] += by


def _move_textures(material: dict[str, Any], by: int) -> None:
    """The same of all textures that a material or an extension of it names."""
    for name, value in material.items():
        inner = value if isinstance(value, dict) else vars(value) if hasattr(value, "__dict__") else None
        if inner is not None:
            if name.endswith("Texture"):
                _move(inner, "index", by)
            _move_textures(inner, by)
