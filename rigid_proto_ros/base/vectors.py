# SPDX-License-Identifier: MIT
"""Types of vectors and arrays; without the kernels, which a program that only sends commands doesn't need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
"""Doubles, in the shape that the docstring gives."""
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Records = NDArray[np.void]
"""Structured records (n,), of the type that the docstring gives."""
Vector3 = NDArray[np.float64]
"""(3,)"""
Matrix3 = NDArray[np.float64]
"""(3, 3)"""
Attitude = NDArray[np.float64]
"""(4,): unit quaternion xyzw, or one to be normalized."""
StateRow = NDArray[np.float64]
"""(13,): COM position [m, world], attitude xyzw, velocity [m/s, world], angular velocity [rad/s, body axes]."""
Points = NDArray[np.float64]
"""(n, 3): points or vectors, a row each."""
Triangles = NDArray[np.int64]
"""(m, 3) indices of points."""

Numbers = Sequence[float] | FloatArray
"""Components of a vector or a quaternion, as they may be given."""
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""xyzw."""


def vector(numbers: Numbers) -> Vector:
    """Three given components."""
    x, y, z = numbers
    return float(x), float(y), float(z)
