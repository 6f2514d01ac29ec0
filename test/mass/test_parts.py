# SPDX-License-Identifier: MIT
"""Bodies of several parts, each with its own material: their sum, what is told of overlaps, and what is refused."""

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mass_solids import box, circle, inward, moved, prism, together
from mesh_files import CUBE_QUADS, CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import InputError, MeshError
from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.mass.from_mesh import MeshBody, mesh_body
from rigid_proto_ros.mass.inspection import inspect_mesh, verify_moments
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mesh.reading import load_mesh

BODY = moved(prism(circle(7, 0.03), 0.04), (0.1, -0.05, 0.02), 3)
COVER = moved(box((0.06, 0.05, 0.004)), (0.1, 0.2, 0.3), 4)


def written(folder: Path, text: str, **meshes) -> str:
    for name, mesh in meshes.items():
        (folder / f"{name}.obj").write_bytes(mesh if isinstance(mesh, bytes) else obj(*mesh))
    (folder / "whole.yaml").write_text(text)
    return str(folder / "whole.yaml")


def sum_of(*parts):
    """Mass, centre and tensor of solids with masses, one after the other."""
    mass = sum(part.mass for part in parts)
    center = sum(part.mass * part.center_of_mass for part in parts) / mass
    tensor = np.zeros((3, 3))
    for part in parts:
        d = part.center_of_mass - center
        tensor += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, center, tensor


def test_the_whole_is_the_sum_of_its_parts(tmp_path) -> None:
    text = "parts:\n  body: {mesh: body.obj, density: 2700}\n  cover: {mesh: cover.obj, mass: 0.12}\n"
    found = mesh_body(written(tmp_path, text, body=BODY, cover=COVER)).moments.mass_properties()
    mass, center, tensor = sum_of(
        MeshMoments(*BODY).mass_properties(density=2700.0), MeshMoments(*COVER).mass_properties(mass=0.12)
    )
    assert found.mass == pytest.approx(mass, rel=1e-15)
    assert found.center_of_mass == pytest.approx(center, rel=1e-14)
    assert found.inertia == pytest.approx(tensor, rel=1e-13, abs=1e-14 * np.max(tensor))


def test_parts_of_one_material_are_one_mesh(tmp_path) -> None:
    text = "parts:\n  body: {mesh: body.obj}\n  cover: {mesh: cover.obj}\n"
    found = mesh_body(written(tmp_path, text, body=BODY, cover=COVER))
    whole = MeshMoments(*together(BODY, COVER))
    for model in ("solid", "shell", "points", "bounding_box"):
        expected = whole.mass_properties(model, density=1000.0)
        properties = found.moments.mass_properties(model)
        assert properties.mass == pytest.approx(expected.mass, rel=1e-14)
        assert properties.inertia == pytest.approx(expected.inertia, rel=1e-12, abs=1e-13 * np.max(expected.inertia))


@pytest.mark.parametrize("far", [0.0, 1e3, 1e6])
def test_parts_are_exact_wherever_they_lie(tmp_path, far) -> None:
    position = f"position: [{far}, {-far}, {0.5 * far}]"
    text = (
        f"parts:\n  body: {{mesh: body.obj, density: 2700, {position}}}\n"
        f"  cover: {{mesh: cover.obj, mass: 0.12, {position}}}\n"
    )
    body = mesh_body(written(tmp_path, text, body=BODY, cover=COVER))
    assert max(verify_moments(body, np.array([0.5, 2.0, -1.0])).values()) <= 1e-13


def test_a_part_is_scaled_then_turned_then_moved(tmp_path) -> None:
    q = np.array([0.1, -0.5, 0.3, 0.8])
    text = (
        "scale: 0.001\n"
        "parts:\n"
        f"  one: {{mesh: one.obj, position: [1.0, 2.0, 3.0], orientation_xyzw: {q.tolist()}}}\n"
        "  other: {mesh: one.obj, scale: [-1.0, 2.0, 3.0]}\n"
    )
    mesh = load_mesh(written(tmp_path, text, one=BODY))
    n = len(BODY[0])
    R = matrix_from_quaternion(q / np.linalg.norm(q))
    assert mesh.vertices[:n] == pytest.approx(0.001 * BODY[0] @ R.T + [1.0, 2.0, 3.0], rel=1e-14)
    assert mesh.vertices[n:].tolist() == (BODY[0] * [-1.0, 2.0, 3.0]).tolist()
    assert mesh.triangles[len(BODY[1]) :].tolist() == (BODY[1][:, [0, 2, 1]] + n).tolist()
    parts = mesh_body(mesh).parts
    assert parts[1].volume == pytest.approx(6.0 * MeshMoments(*BODY).moments("solid").measure, rel=1e-13)


