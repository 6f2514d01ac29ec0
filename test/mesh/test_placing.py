# SPDX-License-Identifier: MIT
"""Matrices of a scene's nodes: as numbers say, multiplied in a fixed order, and mirroring where their determinant is negative."""

from fractions import Fraction

import numpy as np
import pytest

from rigid_proto_ros.base.rotation import matrix_from_quaternion, normalize
from rigid_proto_ros.mesh.assembly import multiply_matrices, node_matrix, place_vertices


def matrix_of(numbers: np.ndarray) -> np.ndarray:
    found = np.full((4, 4), np.nan)
    node_matrix(np.asarray(numbers, dtype=float), found)
    return found


def test_a_node_is_scaled_then_turned_then_moved_or_has_the_given_columns():
    random = np.random.default_rng(4)
    for _ in range(100):
        shift, turn, scale = random.normal(size=3), random.normal(size=4), random.normal(size=3)
        expected = np.eye(4)
        expected[:3, :3] = matrix_from_quaternion(normalize(*turn.tolist())) * scale
        expected[:3, 3] = shift
        np.testing.assert_array_equal(matrix_of(np.concatenate([shift, turn, scale])), expected)
    np.testing.assert_array_equal(matrix_of(np.arange(16.0)), np.arange(16.0).reshape(4, 4).T)


def test_a_product_is_summed_in_the_columns_order():
    random = np.random.default_rng(5)
    for _ in range(100):
        a, b, product = random.normal(size=(4, 4)), random.normal(size=(4, 4)), np.empty((4, 4))
        multiply_matrices(a, b, product)
        expected = ((a[:, :1] * b[:1] + a[:, 1:2] * b[1:2]) + a[:, 2:3] * b[2:3]) + a[:, 3:] * b[3:]
        np.testing.assert_array_equal(product, expected)
        assert np.abs(product - a @ b).max() <= 8 * 2.0**-53 * (np.abs(a) @ np.abs(b)).max()


def mirrors(linear: np.ndarray) -> bool:
    matrix = np.eye(4)
    matrix[:3, :3] = linear
    return place_vertices(np.empty((0, 3)), matrix, np.empty((0, 3)))


def determinant(linear: np.ndarray) -> Fraction:
    (a, b, c), (d, e, f), (g, h, i) = [[Fraction(x) for x in row] for row in linear.tolist()]
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


@pytest.mark.parametrize("size", [1.0, 1e-120, 1e120])
def test_a_matrix_mirrors_where_its_determinant_is_negative_of_any_size(size):
    """At 1e-120 the determinant is below the smallest number, at 1e120 beyond the largest."""
    random = np.random.default_rng(6)
    for k in range(200):
        linear = random.normal(size=(3, 3)) if k % 2 else random.integers(-2, 3, (3, 3)).astype(float)
        assert mirrors(linear * size) == (determinant(linear) < 0)


def test_vertices_are_placed_by_sums_in_a_fixed_order():
    random = np.random.default_rng(7)
    vertices, matrix = random.normal(size=(50, 3)), random.normal(size=(4, 4))
    placed = np.empty((50, 3))
    place_vertices(vertices, matrix, placed)
    x, y, z = vertices.T[:, :, None]
    expected = x * matrix[:3, 0] + y * matrix[:3, 1] + z * matrix[:3, 2] + matrix[:3, 3]
    np.testing.assert_array_equal(placed, expected)
