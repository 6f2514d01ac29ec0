# SPDX-License-Identifier: MIT
"""log₂ and 2ˣ to two digits from a double's own exponent, for lengths of steps: a tenth of the time of libm's, and
everywhere the same bits.
"""

from __future__ import annotations

import math

from ...base.compilation import njit
from ...base.elementary import BIAS, MANTISSA, MANTISSA_BITS, bits_of, double_of


@njit(cache=True, error_model="numpy")
def rough_log2(x: float) -> float:
    """log₂ x for x > 0 with an error below 0.006; −1023 for subnormal x."""
    bits = bits_of(x)
    # m − 1 with x = 2ⁿ m: exact where x is normal. log₂ m − (m − 1) vanishes at m = 1 and 2; the line has its slopes
    # there.
    f = double_of((bits & MANTISSA) | (BIAS << MANTISSA_BITS)) - 1.0
    return float((bits >> MANTISSA_BITS) - BIAS) + f + f * (1.0 - f) * (0.4427 - 0.164 * f)


@njit(cache=True, error_model="numpy")
def rough_exp2(x: float) -> float:
    """2ˣ with a relative error below 0.001, for x cut to ±1000."""
    whole = math.floor(min(max(x, -1000.0), 1000.0))
    f = min(max(x, -1000.0), 1000.0) - whole
    power = double_of((int(whole) + BIAS) << MANTISSA_BITS)
    return power * (1.0 + f - f * (1.0 - f) * (0.3069 + 0.0794 * f))