def test_mass_scales_all_densities_and_size_the_volume(tmp_path) -> None:
    text = "parts:\n  body: {mesh: body.obj, density: 2700}\n  cover: {mesh: cover.obj, mass: 0.12}\n"
    moments = mesh_body(written(tmp_path, text, body=BODY, cover=COVER)).moments
    own = moments.mass_properties()
    heavy = moments.mass_properties(mass=3.0 * own.mass)
    assert heavy.center_of_mass.tolist() == own.center_of_mass.tolist()
    assert heavy.inertia == pytest.approx(3.0 * own.inertia, rel=1e-14, abs=1e-20)
    assert moments.mass_properties(density=3000.0).inertia == pytest.approx(heavy.inertia, rel=1e-14, abs=1e-20)
    large = moments.mass_properties(scale=2.0)
    assert (large.mass, large.center_of_mass) == (
        pytest.approx(8.0 * own.mass),
        pytest.approx(2.0 * own.center_of_mass),
    )
    assert large.inertia == pytest.approx(32.0 * own.inertia, rel=1e-14, abs=1e-20)


def test_polygons_stay_polygons(tmp_path) -> None:
    data = obj(CUBE_VERTICES, CUBE_QUADS)
    mesh = load_mesh(written(tmp_path, "parts:\n  a: {mesh: a.obj}\n  b: {mesh: b.obj}\n", a=data, b=BODY))
    assert mesh.polygon_starts[:7].tolist() == [0, 2, 4, 6, 8, 10, 12]
    assert mesh.polygon_starts[-1] == len(mesh.triangles) and len(mesh.polygon_starts) == 7 + len(BODY[1])


# What is told


def told(tmp_path: Path, one, other) -> list[str]:
    text = "parts:\n  one: {mesh: one.obj}\n  other: {mesh: other.obj}\n"
    body: MeshBody = mesh_body(written(tmp_path, text, one=one, other=other))
    return [finding.message for finding in body.verdict.findings if finding.code.startswith("parts")]


def test_an_overlap_is_told_with_its_part_of_the_smaller_one(tmp_path) -> None:
    (message,) = told(tmp_path, box((4.0, 4.0, 4.0)), moved(box((1.0, 1.0, 1.0)), (2.25, 0.3, 0.2)))
    assert message == "parts one and other overlap, by 25 % of other: what they share counts with both densities"


@pytest.mark.parametrize("offset", [(2.25, 0.0, 0.0), (1.5, 1.5, 1.5)], ids=["coplanar axes", "flush corner"])
def test_an_overlap_of_parts_with_common_planes_is_seen(tmp_path, offset) -> None:
    (message,) = told(tmp_path, box((4.0, 4.0, 4.0)), moved(box((1.0, 1.0, 1.0)), offset))
    assert "other" in message and "both densities" in message


def test_a_part_within_another_is_told(tmp_path) -> None:
    (message,) = told(tmp_path, box(), moved(box((0.2, 0.2, 0.2)), (0.1, 0.1, 0.1)))
    assert message == "part other lies within part one: what they share counts with both densities"


@pytest.mark.parametrize(
    "other",
    [moved(box(), (1.0, 0.0, 0.0)), moved(box(), (1.0, 0.3, 0.2)), moved(box((0.2, 0.2, 0.2)), (0.6, 0.0, 0.0))],
    ids=["same corners", "shifted", "small on large"],
)
def test_parts_that_touch_do_not_overlap(tmp_path, other) -> None:
    assert told(tmp_path, box(), other) == []


