# SPDX-License-Identifier: MIT
"""a b + c rounded once, for processors that have no such operation: WebAssembly and x86-64 before AVX2. It has the bits
of the operation of IEEE 754 in all cases, subnormal, overflowing and cancelling ones included.

The sum is taken as a whole number of 128 bits, high and low half, times a power of two. What is shifted out of it at
the right is kept as one bit, at its end: that is done only to the lesser of two terms that differ by so much that the
sum keeps more digits than the result has.
"""

from __future__ import annotations

import numpy as np

from ..base.arithmetic import bits_of, double_of
from ..base.compilation import exported, njit

_ZERO, _ONE = np.uint64(0), np.uint64(1)
_HALF_WORD, _LOW_HALF = np.uint64(32), np.uint64(0xFFFFFFFF)
_MANTISSA, _IMPLICIT = np.uint64((1 << 52) - 1), np.uint64(1 << 52)
_INFINITE = 0x7FF << 52
_SIGN = -(1 << 63)
_WORD = np.uint64(64)

Whole = tuple[np.uint64, np.uint64]
"""High and low half of a number of 128 bits."""


@exported("f8", "f8", "f8", returns="f8")
def fused(a: float, b: float, c: float) -> float:
    """a b + c rounded once."""
    product = a * b
    size = abs(product)
    if c == -product and 2.0**-960 < size < 2.0**1000 and abs(a) < 2.0**990 and abs(b) < 2.0**990:
        # What rounding took from the product, as two_product asks (Dekker, Numer. Math. 18, 1971): the halves of a and
        # b have 26 digits, and their products are exact.
        a_high = _upper_half(a)
        b_high = _upper_half(b)
        a_low, b_low = a - a_high, b - b_high
        return (((a_high * b_high - product) + a_high * b_low) + a_low * b_high) + a_low * b_low
    return _fused_in_integers(a, b, c)


@njit(error_model="numpy", allocates=False, forceinline=True)
def _upper_half(x: float) -> float:
    t = 134217729.0 * x
    return t - (t - x)


@njit(error_model="numpy", allocates=False)
def _fused_in_integers(a: float, b: float, c: float) -> float:
    if not (abs(a) < np.inf and abs(b) < np.inf):
        return a * b + c
    if not abs(c) < np.inf:
        return c
    if a == 0.0 or b == 0.0:
        return a * b + c
    if c == 0.0:
        return a * b
    a_whole, a_exponent = _parts(a)
    b_whole, b_exponent = _parts(b)
    c_whole, c_exponent = _parts(c)
    # Both terms with their highest bit at 125 or 126 of 0 to 127.
    high, low = _product(a_whole, b_whole)
    high, low = _shifted_left(high, low, np.uint64(21))
    exponent = a_exponent + b_exponent - 21
    c_high, c_low = c_whole << np.uint64(73 - 64), _ZERO
    c_exponent -= 73
    if exponent < c_exponent:
        high, low = _shifted_right(high, low, c_exponent - exponent)
        exponent = c_exponent
    else:
        c_high, c_low = _shifted_right(c_high, c_low, exponent - c_exponent)
    negative = (bits_of(a) ^ bits_of(b)) < 0
    c_negative = bits_of(c) < 0
    if negative == c_negative:
        low = low + c_low
        high = high + c_high + (_ONE if low < c_low else _ZERO)
    elif high > c_high or (high == c_high and low >= c_low):
        high, low = _difference(high, low, c_high, c_low)
    else:
        high, low = _difference(c_high, c_low, high, low)
        negative = c_negative
    if high == _ZERO and low == _ZERO:
        return 0.0
    bits = _rounded(high, low, exponent)
    result: float = double_of(bits | _SIGN) if negative else double_of(bits)
    return result


@njit(error_model="numpy", allocates=False)
def _parts(x: float) -> tuple[np.uint64, int]:
    """|x| = whole · 2^exponent with a whole number of 53 digits, for finite x ≠ 0."""
    bits = bits_of(x)
    biased = (bits >> 52) & 0x7FF
    whole = np.uint64(bits) & _MANTISSA
    if biased != 0:
        return whole | _IMPLICIT, biased - 1075
    exponent = -1074
    while whole < _IMPLICIT:
        whole = whole << _ONE
        exponent -= 1
    return whole, exponent


@njit(error_model="numpy", allocates=False)
def _product(a: np.uint64, b: np.uint64) -> Whole:
    a_high, a_low = a >> _HALF_WORD, a & _LOW_HALF
    b_high, b_low = b >> _HALF_WORD, b & _LOW_HALF
    low = a_low * b_low
    between = a_high * b_low + (low >> _HALF_WORD)  # a_high has 21 bits: no carry is lost
    more = a_low * b_high + (between & _LOW_HALF)
    high = a_high * b_high + (between >> _HALF_WORD) + (more >> _HALF_WORD)
    return high, (more << _HALF_WORD) | (low & _LOW_HALF)


@njit(error_model="numpy", allocates=False)
def _difference(high: np.uint64, low: np.uint64, less_high: np.uint64, less_low: np.uint64) -> Whole:
    return high - less_high - (_ONE if low < less_low else _ZERO), low - less_low


@njit(error_model="numpy", allocates=False)
def _shifted_left(high: np.uint64, low: np.uint64, by: np.uint64) -> Whole:
    """For 0 < by < 64."""
    return (high << by) | (low >> (_WORD - by)), low << by


@njit(error_model="numpy", allocates=False)
def _shifted_right(high: np.uint64, low: np.uint64, by: int) -> Whole:
    """For by ≥ 0. The last bit is set if any bit was lost."""
    if by >= 128:
        return _ZERO, _ONE
    lost = _ZERO
    if by >= 64:
        lost = low
        high, low = _ZERO, high
        by -= 64
    if by > 0:
        n = np.uint64(by)
        lost = lost | (low << (_WORD - n))
        high, low = high >> n, (low >> n) | (high << (_WORD - n))
    return high, low | (_ONE if lost != _ZERO else _ZERO)


@njit(error_model="numpy", allocates=False)
def _length(high: np.uint64, low: np.uint64) -> int:
    """Number of binary digits."""
    length, word = (64, high) if high != _ZERO else (0, low)
    for step in (32, 16, 8, 4, 2, 1):
        if word >> np.uint64(step) != _ZERO:
            word = word >> np.uint64(step)
            length += step
    return length + 1


@njit(error_model="numpy", allocates=False)
def _rounded(high: np.uint64, low: np.uint64, exponent: int) -> int:
    """Bits of the double nearest to the whole number · 2^exponent, of two equally near the even one."""
    subnormal = -1074 - exponent
    cut = max(_length(high, low) - 53, subnormal)
    if cut - subnormal > 2046:
        return _INFINITE
    if cut <= 0:
        kept = low << np.uint64(-cut)
    else:
        # With two digits more: the next one, and whether any other follows.
        if cut == 1:
            low = low << _ONE
        else:
            high, low = _shifted_right(high, low, cut - 2)
        rest = low & np.uint64(3)
        kept = low >> np.uint64(2)
        if rest == np.uint64(3) or (rest == np.uint64(2) and kept & _ONE != _ZERO):
            kept = kept + _ONE
    # A normal number's first digit, which isn't stored, adds one to the exponent; so does one that rounding carries.
    return min(((cut - subnormal) << 52) + int(kept), _INFINITE)
