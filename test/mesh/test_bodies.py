# SPDX-License-Identifier: MIT
"""The bundled bodies are closed solids that other tests and every first flight may trust."""

import re
from pathlib import Path

import numpy as np
import pytest

from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mesh.locate import resolve_mesh

NAMES = ("book", "hammer", "hollow_box", "l_bracket", "spinning_top", "t_handle", "teapot", "tennis_racket")


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of an .obj as our generator writes it: `v x y z` and `f a b c` alone."""
    rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], dtype=float)
    triangles = np.array([row[1:] for row in rows if row[0] == "f"], dtype=np.int64) - 1
    return vertices, triangles


def moments(vertices: np.ndarray, triangles: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre of mass and inertia about it at unit density, by tetrahedra about the box's centre."""
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    corners = (vertices - centre)[triangles]
    sixfold = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    volume = sixfold.sum() / 6.0
    total = corners.sum(axis=1)
    com = np.einsum("i,ij->j", sixfold, total) / (24.0 * volume)
    second = np.einsum("i,ij,ik->jk", sixfold, total, total) + np.einsum("i,icj,ick->jk", sixfold, corners, corners)
    second = second / 120.0 - volume * np.outer(com, com)
    return volume, com + centre, np.trace(second) * np.eye(3) - second


def parts(triangles: np.ndarray) -> int:
    """Number of surfaces that share no vertex."""
    label = np.arange(triangles.max() + 1)
    while True:
        lowest = label[triangles].min(axis=1)
        before = label.copy()
        for corner in range(3):
            np.minimum.at(label, triangles[:, corner], lowest)
        if np.array_equal(label, before):
            return len(np.unique(label))


