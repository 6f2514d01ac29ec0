# SPDX-License-Identifier: MIT
"""The inertia doctor finds the usual mistakes in URDF, SDF and MJCF files, and finds nothing in right ones."""

import json

import numpy as np
import pytest

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.tensor import six_from_tensor, tensor_from_six
from rigid_proto_ros.robots.reading import rotation_from_rpy

MASS = 0.7
RPY = (0.3, -0.5, 0.9)
POSITION = np.array([0.1, 0.2, -0.05])
SCALE = np.array([1.0, 2.0, 1.5])
NAMES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
POUND_INCH = 2.2046226218487757 / 0.0254**2


@pytest.fixture(scope="module")
def truth():
    """COM (3,) and six entries of the hammer's tensor in the link's axes."""
    properties = mesh_body("hammer").moments.mass_properties(scale=SCALE, mass=MASS)
    R = rotation_from_rpy(*RPY)
    return R @ properties.center_of_mass + POSITION, np.array(six_from_tensor(R @ properties.inertia @ R.T))


def words(values) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)


def urdf(center, six, mass=MASS, mesh="hammer") -> str:
    entries = " ".join(f'{name}="{float(value):.17g}"' for name, value in zip(NAMES, six, strict=True))
    return (
        f'<robot name="r"><link name="head"><visual><origin xyz="{words(POSITION)}" rpy="{words(RPY)}"/>'
        f'<geometry><mesh filename="{mesh}" scale="{words(SCALE)}"/></geometry></visual><inertial>'
        f'<origin xyz="{words(center)}"/><mass value="{mass}"/><inertia {entries}/></inertial></link></robot>'
    )


def sdf(center, six) -> str:
    entries = "".join(f"<{name}>{float(value):.17g}</{name}>" for name, value in zip(NAMES, six, strict=True))
    return (
        f'<sdf version="1.9"><model name="m"><link name="head"><collision name="c"><pose>{words(POSITION)} {words(RPY)}'
        f"</pose><geometry><mesh><uri>hammer</uri><scale>{words(SCALE)}</scale></mesh></geometry></collision><inertial>"
        f"<pose>{words(center)} 0 0 0</pose><mass>{MASS}</mass><inertia>{entries}</inertia></inertial></link></model></sdf>"
    )


def mjcf(center, six) -> str:
    ixx, ixy, ixz, iyy, iyz, izz = six
    degrees = np.degrees(RPY)
    return (
        '<mujoco><compiler eulerseq="XYZ"/><asset><mesh name="h" file="hammer" '
        f'scale="{words(SCALE)}"/></asset><worldbody><body name="head"><geom type="mesh" mesh="h" pos="{words(POSITION)}" '
        f'euler="{words(degrees)}"/><inertial pos="{words(center)}" mass="{MASS}" '
        f'fullinertia="{words((ixx, iyy, izz, ixy, ixz, iyz))}"/></body></worldbody></mujoco>'
    )


def compare(capsys, tmp_path, text: str, *arguments: str) -> tuple[int, list[dict]]:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    status = main(["inspect", *arguments, "--compare", str(path), "--json"])
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    return status, json.loads(out)["links"]


@pytest.mark.parametrize("write", [urdf, sdf, mjcf])
def test_a_right_file_is_found_right(capsys, tmp_path, truth, write):
    status, (link,) = compare(capsys, tmp_path, write(*truth))
    assert (status, link["status"], link["causes"]) == (0, "uniform", [])
    assert link["inertia_error"] <= 1e-14
    assert link["center_of_mass_error"] <= 1e-14


def about(center, six, point) -> tuple:
    d = center - point
    return six_from_tensor(tensor_from_six(six) + MASS * (d @ d * np.eye(3) - np.outer(d, d)))


def quarter_turn(six) -> tuple:
    Q = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return six_from_tensor(Q @ tensor_from_six(six) @ Q.T)


def conjugate(six) -> tuple:
    moments, axes = np.linalg.eigh(tensor_from_six(six))
    axes = axes[:, [1, 2, 0]] * np.linalg.det(axes)  # in whichever order a program gives them
    return six_from_tensor(axes.T @ np.diag(moments[[1, 2, 0]]) @ axes)


def principal(six) -> tuple:
    return six_from_tensor(np.diag(np.linalg.eigvalsh(tensor_from_six(six))[::-1]))


