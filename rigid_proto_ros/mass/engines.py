# SPDX-License-Identifier: MIT
"""Mass properties as text for physics engines and scene formats, in their axes, units and words.

Engines take one record: mass, centre of mass, three principal moments, and the rotation of the principal axes. Some
import meshes with one axis mirrored: with S = diag(1, -1, 1), say, the centre of mass c becomes S c, and the rotation R
becomes S R S, a rotation again; the moments stay. Numbers have nine digits, which single precision keeps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..base.rotation import quaternion_from_matrix
from ..base.vectors import Attitude, Matrix3, Vector3
from .properties import MassProperties
from .tensor import principal_axes

SAYS_NO_PRODUCTS = 1e-7
"""Products of inertia, relative to the tensor's largest entry, up to which a diagonal says all that single precision
can."""


@dataclass(frozen=True)
class Record:
    """In an engine's axes and units: mass [kg], centre of mass (3,), ascending principal moments (3,), the rotation of
    the principal axes xyzw, and the tensor (3, 3) about the centre of mass.
    """

    mass: float
    center: Vector3
    moments: Vector3
    rotation: Attitude
    tensor: Matrix3


@dataclass(frozen=True)
class Engine:
    """``place``: where the text goes, in the engine's words; ``mirrored``: axis that its importers mirror, or ``""``;
    ``unit_m``: its unit of length; ``comment``: what begins a comment; ``text``: writes a record.
    """

    place: str
    text: Callable[[Record], str]
    mirrored: str = ""
    unit_m: float = 1.0
    comment: str = "//"


def _of(values: Iterable[float], suffix: str = "") -> str:
    return ", ".join(f"{value + 0.0:.9g}{suffix}" for value in values)


def _single(values: Iterable[float]) -> str:
    """Numbers of single precision in C++ and C#."""
    return ", ".join(f"{float(text)!r}f" for text in _of(values).split(", "))


def _unity(record: Record) -> str:
    return (
        "body.automaticCenterOfMass = body.automaticInertiaTensor = false;\n"
        f"body.mass = {_single([record.mass])};\n"
        f"body.centerOfMass = new Vector3({_single(record.center)});\n"
        f"body.inertiaTensor = new Vector3({_single(record.moments)});\n"
        f"body.inertiaTensorRotation = new Quaternion({_single(record.rotation)});\n"
    )


def _unreal(record: Record) -> str:
    return (
        "FPhysicsCommand::ExecuteWrite(component->GetBodyInstance()->ActorHandle, [](FPhysicsActorHandle& actor) {\n"
        f"  FPhysicsInterface::SetMass_AssumesLocked(actor, {_single([record.mass])});\n"
        f"  FPhysicsInterface::SetMassSpaceInertiaTensor_AssumesLocked(actor, FVector({_of(record.moments)}));\n"
        "  FPhysicsInterface::SetComLocalPose_AssumesLocked(actor,\n"
        f"    FTransform(FQuat({_of(record.rotation)}), FVector({_of(record.center)})));\n"
        "});\n"
    )


def diagonal_error(tensor: Matrix3) -> float:
    """How far a tensor's diagonal alone is off: its largest product, relative to its largest entry."""
    return float(np.max(np.abs(tensor - np.diag(np.diag(tensor)))) / np.max(np.abs(tensor)))


def _godot(record: Record) -> str:
    text = (
        f"mass = {_of([record.mass])}\n"
        "center_of_mass_mode = RigidBody3D.CENTER_OF_MASS_MODE_CUSTOM\n"
        f"center_of_mass = Vector3({_of(record.center)})\n"
        f"inertia = Vector3({_of(np.diag(record.tensor))})\n"
    )
    error = diagonal_error(record.tensor)
    if error <= SAYS_NO_PRODUCTS:
        return text
    x, y, z, w = record.rotation
    center = _principal(record)
    return (
        f"{text}# products of inertia can't be said, by which the tensor is off by {100.0 * error:.2g} %; none is lost"
        f" if the body's children are turned by Quaternion({_of([-x, -y, -z, w])}), and then"
        f" center_of_mass = Vector3({_of(center)}), inertia = Vector3({_of(record.moments)})\n"
    )


def _principal(record: Record) -> Vector3:
    """The centre of mass in principal axes (3,)."""
    _, axes = principal_axes(record.tensor)
    return np.asarray(axes.T @ record.center)


def _rapier(record: Record) -> str:
    vectors = (dict(zip("xyzw", row, strict=False)) for row in _rows(record))
    texts = (f"{{ {', '.join(f'{name}: {_of([value])}' for name, value in row.items())} }}" for row in vectors)
    return f"description.setAdditionalMassProperties({_of([record.mass])}, {', '.join(texts)});\n"


def _rows(record: Record) -> tuple[Vector3, Vector3, Attitude]:
    return record.center, record.moments, record.rotation


