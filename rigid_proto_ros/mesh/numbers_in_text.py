# SPDX-License-Identifier: MIT
"""What the readers of text files share: blanks, tokens, and decimal numbers read to the nearest double, as Python's
float() reads them, at compiled speed."""

from __future__ import annotations

import numpy as np

from ..base.compilation import njit
from ..base.errors import MeshError
from ..base.exact_arithmetic import two_product

EXACT = 0
NEEDS_FLOAT = 1
MISSING = 2

MAX_DIGITS = 18
"""Significant digits of a number that an int64 holds; more are left to float()."""

# Powers of ten that a double holds exactly: within them one multiplication or division rounds once, hence correctly
# (Clinger, "How to read floating point numbers accurately", 1990).
_POWERS = np.array([float(10**k) for k in range(23)])


@njit(cache=True, nogil=True)
def is_blank(c: int) -> bool:
    """Space, tab, carriage return, vertical tab, form feed."""
    return c == 32 or c == 9 or c == 13 or c == 11 or c == 12


@njit(cache=True, nogil=True)
def skip_blanks(buffer: np.ndarray, i: int, across_lines: bool) -> int:
    """First position from i on that isn't blank; with ``across_lines`` line ends are blanks, too."""
    while i < buffer.shape[0] and (is_blank(buffer[i]) or (across_lines and buffer[i] == 10)):
        i += 1
    return i


@njit(cache=True, nogil=True)
def line_end(buffer: np.ndarray, i: int) -> int:
    """Position of the next newline from i on, or the end of the buffer."""
    while i < buffer.shape[0] and buffer[i] != 10:
        i += 1
    return i


@njit(cache=True, nogil=True)
def token_end(buffer: np.ndarray, i: int) -> int:
    """First position from i on that is blank or a newline, or the end of the buffer."""
    while i < buffer.shape[0] and not is_blank(buffer[i]) and buffer[i] != 10:
        i += 1
    return i


@njit(cache=True, nogil=True)
def _digits(buffer: np.ndarray, i: int, stop: int) -> tuple[int | np.int64, int, int, int]:
    """(digits as an integer, exponent that the decimal point asks for, count of digits, position after them).

    A count above MAX_DIGITS, leading zeros apart, says that the integer isn't complete; −1 that there is no digit.
    """
    mantissa = exponent = digits = 0
    seen = point = False
    while i < stop:
        c = buffer[i]
        if 48 <= c <= 57:
            seen = True
            if mantissa > 0 or c > 48:
                digits += 1
            if digits > MAX_DIGITS:
                break
            mantissa = mantissa * 10 + (np.int64(c) - 48)
            if point:
                exponent -= 1
        elif c == 46 and not point:
            point = True
        else:
            break
        i += 1
    return mantissa, exponent, digits if seen else -1, i


@njit(cache=True, nogil=True)
def _exponent(buffer: np.ndarray, i: int, stop: int) -> tuple[int, int]:
    """(the number after an e or E at i, position after it); the position is i when there is none."""
    if i >= stop or (buffer[i] != 101 and buffer[i] != 69):
        return 0, i
    k = i + 1
    sign = 1
    if k < stop and (buffer[k] == 45 or buffer[k] == 43):
        sign = -1 if buffer[k] == 45 else 1
        k += 1
    power = 0
    first = k
    while k < stop and 48 <= buffer[k] <= 57 and power < 10000:
        power = power * 10 + (buffer[k] - 48)
        k += 1
    return sign * power, i if k == first else k


@njit(cache=True, nogil=True)
def read_number(buffer: np.ndarray, i: int) -> tuple[float, int, int]:
    """(value, position after the token, status) of the token that starts at i in the bytes ``buffer``.

    Status NEEDS_FLOAT: more digits or a larger exponent than one rounding can handle, or no number at all: the caller
    hands the token's text to float(). MISSING: no token.
    """
    stop = token_end(buffer, i)
    if stop == i:
        return 0.0, i, MISSING
    negative = buffer[i] == 45
    if negative or buffer[i] == 43:
        i += 1
    mantissa, exponent, digits, i = _digits(buffer, i, stop)
    if digits < 0 or digits > MAX_DIGITS:
        return 0.0, stop, NEEDS_FLOAT
    power, i = _exponent(buffer, i, stop)
    exponent += power
    if i != stop or (mantissa != 0 and (exponent > 22 or exponent < -22)):
        return 0.0, stop, NEEDS_FLOAT
    value = 0.0
    if mantissa != 0:
        value, certain = _scaled(mantissa, exponent)
        if not certain:
            return 0.0, stop, NEEDS_FLOAT
    return (-value if negative else value), stop, EXACT


