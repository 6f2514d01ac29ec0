# SPDX-License-Identifier: MIT
"""R of a QR decomposition, whose rows come piece by piece."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_proto_ros.identify.incremental_qr import upper_triangle


@pytest.mark.parametrize("rows", [0, 3, 7, 1000])
def test_a_triangle_has_the_products_of_the_rows_that_it_stands_for(rows: int) -> None:
    matrix = np.random.default_rng(rows).standard_normal((rows, 7)) * np.logspace(-6, 6, 7)
    matrix[:, 2] = 0.0
    triangle = upper_triangle(matrix.T, slice_rows=64)
    assert np.array_equal(triangle, np.triu(triangle))
    above = upper_triangle(np.empty((7, 0)), triangle)
    assert np.array_equal(above, triangle)
    scale = np.linalg.norm(matrix, axis=0)
    wrong = np.abs(triangle.T @ triangle - matrix.T @ matrix)
    assert np.all(wrong <= 1e-14 * np.outer(scale, scale))  # measured 2e-15
