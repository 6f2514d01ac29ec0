# SPDX-License-Identifier: MIT
"""Mass properties as text for physics engines and scene formats, in their axes, units and words.

Engines take one record: mass, centre of mass, three principal moments, and the rotation of the principal axes. Some
import meshes with one axis mirrored: with S = diag(1, -1, 1), say, the centre of mass c becomes S c, and the rotation R
becomes S R S, a rotation again; the moments stay. Numbers have nine digits, which single precision keeps.

A form is a text with places for numbers, so that the command line and the page (page/src/forms.ts) write the same.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from ..base.rotation import quaternion_from_matrix, transposed_times
from .properties import MassProperties
from .tensor import principal_axes

SAYS_NO_PRODUCTS = 1e-5
"""Products of inertia, in per cent of the tensor's largest entry, up to which a diagonal says all that single
precision can."""


@dataclass(frozen=True)
class Form:
    """What an engine takes. place: where the text goes, in the engine's words; text: its lines, with places for
    ``numbers``, ``{A}`` or ``{A:f}`` with the suffix of single precision; products: a comment for bodies with products
    of inertia, where the lines or the engine's editor can't say them, or "". mirrored: axis that the engine's importers
    mirror, or ""; per_m: its units of length in a metre.
    """

    place: str
    text: str
    products: str = ""
    mirrored: str = ""
    per_m: float = 1.0
    comment: str = "//"

    @property
    def engine(self) -> str:
        """The engine's name."""
        return self.place.partition(" (")[0]

    @property
    def lines(self) -> str:
        """A comment that says where the text goes, and the text."""
        axes = f"the mesh's axes, {self.mirrored} mirrored as its importers do" if self.mirrored else "the mesh's axes"
        unit = "m, kg m²" if self.per_m == 1.0 else "cm, kg cm²"
        return f"{self.comment} {self.place}: {axes}; {unit}\n{self.text}"


_PLACE = re.compile(r"\{(\w+)(:f)?\}")

FORMS = {
    "unity": Form(
        "Unity (C#, a Rigidbody called body)",
        """\
body.automaticCenterOfMass = body.automaticInertiaTensor = false;
body.mass = {mass:f};
body.centerOfMass = new Vector3({cx:f}, {cy:f}, {cz:f});
body.inertiaTensor = new Vector3({A:f}, {B:f}, {C:f});
body.inertiaTensorRotation = new Quaternion({qx:f}, {qy:f}, {qz:f}, {qw:f});
""",
        mirrored="x",
    ),
    "unreal": Form(
        "Unreal 5 (C++, once the component has begun to simulate)",
        """\
component->GetBodyInstance()->SetInertiaConditioningEnabled(false);
FPhysicsCommand::ExecuteWrite(component->GetBodyInstance()->ActorHandle, [](FPhysicsActorHandle& actor) {
  FPhysicsInterface::SetMass_AssumesLocked(actor, {mass:f});
  FPhysicsInterface::SetMassSpaceInertiaTensor_AssumesLocked(actor, FVector({A}, {B}, {C}));
  FPhysicsInterface::SetComLocalPose_AssumesLocked(actor,
    FTransform(FQuat({qx}, {qy}, {qz}, {qw}), FVector({cx}, {cy}, {cz})));
});
""",
        """\
// The details panel can't say products of inertia: its Inertia Tensor Scale keeps the axes of the collision shapes;
// with those of the mesh, as of one box, the tensor is off by {products} %.
""",
        mirrored="y",
        per_m=100.0,
    ),
    "godot": Form(
        "Godot 4 (_ready of a RigidBody3D's script; the inspector rounds to 0.01)",
        """\
mass = {mass}
center_of_mass_mode = RigidBody3D.CENTER_OF_MASS_MODE_CUSTOM
center_of_mass = Vector3({cx}, {cy}, {cz})
inertia = Vector3({xx}, {yy}, {zz})
""",
        """\
# Products of inertia can't be said, without which the tensor is off by {products} %. None is lost if the body's
# children are turned by Quaternion({qx}, {qy}, {qz}, {qw}).inverse(), and then
# center_of_mass = Vector3({px}, {py}, {pz})
# inertia = Vector3({A}, {B}, {C})
""",
        comment="#",
    ),
    "rapier": Form(
        "Rapier (JavaScript, a RigidBodyDesc; colliders with density 0, or theirs is added)",
        """\
description.setAdditionalMassProperties({mass}, { x: {cx}, y: {cy}, z: {cz} }, { x: {A}, y: {B}, z: {C} }, \
{ x: {qx}, y: {qy}, z: {qz}, w: {qw} });
""",
    ),
    "jolt": Form(
        "Jolt (C++, BodyCreationSettings of a shape)",
        """\
settings.SetShape(new OffsetCenterOfMassShape(shape, Vec3({cx:f}, {cy:f}, {cz:f}) - shape->GetCenterOfMass()));
settings.mOverrideMassProperties = EOverrideMassProperties::MassAndInertiaProvided;
settings.mMassPropertiesOverride.mMass = {mass:f};
settings.mMassPropertiesOverride.mInertia = Mat44(
  Vec4({xx:f}, {xy:f}, {xz:f}, 0.0f),
  Vec4({xy:f}, {yy:f}, {yz:f}, 0.0f),
  Vec4({xz:f}, {yz:f}, {zz:f}, 0.0f),
  Vec4(0, 0, 0, 1));
""",
    ),
    "physx": Form(
        "PhysX (C++, a PxRigidDynamic called body)",
        """\
body->setMass({mass:f});
body->setCMassLocalPose(PxTransform(PxVec3({cx:f}, {cy:f}, {cz:f}), PxQuat({qx:f}, {qy:f}, {qz:f}, {qw:f})));
body->setMassSpaceInertiaTensor(PxVec3({A:f}, {B:f}, {C:f}));
""",
    ),
    "havok": Form(
        "Havok (a body on the web; moments for 1 kg, as it takes them)",
        """\
havok.HP_Body_SetMassProperties(body, [[{cx}, {cy}, {cz}], {mass}, [{a}, {b}, {c}], [{qx}, {qy}, {qz}, {qw}]]);
""",
    ),
    "babylon": Form(
        "Babylon.js (a PhysicsBody; moments for 1 kg, as it takes them)",
        """\
body.setMassProperties({
  mass: {mass},
  centerOfMass: new BABYLON.Vector3({cx}, {cy}, {cz}),
  inertia: new BABYLON.Vector3({a}, {b}, {c}),
  inertiaOrientation: new BABYLON.Quaternion({qx}, {qy}, {qz}, {qw}),
});
""",
    ),
    "usd": Form(
        "USD (UsdPhysics; metersPerUnit and kilogramsPerUnit 1)",
        """\
over "body" (
  prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
)
{
  float physics:mass = {mass}
  point3f physics:centerOfMass = ({cx}, {cy}, {cz})
  float3 physics:diagonalInertia = ({A}, {B}, {C})
  quatf physics:principalAxes = ({qw}, {qx}, {qy}, {qz})
}
""",
        comment="#",
    ),
    "gltf": Form(
        "glTF (a node with the mesh's axes; extensionsUsed names KHR_physics_rigid_bodies)",
        """\
"extensions": {"KHR_physics_rigid_bodies": {"motion": {"mass": {mass}, "centerOfMass": [{cx}, {cy}, {cz}], \
"inertiaDiagonal": [{A}, {B}, {C}], "inertiaOrientation": [{qx}, {qy}, {qz}, {qw}]}}}
""",
    ),
}
"""By the names of ``inspect --for``."""


