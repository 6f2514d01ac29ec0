# SPDX-License-Identifier: MIT
"""Files that were misread or refused without need: MJCF as MuJoCo compiles it, SDF as Gazebo takes it."""

import os
import resource
import subprocess
import sys

import numpy as np
import pytest
from mesh_files import CUBE_VERTICES, stl
from test_composite_inertia import as_one_body, assert_same

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.robots import mjcf_compiler
from rigid_proto_ros.robots.composite_inertia import lump_robot
from rigid_proto_ros.robots.diagnosis import compare_robot
from rigid_proto_ros.robots.reading import read_robot

SIX_KG = '<inertial pos="0.1 0 0" mass="6" diaginertia="0.2 0.3 0.4" euler="0 0 30"/>'
CHILD = f"""<mujoco model="child"><compiler angle="radian"/><default><geom type="capsule" size="0.1 0.2"/></default>
<worldbody><body name="c" pos="0 0 1" euler="0 0 0.3">{SIX_KG.replace("30", "0.7")}<joint name="turn" axis="0 1 0"/><geom/></body></worldbody>
</mujoco>"""
GEOMS = """<mujoco><compiler inertiafromgeom="true"/><asset><mesh name="m" file="cube.stl"/></asset>
<worldbody><body name="c"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
INCLUDED = f'<mujoco><body name="c">{SIX_KG}</body></mujoco>'
MODELS = {
    "aligned": """<mujoco><worldbody><body name="a" pos="1 0 0"><freejoint align="true"/>
      <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="10 20 30"/></body></worldbody></mujoco>""",
    "all aligned": """<mujoco><compiler alignfree="true"/><worldbody><body name="a" pos="1 0 0"><freejoint/>
      <geom type="box" size="0.1 0.2 0.3" pos="1 0 0" euler="10 20 30"/></body></worldbody></mujoco>""",
    "attached from geoms": f"""<mujoco><asset><model name="child" file="geoms.xml"/></asset><worldbody><body name="a">{SIX_KG}
      <attach model="child" body="c" prefix="x_"/></body></worldbody></mujoco>""",
    "included by an included file": """<mujoco><worldbody><include file="parts/one.xml"/></worldbody></mujoco>""",
    "attach": f"""<mujoco><asset><model name="child" file="child.xml"/></asset><worldbody><body name="a">{SIX_KG}
      <frame pos="0 1 0" euler="20 0 0"><attach model="child" body="c" prefix="x_"/></frame></body></worldbody></mujoco>""",
    "frame": f"""<mujoco><worldbody><frame pos="0 1 0" euler="20 0 0"><body name="a">{SIX_KG}</body>
      <frame pos="1 0 0"><body name="b" pos="0 0 2">{SIX_KG}</body></frame></frame></worldbody></mujoco>""",
    "settotalmass": f"""<mujoco><compiler settotalmass="10"/><worldbody><body name="a">{SIX_KG}
      <body name="b" pos="0 0 1">{SIX_KG}</body></body></worldbody></mujoco>""",
    "boundmass": f"""<mujoco><compiler boundmass="2"/><worldbody><body name="a">{SIX_KG}<body name="b" pos="0 0 1">
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.1 0.1 0.1"/></body></body></worldbody></mujoco>""",
    "geoms": """<mujoco><default><geom density="500"/></default><worldbody><body name="a"><geom size="0.2"/>
      <body name="b" pos="0 0 1"><geom type="box" size="0.1 0.2 0.3" mass="3"/></body></body></worldbody></mujoco>""",
    "replicate": f"""<mujoco><worldbody><replicate count="3" euler="0 0 30"><body name="a" pos="1 0 0">{SIX_KG}</body>
      </replicate></worldbody></mujoco>""",
}


