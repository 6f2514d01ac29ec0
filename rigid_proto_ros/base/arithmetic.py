# SPDX-License-Identifier: MIT
"""Arithmetic that gives the same bits on every machine: pairs of doubles, and elementary functions. A C library's
functions differ by version, vendor and processor. Called from Python without the compiler they are plain functions with
the same bits.

The functions are made of what IEEE 754 fixes, +, −, ·, / and √, in the order written, and err by less than 1 ulp
(measured against mpmath: see test/base/test_elementary.py). Where a sum decides about the last digit it is taken in
pairs of doubles. tools/elementary_coefficients.py computes the constants. Nothing here may be compiled with fastmath,
which removes rounding errors that algebra says are zero.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compilation import COMPILED, Emitted, intrinsic, njit
from .simd import fused_multiply_add

if COMPILED:
    from llvmlite import ir
    from numba import types

# Pairs of doubles
#
# A sum or product of two doubles as an unevaluated pair high + low, which carries about 104 bits. Two-sum after Knuth
# (TAOCP 2, 4.2.2), two-product by a fused multiply-add (Ogita, Rump and Oishi, SIAM J. Sci. Comput. 26, 2005), pair
# arithmetic after Hida, Li and Bailey (QD, 2001).


@njit(error_model="numpy", allocates=False)
def two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b = high + low, exactly."""
    high = a + b
    t = high - a
    return high, (a - (high - t)) + (b - t)


@njit(error_model="numpy", allocates=False)
def fast_two_sum(a: float, b: float) -> tuple[float, float]:
    """a + b = high + low, exactly, for |a| ≥ |b| or a = 0."""
    high = a + b
    return high, b - (high - a)


@njit(error_model="numpy", allocates=False)
def two_product(a: float, b: float) -> tuple[float, float]:
    """a b = high + low, exactly, while |a b| > 1e-290 or zero."""
    high = a * b
    return high, fused_multiply_add(a, b, -high)