def _jolt(record: Record) -> str:
    columns = ", ".join(f"Vec4({_single([*column, 0.0])})" for column in record.tensor.T)
    return (
        f"settings.SetShape(new OffsetCenterOfMassShape(shape, Vec3({_single(record.center)})"
        " - shape->GetCenterOfMass()));\n"
        "settings.mOverrideMassProperties = EOverrideMassProperties::MassAndInertiaProvided;\n"
        f"settings.mMassPropertiesOverride.mMass = {_single([record.mass])};\n"
        f"settings.mMassPropertiesOverride.mInertia = Mat44({columns}, Vec4(0, 0, 0, 1));\n"
    )


def _physx(record: Record) -> str:
    pose = f"PxTransform(PxVec3({_single(record.center)}), PxQuat({_single(record.rotation)}))"
    return (
        f"body->setMass({_single([record.mass])});\n"
        f"body->setCMassLocalPose({pose});\n"
        f"body->setMassSpaceInertiaTensor(PxVec3({_single(record.moments)}));\n"
    )


def _havok(record: Record) -> str:
    center, moments, rotation = (f"[{_of(row)}]" for row in _rows(_of_one_kilogram(record)))
    return f"havok.HP_Body_SetMassProperties(body, [{center}, {_of([record.mass])}, {moments}, {rotation}]);\n"


def _of_one_kilogram(record: Record) -> Record:
    return Record(record.mass, record.center, record.moments / record.mass, record.rotation, record.tensor)


def _babylon(record: Record) -> str:
    center, moments, rotation = map(_of, _rows(_of_one_kilogram(record)))
    return (
        "body.setMassProperties({\n"
        f"  mass: {_of([record.mass])},\n"
        f"  centerOfMass: new BABYLON.Vector3({center}),\n"
        f"  inertia: new BABYLON.Vector3({moments}),\n"
        f"  inertiaOrientation: new BABYLON.Quaternion({rotation}),\n"
        "});\n"
    )


def _usd(record: Record) -> str:
    x, y, z, w = record.rotation
    return (
        'over "body" (\n  prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]\n)\n{\n'
        f"  float physics:mass = {_of([record.mass])}\n"
        f"  point3f physics:centerOfMass = ({_of(record.center)})\n"
        f"  float3 physics:diagonalInertia = ({_of(record.moments)})\n"
        f"  quatf physics:principalAxes = ({_of([w, x, y, z])})\n"
        "}\n"
    )


def _gltf(record: Record) -> str:
    center, moments, rotation = (f"[{_of(row)}]" for row in _rows(record))
    motion = f'"mass": {_of([record.mass])}, "centerOfMass": {center}'
    motion += f', "inertiaDiagonal": {moments}, "inertiaOrientation": {rotation}'
    return f'"extensions": {{"KHR_physics_rigid_bodies": {{"motion": {{{motion}}}}}}}\n'


ENGINES = {
    "unity": Engine("Unity (C#, a Rigidbody called body)", _unity, mirrored="x"),
    "unreal": Engine("Unreal 5 (C++, once the component has begun to simulate)", _unreal, mirrored="y", unit_m=0.01),
    "godot": Engine("Godot 4 (a RigidBody3D: its inspector, or _init of its script)", _godot, comment="#"),
    "rapier": Engine("Rapier (JavaScript, a RigidBodyDesc; colliders with density 0, or theirs is added)", _rapier),
    "jolt": Engine("Jolt (C++, BodyCreationSettings of a shape)", _jolt),
    "physx": Engine("PhysX (C++, a PxRigidDynamic called body)", _physx),
    "havok": Engine("Havok for the web (a body; moments for 1 kg, as it takes them)", _havok),
    "babylon": Engine("Babylon.js (a PhysicsBody; moments for 1 kg, as it takes them)", _babylon),
    "usd": Engine("USD (UsdPhysics; metersPerUnit and kilogramsPerUnit 1)", _usd, comment="#"),
    "gltf": Engine("glTF (a node with the mesh's axes; extensionsUsed names KHR_physics_rigid_bodies)", _gltf),
}
"""By the names of ``inspect --for``."""


def record_for(engine: Engine, properties: MassProperties) -> Record:
    """A body's record in an engine's axes and units."""
    moments, axes = principal_axes(properties.inertia)
    flip = np.array([-1.0 if axis == engine.mirrored else 1.0 for axis in "xyz"])
    both = np.outer(flip, flip)
    per_m = 1.0 / engine.unit_m
    return Record(
        properties.mass,
        properties.center_of_mass * flip * per_m,
        moments * per_m**2,
        quaternion_from_matrix(axes * both),
        properties.inertia * both * per_m**2,
    )


def engine_text(name: str, properties: MassProperties) -> str:
    """What an engine takes, to be pasted: a comment that says where it goes, then the record in the engine's words."""
    engine = ENGINES[name]
    axes = f"the mesh's axes, {engine.mirrored} mirrored as its importers do" if engine.mirrored else "the mesh's axes"
    unit = "m, kg m²" if engine.unit_m == 1.0 else "cm, kg cm²"
    return f"{engine.comment} {engine.place}: {axes}; {unit}\n{engine.text(record_for(engine, properties))}"
