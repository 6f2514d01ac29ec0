# SPDX-License-Identifier: MIT
"""How a varied value is chosen: from a grid or a list, or drawn at random.

A row's random numbers are its own: the same whatever rows are drawn beside it, in which order and by whom. They come
from a generator with a counter (Philox; Salmon, Moraes, Dror and Shaw, SC 2011), which is set to the row's own place in
the sequence.
"""

from __future__ import annotations

import json
import math
import threading
import warnings
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import lru_cache
from typing import Any

import numpy as np
from numpy import uint64
from numpy.typing import NDArray

from ..base.compilation import njit
from ..base.elementary import exponential_of, logarithm, sine_cosine
from ..base.errors import InputError, is_missing
from .fields import mapping, number, whole

MAX_POINTS = 1_000_000
"""Points of one grid or list."""
SAMPLERS = ("random", "latin_hypercube", "sobol")
MAX_SOBOL = 1 << 30
"""Points that scipy's Sobol sequence has at 30 bits."""

_WORDS = 4
"""Of 64 bits that the generator gives a count."""

GRID, LIST = "grid", "list"
DRAWS = ("uniform", "log_uniform", "normal", "random_rotation", "direction", "random_vertex")
_UNIFORM, _LOG_UNIFORM, _NORMAL, _ROTATION, _DIRECTION, VERTEX = range(6)
"""The same by number. VERTEX: a vertex of the row's mesh, each as likely, known only with the mesh."""
_ACCEPTED = (
    "grid: [...] or {from, to, count, log}, list: [...], uniform: [a, b], log_uniform: [a, b], "
    "normal: [mean, deviation], direction: length, random_rotation, or random_vertex"
)


