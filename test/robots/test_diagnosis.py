# SPDX-License-Identifier: MIT
"""The inertia doctor on files as robots have them: packages, default classes, several shapes a link, primitives, digits."""

import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.robots.diagnosis import compare_robot

CUBE = CUBE_VERTICES - 0.5  # about its centre: inertia m/6 on the diagonal
SIXTH = 1.0 / 6.0


def inertial(mass="1.0000", *moments: float) -> str:
    x, y, z = (moments or (SIXTH,)) * (1 if len(moments) == 3 else 3)
    return f'<inertial><mass value="{mass}"/><inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}"/></inertial>'


def mesh(file, scale="1 1 1", role="visual", xyz="0 0 0") -> str:
    return f'<{role}><origin xyz="{xyz}"/><geometry><mesh filename="{file}" scale="{scale}"/></geometry></{role}>'


def urdf(folder, *links: str):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cube.obj").write_bytes(obj(CUBE))
    path = folder / "robot.urdf"
    texts = [f'<link name="l{k}">{text}</link>' for k, text in enumerate(links)]
    path.write_text(f'<robot name="r">{"".join(texts)}</robot>')
    return path


def judge(path, **options) -> list[tuple[str, str]]:
    """Verdict, and by which shapes, of each link in the file's order."""
    found = sorted(compare_robot(path, **options), key=lambda one: one.link)
    return [(one.status, one.judged_by) for one in found]


def test_a_mesh_belongs_to_the_one_link_that_names_it(tmp_path):
    # Both meshes are called base, but stand in the link at different scales.
    for name, scale in (("visual", 1000.0), ("collision", 1.0)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "base.stl").write_bytes(stl(scale * CUBE))
    shown = mesh("visual/base.stl", "0.001 0.001 0.001")
    path = urdf(tmp_path, shown + mesh("collision/base.stl", role="collision") + inertial())
    with pytest.raises(InputError, match="fits 2 shapes"):
        compare_robot(path, mesh=str(tmp_path / "visual" / "base.stl"))
    (link,) = compare_robot(urdf(tmp_path, shown + inertial()), mesh=str(tmp_path / "visual" / "base.stl"))
    assert link.status == "uniform" and link.inertia_error < 1e-6


BODY = '<inertial pos="0.3 0 0" mass="1" diaginertia="0.1666667 0.1666667 0.1666667"/>'
MILLIMETRES = 'scale="0.001 0.001 0.001"'


def mjcf(folder, text: str):
    (folder / "assets").mkdir()
    (folder / "assets" / "cube.stl").write_bytes(stl(1000.0 * CUBE))
    (folder / "robot.xml").write_text(f"<mujoco>{text}</mujoco>")
    return folder / "robot.xml"


@pytest.mark.parametrize(
    "text",
    [
        f'<default><default class="mm"><mesh {MILLIMETRES}/><geom pos="9 9 9"/><default class="arm"><geom type="mesh" pos="0.3 0 0"/></default></default></default>'
        '<asset><mesh name="c" class="mm" file="assets/cube.stl"/></asset>'
        f'<worldbody><body name="b" childclass="arm"><geom mesh="c"/>{BODY}</body></worldbody>',
        '<compiler meshdir="assets"/><include file="parts.xml"/>'
        f'<worldbody><body name="b"><include file="geoms.xml"/>{BODY}</body></worldbody>',
        f'<asset><mesh name="c" file="assets/cube.stl" {MILLIMETRES}/></asset><worldbody><frame><body name="b">'
        f'<frame pos="0.2 0.1 0" euler="0 0 90"><geom type="mesh" mesh="c" pos="-0.1 -0.1 0"/></frame>{BODY}</body></frame></worldbody>',
        '<compiler angle="radian"/><worldbody><body name="b"><geom type="box" size="0.5 0.5 0.5" pos="0.3 0 0" '
        f'euler="0 0 1.5707963267948966"/>{BODY}</body></worldbody>',
    ],
    ids=["classes", "include", "frame", "primitive"],
)  # fmt: skip
def test_mjcf_is_read_as_its_compiler_reads_it(tmp_path, text):
    pytest.importorskip("mujoco")
    asset = f'<mujoco><asset><mesh name="c" file="cube.stl" {MILLIMETRES}/></asset></mujoco>'
    (tmp_path / "parts.xml").write_text(asset)
    (tmp_path / "geoms.xml").write_text('<mujocoinclude><geom type="mesh" mesh="c" pos="0.3 0 0"/></mujocoinclude>')
    (link,) = compare_robot(mjcf(tmp_path, text))
    assert (link.status, link.causes) == ("uniform", ())
    assert link.expected.center_of_mass == pytest.approx([0.3, 0.0, 0.0], abs=1e-7)


