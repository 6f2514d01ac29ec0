# SPDX-License-Identifier: MIT
"""A flight as a glTF 2.0 binary file (.glb): nodes with the meshes, and one animation.

The root node rotates our z up to glTF's y up. The origin of a body's node is the centre of mass; each mesh has a child
node, translated so that the mesh lies about the centre of mass as in the simulation.
"""

from __future__ import annotations

import hashlib
import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.files import whole_file
from ..base.rotation import quaternion_from_matrix
from ..base.vectors import FloatArray, IntArray, Points, Vector3
from ..mass.moments import referenced_vertices
from ..mass.tensor import principal_axes
from ..mesh.locate import resolve_mesh
from ..picture import style
from ..picture.backend import DrawnMesh
from ..picture.style import Colour
from ..scene.scene_file import read_scene_text
from ..simulation.observer import BodyChanged, GhostChanged, MeshChanged, Started
from ..simulation.setup import Setup
from .flight_record import FlightRecord
from .tracks import BODIES, MESHES, Tracks

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
LINES, TRIANGLES = 1, 4
COMPONENTS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

MAGIC = b"glTF"
PHYSICS = "KHR_physics_rigid_bodies"

LISTS = ("bufferViews", "accessors", "images", "samplers", "textures", "materials", "meshes", "nodes")
"""Lists of a document; items refer to each other by their index in these."""

Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Attitude xyzw of the root: a quarter turn about x, from z up to y up."""


class Document:
    """A file being built: its lists of items, its animation and their binary data. start_ns: the simulated time [ns] at
    its second 0.
    """

    def __init__(self, start_ns: int) -> None:
        self.start_ns = start_ns
        self.lists: dict[str, list[dict[str, Any]]] = {name: [] for name in LISTS}
        self.extensions: dict[str, set[str]] = {"extensionsUsed": set(), "extensionsRequired": set()}
        self.extension_lists: dict[str, Any] = {}
        self.data = bytearray()
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._inputs: dict[bytes, int] = {}

    def add(self, kind: str, **item: Any) -> int:
        """Add an item to a list, without properties that are None; returns its index."""
        self.lists[kind].append({name: value for name, value in item.items() if value is not None})
        return len(self.lists[kind]) - 1

    def seconds(self, times_ns: IntArray) -> NDArray[np.float32]:
        """Times (n,) [s] in single precision, strictly ascending: of two times that round to the same number, the first
        one, which is before a change, becomes the next smaller number.
        """
        seconds = (np.maximum(times_ns - self.start_ns, 0) * 1e-9).astype(np.float32)
        for k in np.flatnonzero(seconds[:-1] >= seconds[1:])[::-1]:
            seconds[k] = np.nextafter(seconds[k + 1], np.float32(-1.0))
        return seconds

    def accessor(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """Add an accessor of values (n,) or (n, c), as float32 or uint32; returns its index."""
        whole = values.dtype.kind in "iu"
        values = np.ascontiguousarray(values, dtype=np.uint32 if whole else np.float32)
        flat = values.reshape(len(values), -1)
        view = self.add("bufferViews", buffer=0, byteOffset=len(self.data), byteLength=values.nbytes, target=target)
        self.data += values.tobytes()
        return self.add(
            "accessors",
            bufferView=view,
            componentType=UNSIGNED_INT if whole else FLOAT,
            count=len(values),
            type=COMPONENTS[flat.shape[1]],
            min=flat.min(axis=0).tolist() if bounds else None,
            max=flat.max(axis=0).tolist() if bounds else None,
        )

    def node(self, name: str, parent: int | None, **properties: Any) -> int:
        """Add a node; returns its index."""
        number = self.add("nodes", name=name, **properties)
        if parent is not None:
            self.lists["nodes"][parent].setdefault("children", []).append(number)
        return number

    def material(self, name: str, colour: Colour, alpha: float = 1.0) -> int:
        """Add a material; returns its index. colour: sRGB of 0 to 255."""
        shade = np.array(colour) / 255.0
        linear = np.where(shade <= 0.04045, shade / 12.92, ((shade + 0.055) / 1.055) ** 2.4)
        surface = {"baseColorFactor": [*linear.tolist(), alpha], "metallicFactor": 0.0, "roughnessFactor": 0.6}
        blend = None if alpha == 1.0 else "BLEND"
        return self.add("materials", name=name, pbrMetallicRoughness=surface, alphaMode=blend, doubleSided=True)

    def mesh(self, name: str, attributes: dict[str, int], indices: int | None, mode: int, material: int) -> int:
        """Add a mesh of one primitive; returns its index."""
        primitive: dict[str, Any] = {"attributes": attributes, "mode": mode, "material": material}
        if indices is not None:
            primitive["indices"] = indices
        return self.add("meshes", name=name, primitives=[primitive])

    def animate(
        self, node: int, path: str, seconds: NDArray[np.float32], values: FloatArray, interpolation: str = "LINEAR"
    ) -> None:
        """Animate a node's ``translation``, ``rotation`` or ``scale`` by values (n, c) at seconds (n,)."""
        key = seconds.tobytes()
        if key not in self._inputs:
            self._inputs[key] = self.accessor(seconds, bounds=True)
        self._channels.append({"sampler": len(self._samplers), "target": {"node": node, "path": path}})
        self._samplers.append(
            {"input": self._inputs[key], "output": self.accessor(values), "interpolation": interpolation}
        )

    def animate_steps(self, node: int, seconds: NDArray[np.float32], **values: Points) -> None:
        """Animate a node by values (n, 3) that are constant from frame to frame; set them once if they never change."""
        # Steps are half-way between frames, so that a player's rounding of time doesn't matter.
        begins = np.append(seconds[:1], 0.5 * (seconds[1:] + seconds[:-1]))
        for path, own in values.items():
            self.lists["nodes"][node][path] = own[0].tolist()
            changes = np.append(True, np.any(own[1:] != own[:-1], axis=1))
            if changes[1:].any():
                self.animate(node, path, begins[changes], own[changes], "STEP")

    def binary(self) -> bytes:
        """The content of the file."""
        from .. import __version__

        animation = {"name": "flight", "channels": self._channels, "samplers": self._samplers}
        parts: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"rigid_proto_ros {__version__}"},
            "scene": 0,
            "scenes": [{"name": "flight", "nodes": [0]}],
            "animations": [animation] if self._channels else [],
            "buffers": [{"byteLength": len(self.data)}],
            **self.lists,
            **{name: sorted(own) for name, own in self.extensions.items()},
            "extensions": self.extension_lists,
        }
        text = json.dumps({name: own for name, own in parts.items() if own not in ([], {})}).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        head = struct.pack("<4sII", MAGIC, 2, 28 + len(text) + len(data))
        return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def write_gltf(file: str, record: FlightRecord, tracks: Tracks) -> None:
    """Write the body, and ghost and string if there are any."""
    document = Document(int(record.times_ns[0]))
    root = document.node("flight", None, rotation=Y_UP, extras={"first_time_s": record.times_ns[0] * 1e-9})
    for name, part in BODIES.items():
        track = tracks.track(part)
        if track is None:
            continue
        seconds = document.seconds(track.times_ns)
        kind = BodyChanged if name == "body" else GhostChanged
        node = document.node(
            name,
            root,
            translation=track.positions[0].tolist(),
            rotation=track.attitudes[0].tolist(),
            extras=_mass_properties(record.setups(kind)[0]),
            extensions={PHYSICS: {"motion": _rigid_motion(record.setups(kind)[0])}},
        )
        document.extensions["extensionsUsed"].add(PHYSICS)
        document.animate(node, "translation", seconds, track.positions)
        document.animate(node, "rotation", seconds, track.attitudes)
        if track.surface is not None:
            below = document.node(f"{name} mesh", node)
            document.animate_steps(below, seconds, scale=track.mesh_scales, translation=track.mesh_places)
            model = model_of(record) if name == "body" else None
            if model is None:
                _draw_surface(document, below, name, track.surface, style.STYLES[MESHES[part]])
            else:
                own, binary, middle = model
                inner = document.node("model", below, translation=(-middle).tolist())
                document.lists["nodes"][inner]["children"] = add_model(document, own, binary)
    _draw_string(document, root, tracks.string)
    with whole_file("--gltf", file) as path:
        path.write_bytes(document.binary())