def test_a_part_in_the_cavity_of_another_does_not_overlap(tmp_path) -> None:
    hollow = together(box((4.0, 4.0, 4.0)), inward(box((2.0, 2.0, 2.0))))
    assert told(tmp_path, hollow, box()) == []


def test_only_boxes_that_meet_are_no_overlap(tmp_path) -> None:
    assert told(tmp_path, prism(circle(3), 1.0), moved(box((0.2, 0.2, 0.2)), (0.85, 0.7, 0.5))) == []


def test_findings_name_their_part_and_an_open_one_is_refused_by_name(tmp_path) -> None:
    text = "parts:\n  body: {mesh: body.obj}\n  cover: {mesh: cover.obj}\n"
    file = written(tmp_path, text, body=BODY, cover=(COVER[0], COVER[1][:-1]))
    body = mesh_body(file)
    assert all(finding.message.startswith("part cover: ") for finding in body.verdict.findings)
    with pytest.raises(MeshError, match="whole: part cover: open surface with 3 boundary edges.*--repair"):
        body.moments.mass_properties()
    assert body.moments.mass_properties("shell", mass=1.0).mass == 1.0
    repaired = mesh_body(file, repair=True)
    expected = 1000.0 * sum(MeshMoments(*mesh).moments("solid").measure for mesh in (BODY, COVER))
    assert repaired.moments.mass_properties().mass == pytest.approx(expected, rel=1e-13)
    hull = mesh_body(file, fallback="hull").moments.mass_properties()
    assert hull.mass == pytest.approx(expected, rel=1e-12)


def test_a_part_wound_inward_counts_as_it_is(tmp_path) -> None:
    text = "parts:\n  one: {mesh: one.obj}\n"
    found = mesh_body(written(tmp_path, text, one=inward(BODY)))
    assert found.moments.mass_properties().mass == pytest.approx(1000.0 * MeshMoments(*BODY).moments("solid").measure)
    assert MeshMoments(found.vertices, found.triangles).moments("solid").measure > 0.0
    assert MeshMoments(found.vertices, found.triangles).moments("solid").second[0] > 0.0


# Printed parts


def test_a_part_may_be_printed(tmp_path) -> None:
    text = (
        "parts:\n  body: {mesh: body.obj, density: 7800}\n"
        "  cover: {mesh: cover.obj, density: 1240, wall_thickness: 0.0004, infill: 0.15}\n"
    )
    body = mesh_body(written(tmp_path, text, body=BODY, cover=COVER))
    mass, center, tensor = sum_of(
        MeshMoments(*BODY).mass_properties(density=7800.0),
        MeshMoments(*COVER).mass_properties("walled", density=1240.0, wall_thickness=4e-4, infill=0.15),
    )
    found = body.moments.mass_properties()
    assert found.mass == pytest.approx(mass, rel=1e-14)
    assert found.inertia == pytest.approx(tensor, rel=1e-12, abs=1e-13 * np.max(tensor))
    (finding,) = [each for each in inspect_mesh(body).findings if each.code == "walled"]
    assert finding.message.startswith("part cover: mass and tensor are those of first order")


def test_walls_of_a_part_that_are_too_thick_are_refused_by_its_name(tmp_path) -> None:
    text = "parts:\n  cover: {mesh: cover.obj, wall_thickness: 0.004}\n"
    with pytest.raises(MeshError, match=r"part cover, wall_thickness: got 0\.004; accepted: at most"):
        mesh_body(written(tmp_path, text, cover=COVER)).moments.mass_properties()


def test_the_model_walled_is_of_a_part_and_not_of_several(tmp_path) -> None:
    moments = mesh_body(written(tmp_path, "parts:\n  a: {mesh: a.obj}\n", a=BODY)).moments
    with pytest.raises(InputError, match="wall_thickness of each part"):
        moments.mass_properties("walled", wall_thickness=0.001, infill=0.2)


# Files


