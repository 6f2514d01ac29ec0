# SPDX-License-Identifier: MIT
"""Edges, components and duplicates by counting in given memory are those by NumPy's sorting."""

import numpy as np
import pytest

from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mesh.topology import component_sums, edge_defects, mesh_topology, turned_triangles

BOX = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)


def first_equal(rows: np.ndarray) -> np.ndarray:
    """For each row the index of the first one equal to it."""
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first[which.reshape(-1)]


def sets_of(pairs: np.ndarray, count: int) -> np.ndarray:
    """The smallest member of the set of each of ``count`` things that pairs (k, 2) join."""
    smallest = np.arange(count)
    while True:
        before = smallest.copy()
        for a, b in ((0, 1), (1, 0)):
            np.minimum.at(smallest, pairs[:, a], before[pairs[:, b]])
        smallest = smallest[smallest]
        if np.array_equal(smallest, before):
            return smallest


def by_numpy(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    """corners, edges, component and duplicates, as in Topology."""
    corners = first_equal(vertices + 0.0)[triangles]
    tails, heads = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    owner = np.repeat(np.arange(len(corners)), 3)
    real = tails != heads
    tails, heads, owner = tails[real], heads[real], owner[real]
    key = np.minimum(tails, heads) * len(vertices) + np.maximum(tails, heads)
    order = np.argsort(key, kind="stable")
    key, owner, upward = key[order], owner[order], (tails < heads)[order]
    edges, first, uses = np.unique(key, return_index=True, return_counts=True)
    number = np.repeat(np.arange(len(edges)), uses)
    forward = np.bincount(number, upward, len(edges)).astype(np.int64)
    second = np.where(uses > 1, owner[np.minimum(first + 1, max(len(key) - 1, 0))], -1) if len(key) else uses
    table = np.stack(
        [edges // len(vertices), edges % len(vertices), forward, uses - forward, owner[first], second], axis=1
    )
    pairs = np.stack([np.repeat(owner[first], uses), owner], axis=1)
    joins = np.repeat(uses <= 2, uses)
    root = sets_of(pairs[joins], len(corners))
    for e in np.flatnonzero(uses > 2).tolist():
        own = number == e
        if np.any(np.bincount(root[owner[own]], np.where(upward[own], 1.0, -1.0)) != 0.0):
            joins |= own
    _, component = np.unique(sets_of(pairs[joins], len(corners)), return_inverse=True)
    smallest = np.argmin(corners, axis=1)[:, None]
    turned = np.take_along_axis(corners, (smallest + np.arange(3)) % 3, axis=1)
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return corners, table, component.reshape(-1), (first_equal(turned) != np.arange(len(corners))) & whole


def soup(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Few vertices, some in one place, and many triangles over them, some without area and some twice."""
    random = np.random.default_rng(seed)
    vertices = random.integers(-1, 2, (random.integers(3, 30), 3)) * random.choice([1.0, -1.0], (1, 3))
    return vertices, random.integers(0, len(vertices), (random.integers(1, 80), 3))


def boxes(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Boxes that touch along edges and faces, some wound inward, open, or with copies."""
    random = np.random.default_rng(seed)
    vertices, triangles = [], []
    for k in range(random.integers(1, 7)):
        faces = FACES[:, [0, 2, 1]] if random.random() < 0.3 else FACES
        faces = np.concatenate([faces, faces[random.integers(0, 12, random.integers(0, 2))]])
        vertices.append(BOX + random.integers(0, 3, 3))
        triangles.append(np.roll(faces[random.integers(0, 2) :], random.integers(3), axis=1) + 8 * k)
    return np.concatenate(vertices), random.permutation(np.concatenate(triangles))


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("of", [soup, boxes], ids=["soup", "boxes"])
def test_edges_components_and_duplicates_are_those_by_sorting(of, seed):
    vertices, triangles = of(seed)
    topology = mesh_topology(vertices, triangles)
    found = topology.corners, topology.edges, topology.component, topology.duplicates
    for mine, theirs in zip(found, by_numpy(vertices, triangles), strict=True):
        assert mine.dtype == theirs.dtype
        np.testing.assert_array_equal(mine, theirs)
    assert topology.components == topology.component.max() + 1
    uses = topology.edges[:, 2] + topology.edges[:, 3]
    odd = np.count_nonzero(uses % 2)
    assert edge_defects(topology.edges) == (odd, len(topology.unbalanced) - odd)


def test_triangles_stay_as_given_where_nothing_is_welded():
    topology = mesh_topology(BOX, FACES)
    assert topology.corners is FACES and topology.components == 1
    assert edge_defects(topology.edges) == (0, 0)


def test_a_mesh_without_triangles_has_no_edges():
    topology = mesh_topology(BOX, FACES[:0])
    assert topology.edges.shape == (0, 6) and topology.components == 0


def test_turned_triangles_have_the_opposite_volume():
    one, other = (component_sums(BOX, mesh_topology(BOX, faces)) for faces in (FACES, turned_triangles(FACES)))
    assert one.volume.tolist() == [1.0] and other.volume.tolist() == [-1.0]
    np.testing.assert_array_equal(turned_triangles(turned_triangles(FACES)), FACES)


@pytest.mark.parametrize("wrong", [8, -1, 2**62])
def test_a_vertex_that_is_not_there_is_refused(wrong):
    faces = FACES.copy()
    faces[3, 1] = wrong
    with pytest.raises(MeshError, match="a vertex outside 0 to 7"):
        mesh_topology(BOX, faces)