def _draw_surface(document: Document, node: int, name: str, surface: DrawnMesh, look: style.Style) -> None:
    """Add a mesh to a node."""
    attributes = {
        "POSITION": document.accessor(surface.vertices, VERTICES, bounds=True),
        "NORMAL": document.accessor(surface.normals, VERTICES),
    }
    corners = document.accessor(surface.triangles.ravel(), INDICES)
    material = document.material(name, look.colours[0], look.opacity)
    document.lists["nodes"][node]["mesh"] = document.mesh(f"{name} mesh", attributes, corners, TRIANGLES, material)


def _mass_properties(setup: Setup) -> dict[str, Any]:
    """Of the body at the start, for those who read a node's extras: SI units, the tensor about the centre of mass."""
    return {
        "mass": setup.body.mass,
        "center_of_mass": setup.body.center_of_mass.tolist(),
        "inertia": setup.body.inertia.tolist(),
        "inertia_model": setup.inertia_model,
    }


def _rigid_motion(setup: Setup) -> dict[str, Any]:
    """The body at the start as KHR_physics_rigid_bodies has it. It follows the animation until somebody sets
    isKinematic to false: then a physics engine moves it.
    """
    moments, axes = principal_axes(setup.body.inertia)
    return {
        "isKinematic": True,
        "mass": setup.body.mass,
        "centerOfMass": [0.0, 0.0, 0.0],
        "inertiaDiagonal": moments.tolist(),
        "inertiaOrientation": quaternion_from_matrix(axes).tolist(),
    }


