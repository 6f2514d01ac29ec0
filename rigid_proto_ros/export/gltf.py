# SPDX-License-Identifier: MIT
"""A flight as a glTF 2.0 binary file (.glb): nodes with the meshes, and one animation.

The root node turns our z up into glTF's y up. A body's node has the centre of mass as its origin; below it hangs a node
for each mesh, moved so that the mesh lies about that centre as it does in the simulation.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..picture.string import POINTS
from ..picture.style import BODY_COLOUR, GHOST_COLOUR, STRING_COLOUR, TRAIL_COLOUR
from .animation import Animation
from .flight_record import DrawnBody, DrawnMesh, FlightRecord
from .interpolation import Keys
from .sampling import Motion, Track, body_size, single
from .string_line import StringKeys

if TYPE_CHECKING:
    import pygltflib

FLOAT, UNSIGNED_INT = 5126, 5125
VERTICES, INDICES = 34962, 34963
LINE_STRIP, TRIANGLES = 3, 4
COMPONENTS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

Y_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Attitude xyzw of the root: a quarter turn about x takes z up to y up."""

STRING_WIDTH, STRING_SIDES = 0.012, 8
"""Of the body's size; corners of its cross-section."""


def check_gltf() -> None:
    """Raise InputError where the library isn't installed."""
    try:
        import pygltflib  # noqa: F401 (whether it is installed)
    except ImportError:
        raise InputError("--gltf", is_missing("pygltflib", "export")) from None


@dataclass(frozen=True)
class Step:
    """What holds from ``seconds`` on: whether a node is shown, and how it lies."""

    seconds: float
    scale: np.ndarray
    translation: np.ndarray


@dataclass
class Document:
    """A file in the making."""

    gltf: pygltflib.GLTF2
    data: bytearray = field(default_factory=bytearray)
    inputs: dict[bytes, int] = field(default_factory=dict)

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

    def material(self, name: str, colour: tuple[int, int, int], alpha: float = 1.0) -> int:
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

    def mesh(
        self,
        name: str,
        attributes: dict[str, int],
        indices: int | None,
        mode: int,
        material: int,
        targets: dict[str, int] | None = None,
    ) -> int:
        """The number of a new mesh of one primitive. targets: accessors of what morph targets add to its points, by
        name.
        """
        import pygltflib

        primitive = pygltflib.Primitive(
            attributes=pygltflib.Attributes(**attributes), indices=indices, mode=mode, material=material
        )
        mesh = pygltflib.Mesh(name=name, primitives=[primitive])
        if targets:
            primitive.targets = [pygltflib.Attributes(POSITION=number) for number in targets.values()]
            mesh.weights, mesh.extras = [0.0] * len(targets), {"targetNames": list(targets)}
        self.gltf.meshes.append(mesh)
        return len(self.gltf.meshes) - 1

    def animate(self, node: int, path: str, keys: Keys, interpolation: str = "LINEAR") -> None:
        """Play these keys at a node's ``translation``, ``rotation``, ``scale`` or ``weights``."""
        import pygltflib

        animation = self.gltf.animations[0]
        times = keys.times.astype(np.float32)
        if times.tobytes() not in self.inputs:
            self.inputs[times.tobytes()] = self.accessor(times, bounds=True)
        values = keys.values
        if path == "rotation":
            values = values / np.linalg.norm(values, axis=1, keepdims=True)
        if path == "weights":
            values = values.ravel()
        sampler = pygltflib.AnimationSampler(
            input=self.inputs[times.tobytes()], output=self.accessor(values), interpolation=interpolation
        )
        target = pygltflib.AnimationChannelTarget(node=node, path=path)
        animation.channels.append(pygltflib.AnimationChannel(sampler=len(animation.samplers), target=target))
        animation.samplers.append(sampler)

    def animate_steps(self, node: int, steps: list[Step]) -> None:
        """Give a node what holds from time to time; without an animation where that never changes."""
        target = self.gltf.nodes[node]
        target.scale, target.translation = steps[0].scale.tolist(), steps[0].translation.tolist()
        times = np.array([step.seconds for step in steps])
        for path in ("scale", "translation"):
            values = np.array([getattr(step, path) for step in steps])
            if np.ptp(values, axis=0).any():
                self.animate(node, path, Keys(times, values), "STEP")


