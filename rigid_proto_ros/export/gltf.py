# SPDX-License-Identifier: MIT
"""A flight as a glTF 2.0 binary file (.glb): nodes with the meshes, and one animation.

The root node turns our z up into glTF's y up. A body's node has the centre of mass as its origin; below it hangs a node
for each mesh, moved so that the mesh lies about that centre as it does in the simulation.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..base.errors import InputError
from ..base.files import whole_file
from ..mesh.locate import resolve_mesh
from ..picture import style
from ..picture.backend import DrawnMesh
from ..picture.style import Colour
from ..scene.scene_file import read_scene_text
from ..simulation.observer import BodyChanged, BodySnapshot, GhostChanged, MeshChanged, Started
from . import check_library
from .flight_record import FlightRecord
from .tracks import BODIES, MeshSteps, Tracks

if TYPE_CHECKING:
    import pygltflib

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
LINES, TRIANGLES = 1, 4
COMPONENTS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

MAGIC = b"glTF"

LISTS = ("bufferViews", "accessors", "images", "samplers", "textures", "materials", "meshes", "nodes")
"""Of a document, whose parts name each other by number."""

Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Attitude xyzw of the root: a quarter turn about x takes z up to y up."""


@dataclass
class Document:
    """A file in the making. start_ns: the simulated time [ns] at its second 0."""

    gltf: pygltflib.GLTF2
    start_ns: int
    data: bytearray = field(default_factory=bytearray)
    inputs: dict[bytes, int] = field(default_factory=dict)

    def seconds(self, times_ns: np.ndarray) -> np.ndarray:
        """Times (n,) [s], in single precision and strictly ascending: of two that it doesn't tell apart the first,
        which is before a change, goes to the number before.
        """
        seconds = (np.maximum(times_ns - self.start_ns, 0) * 1e-9).astype(np.float32)
        for k in np.flatnonzero(seconds[:-1] >= seconds[1:])[::-1]:
            seconds[k] = np.nextafter(seconds[k + 1], np.float32(-1.0))
        return seconds

    def accessor(self, values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """The number of an accessor of these values (n,) or (n, c), as float32 or uint32."""
        import pygltflib

        whole = values.dtype.kind in "iu"
        values = np.ascontiguousarray(values, dtype=np.uint32 if whole else np.float32)
        flat = values.reshape(len(values), -1)
        view = pygltflib.BufferView(buffer=0, byteOffset=len(self.data), byteLength=values.nbytes, target=target)
        self.data += values.tobytes()
        self.gltf.bufferViews.append(view)
        self.gltf.accessors.append(
            pygltflib.Accessor(
                bufferView=len(self.gltf.bufferViews) - 1,
                componentType=UNSIGNED_INT if whole else FLOAT,
                count=len(values),
                type=COMPONENTS[flat.shape[1]],
                min=flat.min(axis=0).tolist() if bounds else None,
                max=flat.max(axis=0).tolist() if bounds else None,
            )
        )
        return len(self.gltf.accessors) - 1

    def node(self, name: str, parent: int | None, **properties: Any) -> int:
        """The number of a new node."""
        import pygltflib

        number = len(self.gltf.nodes)
        self.gltf.nodes.append(pygltflib.Node(name=name, children=[], **properties))
        if parent is not None:
            self.gltf.nodes[parent].children.append(number)
        return number

    def material(self, name: str, colour: Colour, alpha: float = 1.0) -> int:
        """The number of a new material; colour: sRGB of 0 to 255."""
        import pygltflib

        shade = np.array(colour) / 255.0
        linear = np.where(shade <= 0.04045, shade / 12.92, ((shade + 0.055) / 1.055) ** 2.4)
        surface = pygltflib.PbrMetallicRoughness(
            baseColorFactor=[*linear.tolist(), alpha], metallicFactor=0.0, roughnessFactor=0.6
        )
        self.gltf.materials.append(
            pygltflib.Material(
                name=name,
                pbrMetallicRoughness=surface,
                alphaMode="OPAQUE" if alpha == 1.0 else "BLEND",
                alphaCutoff=None,
                doubleSided=True,
            )
        )
        return len(self.gltf.materials) - 1

    def mesh(self, name: str, attributes: dict[str, int], indices: int | None, mode: int, material: int) -> int:
        """The number of a new mesh of one primitive."""
        import pygltflib

        primitive = pygltflib.Primitive(
            attributes=pygltflib.Attributes(**attributes), indices=indices, mode=mode, material=material
        )
        self.gltf.meshes.append(pygltflib.Mesh(name=name, primitives=[primitive]))
        return len(self.gltf.meshes) - 1

    def animate(
        self, node: int, path: str, seconds: np.ndarray, values: np.ndarray, interpolation: str = "LINEAR"
    ) -> None:
        """Play values (n, c) at seconds (n,) at a node's ``translation``, ``rotation`` or ``scale``."""
        import pygltflib

        animation = self.gltf.animations[0]
        key = seconds.tobytes()
        if key not in self.inputs:
            self.inputs[key] = self.accessor(seconds, bounds=True)
        output = self.accessor(values)
        sampler = pygltflib.AnimationSampler(input=self.inputs[key], output=output, interpolation=interpolation)
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        animation.channels.append(pygltflib.AnimationChannel(sampler=len(animation.samplers), target=target))
        animation.samplers.append(sampler)

    def animate_steps(self, node: int, seconds: np.ndarray, **values: np.ndarray) -> None:
        """Give a node what holds from time to time, (n, 3) of a path; without an animation where that never changes."""
        for path, own in values.items():
            setattr(self.gltf.nodes[node], path, own[0].tolist())
            if np.ptp(own, axis=0).any():
                self.animate(node, path, seconds, own, "STEP")


def write_gltf(file: str, record: FlightRecord, tracks: Tracks) -> None:
    """Write the body, and ghost and string where there are any."""
    check_library("--gltf")
    import pygltflib

    document = Document(
        pygltflib.GLTF2(
            asset=pygltflib.Asset(version="2.0", generator=f"rigid_proto_ros {__version__}"),
            scene=0,
            scenes=[pygltflib.Scene(name="flight", nodes=[0])],
            animations=[pygltflib.Animation(name="flight", channels=[], samplers=[])],
        ),
        int(record.times_ns[0]),
    )
    root = document.node("flight", None, rotation=Y_UP)
    document.gltf.nodes[root].extras = {"first_time_s": record.times_ns[0] * 1e-9}
    for name, part, mesh in BODIES:
        times_ns, positions, attitudes = tracks.poses(part)
        if not len(times_ns):
            continue
        seconds = document.seconds(times_ns)
        node = document.node(name, root, translation=positions[0].tolist(), rotation=attitudes[0].tolist())
        kind = BodyChanged if name == "body" else GhostChanged
        document.gltf.nodes[node].extras = _mass_properties(record.bodies(kind)[0][1])
        document.animate(node, "translation", seconds, positions)
        document.animate(node, "rotation", seconds, attitudes)
        steps = tracks.mesh_steps(mesh)
        if steps is not None:
            _draw_mesh(document, node, name, steps, style.STYLES[mesh], model_of(record) if name == "body" else None)
        if times_ns[0] > record.times_ns[0]:
            # A ghost that comes in flight is of no size before.
            begins = np.array([0.0, seconds[0]], np.float32)
            document.animate_steps(node, begins, scale=np.array([np.zeros(3), np.ones(3)]))
    _draw_string(document, root, tracks.string)
    _save(document, file)


def _draw_mesh(
    document: Document,
    body: int,
    name: str,
    steps: MeshSteps,
    look: style.Style,
    model: tuple[bytes, np.ndarray] | None,
) -> None:
    """A node below the body's that has its mesh, or the ``model`` as ``model_of`` has it."""
    node = document.node(f"{name} mesh", body)
    document.animate_steps(node, document.seconds(steps.times_ns), scale=steps.scales, translation=steps.positions)
    if model is not None:
        data, middle = model
        below = document.gltf.nodes[document.node("model", node, translation=(-middle).tolist())]
        below.children += add_model(document.gltf, document.data, type(document.gltf)().load_from_bytes(data))
        return
    material = document.material(name, look.colours[0], look.opacity)
    attributes, corners = _surface(document, steps.surface)
    document.gltf.nodes[node].mesh = document.mesh(f"{name} mesh", attributes, corners, TRIANGLES, material)


def _surface(document: Document, surface: DrawnMesh) -> tuple[dict[str, int], int]:
    attributes = {
        "POSITION": document.accessor(surface.vertices, VERTICES, bounds=True),
        "NORMAL": document.accessor(surface.normals, VERTICES),
    }
    return attributes, document.accessor(surface.triangles.ravel(), INDICES)


def _mass_properties(body: BodySnapshot) -> dict[str, Any]:
    """Of the body at the start, for those who read a node's extras: SI units, the tensor about the centre of mass."""
    return {
        "mass": body.mass,
        "center_of_mass": np.asarray(body.center_of_mass).tolist(),
        "inertia": np.asarray(body.inertia).tolist(),
        "inertia_model": body.inertia_model,
    }


def _draw_string(document: Document, root: int, string: dict[int, np.ndarray | None]) -> None:
    """A straight line from the free end: a unit one along x, turned and stretched to the knot; of no size while no
    string is tied.
    """
    ends = np.array([own if own is not None else np.zeros((2, 3)) for own in string.values()])
    if not ends.any():
        return
    spans = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(spans, axis=1)
    directions = spans / np.where(lengths > 0.0, lengths, 1.0)[:, np.newaxis]
    # The shortest turn from x; opposite to x half a turn about z, and none of what has no direction.
    turns = np.column_stack([np.zeros(len(spans)), -directions[:, 2], directions[:, 1], 1.0 + directions[:, 0]])
    turns[np.linalg.norm(turns, axis=1) < 1e-9] = [0.0, 0.0, 1.0, 0.0]
    points = document.accessor(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), VERTICES, bounds=True)
    material = document.material("string", style.STRING_COLOUR)
    node = document.node("string", root, mesh=document.mesh("string", {"POSITION": points}, None, LINES, material))
    seconds = document.seconds(np.array(list(string), np.int64))
    document.animate(node, "translation", seconds, ends[:, 0])
    document.animate(node, "rotation", seconds, turns / np.linalg.norm(turns, axis=1, keepdims=True))
    document.animate(node, "scale", seconds, np.repeat(lengths[:, np.newaxis], 3, axis=1))


def _save(document: Document, file: str) -> None:
    import pygltflib

    gltf = document.gltf
    for node in gltf.nodes:
        if not node.children:
            node.children = None
    gltf.buffers.append(pygltflib.Buffer(byteLength=len(document.data)))
    gltf.set_binary_blob(bytes(document.data))
    with whole_file("--gltf", file) as path:
        path.write_bytes(b"".join(gltf.save_to_bytes()))


# The .glb that a body was read from, hung into the document as it is, with its materials and pictures
#
# Its parts refer to each other by their places in lists, which are moved on by what the lists hold already (glTF 2.0,
# section 3). Skins, cameras and animations of its own are left out: a rigid body has none.


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