MISTAKES = {
    "millimetres": (lambda c, s: (c, 1e6 * s), "kg mm²"),
    "gram millimetres": (lambda c, s: (c, 1e9 * s), "g mm²"),
    "pounds and inches": (lambda c, s: (c, POUND_INCH * s), "lb in²"),
    "density": (lambda c, s: (c, 3.3 * s), "2.31 kg"),
    "sign of products": (lambda c, s: (c, s * [1, -1, -1, 1, -1, 1]), "signs of the products"),
    "order of entries": (lambda c, s: (c, s[[0, 3, 5, 1, 2, 4]]), "order of entries: xx yy zz"),
    "ixz and iyz": (lambda c, s: (c, s[[0, 1, 4, 3, 2, 5]]), "products ixz and iyz exchanged"),
    "ixy and ixz": (lambda c, s: (c, s[[0, 2, 1, 3, 4, 5]]), "products ixy and ixz exchanged"),
    "ixy and iyz": (lambda c, s: (c, s[[0, 4, 2, 3, 1, 5]]), "products ixy and iyz exchanged"),
    "order of products": (lambda c, s: (c, s[[0, 4, 1, 3, 2, 5]]), "order of products: yz xy xz"),
    "sign of ixy": (lambda c, s: (c, s * [1, -1, 1, 1, 1, 1]), "sign of ixy"),
    "sign of ixz": (lambda c, s: (c, s * [1, 1, -1, 1, 1, 1]), "sign of ixz"),
    "sign of iyz": (lambda c, s: (c, s * [1, 1, 1, 1, -1, 1]), "sign of iyz"),
    "mirrored x": (lambda c, s: (c, s * [1, -1, -1, 1, 1, 1]), "the other side that wasn't mirrored in x"),
    "mirrored y": (lambda c, s: (c, s * [1, -1, 1, 1, -1, 1]), "the other side that wasn't mirrored in y"),
    "mirrored z": (lambda c, s: (c, s * [1, 1, -1, 1, -1, 1]), "the other side that wasn't mirrored in z"),
    "mirrored with its com": (
        lambda c, s: (c * [1, -1, 1], s * [1, -1, 1, 1, -1, 1]),
        "COM of a copy for the other side that wasn't mirrored in y",
    ),
    "no products": (lambda c, s: (c, s * [1, 0, 0, 1, 0, 1]), "products left out"),
    "about the link's origin": (lambda c, s: (c, about(c, s, np.zeros(3))), "link's origin"),
    "about the mesh's origin": (lambda c, s: (c, about(c, s, POSITION)), "mesh's origin"),
    "y up": (lambda c, s: (c, quarter_turn(s)), "quarter turn about x"),
    "placeholder": (lambda c, s: (c, [1e-3, 0, 0, 1e-3, 0, 1e-3]), "placeholder"),
    "zeros": (lambda c, s: (c, 0 * s), "all entries zero"),
    "com at the origin": (lambda c, s: (0 * c, s), "COM left at the link's origin"),
    "com in millimetres": (lambda c, s: (1000 * c, s), "COM in mm"),
    "com mirrored": (lambda c, s: (-c, s), "opposite sign"),
    "one entry": (lambda c, s: (c, s * [1, 1, 1, 1, 1e3, 1]), "iyz is 10^3 times"),
    "six of nine": (lambda c, s: (c, s[[0, 1, 2, 1, 3, 4]]), "first six of nine entries"),
    "conjugate rotation": (lambda c, s: (c, conjugate(s)), "conjugate of the principal rotation"),
    "principal moments": (lambda c, s: (c, principal(s)), "principal moments on the diagonal"),
    "two at once": (lambda c, s: (c, 1e6 * s * [1, -1, -1, 1, -1, 1]), "signs of the products"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_usual_mistake_is_named(capsys, tmp_path, truth, mistake):
    break_it, words_of_cause = MISTAKES[mistake]
    status, (link,) = compare(capsys, tmp_path, urdf(*break_it(*truth)))
    assert status == 1 and link["status"] in ("impossible", "impossible for its shape", "explained")
    assert any(words_of_cause in cause for cause in link["causes"]), link["causes"]
    assert np.array(link["expected"]["inertia"]) == pytest.approx(tensor_from_six(truth[1]), rel=1e-12, abs=1e-15)
    assert link["expected"]["center_of_mass"] == pytest.approx(truth[0], rel=1e-12)


def test_a_shells_tensor_is_recognised(capsys, tmp_path):
    shell = mesh_body("hammer").moments.mass_properties("shell", scale=SCALE, mass=MASS)
    R = rotation_from_rpy(*RPY)
    text = urdf(R @ shell.center_of_mass + POSITION, six_from_tensor(R @ shell.inertia @ R.T))
    status, (link,) = compare(capsys, tmp_path, text)
    assert (status, link["status"]) == (1, "explained")
    assert link["causes"] == ["tensor of the shell, not of the solid", "COM that of the shell"]


@pytest.mark.parametrize(("lengths", "words_of_cause"), [(1.0, "unit density, as"), (1e15, "with lengths in mm")])
@pytest.mark.parametrize("density", [1000.0, 2700.0])
def test_a_tensor_at_unit_density_is_recognised(capsys, tmp_path, truth, lengths, words_of_cause, density):
    mass = density * mesh_body("hammer").moments.mass_properties(scale=SCALE, density=1.0).mass
    com, six = truth
    status, (link,) = compare(capsys, tmp_path, urdf(com, six * (mass / MASS) * lengths / density, mass))
    assert status == 1 and words_of_cause in link["causes"][0] and f"{density:g} kg/m³" in link["causes"][0]
    assert np.array(link["expected"]["inertia"]) == pytest.approx(tensor_from_six(six * mass / MASS), rel=1e-12)


def test_signs_that_come_to_the_same_are_told_together(capsys, tmp_path):
    # A box turned about z has one product only.
    box = '<visual><origin rpy="0 0 0.4"/><geometry><box size="0.3 0.1 0.2"/></geometry></visual>'
    R = rotation_from_rpy(0, 0, 0.4)
    six = six_from_tensor(R @ np.diag([0.05, 0.13, 0.1]) @ R.T / 12.0) * np.array([1, -1, 1, 1, 1, 1])
    entries = " ".join(f'{name}="{float(value):.17g}"' for name, value in zip(NAMES, six, strict=True))
    text = (
        f'<robot name="r"><link name="l">{box}<inertial><mass value="1"/><inertia {entries}/></inertial></link></robot>'
    )
    _, (link,) = compare(capsys, tmp_path, text)
    cause = link["causes"][0]
    assert cause.startswith("signs of the products") and "mirrored in x, or" in cause and cause.endswith("sign of ixy")


def test_a_bounding_boxs_tensor_is_recognised(capsys, tmp_path):
    box = mesh_body("hammer").moments.mass_properties("bounding_box", scale=SCALE, mass=MASS)
    R = rotation_from_rpy(*RPY)
    text = urdf(R @ box.center_of_mass + POSITION, six_from_tensor(R @ box.inertia @ R.T))
    _, (link,) = compare(capsys, tmp_path, text)
    assert any("bounding box, not of the solid" in cause for cause in link["causes"])
    assert "COM that of the bounding box" in link["causes"]


def test_a_mesh_may_be_named_for_the_link_that_shows_it(capsys, tmp_path, truth):
    status, (link,) = compare(capsys, tmp_path, urdf(*truth, mesh="lost/folder/hammer.stl"), "hammer")
    assert (status, link["link"]) == (0, "head")
    com, six = truth
    other = urdf(com, heavier_ends(six), mesh="lost/folder/hammer.stl")
    assert compare(capsys, tmp_path, other, "hammer")[0] == 1
    assert compare(capsys, tmp_path, other, "hammer", "--tolerance", "0.1")[0] == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<robot", "well-formed XML"),
        ("", "well-formed XML"),
        ("<html/>", "<robot>"),
        ("<robot name='r'/>", "an inertial or a shape"),
        ('<!DOCTYPE x [<!ENTITY a "b">]><robot/>', "entities"),
        (
            urdf([0, 0, 0], [1, 0, 0, 1, 0, 1]).replace('mass value="0.7"', 'mass value="heavy"'),
            "mass of link head: got 'heavy'",
        ),
        (urdf([0, 0, 0], [1, 0, 0, 1, 0, 1]).replace('mass value="0.7"', 'mass value="1_0"'), "got '1_0'"),
    ],
)
def test_files_that_cannot_be_judged_are_refused_in_one_line(capsys, tmp_path, text, expected):
    (tmp_path / "robot.urdf").write_text(text)
    assert main(["inspect", "--compare", str(tmp_path / "robot.urdf")]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert expected in captured.err


@pytest.mark.parametrize(
    "arguments",
    [
        ("--model", "shell"),
        ("--scale", "0.001"),
        ("--mass", "1"),
        ("--repair",),
        ("--verify",),
        ("hammer", "--ballast", "1", "0", "0", "0"),
        ("hammer", "--scale", "0"),
        ("hammer", "--fix", "OUT"),
        ("--tolerance", "0"),
        ("--all",),
    ],
)
def test_what_a_comparison_would_pass_over_is_refused(capsys, tmp_path, truth, arguments):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf(*truth))
    assert main(["inspect", *arguments, "--compare", str(path)]) == 2
    said = capsys.readouterr()
    option = next(word for word in arguments if word.startswith("--"))
    assert not said.out and said.err.count("\n") == 1 and option.lstrip("-") in said.err


