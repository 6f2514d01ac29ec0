# SPDX-License-Identifier: MIT
"""R of a QR decomposition, rows added piece by piece: all that a least-squares step needs of many rows.

Compiled here: LAPACK's would share so narrow a matrix out among threads that wait for one another.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.compilation import njit


@njit(cache=True, error_model="numpy")
def _dot(a: np.ndarray, b: np.ndarray) -> float:
    """Four sums side by side: one alone waits for each of its additions."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    whole = a.shape[0] // 4 * 4
    for k in range(0, whole, 4):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
    for k in range(whole, a.shape[0]):
        s0 += a[k] * b[k]
    return (s0 + s1) + (s2 + s3)


@njit(cache=True, error_model="numpy")
def _add_rows(triangle: np.ndarray, columns: np.ndarray) -> None:
    """Householder reflections (Golub and Van Loan, Matrix Computations, 5.1) of triangle (k, k) above columns (k, m),
    one row of ``columns`` for each column; both are overwritten.
    """
    width = triangle.shape[0]
    for j in range(width):
        below = columns[j]
        squares = _dot(below, below)
        if squares == 0.0:
            continue
        top = triangle[j, j]
        length = math.sqrt(top * top + squares)
        if top > 0.0:
            length = -length
        # The reflection's vector is (first, below), 2 over its square is -1 / (length first).
        first = top - length
        triangle[j, j] = length
        for i in range(j + 1, width):
            factor = (triangle[j, i] * first + _dot(below, columns[i])) / (length * first)
            triangle[j, i] += factor * first
            other = columns[i]
            for k in range(other.shape[0]):
                other[k] += factor * below[k]


def upper_triangle(columns: np.ndarray, above: np.ndarray | None = None, slice_rows: int = 4096) -> np.ndarray:
    """R (k, k) with RᵀR = AᵀA for a matrix A of k columns, given transposed: columns (k, m), any m. above (k, k): an
    upper triangle that stands above A.
    """
    width, rows = columns.shape
    triangle = np.zeros((width, width)) if above is None else np.array(above)
    for first in range(0, rows, slice_rows):
        _add_rows(triangle, np.array(columns[:, first : first + slice_rows], dtype=float, order="C"))
    return triangle
