# SPDX-License-Identifier: MIT
"""The quaternion of a rotation vector."""

from __future__ import annotations

import math

from ...base.compilation import njit


@njit(cache=True, error_model="numpy")
def exponential(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Unit quaternion xyzw of the turn by |v| [rad] about v = (x, y, z); exact in the limit of small turns too."""
    angle = math.sqrt(x * x + y * y + z * z)
    # sin(a/2)/a: below 1e-4 the series ½ − a²/48 errs by 1e-19.
    factor = math.sin(0.5 * angle) / angle if angle > 1e-4 else 0.5 - angle * angle / 48.0
    return x * factor, y * factor, z * factor, math.cos(0.5 * angle)
