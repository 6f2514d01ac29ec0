# SPDX-License-Identifier: MIT
"""Mass properties against rational arithmetic, published truths, closed forms and a second method."""

import json

import numpy as np
import pytest
from mass_solids import PLACES, box, solids, sphere

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mass.exact_moments import exact_solid_moments, relative_errors
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.moments import solid_moments
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mesh.reading import load_mesh

BOUND = 1e-13  # measured: at most 2e-15 over all that follows
SOLIDS = solids()
OFTEN = [pytest.param(p, marks=() if p == "+1e6" else pytest.mark.stress) for p in PLACES]
"""Generated solids are tried at every place, large meshes at the others under stress: for base there are published truths."""
REAL = ("spot.obj", "sword.obj", "sword_quads.obj", "nefertiti_lowres.obj")


def errors(vertices, triangles) -> dict[str, float]:
    exact = exact_solid_moments(vertices, triangles)
    properties = MeshMoments(vertices, triangles).mass_properties(density=1.0)
    diagonal = np.linalg.norm(np.ptp(vertices, axis=0))
    return relative_errors(exact, properties.mass, properties.center_of_mass, properties.inertia, diagonal)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", SOLIDS)
def test_generated_solids_are_exact_wherever_they_lie(name, place):
    vertices, triangles = SOLIDS[name]
    assert max(errors(PLACES[place](vertices), triangles).values()) <= BOUND


@pytest.mark.parametrize("place", OFTEN)
@pytest.mark.parametrize("name", REAL)
def test_real_meshes_are_exact_wherever_they_lie(meshes, name, place):
    mesh = load_mesh(str(meshes / name))
    assert max(errors(PLACES[place](mesh.vertices), mesh.triangles).values()) <= BOUND


@pytest.mark.parametrize("place", OFTEN)
@pytest.mark.parametrize("rings", [64, pytest.param(500, marks=pytest.mark.stress)])
def test_large_meshes_are_exact_wherever_they_lie(place, rings):
    """Sixteen thousand triangles, and under stress a million."""
    vertices, triangles = sphere(rings, (1.0, 0.8, 0.3))
    assert len(triangles) > 3.9 * rings**2
    assert max(errors(PLACES[place](vertices), triangles).values()) <= BOUND  # measured 5e-16


@pytest.mark.parametrize("name", REAL)
def test_published_truths_of_real_meshes(meshes, name):
    truth = json.loads((meshes / "truth.json").read_text())[name]
    mesh = load_mesh(str(meshes / name))
    assert (len(mesh.vertices), len(mesh.triangles)) == (truth["vertices"], truth["triangles"])
    properties = mesh_body(mesh).moments.mass_properties(density=1.0)
    inertia = np.array(truth["inertia_unit_density_about_com"])
    diagonal = np.linalg.norm(np.subtract(*truth["bounds"]))
    assert abs(properties.mass - truth["volume"]) <= BOUND * truth["volume"]
    assert np.max(np.abs(properties.inertia - inertia)) <= BOUND * np.max(np.abs(inertia))
    off = np.abs(properties.center_of_mass - truth["center_of_mass"])
    assert np.all(off <= BOUND * diagonal + np.spacing(np.abs(truth["center_of_mass"])))


def test_cuboid_and_tetrahedron_have_their_closed_forms():
    a, b, c = 0.7, 1.9, 0.3
    moments = MeshMoments(*box((a, b, c), 3)).mass_properties(density=2.0)
    mass = 2.0 * a * b * c
    expected = mass / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    assert moments.mass == pytest.approx(mass, rel=1e-14)
    assert np.diag(moments.inertia) == pytest.approx(expected, rel=1e-14)

    vertices, triangles = SOLIDS["tetrahedron"]
    tetrahedron = MeshMoments(vertices, triangles).mass_properties(density=6.0)
    assert tetrahedron.mass == pytest.approx(1.0, rel=1e-14)
    assert tetrahedron.center_of_mass == pytest.approx([0.25] * 3, rel=1e-14)
    assert np.diag(tetrahedron.inertia) == pytest.approx([3 / 40] * 3, rel=1e-14)
    assert tetrahedron.inertia[0, 1] == pytest.approx(1 / 80, rel=1e-14)  # -∫xy = -(1/120 - 1/96)·6


def test_far_from_the_origin_tensor_and_com_keep_their_digits():
    vertices, triangles = sphere(12)
    near = MeshMoments(vertices, triangles).mass_properties(density=1.0)
    far = MeshMoments(vertices + 2.0**30, triangles).mass_properties(density=1.0)
    rounded = MeshMoments((vertices + 2.0**30) - 2.0**30, triangles).mass_properties(density=1.0)
    assert far.inertia == pytest.approx(rounded.inertia, rel=1e-14, abs=1e-14)
    assert near.mass == pytest.approx(far.mass, rel=1e-6)
    # The COM itself is rounded to 1e-7; from the reference near the box's centre it isn't.
    moments = MeshMoments(vertices + 2.0**30, triangles).moments("solid")
    assert moments.center + (moments.reference - 2.0**30) == pytest.approx(rounded.center_of_mass, abs=1e-15)


def test_thin_bodies_take_the_second_path_by_themselves_and_need_it():
    vertices, triangles = SOLIDS["plate 1 x 1 x 1e-6 of 4800, turned"]
    own, pairs = solid_moments(vertices, triangles), solid_moments(vertices, triangles, compensated=True)
    assert own.measure == pairs.measure
    exact = exact_solid_moments(vertices, triangles).volume
    plain = solid_moments(vertices, triangles, compensated=False).measure
    assert abs(plain / float(exact) - 1.0) > 1e-13  # measured 4e-11: the plain sums would not do
    assert solid_moments(*sphere(60)).measure == solid_moments(*sphere(60), compensated=False).measure


def test_a_vertex_that_is_not_there_is_refused():
    vertices, triangles = sphere(5)
    for wrong in (len(vertices), -1, 2**62):
        triangles[-1, 2] = wrong
        with pytest.raises(MeshError, match="a vertex outside 0 to"):
            solid_moments(vertices, triangles)
