# SPDX-License-Identifier: MIT
"""What a study measures and when it samples the flight. Names in the file become rows of numbers for the compiled
measure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray
from ..scene.scenario import publication_ns
from ..simulation import quantities as fm
from ..simulation.commands import nanoseconds
from ..simulation.quantities import DIFFERENCES, NAMES, QUANTITIES, TURNED
from .fields import known_name, mapping, names, number

MAX_SAMPLES = 100_000
"""Largest number of samples of a flight; a state of each is kept in memory."""
KINDS = ("final", "max", "min", "flips", "first", "difference", "sensitivity")
_STATE_PARTS = {"position": 3, "orientation": 4, "velocity": 3, "spin": 3}


@dataclass(frozen=True)
class Measures:
    """columns: names of the measures, which are the rows of ``table`` (k, MEASURE). sample_ns (m,): sample times,
    ascending; the last is the end.
    """

    columns: tuple[str, ...]
    table: FloatArray
    sample_ns: IntArray

    @property
    def needs_reference(self) -> bool:
        """Whether anything is compared with the reference."""
        return bool((self.table[:, fm.KIND] == fm.DIFFERENCE).any())

    @property
    def needs_finer(self) -> bool:
        """Whether the reference is the same motion, ten times as accurate."""
        return any(name.startswith("sensitivity.") for name in self.columns)


def read_measures(spec: Any, watch: float, duration_s: float, field: str) -> Measures:
    """Read ``measure`` of a study. Raises InputError, which names the field."""
    spec = mapping({"final": ["position", "orientation", "velocity", "spin"]} if spec is None else spec, field, KINDS)
    duration_ns = nanoseconds(duration_s)
    sample_ns: list[int] = []
    if {"max", "min", "flips", "first"} & set(spec):
        if duration_s * watch > MAX_SAMPLES:
            raise InputError("watch", watch, f"at most {MAX_SAMPLES} samples in a run of {duration_s:g} s")
        while (time_ns := publication_ns(len(sample_ns), watch)) < duration_ns:
            sample_ns.append(time_ns)
    rows: list[tuple[str, list[float]]] = []
    for kind, value in spec.items():
        rows += _rows(kind, value, f"{field}.{kind}")
    columns = [name for name, _ in rows]
    doubled = next((name for name in columns if columns.count(name) > 1), None)
    if doubled or not rows:
        raise InputError(field, doubled or {}, "each measure once" if doubled else "something to measure")
    table = np.array([row + [0.0] * (fm.MEASURE - len(row)) for _, row in rows])
    return Measures(tuple(columns), table, np.array([*sample_ns, duration_ns], np.int64))


def _rows(kind: str, value: Any, field: str) -> list[tuple[str, list[float]]]:
    if kind == "final":
        known = (*_STATE_PARTS, *(name for name in NAMES if name not in _STATE_PARTS))
        chosen: list[str] = []
        for name in names(value, field, known):
            # The name of a vector in the state stands for all its components.
            parts = _STATE_PARTS.get(name)
            chosen += [f"{name}.{axis}" for axis in "xyzw"[:parts]] if parts else [name]
        return [(name, [fm.FINAL, NAMES.index(name)]) for name in chosen]
    if kind in ("max", "min"):
        code = fm.LARGEST if kind == "max" else fm.SMALLEST
        return [(f"{kind}.{name}", [code, NAMES.index(name)]) for name in names(value, field, NAMES)]
    if kind == "first":
        return [(f"first.{name}", [fm.FIRST, *condition]) for name, condition in _conditions(value, field).items()]
    if kind == "flips":
        return [("flips", [fm.FLIPS, TURNED, *_flips(value, field)])]
    listed = tuple(DIFFERENCES)
    return [(f"{kind}.{name}", [fm.DIFFERENCE, listed.index(name)]) for name in names(value, field, listed)]


def _flips(value: Any, field: str) -> list[float]:
    spec = mapping({} if value is True else value, field, ("axis", "margin"))
    axis = spec.get("axis", "spin")
    margin = number(spec.get("margin", 0.5), f"{field}, margin", 0.0, 0.99)
    if axis == "spin":
        return [margin, 0.0, 0.0, 0.0]
    direction = [number(x, f"{field}, axis") for x in axis] if isinstance(axis, list) else []
    if len(direction) != 3 or not any(direction):
        raise InputError(f"{field}, axis", axis, "spin, or a direction [x, y, z] of the body")
    return [margin, *direction]


def _conditions(spec: Any, field: str) -> dict[str, list[float]]:
    """Conditions by name: index of the quantity, sign and limit."""
    if not isinstance(spec, dict):
        raise InputError(field, spec, "names with {quantity, above} or {quantity, below}")
    found = {}
    for name, condition in spec.items():
        own = f"{field}.{name}"
        condition = mapping(condition, own, ("quantity", "above", "below"), ("quantity",))
        if ("above" in condition) == ("below" in condition):
            raise InputError(own, sorted(condition), "quantity with one of above, below")
        code = NAMES.index(known_name(str(condition["quantity"]), f"{own}, quantity", QUANTITIES))
        word, sign = ("above", 1.0) if "above" in condition else ("below", -1.0)
        found[str(name)] = [float(code), sign, number(condition[word], f"{own}, {word}")]
    return found
