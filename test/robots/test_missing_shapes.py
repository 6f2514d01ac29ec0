# SPDX-License-Identifier: MIT
"""A link is never condemned, nor its inertial rewritten, for a shape that can't be found or read."""

import json

import pytest
from mesh_files import CUBE_VERTICES, collada, obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.robots.diagnosis import compare_robot

RIGHT = '<inertial><mass value="6.00000"/><inertia ixx="1.00000" iyy="1.00000" izz="1.00000"/></inertial>'
"""Of the cube of 1 m, uniform."""
NOBODYS = '<inertial><mass value="6.00000"/><inertia ixx="1.00000" iyy="1.00000" izz="9.00000"/></inertial>'
CRUDE = '<collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>'
"""In which no mass distribution has the cube's tensor."""


def mesh(role: str, file: str) -> str:
    return f'<{role}><geometry><mesh filename="{file}"/></geometry></{role}>'


def robot(folder, shapes: str, inertial: str = RIGHT):
    (folder / "cube.obj").write_bytes(obj(CUBE_VERTICES - 0.5))
    (folder / "cut.stl").write_bytes(b"solid cut\nfacet normal 0 0 1\nouter loop\nvertex 0 0")
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r"><link name="torso">{inertial}{shapes}</link></robot>')
    return path


GONE = "package://my_robot_description/meshes/torso.stl"
SHOWN, HIT = mesh("visual", "cube.obj"), mesh("collision", "cube.obj")


@pytest.mark.parametrize(
    ("shapes", "said"),
    [
        (mesh("visual", GONE) + CRUDE, "visual mesh not found"),
        (mesh("visual", GONE) + HIT, "visual mesh not found"),
        (mesh("visual", "gone.dae") + SHOWN, "visual mesh not found"),
        (SHOWN + mesh("visual", "gone.dae") + HIT, "visual mesh not found"),
        (mesh("visual", "cut.stl") + CRUDE, "visual mesh that can't be read: cut.stl"),
        (mesh("visual", "gone.dae") + mesh("visual", "cut.stl"), "and 1 more"),
        (mesh("collision", GONE), "collision mesh not found"),
        (mesh("collision", "gone.dae") + CRUDE, "collision mesh not found"),
        (CRUDE + mesh("collision", "cut.stl"), "collision mesh that can't be read"),
    ],
)
@pytest.mark.parametrize("inertial", [RIGHT, NOBODYS])
def test_what_cannot_be_read_is_named_and_judges_nothing(tmp_path, capsys, shapes, said, inertial):
    path, out = robot(tmp_path, shapes, inertial), tmp_path / "fixed.urdf"
    impossible = inertial == NOBODYS  # whatever the shapes
    assert main(["inspect", "--compare", str(path), "--json"]) == impossible
    (link,) = json.loads(capsys.readouterr().out)["links"]
    assert link["status"] == ("impossible" if impossible else "unknown")
    assert said in link["note"] and link["expected"] is None
    assert main(["inspect", "--compare", str(path), "--strict"]) == 1
    assert f": {link['status']}; {said}" in capsys.readouterr().out or "and 1 more" in said
    assert main(["inspect", "--compare", str(path), "--fix", str(out), "--all"]) == impossible
    assert out.read_bytes() == path.read_bytes()
    assert said in capsys.readouterr().out


@pytest.mark.parametrize("file", [GONE, "cut.stl"])
def test_a_lost_collision_mesh_is_a_remark_where_all_that_is_shown_can_be_read(tmp_path, capsys, file):
    path = robot(tmp_path, SHOWN + mesh("collision", file))
    (link,) = compare_robot(path)
    assert (link.status, link.judged_by) == ("uniform", "visual") and "collision mesh" in link.info[0]
    assert main(["inspect", "--compare", str(path), "--strict"]) == 0
    assert "  info: collision mesh" in capsys.readouterr().out
    (link,) = compare_robot(robot(tmp_path, SHOWN + mesh("collision", file), RIGHT.replace("1.00000", "4.00000")))
    assert link.status == "impossible for its shape" and link.expected is not None


def test_collision_shapes_judge_a_link_that_shows_nothing(tmp_path):
    (link,) = compare_robot(robot(tmp_path, HIT))
    assert (link.status, link.judged_by) == ("uniform", "collision")


def test_a_link_without_an_inertial_and_mesh_says_both(tmp_path):
    (link,) = compare_robot(robot(tmp_path, mesh("visual", GONE), ""))
    assert link.status == "unknown" and link.note.startswith("no <inertial>; visual mesh not found")


ROD = '<visual><geometry><mesh filename="rod.dae" scale="0.2 1 0.2"/></geometry></visual>'
"""A rod along y, from the link's origin; upright, as its file says it is with y up, it stands along z."""


@pytest.mark.parametrize(
    ("up", "com", "moments", "word"),
    [
        ("Y_UP", "0.1 -0.1 0.5", (0.45, 0.45, 0.04), "unknown"),  # a standing rod, heavier in the middle
        ("Z_UP", "0.1 -0.1 0.5", (0.45, 0.45, 0.04), "impossible for its shape"),
        ("Y_UP", "0.1 0.5 0.1", (0.45, 0.04, 0.45), "not uniform"),  # lying, as its numbers are
        ("Y_UP", "0.1 9.0 0.1", (0.45, 0.04, 0.45), "impossible for its shape"),  # either way
        ("Y_UP", "0.1 0.5 0.1", (0.52e6, 0.04e6, 0.52e6), "explained"),  # by the rod as it lies
    ],
)
def test_a_mesh_that_some_programs_turn_upright_condemns_what_is_wrong_either_way(tmp_path, up, com, moments, word):
    pytest.importorskip("collada")
    data = collada('<node><instance_geometry url="#cube"/></node>')
    (tmp_path / "rod.dae").write_bytes(data.replace(b"</asset>", f"<up_axis>{up}</up_axis></asset>".encode()))
    x, y, z = moments
    own = f'<origin xyz="{com}"/><mass value="6.00000"/><inertia ixx="{x:.6f}" iyy="{y:.6f}" izz="{z:.6f}"/>'
    path = robot(tmp_path, ROD, f"<inertial>{own}</inertial>")
    (link,) = compare_robot(path)
    assert link.status == word, link
    assert ("turned upright" in link.note) == (word == "unknown")
    main(["inspect", "--compare", str(path), "--fix", str(tmp_path / "fixed.urdf")])
    assert ((tmp_path / "fixed.urdf").read_bytes() == path.read_bytes()) == (word in ("unknown", "not uniform"))
