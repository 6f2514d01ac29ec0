# SPDX-License-Identifier: MIT
"""``--fix`` rewrites the inertials that are off, and nothing else; a second run finds nothing."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.robots.fix import fix_robot
from rigid_proto_ros.robots.reading import read_robot

BAR = (CUBE_VERTICES - 0.5) * [0.1, 0.2, 0.3]
INERTIAL = re.compile(rb"<inertial\b.*?(?:</inertial>|/>(?=\s*<(?:/body|geom|inertial)))", re.DOTALL)


@pytest.fixture
def parts(tmp_path):
    (tmp_path / "bar.stl").write_bytes(stl(1000.0 * BAR))
    (tmp_path / "open.obj").write_bytes(obj(BAR, CUBE_TRIANGLES[:-1]))
    return tmp_path


MESH = '<geometry><mesh filename="bar.stl" scale="0.001 0.001 0.001"/></geometry>'
URDF = (
    '\ufeff<?xml version="1.0"?>\r\n<!-- größer: <robot> in a comment -->\r\n<robot name="r">\r\n\t<link name = \'arm\' >\r\n'
    f'\t\t<visual><origin xyz="0.1 0 0" rpy="0 0 0.5"/>{MESH}</visual>\r\n\t\t<visual>{MESH}</visual>\r\n'
    '\t\t<inertial  >  <!-- weighed: ä -->\r\n\t\t\t<inertia izz = "1" iyy=\'1\' ixx="1"   ixy="0.0" ixz="0" iyz="0" note=">"/>\r\n'
    '\t\t\t<mass   value=" 2.50 "/><!-- <mass value="9"/> -->\r\n\t\t\t<origin rpy="0 0 1.5"/>\r\n\t\t</inertial>\r\n\t</link>\r\n'
    f'<link name="bare"><visual>{MESH}</visual></link>\r\n<link name="open"><visual><geometry><mesh filename="open.obj"/></geometry>'
    '</visual><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.004"/></inertial></link>\r\n'
    f'<link name="one"><collision>{MESH}</collision><inertial><mass value="3"/><inertia ixx="7" iyy="1" izz="1"/></inertial></link>'
    '\r\n<joint name="j" type="fixed"><parent link="arm"/><child link="one"/></joint></robot>\r\n<!-- end -->\r\n'
)  # fmt: skip


def fixed(path: Path, text: str | bytes | None = None, **options):
    """Bytes, which differ from the file's in inertials alone, and the links by name."""
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    data, links = fix_robot(path, **options)
    assert INERTIAL.sub(b"#", data) == INERTIAL.sub(b"#", path.read_bytes())
    return data, {link.before.link: link for link in links}


def assert_finds_nothing(path: Path, data: bytes, *left: str) -> None:
    again, links = fixed(path, data)
    assert again == data
    assert {name for name, link in links.items() if link.before.status != "uniform"} == set(left)


def test_only_the_inertials_of_a_urdf_change(parts):
    path = parts / "robot.urdf"
    data, links = fixed(path, URDF)
    assert [(name, link.before.status, link.written) for name, link in links.items()] == [
        ("arm", "explained", True), ("bare", "unknown", False), ("open", "unknown", False),
        ("one", "impossible", True)
    ]  # fmt: skip
    assert "no <inertial>" in links["bare"].left and "open surface" in links["open"].left
    assert b"\t\t<inertial>\r\n\t\t  <origin" in data and b"/>\r\n\t\t</inertial>\r\n\t</link>" in data
    assert_finds_nothing(path, data, "bare", "open")
    (arm, _, _, one) = read_robot(path).links
    assert arm.mass == 2.5 and arm.center_of_mass == pytest.approx([0.05, 0.0, 0.0], abs=1e-15)
    assert one.inertia == pytest.approx(3.0 / 12.0 * np.diag([0.13, 0.1, 0.05]), rel=1e-12)


SDF = """<sdf version="1.9"><model name="m"><!-- a --><link name="l">
  <collision name="c"><pose>0.1 0 0 0 0 0.5</pose><geometry><mesh><uri>bar.stl</uri><scale>0.001 0.001 0.001</scale></mesh></geometry></collision>
  <inertial>
    <mass> 2 </mass> <!-- kg -->
    <inertia><ixx>1</ixx>
      <iyy> 1 </iyy></inertia>
  </inertial>
</link></model></sdf>
"""


