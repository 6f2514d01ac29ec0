# SPDX-License-Identifier: MIT
"""The inertia doctor on files as robots have them: packages, default classes, several shapes a link, primitives, digits."""

import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.robots.diagnosis import compare_robot

CUBE = CUBE_VERTICES - 0.5  # about its centre: inertia m/6 on the diagonal
SIXTH = 1.0 / 6.0


def inertial(mass="1.0000", moment=SIXTH, center="0 0 0") -> str:
    entries = " ".join(
        f'{name}="{moment if name[1] == name[2] else 0.0:.9g}"' for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    return f'<inertial><origin xyz="{center}"/><mass value="{mass}"/><inertia {entries}/></inertial>'


def mesh(file, scale="1 1 1", role="visual", xyz="0 0 0") -> str:
    return f'<{role}><origin xyz="{xyz}"/><geometry><mesh filename="{file}" scale="{scale}"/></geometry></{role}>'


def urdf(folder, *links: str):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "robot.urdf"
    path.write_text(
        '<robot name="r">' + "".join(f'<link name="l{k}">{text}</link>' for k, text in enumerate(links)) + "</robot>"
    )
    return path


def judge(path, **options):
    return {d.link: d for d in compare_robot(path, **options)}


def test_a_mesh_belongs_to_the_one_link_that_names_it(tmp_path):
    # Both meshes are called base, but stand in the link at different scales.
    for name, scale in (("visual", 1000.0), ("collision", 1.0)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "base.stl").write_bytes(stl(scale * CUBE))
    shapes = mesh("visual/base.stl", "0.001 0.001 0.001") + mesh("collision/base.stl", role="collision")
    path = urdf(tmp_path, shapes + inertial())
    with pytest.raises(InputError, match="fits 2 shapes"):
        compare_robot(path, mesh=str(tmp_path / "visual" / "base.stl"))
    path = urdf(tmp_path, mesh("visual/base.stl", "0.001 0.001 0.001") + inertial())
    (link,) = compare_robot(path, mesh=str(tmp_path / "visual" / "base.stl"))
    assert link.status == "uniform" and link.inertia_error < 1e-6


def mjcf(folder, text: str):
    (folder / "assets").mkdir(parents=True, exist_ok=True)
    (folder / "assets" / "cube.stl").write_bytes(stl(1000.0 * CUBE))
    path = folder / "robot.xml"
    path.write_text(f"<mujoco>{text}</mujoco>")
    return path


BODY = '<inertial pos="0.3 0 0" mass="1" diaginertia="0.1666667 0.1666667 0.1666667"/>'
MILLIMETRES = 'scale="0.001 0.001 0.001"'


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
    path = mjcf(tmp_path, text)
    (tmp_path / "parts.xml").write_text(
        f'<mujoco><asset><mesh name="c" file="cube.stl" {MILLIMETRES}/></asset></mujoco>'
    )
    (tmp_path / "geoms.xml").write_text('<mujocoinclude><geom type="mesh" mesh="c" pos="0.3 0 0"/></mujocoinclude>')
    link = judge(path)["b"]
    assert (link.status, link.causes) == ("uniform", ())
    assert link.expected.center_of_mass == pytest.approx([0.3, 0.0, 0.0], abs=1e-7)


@pytest.mark.parametrize(
    ("text", "words_of_refusal"),
    [
        ('<include file="robot.xml"/>', "more files"),
        ('<include file="none.xml"/>', "none.xml"),
        (f'<worldbody><body name="b"><geom class="no" type="sphere"/>{BODY}</body></worldbody>', "unknown default"),
        ('<compiler coordinate="global"/>', "coordinate"),
    ],
)
def test_mjcf_that_cannot_be_honoured_is_refused(tmp_path, text, words_of_refusal):
    with pytest.raises(InputError, match=words_of_refusal):
        compare_robot(mjcf(tmp_path, text))


def test_packages_are_found_upwards_by_name_by_package_xml_and_where_one_says(tmp_path):
    folder = tmp_path / "ws" / "src" / "my_robot"
    (folder / "meshes").mkdir(parents=True)
    (folder / "meshes" / "a b.stl").write_bytes(stl(CUBE))
    links = [
        mesh("package://my_robot/meshes/a b.stl"),
        mesh("model://my_robot/meshes/a%20b.stl"),
        mesh("file://../meshes/a b.stl"),
    ]
    path = urdf(folder / "urdf", *(text + inertial() for text in links))
    assert {d.status for d in judge(path).values()} == {"uniform"}
    folder.rename(tmp_path / "ws" / "src" / "clone")
    path = tmp_path / "ws" / "src" / "clone" / "urdf" / "robot.urdf"
    assert judge(path)["l0"].status == "unknown"
    assert "--package-path" in judge(path)["l0"].note
    (path.parent.parent / "package.xml").write_text("<package><name>my_robot</name></package>")
    assert judge(path)["l0"].status == "uniform"
    elsewhere = urdf(tmp_path / "elsewhere", mesh("package://my_robot/meshes/a b.stl") + inertial())
    assert judge(elsewhere)["l0"].status == "unknown"
    assert judge(elsewhere, folders=(path.parent.parent,))["l0"].status == "uniform"


def test_several_shapes_of_a_link_are_put_together(tmp_path):
    (tmp_path / "cube.obj").write_bytes(obj(CUBE))
    two = mesh("cube.obj", xyz="1 0 0") + mesh("cube.obj", xyz="-1 0 0")
    # Two cubes of half a kilogram, one metre to each side.
    entries = 'ixx="{0:.9g}" iyy="{1:.9g}" izz="{1:.9g}" ixy="0" ixz="0" iyz="0"'.format(SIXTH, SIXTH + 1.0)
    text = f'<inertial><mass value="1.000000"/><inertia {entries}/></inertial>'
    boxes = "".join(
        f'<collision><origin xyz="{x} 0 0"/><geometry><box size="1 1 1"/></geometry></collision>' for x in (-1, 1)
    )
    apart = (
        f'<inertial><mass value="1.000000"/><inertia ixx="{SIXTH:.9g}" iyy="{SIXTH:.9g}" izz="{SIXTH:.9g}"/></inertial>'
    )
    links = judge(urdf(tmp_path, two + text, boxes + text, boxes + apart))
    assert (links["l2"].status, links["l2"].causes) == ("explained", ("parts summed about their own centres",))
    assert [(d.status, d.judged_by) for d in (links["l0"], links["l1"])] == [
        ("uniform", "visual"),
        ("uniform", "collision"),
    ]


def test_visual_and_collision_are_judged_and_the_better_is_named(tmp_path):
    (tmp_path / "cube.obj").write_bytes(obj(CUBE))
    (tmp_path / "open.obj").write_bytes(obj(CUBE, CUBE_TRIANGLES[:-1]))
    coarse = '<collision><geometry><box size="1 1.2 1"/></geometry></collision>'
    links = judge(
        urdf(
            tmp_path,
            mesh("cube.obj") + coarse + inertial(),
            mesh("open.obj") + mesh("cube.obj", role="collision") + inertial(),
        )
    )
    assert [(d.status, d.judged_by) for d in (links["l0"], links["l1"])] == [
        ("uniform", "visual"),
        ("uniform", "collision"),
    ]


def test_the_digits_printed_excuse_what_they_leave_open_and_no_more(tmp_path):
    (tmp_path / "cube.obj").write_bytes(obj(CUBE))
    true = 0.0124  # printed as 0.012: 3.3 % off, and the tensor with six digits is of the true mass
    right = mesh("cube.obj") + inertial("0.012", true / 6.0)
    wrong = mesh("cube.obj") + inertial("0.012000", true / 6.0)
    far = mesh("cube.obj") + inertial("0.012", 0.0132 / 6.0)
    coarse = mesh("cube.obj") + inertial("1.00000", 0.17)
    links = judge(urdf(tmp_path, right, wrong, far, coarse))
    assert [links[f"l{k}"].status for k in range(4)] == ["uniform", "not uniform", "not uniform", "uniform"]


def test_missing_inertials_stand_apart_and_the_rest_is_ranked(tmp_path, capsys):
    (tmp_path / "cube.obj").write_bytes(obj(CUBE))
    shape = mesh("cube.obj")
    path = urdf(tmp_path, shape, shape + inertial(moment=0.2), shape + inertial(), shape + inertial(moment=20.0))
    diagnoses = compare_robot(path)
    verdicts = [("l3", "impossible for its shape"), ("l1", "not uniform"), ("l2", "uniform"), ("l0", "unknown")]
    assert [(d.link, d.status) for d in diagnoses] == verdicts
    assert main(["inspect", "--compare", str(path)]) == 1
    out = capsys.readouterr().out
    assert "l0 (cube): unknown; no <inertial>" in out
    assert "4 links: 1 impossible for its shape, 1 not uniform, 1 uniform, 1 unknown" in out
