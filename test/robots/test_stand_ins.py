# SPDX-License-Identifier: MIT
"""Primitives stand in for parts: they condemn no inertial. A link without mass and shape marks a place."""

import numpy as np
import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.robots.diagnosis import compare_robot

BOX = '<{role}><origin xyz="0 0 0.1"/><geometry><box size="0.2 0.3 0.4"/></geometry></{role}>'
SHOWN, HIT = BOX.format(role="visual"), BOX.format(role="collision")
OWN = np.array([0.25, 0.2, 0.13]) / 12.0
"""Moments of the box's kilogram."""


def inertial(com, moments, mass="1.000000", digits=".9f") -> str:
    x, y, z = (format(moment, digits) for moment in moments)
    return f'<inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia ixx="{x}" iyy="{y}" izz="{z}"/></inertial>'


CAD = inertial("0.012300 -0.000800 0.041100", (0.4, 0.41, 0.3))
"""What no distribution in the box has: the part is larger."""


def robot(folder, *links: str):
    (folder / "cube.obj").write_bytes(obj(CUBE_VERTICES - 0.5))
    (folder / "open.obj").write_bytes(obj(CUBE_VERTICES - 0.5, CUBE_TRIANGLES[:-1]))
    path = folder / "robot.urdf"
    texts = [f'<link name="l{k}">{text}</link>' for k, text in enumerate(links)]
    path.write_text(f'<robot name="r">{"".join(texts)}</robot>')
    return path


def words(path) -> list[str]:
    return [one.status for one in sorted(compare_robot(path), key=lambda one: one.link)]


@pytest.mark.parametrize("shapes", [SHOWN, HIT, SHOWN + HIT])
def test_primitives_alone_do_not_judge_and_what_they_give_is_told(tmp_path, capsys, shapes):
    path, out = robot(tmp_path, shapes + CAD), tmp_path / "fixed.urdf"
    assert main(["inspect", "--compare", str(path)]) == 0
    told = capsys.readouterr().out
    assert "not judged; its shapes are primitives only: not judged against them" in told
    assert "expected: ixx ixy ixz iyy iyz izz 0.0208333333 " in told
    assert main(["inspect", "--compare", str(path), "--strict"]) == 0
    assert main(["inspect", "--compare", str(path), "--tolerance", "0.01"]) == 1  # nothing was compared
    capsys.readouterr()
    assert main(["inspect", "--compare", str(path), "--fix", str(out)]) == 0
    assert out.read_bytes() == path.read_bytes() and "stand in for others" in capsys.readouterr().out
    assert main(["inspect", "--compare", str(path), "--fix", str(out), "--all"]) == 0
    assert words(out) == ["uniform"]


def test_what_primitives_explain_is_explained_in_whole_or_not_at_all(tmp_path):
    at, off = "0 0 0.100000", "0 0 0"
    links = [inertial(at, OWN), inertial(at, 1e4 * OWN), inertial(off, OWN), inertial(off, 1e4 * OWN)]
    links += [inertial(off, (0.4, 0.41, 0.3)), inertial("0.012300 0 0.1", 1e4 * OWN)]
    found = ["uniform", *["explained"] * 3, *["not judged"] * 2]
    assert words(robot(tmp_path, *(SHOWN + one for one in links))) == found


def mesh(role: str, file: str) -> str:
    return f'<{role}><geometry><mesh filename="{file}"/></geometry></{role}>'


def test_a_primitive_beside_a_mesh_finds_a_link_right_and_never_wrong(tmp_path):
    box = '<collision><geometry><box size="1 1 2"/></geometry></collision>'
    off = '<visual><geometry><box size="1 1 2"/></geometry></visual>'
    own, other = np.array([5.0, 5.0, 2.0]) / 12.0, np.array([0.2, 0.2, 0.25])
    links = [
        mesh("visual", "cube.obj") + box + inertial("0 0 0", own),
        mesh("visual", "cube.obj") + box + inertial("0 0 0", 1.5 * own),  # 1.5 times the box's: a cause, of the box
        mesh("visual", "cube.obj") + box + inertial("0 0 0", other),
        mesh("visual", "open.obj") + box + inertial("0 0 0", own),
        mesh("visual", "open.obj") + box + inertial("0 0 0", 1.5 * own),
        off + mesh("collision", "cube.obj") + inertial("0 0 0", other),
    ]
    path = robot(tmp_path, *links)
    assert words(path) == ["uniform", "not uniform", "not uniform", "uniform", "unknown", "not uniform"]
    judged = {one.link: one.judged_by for one in compare_robot(path)}
    assert judged["l2"] == "visual" and judged["l0"] == judged["l5"] == "collision"


def test_a_link_without_mass_and_shape_is_a_frame(tmp_path, capsys):
    massless = [inertial("0 0 0", moments, "0") for moments in ((0, 0, 0), (1, 1, 1))]
    path, out = robot(tmp_path, *massless), tmp_path / "fixed.urdf"
    assert main(["inspect", "--compare", str(path), "--strict"]) == 0
    told = capsys.readouterr().out
    assert told.count("frame; mass 0 and no shape") == 2 and told.count("its tensor isn't 0") == 1
    assert main(["inspect", "--compare", str(path), "--fix", str(out), "--all"]) == 0
    assert out.read_bytes() == path.read_bytes()
    assert words(robot(tmp_path, massless[0] + SHOWN)) == ["impossible"]