def test_an_sdfs_inertial_is_replaced_unless_something_would_be_lost(parts):
    path = parts / "model.sdf"
    data, _ = fixed(path, SDF)
    expected = r"\n  <inertial>\n    <pose>0\.1\S* \S+ \S+ 0 0 0</pose>\n    <mass>2</mass>\n"
    assert re.search(expected, data.decode())
    assert_finds_nothing(path, data)
    (link,) = read_robot(path).links
    assert link.center_of_mass == pytest.approx([0.1, 0.0, 0.0], abs=1e-15) and link.mass == 2.0
    data, links = fixed(path, SDF.replace("<mass>", "<fluid_added_mass/><mass>"))
    assert data == path.read_bytes() and "<fluid_added_mass>" in links["l"].left


MJCF = """<mujoco><include file="more.xml"/>
  <asset><mesh name="bar" file="bar.stl" scale="0.001 0.001 0.001"/></asset>
  <worldbody>
    <body name="full"><inertial pos="0 0 0"  mass="2" fullinertia="1 1 1 0 0 0"/><geom type="mesh" mesh="bar" euler="10 20 30"/></body>
    <body name="diagonal"><inertial
        mass="3" pos="0 0 0" euler="0 0 45" diaginertia="1 1 1"/>
      <geom type="mesh" mesh="bar" pos="0.1 0 0" euler="10 20 30"/></body>
  </worldbody></mujoco>
"""
MORE = """<mujoco><worldbody><body name="more"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<geom type="box" size="1 2 3"/></body></worldbody></mujoco>"""


def test_an_mjcfs_inertials_are_replaced_and_mujoco_reads_them(parts):
    path = parts / "model.xml"
    (parts / "more.xml").write_text(MORE)
    data, links = fixed(path, MJCF)
    assert "another file" in links["more"].left
    assert b'euler="0 0 45"' not in data
    assert_finds_nothing(path, data, "more")
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.body_mass[2:] == pytest.approx([2.0, 3.0])  # the included body comes first
    for body in (2, 3):
        expected = model.body_mass[body] / 12.0 * np.array([0.13, 0.1, 0.05])
        assert np.sort(model.body_inertia[body]) == pytest.approx(np.sort(expected), rel=1e-9)


def test_the_command_writes_tells_and_leaves(parts, capsys):
    path, out = parts / "robot.urdf", parts / "fixed.urdf"
    path.write_bytes(URDF.encode())
    assert main(["inspect", "--compare", str(path), "--fix", str(out)]) == 0
    told = capsys.readouterr().out
    assert "arm: explained -> uniform" in told and "open: unknown; left: open" in told
    assert "2 of 4 inertials rewritten, 2 left" in told
    assert path.read_bytes() == URDF.encode()
    assert main(["inspect", "--compare", str(out), "--fix", str(parts / "again.urdf"), "--json"]) == 0
    links = json.loads(capsys.readouterr().out)["links"]
    assert [link["status"] for link in links] == ["uniform", "unknown", "unknown", "uniform"]
    assert not any(link["written"] for link in links)
    # A difference of 0.4 % is beyond 0.1 %, and within 1 %.
    text = out.read_text()
    ixx = re.search(r'ixx="([^"]+)"', text).group(1)
    out.write_text(text.replace(ixx, repr(1.004 * float(ixx))))
    check = ["inspect", "--compare", str(out)]
    assert [main(check), main([*check, "--tolerance", "0.01"]), main([*check, "--tolerance", "0.001"])] == [0, 0, 1]


@pytest.mark.parametrize("spelling", ["robot.urdf", "./robot.urdf", "link.urdf", "ABSOLUTE"])
def test_the_robots_own_file_is_not_overwritten(spelling, parts, capsys, monkeypatch):
    monkeypatch.chdir(parts)
    (parts / "robot.urdf").write_bytes(URDF.encode())
    (parts / "link.urdf").symlink_to("robot.urdf")
    out = str(parts / "robot.urdf") if spelling == "ABSOLUTE" else spelling
    assert main(["inspect", "--compare", "robot.urdf", "--fix", out]) == 2
    assert (
        capsys.readouterr().err == f"rigid_proto inspect: --fix: got {out!r}; accepted: another file than the robot's\n"
    )
    assert (parts / "robot.urdf").read_bytes() == URDF.encode()


