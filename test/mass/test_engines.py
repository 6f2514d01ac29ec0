# SPDX-License-Identifier: MIT
"""What is printed for an engine is the body in that engine's axes, units and words."""

import json
import re

import numpy as np
import pytest

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.engines import FORMS, engine_text
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.properties import MassProperties

MASS = 2.5
NUMBER = r"-?\d+(?:\.\d+)?(?:e-?\d+)?"


@pytest.fixture(scope="module")
def body():
    return mesh_body("l_bracket")  # not symmetric about any plane of its axes


@pytest.fixture(scope="module")
def properties(body) -> MassProperties:
    return body.moments.mass_properties(mass=MASS)


def numbers(text: str, name: str) -> list[np.ndarray]:
    """The numbers in brackets after a name, as often as it occurs."""
    found = re.findall(rf"\b{name}\W*[(\[]([^()\[\]]*)[)\]]", text)
    return [np.array([float(word) for word in re.findall(NUMBER, each)]) for each in found]


def tensor(moments, rotation) -> np.ndarray:
    R = matrix_from_quaternion(rotation)
    return R @ np.diag(moments) @ R.T


def assert_is(true: MassProperties, mass, center, moments, rotation) -> None:
    assert mass == pytest.approx(true.mass, rel=1e-8)
    assert center == pytest.approx(true.center_of_mass, rel=1e-7)
    assert np.linalg.norm(rotation) == pytest.approx(1.0, abs=1e-8)
    largest = np.max(np.abs(true.inertia))
    assert np.max(np.abs(tensor(moments, rotation) - true.inertia)) <= 1e-7 * largest


# Four masses of 1 kg at the corners of a tetrahedron, whose sums docs/engines.md does by hand: about (0.2, 0.1, 0.3),
# Σx² = 0.48, Σy² = 0.12, Σz² = 1.08, Σxy = -0.08, Σxz = -0.24, Σyz = -0.12.
FOUR = "v 0 0 0\nv 0.8 0 0\nv 0 0.4 0\nv 0 0 1.2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(scope="module")
def four(tmp_path_factory) -> MassProperties:
    file = tmp_path_factory.mktemp("four") / "four.obj"
    file.write_text(FOUR)
    return mesh_body(str(file)).moments.mass_properties("points", mass=4.0)


def symmetric(xx, yy, zz, xy, xz, yz) -> np.ndarray:
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_unity_gets_principal_moments_and_their_turn_with_x_negated(four, body, properties):
    # Rigidbody.inertiaTensor is the diagonal in axes turned by inertiaTensorRotation. Products with x change their signs.
    by_hand = MassProperties(4.0, np.array([-0.2, 0.1, 0.3]), symmetric(1.2, 1.56, 0.6, -0.08, -0.24, 0.12))
    mirrored = body.moments.mass_properties(mass=MASS, scale=(-1.0, 1.0, 1.0))
    for text, true in ((engine_text("unity", four), by_hand), (engine_text("unity", properties), mirrored)):
        center, moments = numbers(text, "Vector3")
        (mass,) = re.findall(rf"body\.mass = ({NUMBER})f;", text)
        assert_is(true, float(mass), center, moments, numbers(text, "Quaternion")[0])


def test_unreal_gets_centimetres_principal_moments_and_their_turn_with_y_negated(four, body, properties):
    # The transform of the mass is where the diagonal stands. Products with y change their signs.
    by_hand = MassProperties(4.0, np.array([20.0, -10.0, 30.0]), symmetric(12000, 15600, 6000, -800, 2400, -1200))
    mirrored = body.moments.mass_properties(mass=MASS, scale=(100.0, -100.0, 100.0))
    for text, true in ((engine_text("unreal", four), by_hand), (engine_text("unreal", properties), mirrored)):
        moments, center = numbers(text, "FVector")
        (mass,) = re.findall(rf"SetMass_AssumesLocked\(actor, ({NUMBER})f\)", text)
        assert_is(true, float(mass), center, moments, numbers(text, "FQuat")[0])


def test_godot_gets_the_diagonal_in_the_axes_of_the_mesh(four):
    text = engine_text("godot", four)
    center, diagonal = numbers(text, "Vector3")[:2]
    assert center == pytest.approx([0.2, 0.1, 0.3]) and diagonal == pytest.approx([1.2, 1.56, 0.6])
    assert re.search(r"^mass = 4$", text, re.MULTILINE) and f"off by {100 * 0.24 / 1.56:.2g} %" in text


def test_godot_gets_the_diagonal_how_far_it_is_off_and_how_nothing_is_lost(properties):
    text = engine_text("godot", properties)
    center, diagonal, principal_center, moments = numbers(text, "Vector3")
    assert center == pytest.approx(properties.center_of_mass, rel=1e-8)
    assert diagonal == pytest.approx(np.diag(properties.inertia), rel=1e-8)
    off = properties.inertia - np.diag(diagonal)
    assert np.max(np.abs(off)) / np.max(properties.inertia) == pytest.approx(0.2353, abs=1e-3)
    assert "off by 24 %" in text
    (axes,) = numbers(text, "Quaternion")
    assert ").inverse()" in text  # so turned, the body's children have the principal axes along the body's
    R = matrix_from_quaternion(axes).T
    assert principal_center == pytest.approx(R @ properties.center_of_mass, rel=1e-6, abs=1e-9)
    assert np.max(np.abs(R @ properties.inertia @ R.T - np.diag(moments))) <= 1e-7 * np.max(moments)


