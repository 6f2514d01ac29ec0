# SPDX-License-Identifier: MIT
"""The search for triangles that pass through each other finds those that exact arithmetic finds."""

from fractions import Fraction
from itertools import combinations

import numpy as np
from judged_meshes import body, codes
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES

from rigid_proto_ros.mesh.intersection import WORK_LIMIT, crossings, hierarchy
from rigid_proto_ros.mesh.topology import mesh_topology


def exactly_cross(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether a side of one triangle (3, 3) passes through the inside of the other, in rational arithmetic."""
    if np.any(first.min(axis=0) > second.max(axis=0)) or np.any(second.min(axis=0) > first.max(axis=0)):
        return False
    p, q = ([[Fraction(x) for x in corner] for corner in triangle.tolist()] for triangle in (first, second))

    def volume(a, b, c, d):
        (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = ([x - y for x, y in zip(e, a, strict=True)] for e in (b, c, d))
        return ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)

    def pierces(a, b, t):
        if volume(*t, a) * volume(*t, b) >= 0:
            return False
        sides = [volume(a, b, t[k], t[(k + 1) % 3]) for k in range(3)]
        return min(sides) > 0 or max(sides) < 0

    return any(pierces(s[k], s[(k + 1) % 3], t) for s, t in ((p, q), (q, p)) for k in range(3))


def found(
    points: np.ndarray, corners: np.ndarray, component: np.ndarray, limit: int = WORK_LIMIT, also_within: bool = True
) -> tuple:
    count = int(component.max()) + 1
    crossing = np.empty((count, count), dtype=bool)
    tree = hierarchy(points, corners)
    of_node = np.empty(len(tree[2]), np.int64)
    within, complete = crossings(points, corners, component, *tree, of_node, also_within, limit, crossing)
    return within, crossing, complete


def within_one(points: np.ndarray, corners: np.ndarray) -> int:
    """Pairs of triangles that cross, all being of one component."""
    return found(points, corners, np.zeros(len(corners), np.int64))[0]


def test_crossing_triangles_are_those_that_exact_arithmetic_finds():
    """Of all sizes, some long and thin, in a unit cube."""
    count, random = 80, np.random.default_rng(3)
    thin = np.array([1.0, 0.05])[random.integers(0, 2, (count, 1, 1))]
    size = 10.0 ** random.uniform(-1.2, -0.2, (count, 1, 1)) * thin
    points = (random.uniform(size=(count, 1, 3)) + size * random.normal(size=(count, 3, 3))).reshape(-1, 3)
    corners = np.arange(3 * count).reshape(-1, 3)
    pairs = [pair for pair in combinations(range(count), 2) if exactly_cross(*points[corners[list(pair)]])]
    assert len(pairs) > 30
    assert within_one(points, corners) == len(pairs)
    # Between components only whether any two cross is asked.
    component = np.random.default_rng(4).integers(0, 30, count)
    expected = np.zeros((component.max() + 1, component.max() + 1), dtype=bool)
    for i, j in pairs:
        expected[component[i], component[j]] = expected[component[j], component[i]] = component[i] != component[j]
    within, crossing, complete = found(points, corners, component)
    assert complete and np.array_equal(crossing, expected) and crossing.any() and not crossing.all()
    assert within == sum(component[i] == component[j] for i, j in pairs)
    assert not found(points, corners, component, 10)[2]
    none, crossing, complete = found(points, corners, component, also_within=False)
    assert complete and none == 0 and np.array_equal(crossing, expected)


def test_triangles_that_share_a_corner_do_not_cross():
    # The second passes through the first from their common corner's other side: a fold, no crossing.
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0.2, 1.0], [0.4, 0.3, -1.0], [0.05, 0.05, 0.0]])
    assert within_one(points, np.array([[0, 1, 2], [0, 3, 4]])) == 0
    assert within_one(points, np.array([[0, 1, 2], [5, 3, 4]])) == 1


def test_a_cube_everted_through_its_own_edges_is_told():
    """Corners exchanged or faces turned so that sides pass through sides, and by no inside of a triangle."""
    cube = CUBE_VERTICES - 0.5
    everted = [np.where(cube[:, 2:] > 0.0, cube * (-1.0, -1.0, 1.0), cube)]
    for i in range(8):
        exchanged = cube.copy()
        exchanged[[i, i ^ 1]] = exchanged[[i ^ 1, i]]
        everted.append(exchanged)
    for vertices in everted:
        assert "self_crossing" in codes(body((vertices, CUBE_TRIANGLES)))


def test_a_wall_that_dips_into_a_flat_floor_by_little_is_found_and_one_that_stands_on_it_is_not():
    x, y = (grid.ravel() for grid in np.meshgrid(np.arange(4.0), np.arange(4.0)))
    cell = (4 * np.arange(3)[:, None] + np.arange(3)).ravel()
    sheet = np.vstack([np.column_stack([cell, cell + 1, cell + 5]), np.column_stack([cell, cell + 5, cell + 4])])
    floor = np.column_stack([x, y, np.zeros(16)])
    for depth in (0.0, 1e-7):
        wall = np.column_stack([np.full(16, 1.7), 0.4 * y + 0.25, 0.5 * x - depth])
        points, triangles = np.vstack([floor, wall]), np.vstack([sheet, sheet + 16])
        pairs = sum(exactly_cross(points[one], points[other]) for one, other in combinations(triangles, 2))
        assert within_one(points, mesh_topology(points, triangles).corners) == pairs
        assert (pairs > 0) == (depth > 0.0)