def test_what_a_body_of_the_shapes_can_have_stays_unless_all_is_asked_for(parts):
    path = parts / "robot.urdf"
    shape = f"<visual>{MESH}</visual>"
    inertial = '<inertial><mass value="1.000"/><inertia ixx="0.012" iyy="0.009" izz="0.005"/></inertial>'
    data, links = fixed(path, f'<robot name="r"><link name="a">{shape}{inertial}</link></robot>')
    assert data == path.read_bytes() and "--all" in links["a"].left
    data, links = fixed(path, everything=True)
    assert (links["a"].before.status, links["a"].written) == ("not uniform", True)
    assert_finds_nothing(path, data)


def test_missing_inertials_are_filled_in_from_the_shapes_at_a_density(parts, capsys):
    path, out, gone = (
        parts / "robot.urdf",
        parts / "fixed.urdf",
        '<visual><geometry><mesh filename="no.stl"/></geometry></visual>',
    )
    box = '<{0}><origin xyz="0 0 1"/><geometry><box size="0.1 0.2 0.3"/></geometry></{0}>'
    path.write_text(
        '<robot name="r"><!-- <link name="bare"> -->\n  <link name="bare">\n    '
        f'<visual>{MESH}</visual>\n  </link><link name="box">{box.format("visual")}{box.format("collision")}</link>\n'
        f'<link name="hit">{box.format("collision")}</link><link name="gone">{gone}{box.format("collision")}</link>'
        '<link name="open"><visual><geometry><mesh filename="open.obj"/></geometry></visual></link><link name="empty"/>\n</robot>'
    )
    assert main(["inspect", "--compare", str(path), "--fix", str(out), "--density", "500"]) == 0
    told = capsys.readouterr().out
    for words in ("bare: unknown -> uniform", "box: unknown -> uniform", "hit: unknown -> uniform", "3 of 5 inertials"):
        assert words in told
    assert "gone: unknown; left: no <inertial>; visual mesh not found" in told and "open: unknown; left" in told
    links = {link.name: link for link in read_robot(out).links}
    for name, height in (("bare", 0.0), ("box", 1.0), ("hit", 1.0)):
        assert links[name].mass == pytest.approx(3.0, rel=1e-6) and links[name].center_of_mass[2] == pytest.approx(
            height
        )
        assert links[name].inertia == pytest.approx(3.0 / 12.0 * np.diag([0.13, 0.1, 0.05]), rel=1e-6)
    assert b'  <link name="bare">\n    <inertial>\n      <origin' in out.read_bytes()
    assert re.sub(rb"\s*<inertial>.*?</inertial>", b"", out.read_bytes(), flags=re.DOTALL) == path.read_bytes()
    data, _ = fix_robot(out, density=500.0)
    assert data == out.read_bytes()
    for more in (["--density", "500"], ["--fix", str(out), "--density", "0"], ["--fix", str(out), "--density", "nan"]):
        assert main(["inspect", "--compare", str(path), *more]) == 2


def test_missing_inertials_of_an_sdf_are_filled_in_and_those_that_a_simulator_computes_are_left(parts):
    path, auto = parts / "model.sdf", "<inertial auto='true'/>"
    path.write_text(re.sub("<inertial>.*</inertial>", "", SDF, flags=re.DOTALL))
    data, links = fix_robot(path, density=1000.0)
    path.write_bytes(data)
    (link,) = read_robot(path).links
    assert links[0].written and link.mass == pytest.approx(6.0, rel=1e-6)
    path.write_text(re.sub("<inertial>.*</inertial>", auto, SDF, flags=re.DOTALL))
    data, links = fix_robot(path, density=1000.0)
    assert data == path.read_bytes() and "auto" in links[0].left


def test_an_inertial_within_another_is_refused(parts):
    path = parts / "robot.urdf"
    path.write_bytes(URDF.replace("</inertial>", "<inertial/></inertial>", 1).encode())
    with pytest.raises(InputError, match="none within another"):
        fixed(path)


def test_xacro_is_refused_with_the_command_that_expands_it_and_wide_characters_too(parts):
    path = parts / "an arm.urdf.xacro"
    path.write_text('<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot>')
    for use in (fixed, read_robot):
        with pytest.raises(InputError, match=r"xacro '\S*an arm\.urdf\.xacro' > EXPANDED"):
            use(path)
    path = parts / "wide.urdf"
    path.write_bytes(URDF.replace("\ufeff", "").replace('<?xml version="1.0"?>', "").encode("utf-16"))
    with pytest.raises(InputError, match="UTF-8"):
        fixed(path)
