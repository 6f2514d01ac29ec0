# SPDX-License-Identifier: MIT
"""Inertials to paste are read back by the formats' own readers as the same body."""

import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import moved, prism, rotation, sphere

from rigid_proto_ros.base.rotation import matrix_from_quaternion, quaternion_from_matrix
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from rigid_proto_ros.mass.properties import MassProperties, MeshMoments
from rigid_proto_ros.robots.reading import read_robot, rotation_from_wxyz

BODIES = {
    "lopsided": moved(prism([[1, 0], [0.2, 0.8], [-0.9, 0.3], [-0.1, -0.7]], 1.3, 0.5, 3), (0.3, -0.2, 5.0), 4),
    "ellipsoid": moved(sphere(8, (1.0, 0.1, 0.02)), (100.0, 0, 0), 5),
}


@pytest.fixture(params=BODIES)
def properties(request) -> MassProperties:
    return MeshMoments(*BODIES[request.param]).mass_properties(density=730.0)


def off(inertia, properties) -> float:
    return np.max(np.abs(inertia - properties.inertia)) / np.max(np.abs(properties.inertia))


def test_urdf_is_read_back_by_the_parser_of_ros(properties):
    urdf = pytest.importorskip("urdf_parser_py.urdf")
    text = f'<robot name="r"><link name="l">{urdf_inertial(properties)}</link></robot>'
    inertial = urdf.URDF.from_xml_string(text).links[0].inertial
    assert inertial.mass == properties.mass
    assert list(inertial.origin.xyz) == properties.center_of_mass.tolist()
    assert list(inertial.origin.rpy) == [0.0, 0.0, 0.0]
    assert inertial.inertia.to_matrix() == properties.inertia.tolist()  # 17 digits: to the last bit


def test_a_flat_body_is_accepted_by_mujoco():
    mujoco = pytest.importorskip("mujoco")
    plate = np.array([[0, 0, 0], [1, 0, 0], [1.0, 2, 0], [0, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    for seed in range(12):
        turned = moved(plate, (1, 2, 3), seed)
        properties = MeshMoments(*turned, no_solid="open").mass_properties("shell", mass=2.0)
        body = f'<body name="b"><freejoint/>{mjcf_inertial(properties)}</body>'
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        R = matrix_from_quaternion(np.roll(model.body_iquat[1], -1))
        assert off(R @ np.diag(model.body_inertia[1]) @ R.T, properties) <= 1e-12


def test_sdf_and_urdf_and_mjcf_are_read_back_by_our_own_reader(properties, tmp_path):
    """MJCF through MuJoCo itself."""
    pytest.importorskip("mujoco")
    files = {
        "r.urdf": f'<robot name="r"><link name="l">{urdf_inertial(properties)}</link></robot>',
        "r.sdf": f'<sdf version="1.9"><model name="m"><link name="l">{sdf_inertial(properties)}</link></model></sdf>',
        "r.xml": f'<mujoco><worldbody><body name="l">{mjcf_inertial(properties)}</body></worldbody></mujoco>',
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        (link,) = read_robot(tmp_path / name).links
        assert link.mass == properties.mass
        assert link.center_of_mass.tolist() == properties.center_of_mass.tolist()
        assert off(link.inertia, properties) <= 1e-14, name


def test_the_command_prints_what_the_json_says(capsys):
    def printed(form: str) -> str:
        main(["inspect", "hammer", form])
        return capsys.readouterr().out

    report = json.loads(printed("--json"))
    urdf, mjcf, sdf = (ElementTree.fromstring(printed(form)) for form in ("--urdf", "--mjcf", "--sdf"))
    assert float(urdf.find("mass").get("value")) == report["mass"]
    assert float(urdf.find("inertia").get("ixz")) == report["inertia"][0][2]
    assert [float(number) for number in mjcf.get("diaginertia").split()] == report["principal_moments"]
    assert float(sdf.findtext("inertia/izz")) == report["inertia"][2][2]


HALF_TURNS = (np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0]))


@given(st.one_of(st.sampled_from((np.eye(3), *HALF_TURNS)), st.integers(0, 2**31).map(rotation)))
@settings(deadline=None, max_examples=30)
def test_a_quaternion_gives_its_rotation_back_half_turns_too(R):
    x, y, z, w = quaternion_from_matrix(R)
    assert rotation_from_wxyz((w, x, y, z)) == pytest.approx(R, abs=2e-15)
