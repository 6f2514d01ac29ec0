# SPDX-License-Identifier: MIT
"""The verdict on a surface, its repair, and what may stand in for it."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judged_meshes import body, codes, volume
from mass_solids import box, inward, moved, rotation, sphere, together
from mesh_files import moebius

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.base.errors import InputError, MeshError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.moments import solid_moments
from rigid_proto_ros.mesh import intersection
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.mesh.solids import convex_hull
from rigid_proto_ros.mesh.topology import mesh_topology

BALL = sphere(10)
HOLLOW = together(box((4.0, 4.0, 4.0)), inward(sphere(10)))


def turned(triangles: np.ndarray, chosen: np.ndarray | list[int]) -> np.ndarray:
    triangles = triangles.copy()
    triangles[chosen] = triangles[chosen][:, ::-1]
    return triangles


def test_cavities_are_kept_and_a_part_inside_wound_outward_counts_twice_and_is_told():
    made = body(HOLLOW)
    assert codes(made) == {"cavities": "info"}
    assert volume(made) == pytest.approx(64.0 - volume(body(BALL)), rel=1e-13)
    assert volume(body(inward(HOLLOW))) == volume(made)
    outward = together(box((4.0, 4.0, 4.0)), BALL)
    assert codes(body(outward)) == {"nested_components": "warning"} and volume(body(outward)) > 64.0
    assert volume(body(outward, repair=True)) == pytest.approx(volume(made), rel=1e-14)


@pytest.mark.parametrize(
    "parts",
    [
        (box(cells=3), moved(box(cells=3), (0.31, 0.17, 0.05), 2)),
        (box((4.0, 1.0, 1.0)), moved(box((1.0, 4.0, 0.5)), (0.1, 0.2, 0.05))),  # bars without a corner in the other
        (box(), moved(box(), (0.5, 0, 0))),  # every edge that meets the other box lies in one of its faces
    ],
)
def test_overlapping_parts_are_told(parts):
    assert codes(body(together(*parts)))["overlapping_components"] == "warning"


def test_parts_apart_or_touching_are_not_called_overlapping():
    for shift in ((3.0, 0, 0), (1.0, 0, 0), (1.0, 0.5, 0)):
        assert codes(body(together(box(), moved(box(), shift)))) == {}
    parts = [moved(box(), place) for place in np.ndindex(4, 4, 4)]
    assert codes(body(together(*parts))) == {}


BUBBLE = sphere(4, (0.02, 0.02, 0.02))


def bubbly(count: int) -> tuple[np.ndarray, np.ndarray]:
    """A ball with count³ spherical bubbles."""
    middle = 0.5 * (count - 1)
    holes = [inward(moved(BUBBLE, 0.12 * (np.array(place) - middle))) for place in np.ndindex(count, count, count)]
    return together(sphere(12), *holes)


def test_a_ball_with_many_bubbles_is_right_as_it_is():
    made = body(bubbly(6), repair=True)
    assert codes(made) == {"cavities": "info"}
    assert volume(made) == pytest.approx(volume(body(sphere(12))) - 216 * volume(body(BUBBLE)), rel=1e-12)


def test_what_is_left_undecided_accuses_no_component_and_turns_none(monkeypatch):
    monkeypatch.setattr(intersection, "WORK_LIMIT", 3000)
    made = body(bubbly(4), repair=True)
    assert codes(made)["components_unchecked"] == "warning"
    assert "component_inward" not in codes(made) and "repaired" not in codes(made)
    assert volume(made) == pytest.approx(volume(body(sphere(12))) - 64 * volume(body(BUBBLE)), rel=1e-12)


def test_repair_turns_faces_to_agree():
    vertices, triangles = BALL
    broken = vertices, turned(triangles, np.random.default_rng(1).random(len(triangles)) < 0.25)
    assert codes(body(broken))["inconsistent_winding"] == "error"
    repaired = body(broken, repair=True)
    assert volume(repaired) == pytest.approx(volume(body(BALL)), rel=1e-14)
    assert codes(repaired) == {"repaired": "warning"}
    vertices, triangles = HOLLOW
    broken = vertices, turned(triangles, np.random.default_rng(2).random(len(triangles)) < 0.3)
    assert volume(body(broken, repair=True)) == pytest.approx(volume(body(HOLLOW)), rel=1e-14)


def test_repair_turns_parts_that_would_subtract(meshes):
    apart = together(box(), inward(moved(box(), (3.0, 0.0, 0.0))), inward(moved(box(), (6.0, 0.0, 0.0), 2)))
    assert codes(body(apart)) == {"component_inward": "error"}
    assert volume(body(apart, repair=True)) == pytest.approx(3.0, rel=1e-14)
    made = mesh_body(load_mesh(str(meshes / "multibody.stl")), repair=True)
    topology = mesh_topology(made.vertices, made.triangles)
    parts = [made.triangles[topology.component == c] for c in range(topology.components)]
    assert len(parts) > 1
    assert volume(made) == pytest.approx(sum(abs(solid_moments(made.vertices, p).measure) for p in parts), rel=1e-13)


def test_a_shell_of_polygons_is_the_same_after_repair(meshes):
    mesh = load_mesh(str(meshes / "sword_quads.obj"))
    sizes = np.diff(mesh.polygon_starts)
    chosen = np.repeat(np.random.default_rng(3).random(len(sizes)) < 0.25, sizes)
    broken = dataclasses.replace(mesh, triangles=turned(mesh.triangles, chosen), sha256="broken")
    repaired, whole = mesh_body(broken, repair=True), mesh_body(mesh)
    assert volume(repaired) == pytest.approx(volume(whole), rel=1e-14)
    assert repaired.moments.moments("shell").measure == pytest.approx(whole.moments.moments("shell").measure, rel=1e-14)


def test_repair_welds_a_torn_surface_and_caps_flat_holes_exactly():
    vertices, triangles = BALL
    soup = vertices[triangles].reshape(-1, 3)
    soup = soup + np.random.default_rng(4).uniform(-6e-6, 6e-6, soup.shape)
    torn = (soup, np.arange(len(soup)).reshape(-1, 3))
    assert codes(body(torn))["open"] == "error"
    repaired = body(torn, repair=True)
    assert "welded" in repaired.verdict.findings[0].message
    assert volume(repaired) == pytest.approx(volume(body(BALL)), rel=1e-5)
    vertices, triangles = box((1.0, 2.0, 3.0), 4)
    missing = np.all(vertices[triangles][:, :, 2] == 1.5, axis=1)
    repaired = body((vertices, triangles[~missing]), repair=True)
    assert "capped 1 hole with" in repaired.verdict.findings[0].message
    assert volume(repaired) == pytest.approx(6.0, rel=1e-15)
    assert repaired.moments.moments("shell").measure == pytest.approx(22.0, rel=1e-14)
    few = body((vertices, np.delete(triangles, [3, 40, 41, 90], axis=0)), repair=True)
    assert volume(few) == pytest.approx(6.0, rel=1e-15)


def test_vertices_at_zero_and_minus_zero_are_one_for_the_verdict():
    vertices, triangles = box()
    vertices = vertices - 0.5
    mixed = triangles.copy()
    mixed[::2] += len(vertices)
    assert body((np.vstack([vertices, np.where(vertices == 0.0, -0.0, vertices)]), mixed)).verdict.closed


def test_copies_that_close_the_surface_stay_and_those_that_spoil_it_go():
    vertices, triangles = BALL
    made = body((vertices, np.concatenate([triangles, triangles[[3]], triangles[[3]][:, ::-1]])))
    assert made.verdict.closed and codes(made)["duplicate_faces"] == "info"
    assert volume(made) == pytest.approx(volume(body(BALL)), rel=1e-14)
    for more in (triangles[[3]], triangles[:7], triangles, np.concatenate([triangles[:7], triangles[[50]]])):
        spoilt = vertices, np.concatenate([triangles, more])
        assert codes(body(spoilt))["duplicate_faces"] == "error"
        assert f"{len(more)} duplicate face" in body(spoilt).verdict.reason
        repaired = body(spoilt, repair=True)
        assert repaired.verdict.closed
        assert volume(repaired) == pytest.approx(volume(body(BALL)), rel=1e-14)


@given(st.integers(0, 10**6), st.sampled_from([1, 2, 5]))
@settings(max_examples=8, deadline=None)
def test_whatever_closes_small_holes_changes_no_more_than_is_said(seed, holes):
    rng = np.random.default_rng(seed)
    vertices, triangles = sphere(16)
    vertices = vertices * rng.uniform(0.3, 3.0, 3)
    whole = body((vertices, triangles))
    holed = vertices, np.delete(triangles, rng.choice(len(triangles), holes, replace=False), axis=0)
    effect = body(holed).verdict.hole_effect
    assert "--accept-open" in body(holed).verdict.reason
    with pytest.raises(MeshError):
        body(holed, accept_open=0.5 * effect).moments.moments("solid")
    for surface in (holed, (vertices, turned(triangles, [3, 9]))):
        effect = body(surface).verdict.hole_effect
        accepted = body(surface, accept_open=1.001 * effect)
        assert codes(accepted)["open_accepted"] == "warning"
        assert abs(volume(accepted) / volume(whole) - 1.0) <= effect
        tensors = [made.moments.mass_properties(density=1.0).inertia for made in (accepted, whole)]
        assert np.abs(tensors[0] - tensors[1]).max() <= effect * np.abs(tensors[1]).max()


def test_a_wide_opening_is_no_small_hole_even_where_its_cap_is_flat():
    vertices, triangles = box((1.0, 1.0, 1.0), 4)
    open_at_top = triangles[~np.all(vertices[triangles][:, :, 2] == 0.5, axis=1)]
    made = body((vertices, open_at_top))
    assert made.verdict.hole_effect is None or made.verdict.hole_effect > 0.2
    assert "--accept-open" not in made.verdict.reason
    with pytest.raises(InputError, match="from 0 to 1"):
        body((vertices, open_at_top), accept_open=2.0)


def test_what_cannot_be_repaired_stays_refused_and_a_good_mesh_is_left_alone():
    made = body(moebius(), repair=True)
    assert "Moebius" in made.verdict.findings[0].message
    with pytest.raises(MeshError, match="--fallback"):
        made.moments.mass_properties(mass=1.0)
    for made in (body(BALL), body(BALL, repair=True)):
        assert codes(made) == {} and made.triangles is BALL[1]
        assert (made.verdict.watertight, made.verdict.winding_consistent, made.verdict.components) == (True, True, 1)


def test_the_fallbacks_are_named_and_stand_in():
    vertices, triangles = box((1.0, 2.0, 3.0))
    opened = (vertices @ rotation(1).T, triangles[:-1])
    hull = body(opened, fallback="hull")
    assert volume(hull) == pytest.approx(6.0, rel=1e-14)
    assert codes(hull) == {"open": "error", "fallback": "warning"}
    assert "convex hull" in hull.verdict.findings[-1].message
    cuboid = body(opened, fallback="box")
    assert volume(cuboid) == pytest.approx(np.prod(np.ptp(opened[0], axis=0)), rel=1e-14)
    solid, box_model = (cuboid.moments.mass_properties(m, mass=1.0).inertia for m in ("solid", "bounding_box"))
    assert solid == pytest.approx(box_model, rel=1e-13, abs=1e-15)
    assert codes(body(BALL, fallback="hull")) == {}  # nothing to stand in for
    with pytest.raises(InputError, match="hull or box"):
        body(opened, fallback="sphere")


def test_a_flat_mesh_is_told_no_remedy_that_does_not_help():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    for options in ({}, {"repair": True}, {"fallback": "hull"}, {"fallback": "box"}):
        with pytest.raises(MeshError) as refused:
            volume(body(square, **options))
        assert not any(word in str(refused.value) for word in ("--repair", "--fallback", "use box"))
    tilted = square[0] @ rotation(1).T, square[1]
    with pytest.raises(MeshError, match="use box instead"):
        volume(body(tilted, fallback="hull"))
    assert volume(body(tilted, fallback="box")) > 0.0


@given(st.integers(0, 2**31), st.integers(4, 60), st.sampled_from(["normal", "sphere", "grid"]), st.floats(-8, 0))
@settings(deadline=None, max_examples=25)
def test_the_hull_is_closed_convex_and_holds_every_point(seed, count, kind, exponent):
    points = np.random.default_rng(seed).normal(size=(count, 3))
    if kind == "sphere":
        points /= np.linalg.norm(points, axis=1)[:, None]
    if kind == "grid":
        points = np.round(points * 1.5)
    points = np.unique(points, axis=0) * [1.0, 1.0, 10.0**exponent] @ rotation(seed % 100).T
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if len(points) < 4 or spread[2] < 1e-9 * spread[0]:
        with pytest.raises(MeshError):
            convex_hull(points)
        return
    corners, triangles = convex_hull(points)
    topology = mesh_topology(corners, triangles)
    assert (len(topology.unbalanced), topology.components) == (0, 1)
    assert solid_moments(corners, triangles).measure > 0.0
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    heights = np.einsum("fk,fpk->fp", np.cross(b - a, c - a), points[None] - a[:, None])
    assert heights.max() <= 1e-9 * spread[0] ** 2 * spread[2] + 1e-14


@pytest.mark.parametrize("cells", [1, 2, 5, 12])
def test_the_hull_of_a_box_with_points_on_its_edges_and_faces_is_the_box(cells):
    vertices, _ = box((1.0, 2.0, 3.0), cells=cells)
    for number in range(5):
        assert solid_moments(*convex_hull(vertices @ rotation(number).T)).measure == pytest.approx(6.0, rel=1e-14)


@pytest.mark.parametrize("name", body_names())
def test_every_bundled_body_has_a_hull(name):
    mesh = load_mesh(name)
    solid = solid_moments(mesh.vertices, mesh.triangles).measure
    assert solid_moments(*convex_hull(mesh.vertices)).measure > solid


def test_many_components_are_judged_in_bounded_work():
    parts = [moved(box(), 3.0 * np.array(place)) for place in np.ndindex(14, 14, 11)]
    made = body(together(*parts))
    assert codes(made) == {"components_unchecked": "warning", "self_crossing_unchecked": "info"}
    assert volume(made) == pytest.approx(len(parts), rel=1e-13)
