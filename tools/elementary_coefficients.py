# SPDX-License-Identifier: MIT
"""Writes the constants of base/arithmetic.py: minimax polynomials by Remez's exchange, and π, log 2 and atan in parts.

``python tools/elementary_coefficients.py`` prints them; mpmath computes with 60 digits. A polynomial's error is measured
relative to the whole function that it completes, after its coefficients have been rounded to doubles.
"""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp

mp.mp.dps = 60
Function = Callable[[mp.mpf], mp.mpf]

LIMB = 28
"""Bits a limb of 2/π holds: two products of limbs add up within 64 bits."""
ZERO_LIMBS, LIMBS = 2, 45
"""In front, for arguments whose last bit lies below the point; and in all, for the largest double."""


def remez(f: Function, weight: Function, begin: float, end: float, count: int) -> list[mp.mpf]:
    """Coefficients, constant first, of the polynomial with the least largest weight·|p − f| on [begin, end]."""
    a, b = mp.mpf(begin), mp.mpf(end)
    points = [(a + b) / 2 - (b - a) / 2 * mp.cos(mp.pi * k / count) for k in range(count + 1)]
    grid = [a + (b - a) * (1 - mp.cos(mp.pi * k / 800)) / 2 for k in range(801)]
    coefficients: list[mp.mpf] = []
    for _ in range(12):
        rows = mp.matrix(count + 1, count + 1)
        right = mp.matrix(count + 1, 1)
        for i, x in enumerate(points):
            for j in range(count):
                rows[i, j] = x**j
            rows[i, count] = (-1) ** i / weight(x)
            right[i] = f(x)
        solution = mp.lu_solve(rows, right)
        coefficients = [solution[j] for j in range(count)]
        errors = [weight(x) * (mp.polyval(coefficients[::-1], x) - f(x)) for x in grid]
        chosen: list[int] = []
        for k, error in enumerate(errors):
            if chosen and mp.sign(errors[chosen[-1]]) == mp.sign(error):
                if abs(error) > abs(errors[chosen[-1]]):
                    chosen[-1] = k
            else:
                chosen.append(k)
        while len(chosen) > count + 1:
            chosen.pop(0 if abs(errors[chosen[0]]) < abs(errors[chosen[-1]]) else -1)
        if len(chosen) < count + 1:
            break
        points = [grid[k] for k in chosen]
    return coefficients


def show(name: str, f: Function, weight: Function, end: float, count: int, begin: float = 0.0) -> None:
    """Print a polynomial's coefficients and the largest error that they leave."""
    c = [float(x) for x in remez(f, weight, begin, end, count)]
    grid = [begin + (mp.mpf(end) - begin) * k / 1000 for k in range(1, 1000)]
    worst = max(abs(weight(x) * (mp.polyval([mp.mpf(v) for v in c[::-1]], x) - f(x))) for x in grid if x != 0)
    print(f"# Relative error 2^{float(mp.log(worst, 2)):.1f}.")
    print(f"{name} = (", *(f"    {v!r}," for v in c), ")", sep="\n")


def truncated(value: mp.mpf, bits: int) -> float:
    """The value cut to so many significant bits."""
    _, exponent = mp.frexp(value)
    return float(mp.floor(mp.ldexp(value, bits - exponent)) * mp.mpf(2) ** (exponent - bits))


def main() -> None:
    """Print them all."""
    quarter = float(mp.pi / 4) * 1.0001
    show(
        "_SIN",
        lambda z: (mp.sin(mp.sqrt(z)) / mp.sqrt(z) - 1) / z if z else mp.mpf(-1) / 6,
        lambda z: z * mp.sqrt(z) / mp.sin(mp.sqrt(z)) if z else mp.mpf(1) / 10**30,
        quarter**2,
        6,
    )
    show(
        "_COS",
        lambda z: (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2 if z else mp.mpf(1) / 24,
        lambda z: z**2 / mp.cos(mp.sqrt(z)) if z else mp.mpf(1) / 10**30,
        quarter**2,
        6,
    )
    half = float(mp.log(2) / 2) * 1.0001
    show(
        "_EXP",
        lambda r: sum(r**k / mp.factorial(k + 3) for k in range(40)),
        lambda r: max(abs(r), mp.mpf("0.02")) ** 3,
        half,
        10,
        -half,
    )
    show(
        "_ATANH",
        lambda z: (mp.atanh(mp.sqrt(z)) / mp.sqrt(z) - 1) / z if z else mp.mpf(1) / 3,
        lambda z: z if z else mp.mpf(1) / 10**30,
        0.1717**2,
        7,
    )
    show(
        "_ATAN",
        lambda z: (mp.atan(mp.sqrt(z)) / mp.sqrt(z) - 1) / z if z else mp.mpf(-1) / 3,
        lambda z: z if z else mp.mpf(1) / 10**30,
        0.1876**2,
        9,
    )
    for name, value, bits in (("_LN2", mp.log(2), (42, 53)), ("_HALF_PI", mp.pi / 2, (33, 33, 53))):
        rest = value
        for number, width in enumerate(bits, 1):
            part = truncated(rest, width) if number < len(bits) else float(rest)
            print(f"{name}_{number} = {part!r}")
            rest -= part
    for name, value in (("_PAIR_HALF_PI", mp.pi / 2),):
        print(f"{name} = ({float(value)!r}, {float(value - float(value))!r})")
    base = [mp.mpf(0), mp.pi / 2, mp.pi / 2, mp.pi]
    sign = [1, -1, 1, -1]
    table = [base[o] + sign[o] * mp.atan(mp.mpf(k) / 8) for o in range(4) for k in range(9)]
    print("_ANGLES = (", *(f"    {float(v)!r}," for v in table), ")", sep="\n")
    print("_ANGLES_LOW = (", *(f"    {float(v - float(v))!r}," for v in table), ")", sep="\n")
    mp.mp.dps = 450
    bits = int(mp.floor(2 / mp.pi * mp.mpf(2) ** (LIMB * (LIMBS - ZERO_LIMBS))))
    limbs = [(bits >> (LIMB * (LIMBS - 1 - k))) & ((1 << LIMB) - 1) for k in range(LIMBS)]
    print("_TWO_OVER_PI_LIMBS = (", *(f"    {limb:#09x}," for limb in limbs), ")", sep="\n")


if __name__ == "__main__":
    main()