def write_gltf(file: str, record: FlightRecord, made: Animation, trail: bool = False) -> None:
    """Write an animation: the body, the ghost and the string where it has them, and the centre of mass's path on
    request.
    """
    motion, keys = made.motion, made.keys
    check_gltf()
    import pygltflib

    document = Document(
        pygltflib.GLTF2(
            asset=pygltflib.Asset(version="2.0", generator=f"rigid_proto_ros {__version__}"),
            scene=0,
            scenes=[pygltflib.Scene(name="flight", nodes=[0])],
            animations=[pygltflib.Animation(name="flight", channels=[], samplers=[])],
        )
    )
    root = document.node("flight", None, rotation=Y_UP)
    document.gltf.nodes[root].extras = {"first_time_s": motion.times_ns[0] * 1e-9}
    surfaces = [_surface(document, mesh) for mesh in record.meshes]
    styles = (("body", document.material("body", BODY_COLOUR)), ("ghost", -1))
    for (name, material), track, pose in zip(styles, motion.tracks, keys, strict=False):
        if name == "ghost":
            material = document.material("ghost", GHOST_COLOUR, 0.45)
        body = document.node(name, root)
        document.gltf.nodes[body].extras = _mass_properties(track.bodies[0])
        document.gltf.nodes[body].translation = pose.places.values[0].tolist()
        document.gltf.nodes[body].rotation = _unit(pose.attitudes.values[0])
        document.animate(body, "translation", pose.places)
        document.animate(body, "rotation", pose.attitudes)
        _draw_meshes(document, body, name, material, surfaces, record, motion, track)
        _show_while_there(document, body, motion, track)
    if made.string is not None:
        _draw_string(document, root, made.string, STRING_WIDTH * body_size(record))
    if trail and len(keys[0].places.times) > 1:
        _draw_trail(document, root, keys[0].places.values)
    _save(document, file)


def _unit(attitude: np.ndarray) -> list[float]:
    return (attitude / np.linalg.norm(attitude)).tolist()


def _surface(document: Document, mesh: DrawnMesh) -> tuple[dict[str, int], int]:
    places, corners, normals = mesh.surface
    attributes = {
        "POSITION": document.accessor(places, VERTICES, bounds=True),
        "NORMAL": document.accessor(normals, VERTICES),
    }
    return attributes, document.accessor(corners.ravel(), INDICES)


def _draw_meshes(
    document: Document,
    body: int,
    name: str,
    material: int,
    surfaces: list[tuple[dict[str, int], int]],
    record: FlightRecord,
    motion: Motion,
    track: Track,
) -> None:
    """A node for each mesh that the body is drawn as, below the body's."""
    spans = motion.spans(track)
    for number, (attributes, indices) in enumerate(surfaces):
        if number not in {span.drawn.mesh for span in spans}:
            continue
        centre = record.meshes[number].centre
        steps = []
        for k, span in enumerate(spans):
            scale, com = span.drawn.body.scale, span.drawn.body.center_of_mass
            # Of the first span the time is the flight's start, whenever the body became what it is.
            seconds = 0.0 if k == 0 else float(single(np.array([span.drawn.time_ns - motion.times_ns[0]]))[0])
            drawn = scale if span.drawn.mesh == number else np.zeros(3)
            steps.append(Step(seconds, drawn, scale * centre - com))
        mesh = document.mesh(f"{name} mesh", attributes, indices, TRIANGLES, material)
        label = f"{name} mesh" if number == 0 else f"{name} mesh {number + 1}"
        document.animate_steps(document.node(label, body, mesh=mesh), steps)