def test_the_hash_is_of_every_file(tmp_path) -> None:
    text = "parts:\n  body: {mesh: body.obj}\n  cover: {mesh: cover.obj}\n"
    first = load_mesh(written(tmp_path, text, body=BODY, cover=COVER)).sha256
    assert load_mesh(str(tmp_path / "whole.yaml")).sha256 == first
    changed = load_mesh(written(tmp_path, text.replace("cover.obj", "cover.obj, mass: 2"))).sha256
    other = load_mesh(written(tmp_path, text, cover=moved(COVER, (0.0, 0.0, 1e-9)))).sha256
    assert len({first, changed, other}) == 3


def test_a_part_is_found_beside_its_file(tmp_path, monkeypatch) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.stl").write_bytes(stl())
    file = tmp_path / "sub" / "whole.yaml"
    file.write_text("parts:\n  a: {mesh: a.stl}\n  b: {mesh: hammer}\n")
    monkeypatch.chdir(tmp_path)
    assert [part.mesh.name for part in load_mesh("sub/whole.yaml").parts] == ["a", "hammer"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("parts: {}", "got 'no parts'; accepted: parts: with 1 to 1000 parts"),
        ("parts: [a]", "got 'no parts'"),
        ("a: 1", "got 'no parts'"),
        ("parts: {a: hammer}", "part a: got 'hammer'; accepted: a mapping"),
        ("parts: {a: {density: 1}}", "part a, mesh: got None; accepted: the name of a mesh's file"),
        ("parts: {a: {mesh: none.stl}}", "part a, mesh: there is no file and no bundled mesh 'none.stl'"),
        ("parts: {a: {mesh: hammer, density: 0}}", "part a, density: got 0; accepted: a finite number > 0"),
        ("parts: {a: {mesh: hammer, density: heavy}}", "part a, density: got 'heavy'"),
        ("parts: {a: {mesh: hammer, mass: .inf}}", "part a, mass: got inf"),
        ("parts: {a: {mesh: hammer, mass: true}}", "part a, mass: got True"),
        ("parts: {a: {mesh: hammer, mass: 1, density: 1}}", "part a, mass: got 1; accepted: density or mass, not both"),
        ("parts: {a: {mesh: hammer, weight: 1}}", "part a, weight: got 1; accepted: one of mesh, density, mass"),
        ("parts: {a: {mesh: hammer, scale: 0}}", "part a, scale: got 0; accepted: one or three numbers"),
        ("parts: {a: {mesh: hammer, scale: [1, 2]}}", "part a, scale: got"),
        ("parts: {a: {mesh: hammer, position: [1, 2]}}", "part a, position: got"),
        ("parts: {a: {mesh: hammer, orientation_xyzw: [0, 0, 0, 0]}}", "part a, orientation_xyzw: got"),
        ("parts: {a: {mesh: hammer, infill: 0.5}}", "part a, infill: got 0.5; accepted: wall_thickness beside it"),
        ("parts: {a: {mesh: hammer, wall_thickness: 0.001, infill: 2}}", "a number from 0 to 1"),
        ("scale: x\nparts: {a: {mesh: hammer}}", "part a, scale: got 'x'"),
        ("density: 5\nparts: {a: {mesh: hammer}}", "whole.yaml: got 'density'; accepted: one of parts, scale"),
        ("parts: {a: {mesh: whole.yaml}}", "part a, mesh: got 'whole.yaml'; accepted: a mesh; a file of parts"),
        ("parts: {a: {mesh: hammer}, a: {mesh: book}}", "a twice in one mapping"),
        ("parts: {a: *b}", "alias"),
    ],
)
def test_what_is_wrong_is_told_by_part_field_and_what_would_be_accepted(tmp_path, text, said) -> None:
    with pytest.raises(MeshError) as refused:
        load_mesh(written(tmp_path, text))
    assert said in str(refused.value)


def test_sums_are_in_rational_numbers(tmp_path) -> None:
    """A thousand equal parts about one centre: their mass is theirs a thousand times, to the last bit."""
    lines = "".join(f"  p{k}: {{mesh: a.obj, mass: 0.1}}\n" for k in range(300))
    body = mesh_body(load_mesh(written(tmp_path, f"parts:\n{lines}", a=BODY)))
    assert body.moments.moments("solid").measure == float(Fraction(0.1) * 300 / 1000)
