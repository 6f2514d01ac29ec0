# SPDX-License-Identifier: MIT
"""Three numbers; without numba, which who only sends commands has no use for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Numbers = Sequence[float] | np.ndarray
"""Components of a vector or a quaternion, as they may be given."""
Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""xyzw."""


def vector(numbers: Numbers) -> Vector:
    """Three given components."""
    x, y, z = numbers
    return float(x), float(y), float(z)
