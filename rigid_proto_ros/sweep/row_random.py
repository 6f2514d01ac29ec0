# SPDX-License-Identifier: MIT
"""Random numbers that belong to a row: the same whatever rows are drawn beside it, in which order and by whom.

They come from a generator with a counter (Philox; Salmon, Moraes, Dror and Shaw, SC 2011), which is set to the row's
own place in the sequence.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import uint64

from ..base.compilation import njit
from ..base.elementary import exponential_of, logarithm, sine_cosine

_WORDS = 4
"""Of 64 bits that the generator gives a count."""


def row_uniforms(seed: int, rows: np.ndarray, dimensions: int) -> np.ndarray:
    """The first uniform numbers in [0, 1) of each row (n,): (n, dimensions)."""
    key = np.random.SeedSequence(seed).generate_state(2, np.uint64)
    counts = -(-dimensions // _WORDS)
    out = np.empty((len(rows), dimensions))
    # Runs of consecutive rows are drawn at once.
    for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) != 1) + 1):
        if len(part):
            generator = np.random.Philox(key=key, counter=int(rows[part[0]]) * counts)
            words = generator.random_raw(len(part) * counts * _WORDS).reshape(len(part), -1)
            out[part] = (words[:, :dimensions] >> uint64(11)) * 2.0**-53
    return out


@njit(cache=True)
def _scrambled(value: uint64, key: uint64) -> uint64:
    """A 64-bit hash of value and key (SplitMix64's finalizer; Steele, Lea and Flood, OOPSLA 2014)."""
    x = value + key * uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> uint64(27))) * uint64(0x94D049BB133111EB)
    return x ^ (x >> uint64(31))


@njit(cache=True)
def permuted(index: int, size: int, key: uint64) -> uint64:
    """Where a random permutation of 0 … size − 1 takes ``index``: six Feistel rounds on the next power of four,
    repeated until within size (Black and Rogaway, CT-RSA 2002, "cycle walking"). No table, so any size costs the same.
    """
    half = uint64(1)
    while (uint64(1) << (uint64(2) * half)) < uint64(size):
        half += uint64(1)
    mask = (uint64(1) << half) - uint64(1)
    x = uint64(index)
    while True:
        left, right = x >> half, x & mask
        for r in range(6):
            left, right = right, left ^ (_scrambled(right, key + uint64(r) * uint64(0xD1342543DE82EF95)) & mask)
        x = (left << half) | right
        if x < uint64(size):
            return x


@njit(cache=True)
def latin_uniforms(keys: np.ndarray, rows: np.ndarray, size: int, jitter: np.ndarray, out: np.ndarray) -> None:
    """Fill out (n, k) with rows (n,) of a Latin hypercube of ``size`` points: (π_k(i) + u)/size. keys (k,) choose the
    permutations; jitter (n, k) are the u.
    """
    for i in range(rows.size):
        for k in range(out.shape[1]):
            out[i, k] = (float(permuted(rows[i], size, keys[k])) + jitter[i, k]) / size


@njit(cache=True, error_model="numpy")
def _tail(r: float, c: tuple[float, ...], d: tuple[float, ...]) -> float:
    return (((((((c[7] * r + c[6]) * r + c[5]) * r + c[4]) * r + c[3]) * r + c[2]) * r + c[1]) * r + c[0]) / (
        ((((((d[6] * r + d[5]) * r + d[4]) * r + d[3]) * r + d[2]) * r + d[1]) * r + d[0]) * r + 1.0
    )