@njit(error_model="numpy", allocates=False)
def pair_add(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Sum of two pairs, relative error ≤ 3·2⁻¹⁰⁶ even under cancellation (the accurate variant)."""
    s, e = two_sum(a, b)
    t, f = two_sum(a_low, b_low)
    s, e = fast_two_sum(s, e + t)
    return fast_two_sum(s, e + f)


@njit(error_model="numpy", allocates=False)
def pair_multiply(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Product of two pairs, relative error ≤ 7·2⁻¹⁰⁶."""
    p, e = two_product(a, b)
    return fast_two_sum(p, e + (a * b_low + a_low * b))


@njit(error_model="numpy", allocates=False)
def pair_divide(a: float, a_low: float, b: float, b_low: float) -> tuple[float, float]:
    """Quotient of two pairs, relative error ≤ 10·2⁻¹⁰⁶; b ≠ 0."""
    q = a / b
    p, e = pair_multiply(q, 0.0, b, b_low)
    r, r_low = pair_add(a, a_low, -p, -e)
    return fast_two_sum(q, (r + r_low) / b)


# Bits of a double

BIAS, MANTISSA_BITS = 1023, 52
MANTISSA = (1 << MANTISSA_BITS) - 1


@intrinsic
def bits_of(_typing_context: Any, _x: Any) -> Emitted:
    """The 64 bits of a double as an integer."""
    return types.int64(types.float64), lambda _, builder, _signature, arguments: builder.bitcast(
        arguments[0], ir.IntType(64)
    )


@intrinsic
def double_of(_typing_context: Any, _bits: Any) -> Emitted:
    """The double with these 64 bits."""
    return types.float64(types.int64), lambda _, builder, _signature, arguments: builder.bitcast(
        arguments[0], ir.DoubleType()
    )


if not COMPILED:

    def bits_of(x: float) -> int:
        """The 64 bits of a double as an integer."""
        return int(np.float64(x).view(np.int64))

    def double_of(bits: int) -> float:
        """The double with these 64 bits."""
        return float(np.int64(bits).view(np.float64))


# What a C library has functions for: exponents, neighbours, whole numbers and remainders. Exact, so that there is one
# result, and made of operations that are instructions on every processor; rounding to a whole number isn't.

_SPECIAL_EXPONENT = 2 * BIAS + 1
"""Exponent's bits of infinity and of what is no number."""


@njit(error_model="numpy", allocates=False)
def exponent_of(x: float) -> int:
    """n with ½ ≤ |x| 2⁻ⁿ < 1, as C's frexp gives it: 0 for zero, infinity and what is no number."""
    biased = (bits_of(x) >> MANTISSA_BITS) & _SPECIAL_EXPONENT
    lifted = 0
    if biased == 0 and x != 0.0:
        biased, lifted = (bits_of(x * 2.0**64) >> MANTISSA_BITS) & _SPECIAL_EXPONENT, 64
    return int(biased - (BIAS - 1) - lifted) if 0 < biased < _SPECIAL_EXPONENT else 0


@njit(error_model="numpy", allocates=False)
def scaled(x: float, n: int) -> float:
    """x 2ⁿ, rounded once, as C's ldexp gives it, for every n.

    Powers of two in range are one multiplication. A smaller one is split so that the last factor is below 2⁻⁵³: what
    comes before it is exact, or so small that its own rounding can't be seen. Source: scalbn of musl.
    """
    if n > BIAS:
        x, n = x * 2.0**1023, n - 1023
        if n > BIAS:
            x, n = x * 2.0**1023, min(n - 1023, 1023)
    elif n < 1 - BIAS:
        x, n = x * 2.0**-969, n + 969
        if n < 1 - BIAS:
            x, n = x * 2.0**-969, max(n + 969, -1022)
    power: float = double_of((n + BIAS) << MANTISSA_BITS)
    return x * power


@njit(error_model="numpy", allocates=False)
def next_up(x: float) -> float:
    """The next larger double; x itself for infinity and what is no number."""
    if not x < math.inf:
        return x
    if x == 0.0:
        return 5e-324
    bits = bits_of(x)
    above: float = double_of(bits + 1 if x > 0.0 else bits - 1)
    return above


@njit(error_model="numpy", allocates=False)
def nearest_whole(x: float) -> float:
    """The whole number nearest to x, an even one between two; −2⁶³ where it is beyond the integers of 64 bits."""
    size = abs(x)
    if size < 2.0**52:
        return math.copysign((size + 2.0**52) - 2.0**52, x) + 0.0  # no −0
    return x if size < 2.0**63 else -(2.0**63)


@njit(error_model="numpy", allocates=False)
def remainder_of(x: float, divisor: float) -> float:
    """x modulo the divisor with the divisor's sign, as Python's %: long division, exact but for the addition that turns
    the sign. Not a number where Python raises an error.
    """
    size, whole = abs(x), abs(divisor)
    if not (size < math.inf and whole > 0.0):
        return math.nan
    rest = size
    if size >= whole:
        e, f = exponent_of(size), exponent_of(whole)
        a, b = int(scaled(size, 53 - e)), int(scaled(whole, 53 - f))
        for _ in range(e - f):
            a = 2 * (a - b if a >= b else a)
        rest = scaled(float(a - b if a >= b else a), f - 53)
    if rest == 0.0:
        return math.copysign(0.0, divisor)
    rest = math.copysign(rest, x)
    return rest if (rest < 0.0) == (divisor < 0.0) else rest + divisor


@njit(error_model="numpy", allocates=False)
def exact_quotient(product: float, factor: float) -> float:
    """x with x · factor == product in double precision where there is one, else the nearest; factor ≠ 0."""
    x = product / factor
    if x * factor == product:
        return x
    up, down = next_up(x), -next_up(-x)
    if up * factor == product:
        return up
    if down * factor == product:
        return down
    return x


# Elementary functions

_TO_NEAREST = 6755399441055744.0
"""1.5·2⁵²: added and taken off again, it leaves the nearest whole number of one up to 2⁵¹."""

# Parts of log 2 and of π/2: products of the first ones with a whole number, below 2¹¹ and 2²⁰, are exact.
_LN2_1 = 0.6931471805598903
_LN2_2 = 5.497923018708371e-14
_HALF_PI_1 = 1.5707963267341256
_HALF_PI_2 = 6.077100506303966e-11
_HALF_PI_3 = 2.0222662487959506e-21
_PAIR_HALF_PI = (1.5707963267948966, 6.123233995736766e-17)
_THIRD_OF_HALF_PI = -1.4973849048591833e-33

_AS_ITSELF = 1e-9
"""|x| below which x²/2 is lost beside 1, so that sine, tangent and their like are x."""
_FAR = 1.6e6
"""|x| below which x less whole quarter turns is exact by three parts of π/2."""
_NEAR_MULTIPLE = 2.0**-30
"""A rest below which that many digits have cancelled isn't known well enough."""

# Minimax polynomials in the square (exp: in the argument itself) of what is left after
# sin r = r + r³ S, cos r = 1 − r²/2 + r⁴ C, eʳ = 1 + r + r²/2 + r³ E, artanh s = s + s³ T, arctan z = z + z³ A.
_SIN = (
    *(-0.1666666666666663, 0.008333333333322108, -0.00019841269829580234, 2.7557313618034487e-06),
    *(-2.5050747220107847e-08, 1.5896197712199157e-10),
)
_COS = (
    *(0.041666666666666595, -0.001388888888887304, 2.480158728884145e-05, -2.755731417625541e-07),
    *(2.087570041819921e-09, -1.1358514060814301e-11),
)
_EXP = (
    *(0.16666666666666682, 0.0416666666666667, 0.008333333333316857, 0.001388888888886516),
    *(0.00019841269896821913, 2.480158736512563e-05, 2.75572344355906e-06, 2.755723865038956e-07),
    *(2.5112179990753723e-08, 2.092568857645337e-09),
)
_ATANH = (
    *(0.33333333333333676, 0.1999999999970468, 0.14285714371842764, 0.11111099214521343),
    *(0.0909178617639457, 0.0765691609772075, 0.07399129342169176),
)
_ATAN = (
    *(-0.3333333333333333, 0.199999999999999, -0.14285714285675663, 0.11111111103649086),
    *(-0.0909090827462691, 0.0769225367843588, -0.06664458490498826, 0.05827632965465174),
    *(-0.04502428537208239,),
)

# arctan k/8, π/2 ∓ it, π − it for k = 0 … 8, and what doubles lack of them.
_ANGLES = np.array(
    [
        *(0.0, 0.12435499454676144, 0.24497866312686414, 0.35877067027057225),
        *(0.4636476090008061, 0.5585993153435624, 0.6435011087932844, 0.7188299996216245),
        *(0.7853981633974483, 1.5707963267948966, 1.446441332248135, 1.3258176636680326),
        *(1.2120256565243244, 1.1071487177940904, 1.0121970114513341, 0.9272952180016122),
        *(0.8519663271732721, 0.7853981633974483, 1.5707963267948966, 1.695151321341658),
        *(1.8157749899217608, 1.9295669970654687, 2.0344439357957027, 2.129395642138459),
        *(2.214297435588181, 2.289626326416521, 2.356194490192345, 3.141592653589793),
        *(3.017237659043032, 2.896613990462929, 2.782821983319221, 2.677945044588987),
        *(2.5829933382462307, 2.498091544796509, 2.4227626539681686, 2.356194490192345),
    ]
).reshape(4, 9)
_ANGLES_LOW = np.array(
    [
        *(0.0, -3.1253241424539383e-18, 1.0698755618734451e-17, -2.4623815582638635e-17),
        *(2.2698777452961687e-17, -5.4556305485916264e-18, 1.5834785051444286e-17, -2.1478388444456983e-17),
        *(3.061616997868383e-17, 6.123233995736766e-17, 9.211323971545052e-17, -8.824429373951136e-17),
        *(3.034500430874847e-17, 9.40447137356638e-17, 6.668797050595929e-17, 4.5397554905923374e-17),
        *(-2.831157406069101e-17, 3.061616997868383e-17, 6.123233995736766e-17, 3.0351440199284805e-17),
        *(-1.133563127078463e-17, 9.211967560598685e-17, 2.841996617907152e-17, 5.577670940877603e-17),
        *(1.880894274713276e-16, 3.975395151291068e-17, 9.184850993605148e-17, 1.2246467991473532e-16),
        *(-6.869902525221314e-17, 1.950326511428876e-16, 9.157734426611613e-17, 1.5527705369303147e-16),
        *(1.2792031046332694e-16, -4.392407599224622e-18, 1.439430683591923e-16, 9.184850993605148e-17),
    ]
).reshape(4, 9)


@njit(error_model="numpy", allocates=False)
def _reduced_in_pairs(x: float) -> tuple[int, float, float]:
    """As ``_reduced``, for |x| < 2⁵¹ with three doubles of π/2. Beyond, neighbours are further apart than an angle is
    of use: then x is taken modulo the double that is nearest to 2π.
    """
    if abs(x) >= 2.0**51:
        x = remainder_of(x, 2.0 * math.pi)
    whole = (x * (2.0 / math.pi) + _TO_NEAREST) - _TO_NEAREST
    for _ in range(2):
        product, product_low = two_product(whole, _PAIR_HALF_PI[0])
        r, low = pair_add(x, 0.0, -product, -product_low)
        product, product_low = two_product(whole, _PAIR_HALF_PI[1])
        r, low = pair_add(r, low, -product, -product_low)
        r, low = pair_add(r, low, -whole * _THIRD_OF_HALF_PI, 0.0)
        # The quotient's own rounding may have missed the nearest whole number.
        if abs(r) <= 0.25 * math.pi:
            break
        whole += math.copysign(1.0, r)
    return int(whole), r, low


@njit(error_model="numpy", allocates=False)
def _reduced(x: float) -> tuple[int, float, float]:
    """n, modulo 4 where it is large, and a pair r with x = n π/2 + r, |r| ≤ π/4.

    Source: Cody and Waite, Software Manual for the Elementary Functions (1980).
    """
    size = abs(x)
    if size < _FAR:
        whole = (x * (2.0 / math.pi) + _TO_NEAREST) - _TO_NEAREST
        r, low = two_sum(x - whole * _HALF_PI_1, -whole * _HALF_PI_2)
        r, low = fast_two_sum(r, low - whole * _HALF_PI_3)
        if abs(r) > _NEAR_MULTIPLE:
            return int(whole), r, low
    if not size < math.inf:
        return 0, math.nan, 0.0
    return _reduced_in_pairs(x)


@njit(error_model="numpy", allocates=False)
def _sine(r: float, low: float) -> float:
    z = r * r
    c = _SIN
    zz = z * z
    tail = (c[1] + z * c[2]) + zz * ((c[3] + z * c[4]) + zz * c[5])
    return r + (z * r * (c[0] + z * tail) + low * (1.0 - 0.5 * z))


@njit(error_model="numpy", allocates=False)
def _cosine(r: float, low: float) -> float:
    z = r * r
    c = _COS
    zz = z * z
    tail = (c[0] + z * c[1]) + zz * ((c[2] + z * c[3]) + zz * (c[4] + z * c[5]))
    half = 0.5 * z
    top = 1.0 - half
    return top + (((1.0 - top) - half) + (zz * tail - r * low))


@njit(error_model="numpy", allocates=False)
def sine_cosine(x: float) -> tuple[float, float]:
    """sin x and cos x."""
    if abs(x) < _AS_ITSELF:
        return x, 1.0
    n, r, low = _reduced(x) if not abs(x) <= 0.25 * math.pi else (0, x, 0.0)
    s, c = _sine(r, low), _cosine(r, low)
    if n & 1:
        s, c = c, -s
    if n & 2:
        s, c = -s, -c
    return s, c


@njit(error_model="numpy", allocates=False)
def _exponential_parts(x: float) -> tuple[int, float, float, float]:
    """n, r and a pair (t, t_low) with eˣ = 2ⁿ (1 + r + t), |r| ≤ ½ log 2; |x| < 1000."""
    whole = (x * (1.0 / 0.6931471805599453) + _TO_NEAREST) - _TO_NEAREST
    r, low = two_sum(x - whole * _LN2_1, -whole * _LN2_2)
    square, square_low = two_product(r, r) if abs(r) > 1e-140 else (0.0, 0.0)
    c = _EXP
    rr = r * r
    tail = ((c[0] + r * c[1]) + rr * (c[2] + r * c[3])) + rr * rr * (
        ((c[4] + r * c[5]) + rr * (c[6] + r * c[7])) + rr * rr * (c[8] + r * c[9])
    )
    t, t_low = fast_two_sum(0.5 * square, r * rr * tail + low * (1.0 + r))
    return int(whole), r, t, t_low + 0.5 * square_low


@njit(error_model="numpy", allocates=False)
def exponential_of(x: float) -> float:
    """eˣ."""
    if not -746.0 < x < 710.0:
        return 0.0 if x < 0.0 else x * math.inf
    n, r, t, t_low = _exponential_parts(x)
    s, e = fast_two_sum(1.0, r)
    s, f = fast_two_sum(s, t)
    return scaled(s + (e + f + t_low), n)


@njit(error_model="numpy", allocates=False)
def expm1(x: float) -> float:
    """eˣ − 1, without cancellation for small x."""
    if not -40.0 < x < 709.0:
        return -1.0 if x < 0.0 else exponential_of(x)
    if abs(x) < 1e-17:
        return x
    n, r, t, t_low = _exponential_parts(x)
    if n == 0:
        high, low = two_sum(r, t)
        return high + (low + t_low)
    s, e = fast_two_sum(1.0, r)
    s, f = fast_two_sum(s, t)
    high, low = two_sum(scaled(s, n), -1.0)
    return high + (low + scaled(e + f + t_low, n))


@njit(error_model="numpy", allocates=False)
def _logarithm(x: float) -> tuple[float, float]:
    """log x as an unevaluated sum of two, for normal x > 0."""
    bits = bits_of(x)
    # The mantissa between √½ and √2: 0x6a09e667f3bcd is that of √2.
    n = (bits >> MANTISSA_BITS) - BIAS
    up = 1 if (bits & MANTISSA) > 0x6A09E667F3BCD else 0
    n += up
    f = double_of((bits & MANTISSA) | ((BIAS - up) << MANTISSA_BITS)) - 1.0
    # log(1 + f) = 2 artanh s with s = f/(2 + f), and 2 s = f − f²/2 + s f²/2.
    s = f / (2.0 + f)
    square, square_low = two_product(f, f)
    z = s * s
    zz = z * z
    c = _ATANH
    artanh = ((c[0] + z * c[1]) + zz * (c[2] + z * c[3])) + zz * zz * ((c[4] + z * c[5]) + zz * c[6])
    high, low = two_sum(float(n) * _LN2_1, f)
    high, lost = two_sum(high, -0.5 * square)
    rest = s * (0.5 * square + 2.0 * z * artanh) + float(n) * _LN2_2 - 0.5 * square_low
    return high, (low + lost) + rest


@njit(error_model="numpy", allocates=False)
def logarithm(x: float) -> float:
    """log x; −∞ for 0, NaN for less."""
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else x if x > 0.0 else math.nan
    if x == 1.0:
        return 0.0
    if x < 1e-300:
        high, low = _logarithm(x * 2.0**100)
        total, lost = two_sum(high, -100.0 * _LN2_1)
        return total + (lost + low - 100.0 * _LN2_2)
    high, low = _logarithm(x)
    return high + low


@njit(error_model="numpy", allocates=False)
def _angle(less: float, more: float, octant: int) -> float:
    """φ = arctan less/more in octant 0, π/2 − φ in 1, π/2 + φ in 2, π − φ in 3, for 0 ≤ less ≤ more, neither tiny nor
    huge.

    With c = k/8 near the ratio, φ = arctan c + arctan z, z = (less − c more)/(more + c less). Where that sum would
    amplify the rounding of z, up to 3/16, c is 0.
    """
    ratio = less if more == 1.0 else less / more
    k = int(8.0 * ratio + 0.5) if ratio > 0.1875 else 0
    z, rest = ratio, 0.0
    if k != 0:
        c = 0.125 * k
        # c has three digits: its product with the upper part of more is exact, and so is the first difference.
        upper = double_of(bits_of(more) & ~15)
        z = ((less - c * upper) - c * (more - upper)) / (more + c * less)
    elif octant == 0 and more != 1.0:
        p, e = two_product(z, more)
        rest = ((less - p) - e) / more
    s = z * z
    a = _ATAN
    ss = s * s
    tail = a[0] + s * a[1] + ss * ((a[2] + s * a[3]) + ss * ((a[4] + s * a[5]) + ss * ((a[6] + s * a[7]) + ss * a[8])))
    tail = z * s * tail + rest
    if octant == 1 or octant == 3:
        z, tail = -z, -tail
    high, low = fast_two_sum(float(_ANGLES[octant, k]), z)
    return high + (low + (float(_ANGLES_LOW[octant, k]) + tail))


@njit(error_model="numpy", allocates=False)
def inverse_tangent_of(y: float, x: float) -> float:
    """The angle of (x, y) from the x axis, −π to π, and so arctan y for x = 1; signs of zeros count as in C's atan2."""
    if not (abs(x) < math.inf and abs(y) < math.inf):
        if x != x or y != y:
            return math.nan
        # Only directions are left.
        if abs(y) < math.inf:
            y = math.copysign(0.0, y)
        elif abs(x) < math.inf:
            x = 0.0
        y = math.copysign(1.0, y) if abs(y) == math.inf else y
        x = math.copysign(1.0, x) if abs(x) == math.inf else x
    across, along = abs(y), abs(x)
    back = math.copysign(1.0, x) < 0.0
    more = max(across, along)
    if across == 0.0:
        return math.copysign(math.pi if back else 0.0, y)
    if more > 1e100 or more < 1e-100:
        exponent = exponent_of(more)
        across, along = scaled(across, -exponent), scaled(along, -exponent)
    if across < 1e-20 * along:
        # What the quotient's rounding and the next term add is below an ulp.
        return y / x if not back else math.copysign(math.pi, y)
    if along < 1e-20 * across:
        return math.copysign(0.5 * math.pi, y)
    less, more = min(across, along), max(across, along)
    octant = (3 if back else 0) if across <= along else (2 if back else 1)
    return math.copysign(_angle(less, more, octant), y)