def heavier_ends(six):
    """A tensor that a body of this shape can have, and the uniform one hasn't."""
    return six + 0.03 * max(six) * np.array([1, 0, 0, 1, 0, 1])


@pytest.mark.parametrize(
    ("tensor", "word"),
    [
        (lambda six: six, "explained"),  # the <origin> was forgotten: the tensor is that of these shapes
        (lambda six: 1e6 * six, "explained"),
        (lambda six: np.array([1e-3, 0, 0, 1e-3, 0, 1e-3]), "explained"),  # a placeholder, and so is the COM
        (heavier_ends, "not uniform"),
        (lambda six: six * [9, 1, 1, 9, 1, 9], "explained"),  # no mass inside the shapes is so wide
    ],
    ids=["uniform tensor", "wrong unit", "placeholder", "weighed", "too wide"],
)
@pytest.mark.parametrize("stated", ['<origin xyz="0 0 0"/>', ""], ids=["origin 0 0 0", "no origin"])
def test_a_com_at_the_links_origin_is_a_slip_unless_the_tensor_is_another_bodys(
    capsys, tmp_path, truth, tensor, word, stated
):
    # The link's origin lies inside the mesh, 3 mm from its centroid.
    com, six = truth
    at = com - [0.003, 0, 0]
    text = urdf(com, tensor(six)).replace(f'xyz="{words(POSITION)}"', f'xyz="{words(POSITION - at)}"')
    text = text.replace(f'<origin xyz="{words(com)}"/>', stated)
    status, (link,) = compare(capsys, tmp_path, text)
    assert (link["status"], status) == (word, word == "explained")
    told = link["causes"] if status else link["info"]
    assert any(line.startswith("COM left at the link's origin") for line in told), (link["causes"], link["info"])
    fixed = tmp_path / "fixed.urdf"
    main(["inspect", "--compare", str(tmp_path / "robot.xml"), "--fix", str(fixed)])
    assert (fixed.read_text() == text) == (word == "not uniform")


def test_a_com_at_the_links_origin_outside_its_shapes_is_a_slip_whatever_the_tensor(capsys, tmp_path, truth):
    com, six = truth
    far = urdf(com, heavier_ends(six)).replace(f'xyz="{words(POSITION)}"', 'xyz="9 0 0"')
    status, (link,) = compare(capsys, tmp_path, far.replace(f'<origin xyz="{words(com)}"/>', ""))
    assert (status, link["status"]) == (1, "explained")
    assert link["causes"][0] == "COM left at the link's origin" and "outside the hull" in link["causes"][1]


def test_a_com_that_happens_to_be_the_shells_condemns_no_other_tensor(capsys, tmp_path):
    shell, solid = (
        mesh_body("hammer").moments.mass_properties(model, scale=SCALE, mass=MASS) for model in ("shell", "solid")
    )
    R = rotation_from_rpy(*RPY)
    six = heavier_ends(np.array(six_from_tensor(R @ solid.inertia @ R.T)))
    status, (link,) = compare(capsys, tmp_path, urdf(R @ shell.center_of_mass + POSITION, six))
    assert (status, link["status"], link["causes"]) == (0, "not uniform", [])
    assert link["info"][-1].startswith("COM that of the shell: maybe")