def _show_while_there(document: Document, node: int, motion: Motion, track: Track) -> None:
    """A ghost that comes or goes in flight is of no size where there is none."""
    if track.shown.all():
        return
    at = np.flatnonzero(np.diff(track.shown.astype(int), prepend=-1))
    steps = [Step(motion.seconds[k], np.full(3, float(track.shown[k])), np.zeros(3)) for k in at]
    times = np.array([step.seconds for step in steps])
    document.animate(node, "scale", Keys(times, np.array([step.scale for step in steps])), "STEP")


def _mass_properties(drawn: DrawnBody) -> dict[str, Any]:
    """Of the body at the start, for those who read a node's extras: SI units, the tensor about the centre of mass."""
    known = asdict(drawn.body)
    return {
        "mass": known["mass"],
        "center_of_mass": known["center_of_mass"].tolist(),
        "inertia": known["inertia"].tolist(),
        "inertia_model": known["inertia_model"],
    }


def _draw_trail(document: Document, root: int, places: np.ndarray) -> None:
    material = document.material("trail", TRAIL_COLOUR)
    points = document.accessor(places, VERTICES, bounds=True)
    mesh = document.mesh("trail", {"POSITION": points}, None, LINE_STRIP, material)
    document.node("trail", root, mesh=mesh)


def _draw_string(document: Document, root: int, string: StringKeys, width: float) -> None:
    """A node at the free end, whose mesh is bent and stretched by morph targets of weights from 0 to 1: from the least
    to the most of span and sag along each axis.
    """
    low, high = string.forms.values.min(axis=0), string.forms.values.max(axis=0)
    sags = bool(low[3:].any() or high[3:].any())
    along = np.linspace(0.0, 1.0, POINTS if sags else 2)
    shares = np.column_stack([along] * 3 + [4.0 * along * (1.0 - along)] * 3)
    around = _cross_sections()
    ways = np.vstack([np.eye(3), np.eye(3)])
    centres = (shares * low) @ ways
    points = (centres[:, np.newaxis] + 0.5 * width * around).reshape(-1, 3)
    moved = np.flatnonzero(high > low)
    targets = {
        f"{'span' if k < 3 else 'sag'} {'xyz'[k % 3]}": document.accessor(
            np.repeat(shares[:, k] * (high - low)[k], len(around))[:, np.newaxis] * ways[k], bounds=True
        )
        for k in moved.tolist()
    }
    attributes = {
        "POSITION": document.accessor(points, VERTICES, bounds=True),
        "NORMAL": document.accessor(np.tile(around, (len(along), 1)), VERTICES),
    }
    corners = document.accessor(_sides(len(along)).ravel(), INDICES)
    material = document.material("string", STRING_COLOUR)
    mesh = document.mesh("string", attributes, corners, TRIANGLES, material, targets)
    node = document.node("string", root, mesh=mesh)
    document.animate(node, "translation", string.places)
    document.animate(node, "scale", string.shown, "STEP")
    if targets:
        weights = (string.forms.values[:, moved] - low[moved]) / (high - low)[moved]
        document.animate(node, "weights", Keys(string.forms.times, weights))


def _cross_sections() -> np.ndarray:
    """Unit circles (3 STRING_SIDES, 3) about x, y and z: along whichever way it is swept, one of them is seen broad."""
    angles = np.linspace(0.0, 2.0 * np.pi, STRING_SIDES, endpoint=False)
    circle = np.column_stack([np.zeros(STRING_SIDES), np.cos(angles), np.sin(angles)])
    return np.vstack([np.roll(circle, axis, axis=1) for axis in range(3)])


def _sides(count: int) -> np.ndarray:
    """Triangles (n, 3) between neighbours of ``count`` cross-sections."""
    low = np.arange(3 * STRING_SIDES)
    following = low - low % STRING_SIDES + (low + 1) % STRING_SIDES
    high, far = low + 3 * STRING_SIDES, following + 3 * STRING_SIDES
    piece = np.vstack([np.column_stack([low, following, far]), np.column_stack([low, far, high])])
    return np.vstack([piece + 3 * STRING_SIDES * k for k in range(count - 1)])


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