@pytest.mark.parametrize(
    ("text", "words_of_refusal"),
    [
        ('<include file="robot.xml"/>', "more files"),
        ('<include file="none.xml"/>', "none.xml"),
        (f'<worldbody><body name="b"><geom class="no" type="sphere"/>{BODY}</body></worldbody>', "unknown default"),
        ('<compiler coordinate="global"/>', "coordinate"),
        ('<asset><model name="x"/></asset>', "a file for each"),
    ],
)
def test_mjcf_that_cannot_be_honoured_is_refused(tmp_path, text, words_of_refusal):
    with pytest.raises(InputError, match=words_of_refusal):
        compare_robot(mjcf(tmp_path, text))


def test_packages_are_found_upwards_by_name_by_package_xml_and_where_one_says(tmp_path):
    folder = tmp_path / "ws" / "src" / "my_robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "a b.stl").write_bytes(stl(CUBE))
    files = ("package://my_robot/meshes/a b.stl", "model://my_robot/meshes/a%20b.stl", "file://../meshes/a%20b.stl")
    uniform, unknown = ("uniform", "visual"), ("unknown", "visual")
    assert judge(urdf(folder / "urdf", *(mesh(file) + inertial() for file in files))) == [uniform] * 3
    folder.rename(tmp_path / "ws" / "src" / "clone")
    path = tmp_path / "ws" / "src" / "clone" / "urdf" / "robot.urdf"
    assert judge(path) == [unknown, unknown, uniform]
    assert "--package-path" in compare_robot(path)[-1].note
    (path.parent.parent / "package.xml").write_text("<package><name>my_robot</name></package>")
    assert judge(path) == [uniform] * 3
    elsewhere = urdf(tmp_path / "elsewhere", mesh(files[0]) + inertial())
    assert judge(elsewhere) == [unknown]
    assert judge(elsewhere, folders=(path.parent.parent,)) == [uniform]


def test_several_shapes_of_a_link_are_put_together(tmp_path):
    # Two cubes of half a kilogram, one metre to each side.
    two = mesh("cube.obj", xyz="1 0 0") + mesh("cube.obj", xyz="-1 0 0")
    right, apart = inertial("1.000000", SIXTH, SIXTH + 1.0, SIXTH + 1.0), inertial("1.000000", SIXTH)
    place = '<collision><origin xyz="{} 0 0"/><geometry><box size="1 1 1"/></geometry></collision>'
    boxes = place.format(1) + place.format(-1)
    path = urdf(tmp_path, two + right, boxes + right, boxes + apart)
    assert judge(path) == [("uniform", "visual"), ("uniform", "collision"), ("explained", "collision")]
    assert compare_robot(path)[0].causes == ("parts summed about their own centres",)


def test_the_worst_verdict_stands_first_and_of_equal_ones_the_farthest_off(tmp_path):
    moments = [(0.15,), (SIXTH,), (0.2,), (20.0,), (0.02, 0.2, 0.9)]
    path = urdf(tmp_path, mesh("cube.obj"), *(mesh("cube.obj") + inertial("1.00000", *each) for each in moments))
    verdicts = [("l5", "impossible"), ("l4", "impossible for its shape"), ("l3", "not uniform"), ("l1", "not uniform")]
    verdicts += [("l2", "uniform"), ("l0", "unknown")]
    assert [(one.link, one.status) for one in compare_robot(path)] == verdicts


def test_exchanged_axes_of_a_box_are_called_so(tmp_path):
    box = '<collision><geometry><box size="0.3 0.2 0.1"/></geometry></collision>'
    (link,) = compare_robot(urdf(tmp_path, box + inertial("16.2", 0.135, 0.0675, 0.1755)))
    assert link.causes == ("axes x and y exchanged",)


def test_visual_and_collision_are_judged_and_the_better_is_named(tmp_path):
    coarse = '<collision><geometry><box size="1 1.2 1"/></geometry></collision>'
    cube = mesh("cube.obj", role="collision")
    path = urdf(tmp_path, mesh("cube.obj") + coarse + inertial(), mesh("open.obj") + cube + inertial())
    (tmp_path / "open.obj").write_bytes(obj(CUBE, CUBE_TRIANGLES[:-1]))
    assert judge(path) == [("uniform", "visual"), ("uniform", "collision")]


def test_the_digits_printed_excuse_what_they_leave_open_and_no_more(tmp_path):
    true = 0.0124  # printed as 0.012: 3.3 % off, and the tensor with six digits is of the true mass
    printed = [("0.012", true / 6.0), ("0.012000", true / 6.0), ("0.012", 0.0132 / 6.0), ("1.00000", 0.17)]
    path = urdf(tmp_path, *(mesh("cube.obj") + inertial(*one) for one in printed))
    assert [status for status, _ in judge(path)] == ["uniform", "not uniform", "not uniform", "uniform"]
