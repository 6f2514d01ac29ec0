# SPDX-License-Identifier: MIT
"""Rays and normals on a surface."""

import itertools

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_proto_ros.motion.surface import Surface, inward_normal

CUBE = Surface(
    np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)]),
    np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ]
    ),
)


def moller_trumbore(surface: Surface, origin, direction) -> float:
    """Distance to the nearest hit, in lengths of ``direction``, by another method: each triangle on its own; inf for none."""
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    p = np.cross(direction, c - a)
    determinant = ((b - a) * p).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = ((origin - a) * p).sum(axis=1) / determinant
        q = np.cross(origin - a, b - a)
        v = (q * direction).sum(axis=1) / determinant
        t = ((c - a) * q).sum(axis=1) / determinant
    hits = t[(determinant != 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0)]
    return float(hits.min()) if len(hits) else np.inf


def blob(seed: int) -> Surface:
    """A cube cut fine, its corners shifted at random: closed, with triangles in all directions."""
    mesh = trimesh.Trimesh(CUBE.vertices, CUBE.triangles).subdivide().subdivide()
    shifts = np.random.default_rng(seed).uniform(-0.04, 0.04, mesh.vertices.shape)
    return Surface(mesh.vertices + shifts, np.ascontiguousarray(mesh.faces))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_hits_where_every_triangle_by_itself_says(seed):
    rng = np.random.default_rng(seed)
    surface = blob(seed % 5)
    for _ in range(20):
        origin, direction = rng.normal(size=3) * 1.5, rng.normal(size=3)
        expected = moller_trumbore(surface, origin, direction)
        hit = surface.ray_hit(origin, direction)
        if hit is None:
            assert expected == np.inf
            continue
        distance = np.linalg.norm(hit - origin) / np.linalg.norm(direction)
        assert distance == pytest.approx(expected, rel=1e-9, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_ray_slips_through_an_edge_or_a_corner(seed):
    # From outside towards exact points of edges and corners, whose images in the ray's frame round.
    rng = np.random.default_rng(seed)
    surface = blob(seed % 5)
    a, b = surface.vertices[surface.triangles[rng.integers(len(surface.triangles)), :2]]
    inside = np.array([0.5, 0.5, 0.5])
    for target in (a, b, 0.5 * (a + b), a + rng.uniform() * (b - a)):
        # The blob is star-shaped about its middle: a ray from the middle through any point of it must hit.
        assert surface.ray_hit(inside, target - inside) is not None


def test_a_ray_along_the_axes_hits_the_diagonal_that_two_triangles_share():
    for axis, sign, t in itertools.product(range(3), (1.0, -1.0), np.linspace(0.0, 1.0, 33)):
        origin = np.full(3, t)
        origin[axis] = 0.5 + 3.0 * sign
        direction = np.zeros(3)
        direction[axis] = -sign
        hit = CUBE.ray_hit(origin, direction)
        assert hit is not None
        assert hit[axis] == (1.0 if sign > 0 else 0.0)


def test_a_ray_behind_or_beside_the_body_misses():
    assert CUBE.ray_hit([0.5, 0.5, 2.0], [0.0, 0.0, 1.0]) is None
    assert CUBE.ray_hit([1.5, 0.5, 2.0], [0.0, 0.0, -1.0]) is None


def test_the_size_of_the_direction_does_not_matter():
    for size in (1e-300, 1.0, 1e300):
        hit = CUBE.ray_hit([0.25, 0.5, 2.0], [0.0, 0.0, -size])
        assert hit.tolist() == [0.25, 0.5, 1.0]


@pytest.mark.parametrize(
    ("point", "outward"),
    [
        ([0.5, 0.5, 1.0], [0, 0, 1]),
        ([0.25, 0.75, 1.0], [0, 0, 1]),
        ([0.0, 0.3, 0.6], [-1, 0, 0]),
        ([1.0, 0.5, 1.0], [1, 0, 1]),
        ([0.5, 0.0, 0.0], [0, -1, -1]),
        ([1.0, 1.0, 1.0], [1, 1, 1]),
        ([0.0, 1.0, 0.0], [-1, 1, -1]),
        ([0.5, 0.5, 3.0], [0, 0, 1]),
    ],
)
def test_the_inward_normal_of_a_cube_is_its_symmetry_axis(point, outward):
    expected = -np.array(outward) / np.linalg.norm(outward)
    assert np.abs(CUBE.inward_normal(point) - expected).max() <= 1e-15


def test_two_faces_that_lie_on_each_other_have_no_normal():
    normal, folded = np.full(3, np.nan), np.array([[0, 1, 2], [0, 2, 1]])
    assert not inward_normal(np.eye(3), folded, np.zeros(3), np.ones(3), normal)
    assert normal.tolist() == [0.0, 0.0, 0.0] == Surface(np.eye(3), folded).inward_normal([0.0, 0.0, 0.0]).tolist()
    assert inward_normal(CUBE.vertices, CUBE.triangles, np.zeros(3), CUBE.extent, normal)


def test_the_extent_is_of_the_vertices_that_faces_use():
    stray = np.concatenate([CUBE.vertices, [[7.0, -8.0, 9.0]]])
    assert Surface(stray, CUBE.triangles).extent.tolist() == [1.0, 1.0, 1.0]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_sampled_point_of_the_surface_is_nearer_than_the_nearest(seed):
    rng = np.random.default_rng(seed)
    surface = blob(seed % 5)
    point = rng.normal(size=3)
    corners = surface.vertices[surface.triangles]
    weights = rng.dirichlet(np.ones(3), size=(len(corners), 5))
    sampled = (weights[..., None] * corners[:, None]).sum(axis=2).reshape(-1, 3)
    nearest = surface.nearest_point(point)
    assert np.linalg.norm(nearest - point) <= np.linalg.norm(sampled - point, axis=1).min() + 1e-12
    assert np.linalg.norm(surface.nearest_point(nearest) - nearest) <= 1e-12


@pytest.mark.parametrize("sliver", [(0, 0, 1), (0, 1, 1), (0, 1, 0), (2, 2, 2)])
def test_a_triangle_without_area_changes_no_answer(sliver):
    """As an .obj or .stl file may hold one, two of its corners being one point."""
    with_sliver = Surface(CUBE.vertices, np.vstack([CUBE.triangles, [sliver]]))
    for point in ([0.0, 0.0, 0.5], [-0.1, -0.2, 0.4], [0.3, 0.4, 0.5], [-1.0, -1.0, 2.0]):
        assert np.array_equal(with_sliver.nearest_point(point), CUBE.nearest_point(point))
        assert np.array_equal(with_sliver.inward_normal(point), CUBE.inward_normal(point))