def numbers(form: Form, properties: MassProperties) -> dict[str, float]:
    """What a form has places for, in its engine's axes and units.

    mass [kg]; c: centre of mass; A ≤ B ≤ C: principal moments, a, b, c: those of 1 kg; q: rotation of the principal
    axes; xx .. zz: the tensor about the centre of mass; p: the centre of mass in principal axes; products: the largest
    product, in per cent of the tensor's largest entry.
    """
    moments, axes = principal_axes(properties.inertia)
    mirrored = "xyz".find(form.mirrored or "-")
    flip = np.array([-1.0 if k == mirrored else 1.0 for k in range(3)])
    # S R S is R's turn seen in the mirror: of the turn's axis only the mirrored component stays.
    turn = quaternion_from_matrix(axes) * np.append(flip if mirrored < 0 else -flip, 1.0)
    square = form.per_m * form.per_m
    c = properties.center_of_mass * flip * form.per_m
    p = transposed_times(axes, properties.center_of_mass) * flip * form.per_m
    tensor = properties.inertia * np.outer(flip, flip) * square
    largest, product = np.max(np.abs(tensor)), np.max(np.abs(tensor[np.triu_indices(3, 1)]))
    own = moments * square
    return {
        "mass": properties.mass,
        **{f"c{name}": c[k] for k, name in enumerate("xyz")},
        **{name: own[k] for k, name in enumerate("ABC")},
        **{name: own[k] / properties.mass for k, name in enumerate("abc")},
        **{f"q{name}": turn[k] for k, name in enumerate("xyzw")},
        **{f"{one}{other}": tensor[i, j] for i, one in enumerate("xyz") for j, other in enumerate("xyz")},
        **{f"p{name}": p[k] for k, name in enumerate("xyz")},
        "products": 100.0 * product / largest,
    }


def engine_text(name: str, properties: MassProperties) -> str:
    """What an engine takes, to be pasted: a comment that says where it goes, then the record in the engine's words."""
    form = FORMS[name]
    values = numbers(form, properties)

    def number(place: re.Match[str]) -> str:
        name, single = place.groups()
        text = f"{values[name] + 0.0:{'.2g' if name == 'products' else '.9g'}}"
        return f"{float(text)!r}f" if single else text

    return _PLACE.sub(number, form.lines + (form.products if values["products"] > SAYS_NO_PRODUCTS else ""))