@pytest.mark.parametrize("name", MODELS)
def test_an_mjcf_weighs_what_it_weighs_in_mujoco(tmp_path, name, monkeypatch):
    mujoco = pytest.importorskip("mujoco")
    (tmp_path / "child.xml").write_text(CHILD)
    (tmp_path / "geoms.xml").write_text(GEOMS)
    (tmp_path / "cube.stl").write_bytes(stl(CUBE_VERTICES))
    (tmp_path / "parts").mkdir()
    # Beside the main file, or else beside the one that includes it.
    (tmp_path / "parts/one.xml").write_text('<mujoco><include file="two.xml"/><include file="three.xml"/></mujoco>')
    (tmp_path / "parts/two.xml").write_text(INCLUDED)
    (tmp_path / "parts/three.xml").write_text("<mujoco/>")
    (tmp_path / "three.xml").write_text(INCLUDED.replace('"c"', '"d"'))
    path = tmp_path / "model.xml"
    path.write_text(MODELS[name])
    monkeypatch.chdir(tmp_path)
    assert_same(lump_robot(path), as_one_body(mujoco.MjModel.from_xml_path("model.xml")))


def test_shapes_stay_in_the_frame_of_the_file_whatever_mujoco_aligns(tmp_path):
    pytest.importorskip("mujoco")
    place = 'pos="1 0 0" euler="10 20 30"'
    shape = f'<geom type="box" size="0.1 0.2 0.3" {place}/><inertial {place} mass="48" diaginertia="2.08 1.6 0.8"/>'
    path = tmp_path / "model.xml"
    path.write_text(f"""<mujoco><compiler alignfree="true"/><worldbody><body name="a"><freejoint/>{shape}</body>
<body name="b"><freejoint align="true"/>{shape}</body></worldbody></mujoco>""")
    assert {d.link: d.status for d in compare_robot(path)} == {"a": "uniform", "b": "uniform"}


def test_a_file_included_twice_and_meshes_that_mujoco_cannot_load(tmp_path):
    pytest.importorskip("mujoco")
    (tmp_path / "geom.xml").write_text('<mujocoinclude><geom type="box" size="0.1 0.2 0.3"/></mujocoinclude>')
    inertial = '<inertial pos="0 0 0" mass="12" diaginertia="0.52 0.4 0.2"/>'
    body = f'<body name="%s">{inertial}<include file="geom.xml"/>%s</body>'
    lost = '<geom type="mesh" mesh="m" contype="0" conaffinity="0"/>'
    asset = '<asset><mesh name="m" file="lost.dae"/><texture name="t" type="2d" file="lost.png"/></asset>'
    path = tmp_path / "model.xml"
    path.write_text(f"<mujoco>{asset}<worldbody>{body % ('a', lost)}{body % ('b', '')}</worldbody></mujoco>")
    assert {d.link: d.status for d in compare_robot(path)} == {"a": "unknown", "b": "uniform"}
    path.write_text(path.read_text().replace('conaffinity="0"', 'conaffinity="1"'))  # collides, too, and isn't shown
    assert {d.link: d.status for d in compare_robot(path)} == {"a": "unknown", "b": "uniform"}
    assert lump_robot(path).properties.mass == 24.0


PARTS = '<asset><model name="m" file="part.xml"/></asset>'


@pytest.mark.stress
@pytest.mark.parametrize(
    "text",
    [
        '<worldbody><replicate count="100000000"><body><geom size=".1"/></body></replicate></worldbody>',
        "<worldbody>" + 5 * '<replicate count="30">' + '<geom size=".1"/>' + 5 * "</replicate>" + "</worldbody>",
        '<worldbody><body name="b"><flexcomp name="f" type="grid" count="900 900 900"/></body></worldbody>',
        f'{PARTS}<worldbody><replicate count="3000"><attach model="m" prefix="a"/></replicate></worldbody>',
    ],
)
def test_an_mjcf_that_grows_beyond_all_measure_is_refused(tmp_path, text):
    pytest.importorskip("mujoco")
    grown = '<replicate count="1000"><geom size=".1"/></replicate>'
    (tmp_path / "part.xml").write_text(f"<mujoco><worldbody><body>{grown}</body></worldbody></mujoco>")
    (tmp_path / "model.xml").write_text(f"<mujoco>{text}</mujoco>")
    with pytest.raises(InputError, match="robot file"):
        compare_robot(tmp_path / "model.xml")


