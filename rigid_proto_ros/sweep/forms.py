# SPDX-License-Identifier: MIT
"""How a varied value is chosen: from a grid or a list, or drawn at random."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import Any

import numpy as np

from ..base.errors import InputError
from . import row_random as rr
from .fields import mapping, number, whole

MAX_POINTS = 1_000_000
"""Points of one grid or list."""

GRID, LIST = "grid", "list"
VERTEX = -1
"""A vertex of the row's mesh, each as likely: known only with the mesh."""
_RANDOM = {
    "uniform": rr.UNIFORM,
    "log_uniform": rr.LOG_UNIFORM,
    "normal": rr.NORMAL,
    "random_rotation": rr.ROTATION,
    "direction": rr.DIRECTION,
    "random_vertex": VERTEX,
}
_ACCEPTED = (
    "grid: [...] or {from, to, count, log}, list: [...], uniform: [a, b], log_uniform: [a, b], "
    "normal: [mean, deviation], direction: length, random_rotation, or random_vertex"
)


@dataclass(frozen=True)
class Points:
    """Given values. kind: ``grid`` (every combination with other grids) or ``list`` (in step with other lists)."""

    kind: str
    values: tuple

    @property
    def probes(self) -> list:
        """Values that stand for all, for a check before the start."""
        every = max(1, len(self.values) // 1000)
        return [*self.values[::every], self.values[-1]]

    def taken(self, indices: np.ndarray) -> np.ndarray:
        """The values at these indices: numbers as float64 (n,) or (n, k), the rest as objects (n,)."""
        first = self.values[0]
        if _is_number(first) and all(map(_is_number, self.values)):
            return np.array(self.values, dtype=float)[indices]
        alike = isinstance(first, list) and all(isinstance(v, list) and len(v) == len(first) for v in self.values)
        if alike and all(_is_number(x) for v in self.values for x in v):
            return np.array(self.values, dtype=float)[indices]
        objects = np.empty(len(self.values), dtype=object)
        objects[:] = [tuple(v) if isinstance(v, list) else v for v in self.values]
        return objects[indices]


@dataclass(frozen=True)
class Draw:
    """A random value; ``a`` and ``b`` as sweep/row_random.py takes them."""

    shape: int
    a: float = 0.0
    b: float = 0.0
    kind: str = "random"

    @property
    def uniforms(self) -> int:
        """How many uniform numbers a draw takes."""
        return 1 if self.shape == VERTEX else rr.UNIFORMS[self.shape]

    @property
    def probes(self) -> list:
        """Values that stand for all."""
        if self.shape == rr.NORMAL:
            return [self.a]
        if self.shape == rr.ROTATION:
            return [[0.0, 0.0, 0.0, 1.0]]
        if self.shape == VERTEX:
            return [{"vertex": 0}]
        if self.shape == rr.DIRECTION:
            return [[self.a, 0.0, 0.0]]
        return [self.a, self.b]

    def shaped(self, uniforms: np.ndarray) -> np.ndarray:
        """Values (n,) or (n, k) from uniform numbers (n, ``uniforms``); those themselves for a vertex."""
        if self.shape == VERTEX:
            return uniforms[:, 0]
        out = np.empty((len(uniforms), rr.NUMBERS[self.shape]))
        rr.shape_uniforms(self.shape, self.a, self.b, np.ascontiguousarray(uniforms), out)
        return out[:, 0] if out.shape[1] == 1 else out


def read_form(spec: Any, field: str) -> Points | Draw:
    """The form that a study gives; raises InputError naming the field."""
    if spec in ("random_rotation", "random_vertex"):
        spec = {spec: None}
    if not isinstance(spec, dict) or len(spec) != 1:
        raise InputError(field, spec, _ACCEPTED)
    spec = mapping(spec, field, (GRID, LIST, *_RANDOM))
    ((kind, value),) = spec.items()
    field = f"{field}.{kind}"
    if kind in (GRID, LIST):
        return Points(kind, tuple(_points(value, field)))
    shape = _RANDOM[kind]
    if shape in (rr.ROTATION, VERTEX):
        return Draw(shape)
    if shape == rr.DIRECTION:
        return Draw(shape, number(value, field, above=0.0))
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(field, value, "two numbers [a, b]")
    a, b = (number(x, field) for x in value)
    if shape == rr.NORMAL:
        number(b, f"{field}, deviation", above=0.0)
    elif shape == rr.LOG_UNIFORM and not 0.0 < a < b:
        raise InputError(field, value, "two numbers 0 < a < b")
    elif not a < b:
        raise InputError(field, value, "a range [a, b] with a < b")
    return Draw(shape, a, b)


def _points(value: Any, field: str) -> list:
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
        return np.linspace(a, b, count).tolist()
    if not isinstance(value, list) or not 0 < len(value) <= MAX_POINTS:
        raise InputError(field, value, f"a list of 1 to {MAX_POINTS} values, or {{from, to, count}}")
    for k, item in enumerate(value, 1):
        _check_finite(item, f"{field}, value {k}")
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


def _check_finite(item: Any, field: str) -> None:
    """Numbers anywhere in a value are finite."""
    for x in _leaves(item):
        if isinstance(x, float) and not math.isfinite(x):
            raise InputError(field, item, "finite numbers")


def _leaves(item: Any) -> Iterator[Any]:
    inner = item.values() if isinstance(item, dict) else item if isinstance(item, list) else None
    if inner is None:
        yield item
    else:
        for x in inner:
            yield from _leaves(x)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def as_text(value: Any) -> str:
    """A value that isn't a number as a table holds it."""
    return value if isinstance(value, str) else json.dumps(value)
