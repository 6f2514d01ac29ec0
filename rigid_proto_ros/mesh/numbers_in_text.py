# SPDX-License-Identifier: MIT
"""Decimal numbers in text files, read to the nearest double as Python's float() reads them, at compiled speed."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from ..base.exact_arithmetic import two_product

EXACT = 0
NEEDS_FLOAT = 1
MISSING = 2

# Powers of ten that a double holds exactly: within them one multiplication or division rounds once, hence correctly
# (Clinger, "How to read floating point numbers accurately", 1990).
_POWERS = np.array([10.0**k for k in range(23)])


@njit(cache=True, nogil=True)
def is_blank(c: int) -> bool:
    """Space, tab, carriage return, vertical tab, form feed."""
    return c == 32 or c == 9 or c == 13 or c == 11 or c == 12


@njit(cache=True, nogil=True)
def token_end(buffer: np.ndarray, i: int, end: int) -> int:
    """First position from i on that is blank, a line end, or ``end``."""
    while i < end and not is_blank(buffer[i]) and buffer[i] != 10:
        i += 1
    return i


@njit(cache=True, nogil=True)
def read_number(buffer: np.ndarray, i: int, end: int) -> tuple[float, int, int]:
    """(value, position after the token, status) of the token that starts at i in the bytes ``buffer``.

    Status NEEDS_FLOAT: more digits or a larger exponent than one rounding can handle, or no number at all: the caller
    hands the token's text to float(). MISSING: no token.
    """
    stop = token_end(buffer, i, end)
    if stop == i:
        return 0.0, i, MISSING
    negative = buffer[i] == 45
    if negative or buffer[i] == 43:
        i += 1
    mantissa = 0
    digits = 0
    exponent = 0
    seen = False
    point = False
    while i < stop:
        c = buffer[i]
        if 48 <= c <= 57:
            seen = True
            if mantissa > 0 or c > 48:
                digits += 1
            if digits > 18:
                return 0.0, stop, NEEDS_FLOAT
            mantissa = mantissa * 10 + (c - 48)
            if point:
                exponent -= 1
        elif c == 46 and not point:
            point = True
        else:
            break
        i += 1
    if not seen:
        return 0.0, stop, NEEDS_FLOAT
    if i < stop and (buffer[i] == 101 or buffer[i] == 69):
        i += 1
        sign = 1
        if i < stop and (buffer[i] == 45 or buffer[i] == 43):
            sign = -1 if buffer[i] == 45 else 1
            i += 1
        power = 0
        first = i
        while i < stop and 48 <= buffer[i] <= 57 and power < 10000:
            power = power * 10 + (buffer[i] - 48)
            i += 1
        if i == first:
            return 0.0, stop, NEEDS_FLOAT
        exponent += sign * power
    if i != stop:
        return 0.0, stop, NEEDS_FLOAT
    value = 0.0
    if mantissa != 0:
        if exponent > 22 or exponent < -22:
            return 0.0, stop, NEEDS_FLOAT
        value, certain = _scaled(mantissa, exponent)
        if not certain:
            return 0.0, stop, NEEDS_FLOAT
    return (-value if negative else value), stop, EXACT


@njit(cache=True, nogil=True)
def _scaled(mantissa: int, exponent: int) -> tuple[float, bool]:
    """mantissa (below 10¹⁸) times 10^exponent (−22 to 22), and whether it is certain to be the nearest double.

    Up to 53 bits one operation rounds once. More are an exact pair of doubles, whose product or quotient with the power is a pair
    with an error of 2⁻¹⁰⁰: only a value that lies that near to the middle of two doubles isn't certain.
    """
    power = _POWERS[abs(exponent)]
    high = float(mantissa)
    if mantissa < 9007199254740992:
        return (high / power if exponent < 0 else high * power), True
    low = float(mantissa - np.int64(high))
    if exponent < 0:
        first = high / power
        product, error = two_product(first, power)
        second = ((high - product) - error + low) / power
    else:
        first, error = two_product(high, power)
        second = error + low * power
    value = first + second
    return value, first + second * (1.0 - 2.0**-40) == value == first + second * (1.0 + 2.0**-40)


def float_of(token: bytes) -> float | None:
    """The token as a double, or None when it is no number; nan and inf are numbers here, a verdict refuses them."""
    if b"_" in token:
        return None
    try:
        return float(token)
    except ValueError:
        return None


def line_of(data: bytes, position: int) -> int:
    """1-based number of the line that holds byte ``position``."""
    return data.count(b"\n", 0, position) + 1


@njit(cache=True, nogil=True)
def _numbers(buffer, i, values, slow):
    """Read blank or newline separated numbers from i until ``values`` is full; returns (read, slow tokens, end)."""
    end = buffer.shape[0]
    count = slow_count = 0
    while count < values.shape[0]:
        while i < end and (is_blank(buffer[i]) or buffer[i] == 10):
            i += 1
        first = i
        value, i, status = read_number(buffer, i, end)
        if status == MISSING:
            break
        if status == NEEDS_FLOAT:
            if slow_count == slow.shape[0]:
                grown = np.empty((2 * slow.shape[0], 3), np.int64)
                grown[:slow_count] = slow
                slow = grown
            slow[slow_count, 0] = count
            slow[slow_count, 1] = first
            slow[slow_count, 2] = i
            slow_count += 1
        values[count] = value
        count += 1
    return count, slow[:slow_count], i


def read_numbers(data: bytes, start: int, limit: int) -> tuple[np.ndarray, int | None]:
    """Up to ``limit`` numbers (k,) float64 from byte ``start`` on, and the position of the first token that is none.

    The position is None when all tokens read are numbers; the values from a bad token on are to be ignored.
    """
    values = np.empty(max(0, min(limit, (len(data) - start + 1) // 2)))
    count, slow, _ = _numbers(np.frombuffer(data, np.uint8), start, values, np.empty((1024, 3), np.int64))
    for index, first, stop in slow.tolist():
        value = float_of(data[first:stop])
        if value is None:
            return values[:index], first
        values[index] = value
    return values[:count], None


def excerpt(data: bytes, position: int) -> str:
    """The rest of the line at ``position`` for a message: at most 40 printable characters."""
    text = data[position : position + 40].split(b"\n")[0].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "?" for c in text)