@dataclass(frozen=True)
class Points:
    """Given values. kind: ``grid`` (every combination with other grids) or ``list`` (in step with other lists)."""

    kind: str
    values: tuple[Any, ...]

    @property
    def probes(self) -> list[Any]:
        """Values that stand for all, for a check before the start."""
        every = max(1, len(self.values) // 1000)
        return [*self.values[::every], self.values[-1]]

    def taken(self, indices: NDArray[np.int64]) -> NDArray[Any]:
        """The values at these indices (n,): numbers as float64 (n,) or (n, k), the rest as objects (n,)."""
        rows = [value if isinstance(value, list) else [value] for value in self.values]
        alike = len({(type(value) is list, len(row)) for value, row in zip(self.values, rows, strict=True)}) == 1
        if alike and all(isinstance(x, (int, float)) and not isinstance(x, bool) for row in rows for x in row):
            return np.take(np.array(self.values, dtype=float), indices, axis=0)
        objects = np.empty(len(self.values), dtype=object)
        objects[:] = [tuple(v) if isinstance(v, list) else v for v in self.values]
        return np.take(objects, indices)


@dataclass(frozen=True)
class Draw:
    """A random value: between ``a`` and ``b``, of mean a and deviation b, or a direction of length a."""

    shape: int
    a: float = 0.0
    b: float = 1.0
    kind: str = "random"

    @property
    def uniforms(self) -> int:
        """How many uniform numbers a draw takes."""
        return {_ROTATION: 3, _DIRECTION: 2}.get(self.shape, 1)

    @property
    def probes(self) -> list[Any]:
        """Values that stand for all."""
        special: dict[int, list[Any]] = {
            _NORMAL: [self.a],
            _ROTATION: [[0.0, 0.0, 0.0, 1.0]],
            _DIRECTION: [[self.a, 0.0, 0.0]],
            VERTEX: [{"vertex": 0}],
        }
        return special.get(self.shape, [self.a, self.b])

    def shaped(self, uniforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (n,) or (n, k) from uniform numbers (n, ``uniforms``); those themselves for a vertex."""
        out = np.empty((len(uniforms), {_ROTATION: 4, _DIRECTION: 3}.get(self.shape, 1)))
        _shape(self.shape, self.a, self.b, np.ascontiguousarray(uniforms), out)
        return out[:, 0] if out.shape[1] == 1 else out


def read_form(spec: Any, field: str) -> Points | Draw:
    """The form that a study gives; raises InputError naming the field."""
    if spec in ("random_rotation", "random_vertex"):
        spec = {spec: None}
    if not isinstance(spec, dict) or len(spec) != 1:
        raise InputError(field, spec, _ACCEPTED)
    spec = mapping(spec, field, (GRID, LIST, *DRAWS))
    ((kind, value),) = spec.items()
    field = f"{field}.{kind}"
    if kind in (GRID, LIST):
        return Points(kind, tuple(_points(value, field)))
    shape = DRAWS.index(kind)
    if shape in (_ROTATION, VERTEX):
        return Draw(shape)
    if shape == _DIRECTION:
        return Draw(shape, number(value, field, above=0.0))
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(field, value, "two numbers [a, b]")
    a, b = (number(x, field) for x in value)
    if shape == _NORMAL:
        number(b, f"{field}, deviation", above=0.0)
    elif shape == _LOG_UNIFORM and not 0.0 < a < b:
        raise InputError(field, value, "two numbers 0 < a < b")
    elif not a < b:
        raise InputError(field, value, "a range [a, b] with a < b")
    return Draw(shape, a, b)


def _points(value: Any, field: str) -> list[Any]:
    if isinstance(value, dict):
        spec = mapping(value, field, ("from", "to", "count", "log"), ("from", "to", "count"))
        a, b = number(spec["from"], f"{field}, from"), number(spec["to"], f"{field}, to")
        count = whole(spec["count"], f"{field}, count", 2, MAX_POINTS)
        if a == b:
            raise InputError(field, [a, b], "a range whose ends differ")
        if spec.get("log", False) is True:
            if not (a > 0.0 and b > 0.0):
                raise InputError(field, [a, b], "ends above 0 on a logarithmic grid")
            return _geometric(a, b, count)
        return [float(x) for x in np.linspace(a, b, count)]
    if not isinstance(value, list) or not 0 < len(value) <= MAX_POINTS:
        raise InputError(field, value, f"a list of 1 to {MAX_POINTS} values, or {{from, to, count}}")
    for k, item in enumerate(value, 1):
        try:
            json.dumps(item, allow_nan=False, default=str)
        except ValueError:
            raise InputError(f"{field}, value {k}", item, "finite numbers") from None
    return value


def _geometric(a: float, b: float, count: int) -> list[float]:
    """From a to b in equal ratios, each rounded once from 40 digits: the C library's powers differ in their last."""
    with localcontext() as context:
        context.prec = 40
        ratio = (Decimal(b) / Decimal(a)) ** (1 / Decimal(count - 1))
        value, inner = Decimal(a), []
        for _ in range(count - 2):
            value *= ratio
            inner.append(float(value))
    return [a, *inner, b]


def as_text(value: Any) -> str:
    """A value that isn't a number as a table holds it."""
    return value if isinstance(value, str) else json.dumps(value)


# Uniform numbers


def uniforms(sampler: str, seed: int, rows: np.ndarray, samples: int, dimensions: int) -> np.ndarray:
    """Uniform numbers (n, dimensions) in [0, 1) of rows (n,); each run of ``samples`` rows is one design.

    ``random``: the row's own numbers (``row_uniforms``). ``latin_hypercube``: one number in each of ``samples``
    strata per dimension; where in it, by the row's own numbers. ``sobol``: scrambled by the seed (scipy.stats.qmc).
    """
    if sampler == "sobol":
        return _sobol(seed, dimensions).points(rows % samples)
    own = row_uniforms(seed, rows, dimensions)
    if sampler == "random":
        return own
    out = np.empty_like(own)
    keys = np.random.SeedSequence(seed).generate_state(dimensions, np.uint64)
    _latin_uniforms(keys, rows % samples, samples, own, out)
    return out


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
def _latin_uniforms(keys: np.ndarray, rows: np.ndarray, size: int, jitter: np.ndarray, out: np.ndarray) -> None:
    """Fill out (n, k) with rows (n,) of a Latin hypercube of ``size`` points: (π_k(i) + u)/size. keys (k,) choose the
    permutations; jitter (n, k) are the u.
    """
    for i in range(rows.size):
        for k in range(out.shape[1]):
            out[i, k] = (float(permuted(rows[i], size, keys[k])) + jitter[i, k]) / size


class _Sobol:
    """Points of the sequence by number. It goes forward from where it stands, so that chunk after chunk
    costs no more.
    """

    def __init__(self, seed: int, dimensions: int) -> None:
        try:
            from scipy.stats import qmc
        except ImportError:
            raise InputError("sampler", f"sobol: {is_missing('scipy', 'sweep')}") from None
        self._engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(np.random.SeedSequence(seed)))
        self._lock = threading.Lock()

    def points(self, numbers: np.ndarray) -> np.ndarray:
        """Points (n, d) of these numbers."""
        out = np.empty((len(numbers), self._engine.d))
        # Runs of consecutive numbers are drawn at once.
        cuts = np.flatnonzero(np.diff(numbers) != 1) + 1
        with self._lock, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a balance that only powers of two have
            for part in np.split(np.arange(len(numbers)), cuts):
                if len(part) == 0:
                    continue
                first = int(numbers[part[0]])
                if self._engine.num_generated > first:
                    self._engine.reset()
                if first > self._engine.num_generated:
                    self._engine.fast_forward(first - self._engine.num_generated)
                out[part] = self._engine.random(len(part))
        return out


@lru_cache(maxsize=4)
def _sobol(seed: int, dimensions: int) -> _Sobol:
    return _Sobol(seed, dimensions)


# From uniform numbers to others

# Numerators and denominators of a quantile near the middle, in a tail and far out, from the constant term on: Wichura,
# Algorithm AS 241, Applied Statistics 37 (1988) 477, PPND16: about 1 part in 10¹⁶.
# fmt: off
_PPND16 = np.array([
    [3.3871328727963666080, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3],
    [1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
     2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3],
    [1.42343711074968357734, 4.63033784615654529590, 5.76949722146069140550, 3.64784832476320460504,
     1.27045825245236838258, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4],
    [1.0, 2.05319162663775882187, 1.67638483018380384940, 6.89767334985100004550e-1,
     1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9],
    [6.65790464350110377720, 5.46378491116411436990, 1.78482653991729133580, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7],
    [1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
     7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15],
])
# fmt: on


@njit(cache=True, error_model="numpy")
def _ratio(part: int, r: float) -> float:
    above, below = _PPND16[2 * part, 7], _PPND16[2 * part + 1, 7]
    for k in range(6, -1, -1):
        above = above * r + _PPND16[2 * part, k]
        below = below * r + _PPND16[2 * part + 1, k]
    return float(above / below)


@njit(cache=True, error_model="numpy")
def normal_quantile(u: float) -> float:
    """x with Φ(x) = u, 0 < u < 1."""
    q = u - 0.5
    if abs(q) <= 0.425:
        return q * _ratio(0, 0.180625 - q * q)
    r = math.sqrt(-logarithm(min(u, 1.0 - u)))
    x = _ratio(1, r - 1.6) if r <= 5.0 else _ratio(2, r - 5.0)
    return x if q > 0.0 else -x


@njit(cache=True, error_model="numpy")
def _shape(kind: int, a: float, b: float, u: np.ndarray, out: np.ndarray) -> None:
    """Fill out (n, k) from uniforms u (n, j), as ``Draw`` has them.

    A rotation is uniform over the group (Shoemake, Graphics Gems III, 1992), a direction over the sphere.
    """
    for i in range(out.shape[0]):
        if kind in (_UNIFORM, VERTEX):
            out[i, 0] = a + (b - a) * u[i, 0]
        elif kind == _LOG_UNIFORM:
            out[i, 0] = exponential_of(logarithm(a) + (logarithm(b) - logarithm(a)) * u[i, 0])
        elif kind == _NORMAL:
            out[i, 0] = a + b * normal_quantile(min(max(u[i, 0], 2.0**-54), 1.0 - 2.0**-53))
        elif kind == _ROTATION:
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
