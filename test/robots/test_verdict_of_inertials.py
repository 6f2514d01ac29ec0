# SPDX-License-Identifier: MIT
"""Which inertials a body can have, and which a mass distribution inside a link's shapes can."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import sphere
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mass.tensor import six_from_tensor
from rigid_proto_ros.robots.diagnosis import MARGIN, beyond_shapes, compare_robot
from rigid_proto_ros.robots.link_shapes import primitive_surface
from rigid_proto_ros.robots.reading import Link, rotation_from_rpy

BOX = '<visual><geometry><box size="1 2 3"/></geometry></visual>'
MADE = '<visual><geometry><mesh filename="box.obj"/></geometry></visual>'
"""The same as a mesh, which stands for itself."""
NAMES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def urdf(folder, *links):
    """Links of (shapes, mass, COM, six entries), called l0, l1 and so on; no inertial for a mass of None."""
    texts = []
    for k, (shapes, mass, com, six) in enumerate(links):
        entries = " ".join(f'{name}="{value}"' for name, value in zip(NAMES, six, strict=True))
        inertial = f'<inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia {entries}/></inertial>'
        texts.append(f'<link name="l{k}">{shapes}{inertial if mass is not None else ""}</link>')
    (folder / "box.obj").write_bytes(obj((CUBE_VERTICES - 0.5) * [1, 2, 3]))
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(texts)}</robot>')
    return path


def verdicts(path) -> dict:
    return {d.link: d.status for d in compare_robot(path)}


@pytest.mark.parametrize("shapes", ["", BOX, MADE, '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'])
@pytest.mark.parametrize(
    ("mass", "six"),
    [
        ("1.0000", (1, 0, 0, 1, 0, 5)),
        ("1.0000", (1, 2, 0, 1, 0, 1)),
        ("1.0000", (-1, 0, 0, 1, 0, 1)),
        ("0", (0, 0, 0, 0, 0, 0)),
        ("1e-9", (0, 0, 0, 0, 0, 0)),
        ("-1", (1, 0, 0, 1, 0, 1)),
        ("nan", (1, 0, 0, 1, 0, 1)),
        ("1e999", (1, 0, 0, 1, 0, 1)),
    ],
)
def test_what_no_body_has_is_impossible_with_and_without_shapes(tmp_path, capsys, shapes, mass, six):
    path = urdf(tmp_path, (shapes, mass, "0 0 0", six))
    if mass == "0" and not shapes:
        assert verdicts(path) == {"l0": "frame"}
        return
    assert main(["inspect", "--compare", str(path), "--json"]) == 1
    (link,) = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)["links"]  # NaN and Infinity are no JSON
    assert link["status"] == "impossible" and link["causes"]
    assert any("needs no inertial" in cause for cause in link["causes"]) == (not any(six))


FAR = BOX.replace("<geometry>", '<origin xyz="1e20 0 0"/><geometry>')
SPHERE = '<collision><geometry><sphere radius="{}"/></geometry></collision>'


@pytest.mark.parametrize(
    ("shapes", "mass", "word", "note"),
    [
        (FAR, "1", "unknown", "of the distance"),
        (FAR + SPHERE.format("1e-30"), "1", "unknown", "of the distance"),  # what it shows can't be taken
        (SPHERE.format("1e-30"), "1", "not judged", ""),
        (MADE + SPHERE.format("1e-30"), "1e-4", "explained", ""),
        (SPHERE.format("1e-3"), "1e-300", "not judged", ""),  # times which no double is the tensor's size
        (BOX.replace("3", "1e30"), "1", "unknown", "a solid of link l0"),
    ],
)
def test_shapes_of_any_size_and_place_are_judged_and_written_only_if_a_body_can_have_them(
    tmp_path, capsys, shapes, mass, word, note
):
    path = urdf(tmp_path, (shapes, mass, "0 0 0", (1, 0, 0, 1, 0, 1)))
    for more in ([], ["--fix", str(tmp_path / "fixed.urdf"), "--all"]):
        assert main(["inspect", "--compare", str(path), "--json", *more]) in (0, 1)
        (link,) = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)["links"]
        assert link["status"] == word and note in link["note"]
    assert link["written"] == (link["expected"] is not None)


def test_each_verdict_and_its_exit_status(tmp_path, capsys):
    # The uniform box's moments are 13/12, 10/12 and 5/12 of its mass; all mass at its corners gives three times that.
    lost = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
    links = [
        (MADE, "1.00000", "0 0 1.60000", (1.1, 0, 0, 1, 0, 1)),
        (MADE, "1.00000", "0 0 0", ("3.30000", 0, 0, "2.60000", 0, "1.30000")),
        (MADE, "1.00000", "0 0 0", (10833.33333, 0, 0, 8333.33333, 0, 4166.66667)),
        (MADE, "1.00000", "0 0 0", (1.08333333, 0, 0, 0.83333333, 0, 41.6666667)),
        (MADE, "1.00000", "0.10000 0 0.20000", ("1.40000", 0.1, 0, 1, 0, 0.7)),
        (MADE, "1.00000", "0 0 0", (1.08333333, 0, 0, 0.83333333, 0, 0.41666667)),
        (MADE, "1.00000", "0 0 0", (1.08333333, 0, 0, 0.833333333, 0, 0.4708333)),
        (lost, "1.00000", "0 0 0", (1, 0, 0, 1, 0, 1)),
        ("", "1.00000", "0 0 0", (1, 0, 0, 1, 0, 1)),
        (MADE, None, "", (0, 0, 0, 0, 0, 0)),
    ]
    beyond = "impossible for its shape"
    expected = [beyond, beyond, "explained", "impossible", "not uniform", "uniform", "not uniform"] + ["unknown"] * 3
    assert verdicts(urdf(tmp_path, *links)) == {f"l{k}": word for k, word in enumerate(expected)}

    for k, (status, strict) in enumerate(zip([1, 1, 1, 1] + [0] * 6, [1, 1, 1, 1, 1, 0, 1, 1, 0, 1], strict=True)):
        # With a tolerance, a link whose shapes can't be read wasn't compared; one without shapes has none to compare.
        path = urdf(tmp_path, links[k])
        assert main(["inspect", "--compare", str(path)]) == status
        assert main(["inspect", "--compare", str(path), "--tolerance", "0.01"]) == strict
    assert main(["inspect", "--compare", str(urdf(tmp_path, links[6])), "--tolerance", "0.2"]) == 0
    assert main(["inspect", "--compare", str(urdf(tmp_path, *links[5:8]))]) == 0
    told = capsys.readouterr().out
    for part in ("outside the hull", "kg cm²", "times as large", "expected: com", "density", "3 links: "):
        assert part in told


def test_a_tensor_that_is_a_little_too_large_throughout_is_no_mistake(tmp_path):
    for factor, word in ((1.0034, "not uniform"), (1.5, "explained")):
        six = [f"{factor * moment:.8f}" for moment in (13 / 12, 0, 0, 10 / 12, 0, 5 / 12)]
        assert verdicts(urdf(tmp_path, (MADE, "1.00000", "0 0 0", six))) == {"l0": word}


def test_an_open_mesh_bounds_what_may_lie_inside_it(tmp_path):
    (tmp_path / "open.obj").write_bytes(obj(CUBE_VERTICES - 0.5, CUBE_TRIANGLES[:-1]))
    shape = '<visual><geometry><mesh filename="open.obj"/></geometry></visual>'
    links = [
        (shape, "1.0000", com, [m, 0, 0, m, 0, m]) for com, m in (("0 0 0", 0.2), ("0.70 0 0", 0.2), ("0 0 0", 0.6))
    ]
    beyond = "impossible for its shape"
    assert verdicts(urdf(tmp_path, *links)) == {"l0": "unknown", "l1": beyond, "l2": beyond}


def test_a_mesh_with_a_hole_is_judged_where_one_accepts_what_the_hole_can_do(tmp_path):
    vertices, triangles = sphere(16)
    (tmp_path / "holed.obj").write_bytes(obj(vertices, triangles[:-1]))
    whole = MeshMoments(vertices, triangles).mass_properties(mass=1.0)  # the flat cap is the triangle that is missing
    shape = '<visual><geometry><mesh filename="holed.obj"/></geometry></visual>'
    path = urdf(tmp_path, (shape, "1.0000", "0 0 0", six_from_tensor(whole.inertia)))
    assert verdicts(path) == {"l0": "unknown"}
    (link,) = compare_robot(path, accept_open=0.05)
    assert link.status == "uniform" and link.inertia_error < 1e-6


def test_visual_and_collision_shapes_together_bound_the_mass(tmp_path):
    far = '<collision><origin xyz="0 0 4"/><geometry><box size="1 1 1"/></geometry></collision>'
    inertial = ("1.0000", "0 0 2.0000", (4.2, 0, 0, 4.2, 0, 0.3))
    assert verdicts(urdf(tmp_path, (MADE + far, *inertial), (MADE, *inertial))) == {
        "l0": "not uniform",
        "l1": "impossible for its shape",
    }


def point_masses(masses, points) -> Link:
    """The inertial of point masses (n,) at points (n, 3)."""
    center = masses @ points / masses.sum()
    r = points - center
    inertia = (masses[:, None, None] * ((r * r).sum(1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None, :])).sum(
        0
    )
    return Link("l", (), "", float(masses.sum()), center, inertia)


PLACED = st.tuples(
    st.sampled_from(["box", "cylinder", "sphere", "capsule", "ellipsoid"]),
    st.tuples(*[st.floats(0.05, 3.0)] * 3),
    st.tuples(*[st.floats(-3.0, 3.0)] * 6),
    st.integers(0, 2**32 - 1),
)
COUNTS = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "ellipsoid": 3}


def surface(kind, sizes, pose) -> np.ndarray:
    vertices, _ = primitive_surface(kind, sizes[: COUNTS[kind]])
    if len(vertices) > 100:  # any points will do, and few have a hull soon
        vertices = vertices[::11]
    return vertices @ rotation_from_rpy(*pose[3:]).T + pose[:3]


@given(PLACED, st.integers(4, 9), st.floats(0.0, 4.0))
@settings(max_examples=30, deadline=None)
def test_no_distribution_inside_the_shapes_is_called_impossible(placed, count, unequal):
    kind, sizes, pose, seed = placed
    points = surface(kind, sizes, pose)
    random = np.random.default_rng(seed)
    masses = 10.0 ** (unequal * random.uniform(-1.0, 0.0, count))
    assert beyond_shapes(point_masses(masses, points[random.integers(len(points), size=count)]), points) == ""


@given(PLACED, st.floats(1.05, 3.0), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
@settings(max_examples=30, deadline=None)
def test_masses_at_both_ends_of_something_longer_are_found(placed, longer, direction):
    kind, sizes, pose, _ = placed
    axis = np.array(direction) + [0.0, 0.0, 1.5]
    axis /= np.linalg.norm(axis)
    points = surface(kind, sizes, pose)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    # The widest chord through the middle, and a little of it across, so that no moment vanishes.
    along = (points - middle) @ axis
    margin = 2.0 * MARGIN * np.linalg.norm(np.ptp(points, axis=0))
    ends = middle + np.outer([longer * along.min() - margin, longer * along.max() + margin], axis)
    inertial = point_masses(np.ones(2), ends)
    tiny = 1e-3 * np.trace(inertial.inertia) * np.eye(3)
    found = Link("l", (), "", inertial.mass, inertial.center_of_mass, inertial.inertia + tiny)
    assert beyond_shapes(found, points)