WORLD = "<mujoco>{}<worldbody>{}</worldbody></mujoco>"
BALL = '<body><joint/><geom size=".1"/></body>'
MODEST = {
    "memory asked for": WORLD.format('<size memory="500G"/>', BALL),
    "user data": WORLD.format('<size nuserdata="2000000000"/>', BALL),
    "user data of each geom": WORLD.format('<size nuser_geom="1000000000"/>', BALL),
    "user data of many": WORLD.format('<size nuser_body="1000000"/>', 3000 * "<body/>" + BALL),
    "key frames": WORLD.format('<size nkey="100000000"/>', BALL),
    "a plate made": WORLD.format(
        '<asset><mesh name="m" builtin="plate" params="20000 20000"/></asset>', '<geom type="mesh" mesh="m"/>' + BALL
    ),
    "a wedge made": WORLD.format(
        '<asset><mesh name="m" builtin="wedge" params="20000 20000 20 20 .5"/></asset>',
        '<geom type="mesh" mesh="m"/>' + BALL,
    ),
    "replicated up to the limit": WORLD.format("", f'<replicate count="4900" offset="1 0 0">{BALL}</replicate>'),
    "a grid up to the limit": WORLD.format(
        "", '<body name="b"><flexcomp type="grid" name="f" dim="3" count="26 26 26" spacing="1 1 1" mass="1"/></body>'
    ),
    "a cloth up to the limit": WORLD.format(
        "", '<body name="b"><flexcomp type="grid" name="f" dim="2" count="140 140 1" spacing="1 1 1" mass="1"/></body>'
    ),
    "a rope up to the limit": WORLD.format(
        "", '<body name="b"><flexcomp type="grid" name="f" dim="1" count="19000 1 1" spacing="1 1 1" mass="1"/></body>'
    ),
    "cells of a grid": WORLD.format(
        "",
        '<body name="b"><flexcomp type="grid" name="f" dim="3" count="8 8 8" spacing="1 1 1" mass="1" dof="trilinear" '
        'cellcount="2000 2000 2000"/></body>',
    ),
    "a disc without count": WORLD.format(
        "", '<body name="b"><flexcomp type="disc" name="f" dim="2" count="130 130 1" spacing="1 1 1" mass="1"/></body>'
    ),
    "samples of a sensor": WORLD.format("", BALL.replace("<joint/>", '<joint name="j"/>')).replace(
        "</mujoco>", '<sensor><jointpos joint="j" nsample="1000000000" delay=".1"/></sensor></mujoco>'
    ),
}
"""MJCFs of a few lines whose counts are small, or aren't counted, and that may take minutes and gigabytes."""