@njit(cache=True, nogil=True)
def _scaled(mantissa: int | np.int64, exponent: int) -> tuple[float, bool]:
    """mantissa (below 10¹⁸) times 10^exponent (−22 to 22), and whether it is certain to be the nearest double.

    Up to 53 bits one operation rounds once. More are an exact pair of doubles, whose product or quotient with the power
    is a pair good to about 2⁻¹⁰⁰: where a change of 2⁻⁴⁰ in its low part doesn't change the sum, that sum is certain.
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


@njit(cache=True, nogil=True)
def read_point(
    buffer: np.ndarray, i: int, points: np.ndarray, row: int, slow: np.ndarray, slow_count: int, across_lines: bool
) -> tuple[int, int, bool]:
    """Three numbers from i on as row ``row`` of points (n, 3), C-contiguous.

    Those left to float() are noted in slow (k, 3) as flat index, token start, token end, for ``finish_numbers``.
    Returns (position after, numbers noted, whether there were three tokens).
    """
    for k in range(3):
        i = skip_blanks(buffer, i, across_lines)
        first = i
        value, i, status = read_number(buffer, i)
        if status == MISSING:
            return i, slow_count, False
        if status == NEEDS_FLOAT:
            slow[slow_count, 0], slow[slow_count, 1], slow[slow_count, 2] = 3 * row + k, first, i
            slow_count += 1
        else:
            points[row, k] = value
    return i, slow_count, True


def finish_numbers(points: np.ndarray, slow: np.ndarray, data: bytes, name: str, accepted: str) -> None:
    """Read by float() into points (n, 3) what ``read_point`` noted in slow (k, 3); raises MeshError naming the line."""
    flat = points.reshape(-1)
    for index, first, stop in slow.tolist():
        value = float_of(data[first:stop])
        if value is None:
            raise error_at(data, first, name, accepted)
        flat[index] = value


def float_of(token: bytes) -> float | None:
    """The token as a double, or None when it is no number; nan and inf are numbers here, a verdict refuses them."""
    if b"_" in token:
        return None
    try:
        return float(token)
    except ValueError:
        return None


@njit(cache=True, nogil=True)
def _numbers(buffer: np.ndarray, i: int, values: np.ndarray, slow: np.ndarray) -> tuple[int, np.ndarray, int]:
    """Read blank or newline separated numbers from i until ``values`` is full; returns (read, slow tokens, end)."""
    count = slow_count = 0
    while count < values.shape[0]:
        i = skip_blanks(buffer, i, True)
        first = i
        value, i, status = read_number(buffer, i)
        if status == MISSING:
            break
        if status == NEEDS_FLOAT:
            if slow_count == slow.shape[0]:
                grown = np.empty((2 * slow.shape[0], 3), np.int64)
                grown[:slow_count] = slow
                slow = grown
            slow[slow_count, 0], slow[slow_count, 1], slow[slow_count, 2] = count, first, i
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


def error_at(data: bytes, position: int, name: str, accepted: str) -> MeshError:
    """The refusal of what stands at byte ``position``: file, line, the text there, and what is accepted."""
    line = data.count(b"\n", 0, position) + 1
    return MeshError(f"{name} line {line}", excerpt(data, position), accepted)


def excerpt(data: bytes, position: int) -> str:
    """The rest of the line at ``position`` for a message: at most 40 printable characters."""
    text = data[position : position + 40].split(b"\n")[0].decode("ascii", "replace").strip()
    return "".join(c if c.isprintable() else "?" for c in text)
