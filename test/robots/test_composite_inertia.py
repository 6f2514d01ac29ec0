# SPDX-License-Identifier: MIT
"""A robot with its joints at 0 is one rigid body: that of MuJoCo's kinematics, in a mesh of its links, flown as a scene."""

import json

import numpy as np
import pytest
from mesh_files import CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mesh.reading import Mesh
from rigid_proto_ros.robots.composite_inertia import lump_robot
from rigid_proto_ros.robots.link_shapes import primitive_solid, primitive_surface
from rigid_proto_ros.robots.reading import read_robot

INERTIA = 'ixx="0.03" ixy="0.001" ixz="-0.002" iyy="0.02" iyz="0.003" izz="0.025"'


def link(name: str, mass: float, xyz: str, shape: str = "") -> str:
    origin = f'<origin xyz="{xyz}" rpy="0.1 0.2 0.3"/>'
    return f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/><inertia {INERTIA}/></inertial>{shape}</link>'


def joint(kind: str, parent: str, child: str) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0.3 -0.1 0.2" rpy="0.4 0.5 -0.6"/>'
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    return f'<joint name="{child}s" type="{kind}">{ends}<axis xyz="0 0.6 0.8"/>{limit}</joint>'


BOX = '<visual><origin xyz="0 0 0.1"/><geometry><box size="0.1 0.2 0.3"/></geometry></visual>'
LINKS = link("base", 3.0, "0.1 0 0") + link("arm", 2.0, "0 0.2 0") + link("hand", 0.5, "0.05 0 0")
JOINTS = joint("revolute", "base", "arm") + joint("prismatic", "arm", "hand")
URDF = (
    f'<robot name="r">{LINKS.replace("</link>", f"{BOX}</link>")}<link name="eye">{BOX}</link>'
    f"{JOINTS}{joint('fixed', 'hand', 'eye')}</robot>"
)


def as_one_body(model):
    """Mass, COM and tensor of all bodies of a MuJoCo model as its file has them."""
    mujoco = pytest.importorskip("mujoco")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mass = model.body_mass.sum()
    center = model.body_mass @ data.xipos / mass
    inertia = np.zeros((3, 3))
    for body in range(model.nbody):
        R, d = data.ximat[body].reshape(3, 3), data.xipos[body] - center
        inertia += R @ np.diag(model.body_inertia[body]) @ R.T
        inertia += model.body_mass[body] * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, center, inertia


def assert_same(lump, expected) -> None:
    mass, center, inertia = expected
    assert lump.properties.mass == pytest.approx(mass, rel=1e-14)
    assert lump.properties.center_of_mass == pytest.approx(center, abs=1e-13)  # measured 2e-16
    assert lump.properties.inertia == pytest.approx(inertia, abs=1e-13)  # measured 4e-16