def test_the_bodies_are_the_promised_ones() -> None:
    assert tuple(body_names()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_body_is_a_closed_outward_wound_solid(name: str) -> None:
    vertices, triangles = read(resolve_mesh(name))
    assert np.isfinite(vertices).all()
    assert len(np.unique(vertices, axis=0)) == len(vertices), "duplicate vertices"
    assert np.array_equal(np.unique(triangles), np.arange(len(vertices))), "unused or missing vertices"

    # Each directed edge once, and its reverse once: closed, and wound consistently.
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    code = edges[:, 0] * len(vertices) + edges[:, 1]
    assert len(np.unique(code)) == len(code)
    assert np.array_equal(np.sort(code), np.sort(edges[:, 1] * len(vertices) + edges[:, 0]))
    # Triangles about one vertex form one fan: as many outgoing edges as one walk around it meets.
    assert _fans_per_vertex(triangles, len(vertices)).max() == 1

    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    longest = np.linalg.norm(corners - corners[:, [1, 2, 0]], axis=2).max(axis=1)
    height = np.linalg.norm(normals, axis=1) / longest
    # The thinnest triangle measured is 5 µm high, 500 times the 10 nm to which coordinates are written.
    assert height.min() > 1e-6
    assert moments(vertices, triangles)[0] > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_surface_encloses_each_point_once_or_not_at_all(name: str) -> None:
    vertices, triangles = read(resolve_mesh(name))
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    chosen = np.random.default_rng(1).choice(len(triangles), 120)
    # Parts that overlap or folds would show as a winding number of 2 just inside, or 1 just outside, some triangle.
    for side, expected in ((1e-6, 0.0), (-1e-6, 1.0)):
        points = corners[chosen].mean(axis=1) + side * normals[chosen]
        numbers = [winding_number(point, corners) for point in points]
        assert numbers == pytest.approx([expected] * len(points), abs=1e-6)


def winding_number(point: np.ndarray, corners: np.ndarray) -> float:
    """How often closed triangles (m, 3, 3) wind about a point: their solid angles (van Oosterom, Strackee 1983) over 4 pi."""
    a, b, c = np.swapaxes(corners - point, 0, 1)
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    rest = (np.einsum("ij,ij->i", p, q) * length for p, q, length in ((a, b, lc), (b, c, la), (c, a, lb)))
    return float(np.arctan2(triple, la * lb * lc + sum(rest)).sum() / (2.0 * np.pi))


@pytest.mark.parametrize("name", NAMES)
def test_body_is_one_solid_of_a_size_one_holds(name: str) -> None:
    vertices, triangles = read(resolve_mesh(name))
    assert parts(triangles) == (2 if name == "hollow_box" else 1)
    assert 250 <= len(triangles) <= 7000
    assert 0.05 <= np.ptp(vertices, axis=0).max() <= 0.7


@pytest.mark.parametrize("name", NAMES)
def test_body_has_the_size_that_its_description_states(name: str) -> None:
    pytest.importorskip("manifold3d")
    from bundled_bodies.catalogue import BODIES

    stated = re.search(r"Size ([0-9.]+) x ([0-9.]+) x ([0-9.]+) m\.", BODIES[name].__doc__)
    assert stated, name
    assert np.ptp(read(resolve_mesh(name))[0], axis=0) == pytest.approx([float(x) for x in stated.groups()], abs=5.1e-4)


def test_the_lesson_states_the_size_of_the_book() -> None:
    page = Path(__file__).parents[2] / "docs" / "lessons" / "book.md"
    if not page.is_file():
        pytest.skip("not run from a source tree")
    stated = re.search(r"([0-9.]+) cm wide, ([0-9.]+) cm high\s+and ([0-9.]+) cm thick", page.read_text("utf-8"))
    assert 100.0 * np.ptp(read(resolve_mesh("book"))[0], axis=0) == pytest.approx([float(x) for x in stated.groups()])


def test_hollow_box_weighs_the_walls_alone() -> None:
    vertices, triangles = read(resolve_mesh("hollow_box"))
    volume = moments(vertices, triangles)[0]
    walls = 0.20 * 0.12 * 0.08 - 0.19 * 0.11 * 0.07
    # Rounded edges take away a little: measured 0.9905 of the sharp box's walls.
    assert 0.98 * walls < volume < walls


def test_t_handle_spins_about_its_middle_axis() -> None:
    _, com, inertia = moments(*read(resolve_mesh("t_handle")))
    ixx, iyy, izz = np.diag(inertia)
    # Measured 1 : 1.418 : 2.376.
    assert 1.2 * iyy < izz < ixx / 1.2
    assert abs(inertia - np.diag(np.diag(inertia))).max() < 1e-5 * izz
    assert abs(com[:2]).max() < 1e-7


def test_hammer_com_lies_far_from_the_box_centre() -> None:
    vertices, triangles = read(resolve_mesh("hammer"))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    offset = np.linalg.norm(moments(vertices, triangles)[1] - (low + high) / 2.0) / np.linalg.norm(high - low)
    # Measured 0.23 of the diagonal.
    assert offset > 0.2


def test_l_bracket_has_all_three_products_of_inertia() -> None:
    inertia = moments(*read(resolve_mesh("l_bracket")))[2]
    off_diagonal = np.abs(inertia[np.triu_indices(3, 1)]) / inertia.max()
    # Measured 0.0087, 0.235 and 0.0019 of the largest entry.
    assert off_diagonal.min() > 1e-3


def test_spinning_top_is_symmetric_about_its_axis() -> None:
    inertia = moments(*read(resolve_mesh("spinning_top")))[2]
    # Coordinates are rounded to 10 nm on a radius of 36 mm.
    assert abs(inertia[0, 0] - inertia[1, 1]) < 1e-6 * inertia[2, 2]


@pytest.mark.parametrize("name", NAMES)
def test_generator_reproduces_the_committed_body(name: str) -> None:
    pytest.importorskip("manifold3d")
    from bundled_bodies.catalogue import BODIES

    made_vertices, made_triangles = BODIES[name]()
    vertices, triangles = read(resolve_mesh(name))
    # Another machine's sine may differ in its last bit and so move one written digit, 10 nm; mass properties don't notice.
    made, kept = moments(made_vertices, made_triangles), moments(vertices, triangles)
    assert made[0] == pytest.approx(kept[0], rel=1e-6)
    assert made[1] == pytest.approx(kept[1], abs=1e-7)
    assert made[2] == pytest.approx(kept[2], abs=1e-6 * abs(kept[2]).max())
    assert len(made_triangles) == len(triangles)


def _fans_per_vertex(triangles: np.ndarray, count: int) -> np.ndarray:
    """How many separate fans of triangles meet at each vertex."""
    around: list[dict[int, int]] = [{} for _ in range(count)]
    for a, b, c in triangles.tolist():
        around[a][b], around[b][c], around[c][a] = c, a, b
    fans = np.zeros(count, dtype=int)
    for vertex, after in enumerate(around):
        unseen = set(after)
        while unseen:
            fans[vertex] += 1
            corner = unseen.pop()
            while (corner := after[corner]) in unseen:
                unseen.remove(corner)
    return fans
