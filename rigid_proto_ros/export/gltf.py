# SPDX-License-Identifier: MIT
"""A flight as a glTF 2.0 binary file (.glb): nodes with the meshes, and one animation.

The root node turns our z up into glTF's y up. A body's node has the centre of mass as its origin; below it hangs a node
for each mesh, moved so that the mesh lies about that centre as it does in the simulation.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..picture import style
from ..picture.backend import DrawnMesh
from ..picture.string import POINTS
from ..picture.style import Colour
from ..simulation.observer import BodyChanged, BodySnapshot, GhostChanged
from .flight_record import FlightRecord
from .gltf_model import add_model, model_of
from .tracks import MeshSteps, Tracks

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

    def animate(
        self, node: int, path: str, seconds: np.ndarray, values: np.ndarray, interpolation: str = "LINEAR"
    ) -> None:
        """Play values (n, c) at seconds (n,) at a node's ``translation``, ``rotation``, ``scale`` or ``weights``."""
        import pygltflib

        animation = self.gltf.animations[0]
        if path == "rotation":
            values = _unit(values)
        key = seconds.tobytes()
        if key not in self.inputs:
            self.inputs[key] = self.accessor(seconds, bounds=True)
        output = self.accessor(values.ravel() if path == "weights" else values)
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
    """Write the body, and ghost, string and path of the centre of mass where the tracks have them."""
    check_gltf()
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
    surfaces: dict[int, tuple[dict[str, int], int]] = {}
    for name, part, mesh, kind in (
        ("body", style.BODY, style.BODY_MESH, BodyChanged),
        ("ghost", style.GHOST, style.GHOST_MESH, GhostChanged),
    ):
        times_ns, positions, attitudes = tracks.poses(part)
        if not len(times_ns):
            continue
        seconds = document.seconds(times_ns)
        node = document.node(name, root, translation=positions[0].tolist(), rotation=_unit(attitudes[:1])[0].tolist())
        document.gltf.nodes[node].extras = _mass_properties(record.bodies(kind)[0][1])
        document.animate(node, "translation", seconds, positions)
        document.animate(node, "rotation", seconds, attitudes)
        model = model_of(record) if kind is BodyChanged else None
        _draw_meshes(document, node, name, tracks.meshes(mesh), style.STYLES[mesh], surfaces, model)
        if times_ns[0] > record.times_ns[0]:
            # A ghost that comes in flight is of no size before.
            begins = np.array([0.0, seconds[0]], np.float32)
            document.animate_steps(node, begins, scale=np.array([np.zeros(3), np.ones(3)]))
    _draw_string(document, root, tracks.string, STRING_WIDTH * tracks.size)
    if len(tracks.trail) > 1:
        points = document.accessor(tracks.trail, VERTICES, bounds=True)
        material = document.material("trail", style.TRAIL_COLOUR)
        document.node("trail", root, mesh=document.mesh("trail", {"POSITION": points}, None, LINE_STRIP, material))
    _save(document, file)


def _unit(attitudes: np.ndarray) -> np.ndarray:
    return attitudes / np.linalg.norm(attitudes, axis=1, keepdims=True)


def _draw_meshes(
    document: Document,
    body: int,
    name: str,
    meshes: list[MeshSteps],
    look: style.Style,
    surfaces: dict[int, tuple[dict[str, int], int]],
    model: tuple[bytes, np.ndarray] | None,
) -> None:
    """A node for each mesh that the body is drawn as, below the body's; model: as ``model_of`` has it, in its place."""
    if not meshes:
        return
    if model is not None:
        data, middle = model
        (steps,) = meshes
        frame = document.node(f"{name} mesh", body)
        document.animate_steps(frame, document.seconds(steps.times_ns), scale=steps.scales, translation=steps.positions)
        document.node("model", frame, translation=(-middle).tolist())
        below = document.gltf.nodes[-1]
        below.children += add_model(document.gltf, document.data, type(document.gltf)().load_from_bytes(data))
        return
    material = document.material(name, look.colours[0], look.opacity)
    for number, steps in enumerate(meshes, 1):
        surface = steps.surface
        if id(surface) not in surfaces:
            surfaces[id(surface)] = _surface(document, surface)
        mesh = document.mesh(f"{name} mesh", *surfaces[id(surface)], TRIANGLES, material)
        node = document.node(f"{name} mesh" if number == 1 else f"{name} mesh {number}", body, mesh=mesh)
        document.animate_steps(node, document.seconds(steps.times_ns), scale=steps.scales, translation=steps.positions)


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


def _draw_string(document: Document, root: int, string: dict[int, np.ndarray | None], width: float) -> None:
    """A node at the free end, whose mesh is bent and stretched by morph targets of weights from 0 to 1: from the least
    to the most of span and sag along each axis.
    """
    strips = [own for own in string.values() if own is not None]
    if not strips:
        return
    # Per tied frame: the free end, its way to the knot, and how far the middle hangs below the span's.
    free, knots = np.array([own[0] for own in strips]), np.array([own[-1] for own in strips])
    sags = [own[len(own) // 2] - 0.5 * (own[0] + own[-1]) if len(own) > 2 else np.zeros(3) for own in strips]
    forms = np.hstack([knots - free, sags])
    # Without a string it stays as it was, unseen.
    tied = np.array([own is not None for own in string.values()])
    known = np.clip(np.cumsum(tied) - 1, 0, None)
    free, forms = free[known], forms[known]
    low, high = forms.min(axis=0), forms.max(axis=0)
    along = np.linspace(0.0, 1.0, POINTS if forms[:, 3:].any() else 2)
    shares = np.column_stack([along] * 3 + [4.0 * along * (1.0 - along)] * 3)
    around = _cross_sections()
    ways = np.vstack([np.eye(3), np.eye(3)])
    centres = (shares * low) @ ways
    points = (centres[:, np.newaxis] + 0.5 * width * around).reshape(-1, 3)
    moved = np.flatnonzero(high > low)
    targets = {
        f"{'span' if k < 3 else 'sag'} {'xyz'[k % 3]}": document.accessor(
            np.repeat(shares[:, k] * (high - low)[k], len(around))[:, np.newaxis] * ways[k], VERTICES, bounds=True
        )
        for k in moved.tolist()
    }
    attributes = {
        "POSITION": document.accessor(points, VERTICES, bounds=True),
        "NORMAL": document.accessor(np.tile(around, (len(along), 1)), VERTICES),
    }
    corners = document.accessor(_sides(len(along)).ravel(), INDICES)
    material = document.material("string", style.STRING_COLOUR)
    mesh = document.mesh("string", attributes, corners, TRIANGLES, material, targets)
    node = document.node("string", root, mesh=mesh)
    seconds = document.seconds(np.array(list(string), np.int64))
    document.animate(node, "translation", seconds, free)
    document.animate_steps(node, seconds, scale=np.repeat(tied[:, np.newaxis], 3, axis=1).astype(float))
    if targets:
        document.animate(node, "weights", seconds, (forms[:, moved] - low[moved]) / (high - low)[moved])


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