def judged_within_limits(path) -> float:
    """That the file is judged or refused in one line within what is said; seconds of a core."""
    code = (
        "import sys; from rigid_proto_ros.cli.main import main; sys.exit(main(['inspect', '--compare', sys.argv[1]]))"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode in (0, 2), done.stderr
    assert done.stderr.count("\n") == (done.returncode == 2), done.stderr
    assert after.ru_maxrss <= mjcf_compiler.MEMORY_BYTES / 1024  # of the largest child so far
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.stress
@pytest.mark.parametrize("name", MODEST)
def test_no_small_mjcf_takes_more_than_ten_seconds_and_a_gibibyte(tmp_path, name):
    pytest.importorskip("mujoco")
    (tmp_path / "model.xml").write_text(MODEST[name])
    assert judged_within_limits(tmp_path / "model.xml") <= mjcf_compiler.CPU_S + 5.0


def test_an_mjcf_that_takes_too_long_or_too_much_is_refused(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    limited = "what MuJoCo compiles in"
    path = tmp_path / "model.xml"
    path.write_text(MODEST["a plate made"])
    with pytest.raises(InputError, match="what MuJoCo reads"):
        read_robot(path)
    path.write_text(MODEST["key frames"])
    monkeypatch.setattr(mjcf_compiler, "WALL_S", 1.5)
    with pytest.raises(InputError, match=limited):
        read_robot(path)


def test_mujoco_is_not_taken_from_the_folder_of_a_robot(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    (tmp_path / "mujoco.py").write_text("raise SystemExit(3)")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    (tmp_path / "model.xml").write_text(WORLD.format("", f'<body name="b">{SIX_KG}<geom size=".1"/></body>'))
    monkeypatch.chdir(tmp_path)
    assert [link.name for link in read_robot(tmp_path / "model.xml").links] == ["b"]


def test_an_mjcf_too_deep_or_with_a_pipe_to_include_is_refused(tmp_path):
    pytest.importorskip("mujoco")
    os.mkfifo(tmp_path / "pipe.xml")
    path = tmp_path / "model.xml"
    for inside, words in ((2000 * "<body>" + 2000 * "</body>", "deep"), ('<include file="pipe.xml"/>', "pipe")):
        path.write_text(f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
        with pytest.raises(InputError, match=words):
            read_robot(path)


def test_an_mjcf_with_an_inertial_that_mujoco_refuses_is_judged(tmp_path, capsys):
    pytest.importorskip("mujoco")
    path = tmp_path / "model.xml"
    path.write_text(
        '<mujoco><worldbody><body name="a"><freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 5"/>'
        '<geom size="1"/></body></worldbody></mujoco>'
    )
    (link,) = compare_robot(path)
    assert link.status == "impossible"
    # As one body it is what MuJoCo makes of it, which is nothing.
    with pytest.raises(InputError, match=r"A \+ B"):
        lump_robot(path)
    assert main(["inspect", "--compare", str(path)]) == 1


def test_without_mujoco_an_mjcf_is_refused_with_the_extra_that_reads_it(tmp_path, monkeypatch):
    path = tmp_path / "model.xml"
    path.write_text("<mujoco/>")
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(InputError, match=r"rigid_proto_ros\[robots\]"):
        compare_robot(path)


def sdf(folder, links: str):
    (folder / "cube.stl").write_bytes(stl(CUBE_VERTICES - 0.5))
    path = folder / "model.sdf"
    path.write_text(
        f'<sdf version="1.11"><model name="m">{links}<plugin name="p" filename="f"><gz:system gz:on="1"/></plugin></model></sdf>'
    )
    return path


BOX = (
    '<collision name="{0}"><pose>{1} 0 0 0 0 0</pose>{2}<geometry><box><size>1 1 1</size></box></geometry></collision>'
)


def test_links_of_several_models_have_the_names_of_their_models_before_theirs(tmp_path):
    inertial = "<inertial><mass>1</mass></inertial>"
    models = [f'<model name="{name}"><link name="link">{inertial}</link></model>' for name in ("cup", "table")]
    path = tmp_path / "world.sdf"
    path.write_text(f'<sdf version="1.9"><world name="w">{"".join(models)}</world></sdf>')
    assert [link.name for link in read_robot(path).links] == ["cup::link", "table::link"]
    assert [link.name for link in read_robot(sdf(tmp_path, f'<link name="link">{inertial}</link>')).links] == ["link"]


def test_a_name_with_line_breaks_and_control_characters_is_one_printable_line(tmp_path, capsys):
    path = sdf(tmp_path, '<link name="a&#10;9 links: 9 uniform&#155;2J&#x202e;"><inertial/></link>')
    assert main(["inspect", "--compare", str(path)]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert line.isprintable() and line.startswith("a 9 links")


def test_prefixes_that_an_sdf_does_not_declare_are_names_and_blank_lines_before_it_are_no_fault(tmp_path):
    inertia = "<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia>"
    path = sdf(
        tmp_path, f'<link name="a"><inertial><mass>6.0000</mass>{inertia}</inertial>{BOX.format("c", 0, "")}</link>'
    )
    path.write_text(f'\n\n<?xml version="1.0"?>\n{path.read_text()}')
    (link,) = compare_robot(path)
    assert link.status == "uniform"


def test_an_inertial_that_gazebo_computes_counts_as_its_collision_shapes(tmp_path, capsys):
    light, heavy = (f"<density>{value}</density>" for value in (100, 300))
    shapes = BOX.format("c1", -1, light) + BOX.format("c2", 1, heavy)
    path = sdf(tmp_path, f'<link name="a"><inertial auto="true"/>{shapes}</link>')
    (link,) = compare_robot(path)
    assert link.status == "unknown" and "auto" in link.note
    properties = lump_robot(path).properties
    # 100 kg at x = -1, 300 kg at x = 1; a cube of side 1 has m/6 about each axis.
    assert properties.mass == pytest.approx(400.0, rel=1e-14)
    assert properties.center_of_mass == pytest.approx([0.5, 0.0, 0.0], abs=1e-14)
    across = 400.0 / 6.0 + 100.0 * 1.5**2 + 300.0 * 0.5**2
    assert properties.inertia == pytest.approx(np.diag([400.0 / 6.0, across, across]), rel=1e-13, abs=1e-12)
    path = sdf(tmp_path, f'<link name="a"><inertial auto="true"><mass>4</mass></inertial>{shapes}</link>')
    assert lump_robot(path).properties.inertia == pytest.approx(properties.inertia / 100.0, rel=1e-13, abs=1e-14)
    density = "<inertial auto='true'><density>50</density></inertial>"
    path = sdf(tmp_path, f'<link name="a">{density}{BOX.format("c", 0, "")}</link>')
    assert lump_robot(path).properties.mass == pytest.approx(50.0, rel=1e-14)


SHAPED = {
    "urdf": '<robot name="r"><link name="a"><visual><origin xyz="{0} 0 0" rpy="0 {1} 0"/><geometry><box size="1 {2} 1"/>'
    '</geometry></visual><inertial><mass value="6"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
    '<joint name="j" type="fixed"><parent link="b"/><child link="a"/><origin xyz="{3} 0 0"/></joint><link name="b"/></robot>',
    "sdf": '<sdf version="1.9"><model name="m"><link name="a"><pose>{3} 0 0 0 0 0</pose><visual name="v">'
    "<pose>{0} 0 0 0 {1} 0</pose><geometry><box><size>1 {2} 1</size></box></geometry></visual>"
    "<inertial><mass>6</mass><inertia/></inertial></link></model></sdf>",
    "xml": '<mujoco><worldbody><body name="a" pos="{3} 0 0"><geom pos="{0} 0 0" euler="0 {1} 0" type="box" '
    'size=".5 {4} .5"/><inertial pos="0 0 0" mass="6" diaginertia="1 1 1"/></body></worldbody></mujoco>',
}


WORDS = ("nan", "1e999", "1e200", "1 2", "x")
IN_PROCESSES = [pytest.param("xml", word, marks=[pytest.mark.stress] if word != "nan" else []) for word in WORDS]
"""MuJoCo compiles each in a process of its own."""


@pytest.mark.parametrize(
    ("file_format", "word"), [*((kind, word) for kind in ("urdf", "sdf") for word in WORDS), *IN_PROCESSES]
)
def test_numbers_that_no_robot_has_are_named(tmp_path, capsys, file_format, word):
    if file_format == "xml":
        pytest.importorskip("mujoco")
    path, out = tmp_path / f"robot.{file_format}", str(tmp_path / "out")
    for slot, said in enumerate(("position of box", "orientation of box", "size of box", "position of link a")):
        words = ["0", "0", "1", "0", "0.5"]
        words[slot] = words[4] if slot == 1 and word == "1e200" else word  # an angle may have any size
        words[4] = word if slot == 2 else words[4]
        path.write_text(SHAPED[file_format].format(*words))
        for use in (["--compare", str(path)], ["--compare", str(path), "--fix", out], ["--lump", str(path)]):
            status = main(["inspect", *use])
            told = capsys.readouterr()
            if status == 2:
                assert told.err.count("\n") == 1 and "accepted:" in told.err
            elif "--lump" in use:
                assert f"not in the mesh: a: {said}" in told.out or words[slot] == "0.5"
            else:  # where the link stands is of no concern
                assert slot == 3 or words[slot] == "0.5" or "unknown" in told.out and said in told.out