def _draw_string(document: Document, root: int, string: dict[int, Points | None]) -> None:
    """Add the string as a straight line from its free end: a unit line along x, rotated and scaled to the knot; its
    scale is 0 while no string is tied.
    """
    ends = np.array([own if own is not None else np.zeros((2, 3)) for own in string.values()])
    if not ends.any():
        return
    spans = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(spans, axis=1)
    directions = spans / np.where(lengths > 0.0, lengths, 1.0)[:, np.newaxis]
    # The shortest rotation from x; half a turn about z for −x, and none without a direction.
    turns = np.column_stack([np.zeros(len(spans)), -directions[:, 2], directions[:, 1], 1.0 + directions[:, 0]])
    turns[np.linalg.norm(turns, axis=1) < 1e-9] = [0.0, 0.0, 1.0, 0.0]
    points = document.accessor(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), VERTICES, bounds=True)
    material = document.material("string", style.STRING_COLOUR)
    node = document.node("string", root, mesh=document.mesh("string", {"POSITION": points}, None, LINES, material))
    seconds = document.seconds(np.array(list(string), np.int64))
    document.animate(node, "translation", seconds, ends[:, 0])
    document.animate(node, "rotation", seconds, turns / np.linalg.norm(turns, axis=1, keepdims=True))
    document.animate(node, "scale", seconds, np.repeat(lengths[:, np.newaxis], 3, axis=1))


# The .glb file of the body, added to the document unchanged, with its materials and images
#
# Its items refer to each other by their index in lists (glTF 2.0, section 3), so indices are shifted by the present
# length of each list. Its skins, cameras and animations are left out, since a rigid body has none.


def model_of(record: FlightRecord) -> tuple[dict[str, Any], bytes, Vector3] | None:
    """Document and data of the body's .glb file, and the middle (3,) of its vertices' box. None if the mesh isn't from
    a .glb file, if that file has changed or gone, refers to external data or has no scene, or if the mesh changes.
    """
    drawn = [event for event in record.changes if isinstance(event, (Started, MeshChanged))]
    if len(drawn) != 1 or not isinstance(began := drawn[0], Started):
        return None
    if began.vertices is None or began.triangles is None:
        return None
    vertices = referenced_vertices(np.asarray(began.vertices, dtype=float), began.triangles)
    try:
        data = resolve_mesh(str(read_scene_text(began.scene).values.get("mesh", ""))).read_bytes()
    except (InputError, OSError):
        return None
    if data[:4] != MAGIC or hashlib.sha256(data).hexdigest() != began.mesh_sha256:
        return None
    length = int.from_bytes(data[12:16], "little")
    model = json.loads(data[20 : 20 + length])
    if not model.get("scenes") or ["uri" in buffer for buffer in model.get("buffers", ())] != [False]:
        return None
    return model, data[28 + length :], 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))


EXTENSION_LISTS = ("KHR_lights_punctual", "KHR_materials_variants")
"""Extensions with items at the top level of the document, to which nodes and meshes refer by index."""

REFERENCES = {
    "bufferView": "bufferViews",
    "indices": "accessors",
    "material": "materials",
    "mesh": "meshes",
    "sampler": "samplers",
    "source": "images",
}
"""Properties that refer to an item by its index, and their lists."""


def add_model(document: Document, model: dict[str, Any], binary: bytes) -> list[int]:
    """Add the default scene of a .glb to a document; returns the new indices of the scene's root nodes."""
    document.data += bytes(-len(document.data) % 4)
    begin = len(document.data)
    document.data += binary
    start = {kind: len(own) for kind, own in document.lists.items()}
    for view in model.get("bufferViews", ()):
        view["byteOffset"] = begin + view.get("byteOffset", 0)
    for node in model.get("nodes", ()):
        for left_out in ("skin", "camera"):
            node.pop(left_out, None)
        if "children" in node:
            node["children"] = [child + start["nodes"] for child in node["children"]]
    for kind in LISTS:
        items = model.get(kind, [])
        for item in items:
            _renumber(item, start)
        document.lists[kind] += items
    for name, own in document.extensions.items():
        own |= set(model.get(name, ()))
    own_lists = model.get("extensions", {})
    document.extension_lists = {name: own_lists[name] for name in EXTENSION_LISTS if name in own_lists}
    return [root + start["nodes"] for root in model["scenes"][model.get("scene", 0)]["nodes"]]


def _renumber(item: dict[str, Any], start: dict[str, int]) -> None:
    """Shift the indices in an item by ``start``, by list."""
    for name, value in item.items():
        if name == "extras":
            continue
        if name in REFERENCES and isinstance(value, int):
            item[name] = value + start[REFERENCES[name]]
        elif name in ("attributes", "targets"):
            for attributes in [value] if name == "attributes" else value:
                for attribute in attributes:
                    attributes[attribute] += start["accessors"]
        else:
            for inner in value if isinstance(value, list) else [value]:
                if isinstance(inner, dict):
                    _renumber(inner, start)
            if name.endswith("Texture"):
                value["index"] += start["textures"]