# Wichura, Algorithm AS 241, Applied Statistics 37 (1988) 477, PPND16: about 1 part in 10¹⁶.
_A = (
    3.3871328727963666080,
    1.3314166789178437745e2,
    1.9715909503065514427e3,
    1.3731693765509461125e4,
    4.5921953931549871457e4,
    6.7265770927008700853e4,
    3.3430575583588128105e4,
    2.5090809287301226727e3,
)
_B = (
    4.2313330701600911252e1,
    6.8718700749205790830e2,
    5.3941960214247511077e3,
    2.1213794301586595867e4,
    3.9307895800092710610e4,
    2.8729085735721942674e4,
    5.2264952788528545610e3,
)
_C = (
    1.42343711074968357734,
    4.63033784615654529590,
    5.76949722146069140550,
    3.64784832476320460504,
    1.27045825245236838258,
    2.41780725177450611770e-1,
    2.27238449892691845833e-2,
    7.74545014278341407640e-4,
)
_D = (
    2.05319162663775882187,
    1.67638483018380384940,
    6.89767334985100004550e-1,
    1.48103976427480074590e-1,
    1.51986665636164571966e-2,
    5.47593808499534494600e-4,
    1.05075007164441684324e-9,
)
_E = (
    6.65790464350110377720,
    5.46378491116411436990,
    1.78482653991729133580,
    2.96560571828504891230e-1,
    2.65321895265761230930e-2,
    1.24266094738807843860e-3,
    2.71155556874348757815e-5,
    2.01033439929228813265e-7,
)
_F = (
    5.99832206555887937690e-1,
    1.36929880922735805310e-1,
    1.48753612908506148525e-2,
    7.86869131145613259100e-4,
    1.84631831751005468180e-5,
    1.42151175831644588870e-7,
    2.04426310338993978564e-15,
)


@njit(cache=True, error_model="numpy")
def normal_quantile(u: float) -> float:
    """x with Φ(x) = u, 0 < u < 1."""
    q = u - 0.5
    if abs(q) <= 0.425:
        return q * _tail(0.180625 - q * q, _A, _B)
    r = math.sqrt(-logarithm(min(u, 1.0 - u)))
    x = _tail(r - 1.6, _C, _D) if r <= 5.0 else _tail(r - 5.0, _E, _F)
    return x if q > 0.0 else -x


UNIFORM, LOG_UNIFORM, NORMAL, ROTATION, DIRECTION = range(5)
UNIFORMS = {UNIFORM: 1, LOG_UNIFORM: 1, NORMAL: 1, ROTATION: 3, DIRECTION: 2}
"""How many uniform numbers a draw takes."""
NUMBERS = {UNIFORM: 1, LOG_UNIFORM: 1, NORMAL: 1, ROTATION: 4, DIRECTION: 3}
"""How many numbers it gives."""


@njit(cache=True, error_model="numpy")
def shape_uniforms(kind: int, a: float, b: float, u: np.ndarray, out: np.ndarray) -> None:
    """Fill out (n, NUMBERS) from uniforms u (n, UNIFORMS): between a and b, mean a and deviation b, or a direction of
    length a.

    A rotation is uniform over the group (Shoemake, Graphics Gems III, 1992), a direction over the sphere.
    """
    for i in range(out.shape[0]):
        if kind == UNIFORM:
            out[i, 0] = a + (b - a) * u[i, 0]
        elif kind == LOG_UNIFORM:
            out[i, 0] = exponential_of(logarithm(a) + (logarithm(b) - logarithm(a)) * u[i, 0])
        elif kind == NORMAL:
            out[i, 0] = a + b * normal_quantile(min(max(u[i, 0], 2.0**-54), 1.0 - 2.0**-53))
        elif kind == ROTATION:
            near, far = math.sqrt(1.0 - u[i, 0]), math.sqrt(u[i, 0])
            sine, cosine = sine_cosine(2.0 * math.pi * u[i, 1])
            out[i, 0], out[i, 1] = near * sine, near * cosine
            sine, cosine = sine_cosine(2.0 * math.pi * u[i, 2])
            out[i, 2], out[i, 3] = far * sine, far * cosine
        else:
            z = 2.0 * u[i, 0] - 1.0
            sine, cosine = sine_cosine(2.0 * math.pi * u[i, 1])
            across = math.sqrt(max(1.0 - z * z, 0.0))
            out[i, 0], out[i, 1], out[i, 2] = a * across * cosine, a * across * sine, a * z
