# SPDX-License-Identifier: MIT
"""How a varied value is chosen: from a grid or a list, or drawn at random.

A row's random numbers are its own: the same whatever rows are drawn beside it, in which order and by whom. They come
from a generator with a counter (Philox; Salmon, Moraes, Dror and Shaw, SC 2011), which is set to the row's own place in
the sequence.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arithmetic import exponential_of, logarithm, sine_cosine
from ..base.compilation import exported
from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray
from .fields import mapping, number, whole

MAX_POINTS = 1_000_000
"""Values of one grid or list."""

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
class Levels:
    """Given values. kind: ``grid`` (every combination with other grids) or ``list`` (in step with other lists)."""

    kind: str
    values: tuple[Any, ...]

    @property
    def probes(self) -> list[Any]:
        """Values that stand for all, for a check before the start."""
        every = max(1, len(self.values) // 1000)
        return [*self.values[::every], self.values[-1]]

    @cached_property
    def array(self) -> NDArray[Any]:
        """The values: numbers as float64 (n,) or (n, k), the rest as objects (n,). There may be a million."""
        rows = [value if isinstance(value, list) else [value] for value in self.values]
        alike = len({(type(value) is list, len(row)) for value, row in zip(self.values, rows, strict=True)}) == 1
        if alike and all(isinstance(x, (int, float)) and not isinstance(x, bool) for row in rows for x in row):
            return np.array(self.values, dtype=float)
        objects = np.empty(len(self.values), dtype=object)
        objects[:] = [tuple(v) if isinstance(v, list) else v for v in self.values]
        return objects


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
        return {_ROTATION: 3, _DIRECTION: 2, _NORMAL: 2}.get(self.shape, 1)

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

    def shaped(self, uniforms: FloatArray) -> FloatArray:
        """Values (n,) or (n, k) from uniform numbers (n, ``uniforms``); those themselves for a vertex."""
        out = np.empty((len(uniforms), {_ROTATION: 4, _DIRECTION: 3}.get(self.shape, 1)))
        shape_draws(self.shape, self.a, self.b, np.ascontiguousarray(uniforms), out)
        return out[:, 0] if out.shape[1] == 1 else out


def read_form(spec: Any, field: str) -> Levels | Draw:
    """The form that a study gives; raises InputError naming the field."""
    if spec in ("random_rotation", "random_vertex"):
        spec = {spec: None}
    if not isinstance(spec, dict) or len(spec) != 1:
        raise InputError(field, spec, _ACCEPTED)
    spec = mapping(spec, field, (GRID, LIST, *DRAWS))
    ((kind, value),) = spec.items()
    field = f"{field}.{kind}"
    if kind in (GRID, LIST):
        return Levels(kind, tuple(_points(value, field)))
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
        log = spec.get("log", False)
        if not isinstance(log, bool):
            raise InputError(f"{field}, log", log, "true or false")
        if a == b:
            raise InputError(field, [a, b], "a range whose ends differ")
        if log:
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


def row_uniforms(seed: int, rows: IntArray, dimensions: int) -> FloatArray:
    """The first uniform numbers in [0, 1) of each row (n,): (n, dimensions)."""
    key = np.random.SeedSequence(seed).generate_state(2, np.uint64)
    counts = -(-dimensions // _WORDS)
    out = np.empty((len(rows), dimensions))
    # Runs of consecutive rows are drawn at once.
    for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(rows) != 1) + 1):
        if len(part):
            generator = np.random.Philox(key=key, counter=int(rows[part[0]]) * counts)
            words = generator.random_raw(len(part) * counts * _WORDS).reshape(len(part), -1)
            out[part] = (words[:, :dimensions] >> np.uint64(11)) * 2.0**-53
    return out


@exported("i8", "f8", "f8", "f8[:,:]", "f8[:,:]", nogil=True)
def shape_draws(kind: int, a: float, b: float, u: FloatArray, out: FloatArray) -> None:
    """Fill out (n, k) from uniforms u (n, j), as ``Draw`` has them.

    A rotation is uniform over the group (Shoemake, Graphics Gems III, 1992), a direction over the sphere; a normal
    number comes from two uniform ones (Box and Muller, Ann. Math. Stat. 29, 1958).
    """
    for i in range(out.shape[0]):
        if kind in (_UNIFORM, VERTEX):
            out[i, 0] = a + (b - a) * u[i, 0]
        elif kind == _LOG_UNIFORM:
            out[i, 0] = exponential_of(logarithm(a) + (logarithm(b) - logarithm(a)) * u[i, 0])
        elif kind == _NORMAL:
            _, cosine = sine_cosine(2.0 * math.pi * u[i, 1])
            out[i, 0] = a + b * math.sqrt(-2.0 * logarithm(1.0 - u[i, 0])) * cosine
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
