# SPDX-License-Identifier: MIT
"""Inertials to paste are read back by the formats' own readers as the same body."""

import json
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from mass_solids import moved, prism, sphere

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from rigid_proto_ros.mass.properties import MassProperties, MeshMoments
from rigid_proto_ros.robots.reading import read_robot

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


def read_by_mujoco(inertial: str):
    """Mass, COM (3,) and tensor (3, 3) of a body with an MJCF <inertial>."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="b"><freejoint/>{inertial}</body></worldbody></mujoco>'
    )
    R = np.empty(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[1])
    R = R.reshape(3, 3)
    return model.body_mass[1], model.body_ipos[1], R @ np.diag(model.body_inertia[1]) @ R.T


def test_mjcf_is_read_back_by_mujoco(properties):
    mass, center, inertia = read_by_mujoco(mjcf_inertial(properties))
    assert mass == properties.mass
    assert center.tolist() == properties.center_of_mass.tolist()
    assert off(inertia, properties) <= 1e-14


def test_a_flat_body_is_accepted_by_mujoco():
    plate = np.array([[0, 0, 0], [1, 0, 0], [1.0, 2, 0], [0, 2, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    for seed in range(12):
        turned = moved(plate, (1, 2, 3), seed)
        properties = MeshMoments(*turned, no_solid="open").mass_properties("shell", mass=2.0)
        assert off(read_by_mujoco(mjcf_inertial(properties))[2], properties) <= 1e-12


def test_sdf_and_urdf_and_mjcf_are_read_back_by_our_own_reader(properties, tmp_path):
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
    main(["inspect", "hammer", "--json"])
    report = json.loads(capsys.readouterr().out)
    main(["inspect", "hammer", "--urdf"])
    element = ElementTree.fromstring(capsys.readouterr().out)
    assert float(element.find("mass").get("value")) == report["mass"]
    assert float(element.find("inertia").get("ixz")) == report["inertia"][0][2]
    main(["inspect", "hammer", "--mjcf"])
    numbers = ElementTree.fromstring(capsys.readouterr().out).get("diaginertia").split()
    assert [float(n) for n in numbers] == report["principal_moments"]
    main(["inspect", "hammer", "--sdf"])
    assert float(ElementTree.fromstring(capsys.readouterr().out).findtext("inertia/izz")) == report["inertia"][2][2]