def test_a_urdf_is_the_body_that_mujoco_makes_of_it(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "robot.urdf"
    path.write_text(URDF)
    lump = lump_robot(path)
    # MuJoCo drops the mass of a root that doesn't move.
    free = '<link name="world"/><joint name="f" type="floating"><parent link="world"/><child link="base"/></joint>'
    compiler = '<mujoco><compiler fusestatic="false"/></mujoco>'
    model = mujoco.MjModel.from_xml_string(f'<robot name="r">{compiler}{LINKS}{JOINTS}{free}</robot>')
    assert_same(lump, as_one_body(model))
    assert lump.massless == ("eye",) and len(lump.links) == 3


MJCF = """<mujoco><compiler angle="degree"/><default><joint axis="0 1 0"/><default class="c"><joint type="slide" pos="9 9 9"/></default></default>
<worldbody><frame pos="0 0 1" euler="10 0 0"><body name="a" pos="1 2 3" euler="20 30 40">
  <inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.04"/><joint name="first" pos="0.1 0.2 0.3" axis="1 1 0" ref="30"/><joint name="second" pos="-0.1 0 0"/>
  <geom type="capsule" fromto="0 0 0 0.3 0.2 0.1" size="0.05"/>
  <body pos="0.5 0 0" childclass="c"><joint name="third" ref="0.1"/><inertial pos="0 0.1 0" mass="1" fullinertia="0.02 0.03 0.04 0.001 0 0"/>
  </body></body></frame></worldbody></mujoco>"""


def test_an_mjcf_is_the_body_that_mujoco_makes_of_it(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    path = tmp_path / "robot.xml"
    # Joints at their reference, which is how the file draws the bodies.
    for text in (MJCF, MJCF.replace('<inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>', "")):
        path.write_text(text)
        model = mujoco.MjModel.from_xml_string(text.replace(' ref="30"', "").replace(' ref="0.1"', ""))
        assert_same(lump_robot(path), as_one_body(model))
    assert len(lump_robot(path).triangles) and not lump_robot(path).absent


SDF = """<sdf version="1.9"><model name="m">
<link name="base"><inertial><mass>3</mass><inertia><ixx>0.03</ixx><iyy>0.02</iyy><izz>0.04</izz></inertia></inertial></link>
<frame name="mount" attached_to="base"><pose>0.3 -0.1 0.2 0.4 0.5 -0.6</pose></frame>
<link name="arm"><pose relative_to="turn">0.1 0 0 0 0 0</pose><inertial><pose>0 0.2 0 0 0 0</pose><mass>2</mass>
  <inertia><ixx>0.03</ixx><iyy>0.02</iyy><izz>0.04</izz></inertia></inertial></link>
<joint name="turn" type="revolute"><pose relative_to="mount"/><parent>base</parent><child>arm</child><axis><xyz>1 2 3</xyz></axis></joint>
</model></sdf>"""


def test_an_sdfs_frames_are_followed(tmp_path):
    path, same = tmp_path / "robot.sdf", tmp_path / "same.urdf"
    path.write_text(SDF)
    # The same robot as a URDF, whose link begins at the joint.
    inertial = '<inertial><origin xyz="{}"/><mass value="{}"/><inertia ixx="0.03" iyy="0.02" izz="0.04"/></inertial>'
    links = [
        f'<link name="{name}">{inertial.format(*of)}</link>'
        for name, of in (("base", ("0 0 0", 3)), ("arm", ("0.1 0.2 0", 2)))
    ]
    same.write_text(f'<robot name="r">{"".join(links)}{joint("revolute", "base", "arm")}</robot>')
    expected = lump_robot(same).properties
    assert_same(lump_robot(path), (expected.mass, expected.center_of_mass, expected.inertia))


def test_a_chain_of_frames_is_followed_however_long_it_is(tmp_path):
    pose = '<pose relative_to="l{}">1 0 0 0 0 0</pose>'
    links = [f'<link name="l{k}">{pose.format(k + 1)}</link>' for k in range(2000)]
    path = tmp_path / "model.sdf"
    path.write_text(f'<sdf><model name="m">{"".join(links)}<link name="l2000"><inertial/></link></model></sdf>')
    assert read_robot(path).poses()["l0"].position.tolist() == [2000.0, 0.0, 0.0]


def test_a_pose_with_a_quaternion_is_that_with_angles(tmp_path):
    path = tmp_path / "robot.sdf"
    place = '<pose degrees="True">1 2 3 0 0 60</pose>'
    inertia = "<inertia><ixx>0.03</ixx><ixy>0.001</ixy><iyy>0.02</iyy><izz>0.04</izz></inertia>"
    text = f"""<sdf version="1.9"><model name="m"><link name="a">{place}<inertial>{place}<mass>2</mass>{inertia}
</inertial></link></model></sdf>"""
    path.write_text(text)
    expected = lump_robot(path).properties
    path.write_text(text.replace(place, f'<pose rotation_format="quat_xyzw">1 2 3 0 0 1 {3.0**0.5}</pose>'))
    assert_same(lump_robot(path), (expected.mass, expected.center_of_mass, expected.inertia))
    path.write_text(text.replace(place, '<pose rotation_format="quat_xyzw"/>'))
    assert lump_robot(path).properties.center_of_mass.tolist() == [0.0, 0.0, 0.0]
    path.write_text(text.replace(place, '<pose rotation_format="quat_xyzw">1 2 3 0 0 0 0</pose>'))
    with pytest.raises(InputError, match="a quaternion other than 0"):
        lump_robot(path)


def test_what_an_sdf_leaves_out_of_an_inertial_are_its_defaults(tmp_path):
    path = tmp_path / "robot.sdf"
    path.write_text("""<sdf version="1.9"><model name="m"><link name="a"><inertial><mass>5</mass></inertial></link>
<link name="b"><pose>6 0 0 0 0 0</pose><inertial><inertia><ixx>2</ixx></inertia></inertial></link></model></sdf>""")
    far = 5.0 / 6.0 * 36.0
    expected = 6.0, np.array([1.0, 0.0, 0.0]), np.diag([3.0, 2.0 + far, 2.0 + far])
    assert_same(lump_robot(path), expected)


def test_an_older_sdf_names_the_frame_of_a_pose_by_another_attribute(tmp_path):
    path = tmp_path / "robot.sdf"
    path.write_text(SDF)
    expected = lump_robot(path).properties
    path.write_text(SDF.replace("relative_to", "frame").replace("1.9", "1.6"))
    assert_same(lump_robot(path), (expected.mass, expected.center_of_mass, expected.inertia))


def test_only_the_links_of_the_robot_itself_count(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(URDF.replace("</robot>", f"<gazebo>{link('other', 9.0, '0 0 0')}</gazebo></robot>"))
    assert lump_robot(path).properties.mass == 5.5


@pytest.mark.parametrize(
    ("kind", "attributes", "size"),
    [
        ("box", 'size="0.1 0.2 0.3"', (0.1, 0.2, 0.3)),
        ("cylinder", 'radius="0.1" length="0.5"', (0.1, 0.5)),
        ("capsule", 'radius="0.1" length="0.5"', (0.1, 0.5)),
        ("sphere", 'radius="0.1"', (0.1,)),
        ("ellipsoid", None, (0.1, 0.2, 0.3)),
    ],
)
def test_primitives_are_closed_surfaces_of_their_size(tmp_path, kind, attributes, size):
    surface = primitive_surface(kind, size)
    body = mesh_body(Mesh(kind, f"/{kind}.obj", *surface, None, kind))
    assert body.verdict.closed and not body.verdict.inward
    exact, inscribed = primitive_solid(kind, size), body.moments.mass_properties(density=1.0)
    assert 0.985 * exact.mass < inscribed.mass <= (1.0 + 1e-12) * exact.mass
    assert inscribed.inertia == pytest.approx(exact.inertia, rel=0.03, abs=1e-12)
    if attributes is not None:
        path = tmp_path / "robot.urdf"
        shape = f"<visual><geometry><{kind} {attributes}/></geometry></visual>"
        path.write_text(f'<robot name="r">{link("a", 1.0, "0 0 0", shape)}</robot>')
        assert np.array_equal(lump_robot(path).vertices, surface[0])


def test_the_command_writes_a_scene_that_flies(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cube.stl").write_bytes(stl(CUBE_VERTICES))
    cube = '<visual><geometry><mesh filename="cube.stl" scale="-0.1 0.1 0.1"/></geometry></visual>'
    (tmp_path / "robot.urdf").write_text(URDF.replace("</inertial>", f"</inertial>{cube}", 1))
    arguments = ["inspect", "--lump", "robot.urdf"]
    assert main([*arguments, "--as-scene", "flown.yaml", "--json"]) == 0
    lump = json.loads(capsys.readouterr().out)
    assert lump["mass"] == pytest.approx(5.5) and lump["massless"] == ["eye"]
    spin = "initial.angular_velocity=[0.1, 2.0, 0.3]"
    assert main(["simulate", "flown.yaml", "--duration", "1", "--set", spin, "--json"]) == 0
    flown = json.loads(capsys.readouterr().out)
    omega = np.array([0.1, 2.0, 0.3])
    assert flown["angular_momentum"] == pytest.approx(np.array(lump["inertia"]) @ omega, rel=1e-9)
    assert main(arguments) == 0
    assert "without mass: eye" in capsys.readouterr().out
    assert main([*arguments, "--urdf"]) == 0
    assert "<inertial>" in capsys.readouterr().out


def test_a_scene_takes_the_place_of_no_file_of_the_robot_nor_of_its_own_mesh(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.obj").write_bytes(obj())
    box, mesh = (
        BOX,
        BOX.replace('<box size="0.1 0.2 0.3"/>', '<mesh filename="arm.obj"/>').replace("visual", "collision"),
    )
    (tmp_path / "robot.urdf").write_text(URDF.replace(box, box + mesh, 1))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    for name, words in {"arm.yaml": "arm.obj", "robot.urdf": "robot.urdf", "new.obj": "beside it"}.items():
        assert main(["inspect", "--lump", "robot.urdf", "--as-scene", name]) == 2
        refusal = capsys.readouterr().err
        assert refusal.count("\n") == 1 and words in refusal
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    for _ in range(2):
        assert main(["inspect", "--lump", "robot.urdf", "--as-scene", "robot.yaml"]) == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--lump", "robot.urdf", "--mass", "1"], "--mass"),
        (["--lump", "robot.urdf", "--compare", "robot.urdf"], "--compare"),
        (["hammer", "--as-scene", "x.yaml"], "--lump ROBOT"),
        (["--lump", "none.urdf"], "none.urdf"),
        (["--lump", "two.urdf"], "2 root links"),
        (["--lump", "loop.urdf"], "a tree of links"),
        (["--lump", "empty.urdf"], "inertials"),
        (["--lump", "pose.urdf"], "xyz of joint arms: got 'along'"),
        (["--lump", "twins.urdf"], "two links 'hand'"),
        (["--lump", "half.urdf"], "without mass or inertia"),
        (["--lump", "world.urdf"], "no link 'world'"),
        (["--lump", "robot.urdf", "--tolerance", "0"], "--tolerance"),
        (["--lump", "robot.urdf", "--as-scene", ""], "--as-scene"),
        (["--lump", "frame.sdf"], "pose is relative to 'mount'"),
        (["--lump", "world.sdf"], "frame 'world'"),
        (["--lump", "format.sdf"], "rotation_format of the pose of link arm: got 'axis'"),
    ],
)
def test_what_is_no_one_body_is_refused_in_one_line(tmp_path, capsys, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "robot.urdf").write_text(URDF)
    (tmp_path / "two.urdf").write_text(f'<robot name="r">{link("a", 1, "0 0 0")}{link("b", 1, "0 0 0")}</robot>')
    (tmp_path / "loop.urdf").write_text(URDF.replace("</robot>", f"{joint('fixed', 'base', 'hand')}</robot>"))
    (tmp_path / "pose.urdf").write_text(URDF.replace('xyz="0.3 -0.1 0.2"', 'xyz="along"'))
    (tmp_path / "twins.urdf").write_text(URDF.replace("</robot>", f"{link('hand', 1, '0 0 0')}</robot>"))
    (tmp_path / "world.urdf").write_text(URDF.replace("</robot>", f"{joint('fixed', 'world', 'base')}</robot>"))
    half = f'<link name="half"><inertial><mass value="1"/></inertial></link>{joint("fixed", "hand", "half")}'
    (tmp_path / "half.urdf").write_text(URDF.replace("</robot>", f"{half}</robot>"))
    (tmp_path / "frame.sdf").write_text(SDF.replace("<pose>0 0.2 0 ", '<pose relative_to="mount">0 0.2 0 '))
    (tmp_path / "format.sdf").write_text(SDF.replace('relative_to="turn"', 'rotation_format="axis"'))
    (tmp_path / "world.sdf").write_text(SDF.replace('relative_to="turn"', 'relative_to="world"'))
    (tmp_path / "empty.urdf").write_text(f'<robot name="r"><link name="a">{BOX}</link></robot>')
    assert main(["inspect", *arguments]) == 2
    refusal = capsys.readouterr().err
    assert refusal.count("\n") == 1 and words in refusal