@pytest.mark.parametrize(("engine", "comment"), [("godot", "#"), ("unreal", "//")])
def test_what_cant_say_products_tells_how_far_it_is_off_where_there_are_any(properties, engine, comment):
    plain = MassProperties(1.0, np.zeros(3), np.diag([0.3, 0.5, 0.7]))
    assert engine_text(engine, plain).count(comment) == 1
    rounded = MassProperties(1.0, np.zeros(3), plain.inertia + 5e-8 * 0.7 * (1.0 - np.eye(3)))
    assert engine_text(engine, rounded).count(comment) == 1
    slight = MassProperties(1.0, np.zeros(3), plain.inertia + 1.2e-6 * 0.7 * (1.0 - np.eye(3)))
    assert "off by 0.00012 %" in engine_text(engine, slight)
    assert "products of inertia" in engine_text(engine, properties).lower() and "off by 24 %" in engine_text(
        engine, properties
    )


@pytest.mark.parametrize(
    ("engine", "vector", "quaternion", "per_kg"),
    [("physx", "PxVec3", "PxQuat", 1.0), ("babylon", "Vector3", "Quaternion", MASS)],
)
def test_moments_and_rotation_are_the_tensor(properties, engine, vector, quaternion, per_kg):
    text = engine_text(engine, properties)
    center, moments = numbers(text, vector)
    assert_is(properties, MASS, center, moments * per_kg, numbers(text, quaternion)[0])
    assert "2.5" in text


def test_rapier_havok_and_jolt_get_rows_in_their_order(properties):
    rapier = [float(word) for word in re.findall(NUMBER, engine_text("rapier", properties).splitlines()[1])]
    assert_is(properties, rapier[0], rapier[1:4], rapier[4:7], rapier[7:])
    havok = json.loads(engine_text("havok", properties).partition("body, ")[2].rstrip(");\n"))
    assert_is(properties, havok[1], havok[0], MASS * np.array(havok[2]), havok[3])
    jolt = engine_text("jolt", properties)
    columns = np.array(numbers(jolt, "Vec4"))
    assert columns[:3, :3] == pytest.approx(properties.inertia, rel=1e-7, abs=1e-12)
    assert columns[:, 3].tolist() == [0, 0, 0, 1] and columns[3, :3].tolist() == [0, 0, 0]
    assert numbers(jolt, "Vec3")[0] == pytest.approx(properties.center_of_mass, rel=1e-8)


def test_usd_is_read_back_by_its_own_library(properties):
    pxr = pytest.importorskip("pxr")
    from pxr import Sdf, Usd, UsdPhysics

    assert pxr
    layer = Sdf.Layer.CreateAnonymous(".usda")
    head = "#usda 1.0\n(\n  metersPerUnit = 1\n  kilogramsPerUnit = 1\n)\n"
    text = engine_text("usd", properties)
    assert layer.ImportFromString(head + text.replace("over", "def Xform"))
    stage = Usd.Stage.Open(layer)
    prim = stage.GetPrimAtPath("/body")
    assert prim.HasAPI(UsdPhysics.RigidBodyAPI)
    mass = UsdPhysics.MassAPI(prim)
    turn = mass.GetPrincipalAxesAttr().Get()
    rotation = np.array([*turn.GetImaginary(), turn.GetReal()])
    center, moments = np.array(mass.GetCenterOfMassAttr().Get()), np.array(mass.GetDiagonalInertiaAttr().Get())
    assert mass.GetMassAttr().Get() == MASS
    assert center == pytest.approx(properties.center_of_mass, rel=1e-6)
    assert np.max(np.abs(tensor(moments, rotation / np.linalg.norm(rotation)) - properties.inertia)) <= 1e-6 * 0.0033


def test_gltf_is_a_nodes_extension(properties):
    text = engine_text("gltf", properties).splitlines()[1]
    motion = json.loads("{" + text + "}")["extensions"]["KHR_physics_rigid_bodies"]["motion"]
    assert set(motion) == {"mass", "centerOfMass", "inertiaDiagonal", "inertiaOrientation"}
    assert_is(properties, *(motion[name] for name in ("mass", "centerOfMass", "inertiaDiagonal", "inertiaOrientation")))


@pytest.mark.parametrize("engine", FORMS)
def test_the_command_prints_one_comment_and_the_lines(capsys, engine):
    assert main(["inspect", "l_bracket", "--mass", "2.5", "--for", engine]) == 0
    told = capsys.readouterr()
    first, *lines = told.out.splitlines()
    assert first.startswith(("// ", "# ")) and ("kg m²" in first or "kg cm²" in first)
    says = [k for k, line in enumerate(lines) if not line.startswith(("//", "#"))]
    assert says == list(range(max(says) + 1)) and told.err == ""
    assert not re.search(r"\{\w+(:f)?\}|\bnan\b|\binf\b", told.out)


def test_the_command_has_the_rotation_in_its_json_and_refuses_what_has_no_solid(capsys, tmp_path):
    assert main(["inspect", "l_bracket", "--mass", "2.5", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    R = matrix_from_quaternion(told["principal_orientation_xyzw"])
    assert np.allclose(R, told["principal_axes"], atol=1e-14)
    (tmp_path / "open.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n")
    assert main(["inspect", str(tmp_path / "open.obj"), "--for", "unity"]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1
