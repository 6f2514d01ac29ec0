# SPDX-License-Identifier: MIT
"""Corners at open edges that differ by rounding count as one; a gap stays a gap, and no vertex moves."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mass_solids import sphere
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj, stl

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.inspection import verify_moments
from rigid_proto_ros.mass.moments import referenced_vertices
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mass.verdict import check_surface
from rigid_proto_ros.mesh.reading import read_mesh
from rigid_proto_ros.mesh.topology import JOINED, ROUNDING, mesh_topology

MADE = Path("/rigid_proto_upload_/made.obj")
"""Of a file whose verdict isn't kept."""
DIAGONAL = float(np.sqrt(3.0))


def apart(vertices, triangles, distance: float, seed: int = 1):
    """Each triangle with corners of its own, moved by at most ``distance`` / 2."""
    random = np.random.default_rng(seed)
    shift = random.normal(size=(3 * len(triangles), 3))
    shift *= 0.5 * distance / np.linalg.norm(shift, axis=1)[:, None]
    return vertices[triangles.ravel()] + shift, np.arange(3 * len(triangles)).reshape(-1, 3)


@pytest.mark.parametrize(("part", "closes"), [(1e-17, True), (1e-9, True), (0.99 * JOINED, True), (3 * JOINED, False)])
def test_corners_are_joined_up_to_the_limit_and_no_farther(part, closes):
    vertices, triangles = apart(CUBE_VERTICES, CUBE_TRIANGLES, part * DIAGONAL)
    verdict = check_surface(vertices, triangles)
    assert verdict.closed == closes and verdict.watertight == closes
    (finding,) = verdict.findings
    if closes:
        assert (finding.code, finding.severity) == ("joined_corners", "info") and verdict.components == 1
        assert f"{verdict.joined} corners at open edges joined to others up to " in finding.message
        assert finding.message.endswith("%")
    else:
        assert finding.code == "open" and " at gaps up to " in finding.message


def test_far_from_the_origin_the_limit_is_that_of_a_files_numbers():
    # Numbers of 32 bits near 1000 are 6e-5 apart.
    vertices, triangles = apart(CUBE_VERTICES, CUBE_TRIANGLES, 0.0)
    far = vertices + [1000.0, 0.0, 0.0]
    far[::2, 0] += 0.9 * ROUNDING * 1001.0
    assert check_surface(far, triangles).closed
    far[::2, 0] += 0.9 * ROUNDING * 1001.0
    assert not check_surface(far, triangles).closed


@given(st.integers(0, 2**32 - 1), st.floats(-16.0, -6.2))
@settings(max_examples=10, deadline=None)
def test_what_is_said_of_the_effect_bounds_it(seed, exponent):
    vertices, triangles = sphere(8)
    true = MeshMoments(vertices, triangles).mass_properties(density=1.0)
    mesh = read_mesh(obj(*apart(vertices, triangles, 10.0**exponent, seed)), MADE)
    body = mesh_body(mesh)
    assert body.verdict.closed and body.verdict.joined
    said = next(one.message for one in body.verdict.findings if one.code == "joined_corners")
    most = 0.01 * float(said.split("at most ")[1].split()[0])
    found = body.moments.mass_properties(density=1.0)
    moved = 1e-14  # rounding of the sphere itself
    assert abs(found.mass / true.mass - 1.0) <= 3.0 * most + moved  # corners that stay were moved, too
    assert np.max(np.abs(found.inertia - true.inertia)) <= (5.0 * most + moved) * np.max(np.abs(true.inertia))
    assert max(verify_moments(body, np.ones(3)).values()) <= 1e-13


def test_vertices_keep_their_numbers_and_places():
    vertices, triangles = apart(CUBE_VERTICES, CUBE_TRIANGLES, 1e-8)
    mesh = read_mesh(obj(vertices, triangles), MADE)
    body = mesh_body(mesh)
    assert body.verdict.closed and np.array_equal(body.vertices, mesh.vertices)
    assert np.array_equal(body.triangles, mesh.triangles)
    assert len(referenced_vertices(body.vertices, body.triangles)) == 36
    for model in ("shell", "points", "bounding_box"):
        assert body.moments.mass_properties(model, mass=1.0).mass == 1.0


def test_joining_does_not_chain():
    # An open ribbon whose edge has corners nearer to each other than the limit: those within it of the first one
    # count as that one, and no others.
    step = 0.4 * JOINED * 100.0
    upper = np.array([[100.0, k * step, 0.0] for k in range(7)])
    vertices = np.concatenate([[[0.0, 0.0, 0.0]], upper])
    triangles = np.array([[0, k, k + 1] for k in range(1, 7)])
    topology = mesh_topology(vertices, triangles)
    lost = {int(v) for v in triangles.ravel()} - {int(v) for v in topology.corners.ravel()}
    assert lost <= {2, 3, 5, 6, 7} and (not topology.joined or topology.farthest <= JOINED * 100.0 * 1.01)


def test_closed_meshes_and_open_ones_without_near_corners_are_as_before():
    for vertices, triangles in ((CUBE_VERTICES, CUBE_TRIANGLES), (CUBE_VERTICES, CUBE_TRIANGLES[:-1]), sphere(8)):
        topology = mesh_topology(vertices, triangles)
        assert topology.joined == 0 and topology.corners is not None
        assert np.array_equal(topology.corners, mesh_topology(vertices, triangles, 0.0).corners)


def test_corners_of_a_closed_surface_are_never_joined():
    # Two cubes of 1 m, 1e-8 m apart.
    vertices = np.concatenate([CUBE_VERTICES, CUBE_VERTICES + [1.0 + 1e-8, 0.0, 0.0]])
    triangles = np.concatenate([CUBE_TRIANGLES, CUBE_TRIANGLES + 8])
    topology = mesh_topology(vertices, triangles)
    assert (topology.joined, topology.components) == (0, 2)


def test_an_stl_whose_corners_are_rounded_each_for_itself_has_its_solids_mass(tmp_path):
    vertices, triangles = apart(CUBE_VERTICES, CUBE_TRIANGLES, 0.0)
    turned = np.nextafter(vertices.astype(np.float32), np.float32(2.0))
    turned[::3] = vertices[::3]
    (tmp_path / "cube.stl").write_bytes(stl(turned, triangles))
    body = mesh_body(str(tmp_path / "cube.stl"))
    assert body.verdict.closed and body.verdict.joined > 0
    assert body.moments.mass_properties(density=1000.0).mass == pytest.approx(1000.0, rel=1e-6)


def test_a_gap_is_told_with_what_repair_would_do_and_did(tmp_path):
    vertices, triangles = apart(CUBE_VERTICES, CUBE_TRIANGLES, 1e-3 * DIAGONAL)
    body = mesh_body(read_mesh(obj(vertices, triangles), MADE))
    assert "of the size (--repair welds up to 1e-05 of it, and caps what is wider as holes)" in body.verdict.reason
    repaired = mesh_body(read_mesh(obj(vertices, triangles), MADE), repair=True)
    with pytest.raises(MeshError, match="repaired: capped 12 holes with 36 edges; .*, and then: "):
        repaired.moments.mass_properties(mass=1.0)
