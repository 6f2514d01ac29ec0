# SPDX-License-Identifier: MIT
"""What a study measures and when it samples the flight: names in the file become rows of numbers for the
compiled measure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..scene.scenario import publication_ns
from ..simulation import quantities as fm
from ..simulation.commands import nanoseconds
from ..simulation.quantities import DIFFERENCES, NAMES, QUANTITIES, TURNED
from .fields import known_name, mapping, names, number

MAX_SAMPLES = 100_000
"""Samples of one flight: a state is kept of each."""
KINDS = ("final", "max", "min", "flips", "first", "samples", "difference", "max_difference")
_STATE_PARTS = {"position": 3, "orientation": 4, "velocity": 3, "spin": 3}


@dataclass(frozen=True)
class Measures:
    """columns: names of what is measured, rows of ``table`` (k, MEASURE). stops: names and (k, 3) conditions. sample_ns
    (m,) ascending, the last at the end; watched (m,): which of them count for extremes, firsts, flips and stops.
    """

    columns: tuple[str, ...]
    table: np.ndarray
    stop_names: tuple[str, ...]
    stops: np.ndarray
    sample_ns: np.ndarray
    watched: np.ndarray

    @property
    def needs_reference(self) -> bool:
        """Something is compared with the reference."""
        return bool(np.isin(self.table[:, fm.KIND], (fm.DIFFERENCE, fm.LARGEST_DIFFERENCE)).any())


def read_measures(spec: Any, stop: Any, watch: float, duration_s: float, field: str) -> Measures:
    """What ``measure`` and ``stop`` of a study say; raises InputError naming the field."""
    spec = mapping({"final": ["position", "orientation", "velocity", "spin"]} if spec is None else spec, field, KINDS)
    duration_ns = nanoseconds(duration_s)
    samples_ns = _sample_times(spec["samples"], duration_s, f"{field}.samples") if "samples" in spec else []
    stops = _conditions({} if stop is None else stop, field.replace("measure", "stop"))
    watching = bool(stops) or bool({"max", "min", "flips", "first", "max_difference"} & set(spec))
    if watching and duration_s * watch > MAX_SAMPLES:
        raise InputError("watch", watch, f"at most {MAX_SAMPLES} samples in a run of {duration_s:g} s")
    sample_ns, watched = _all_sample_times(watch if watching else 0.0, samples_ns, duration_ns)
    rows: list[tuple[str, list[float]]] = []
    for kind, value in spec.items():
        rows += _rows(kind, value, f"{field}.{kind}", sample_ns)
    columns = [name for name, _ in rows]
    doubled = next((name for name in columns if columns.count(name) > 1), None)
    if doubled or not rows:
        raise InputError(field, doubled or {}, "each measure once" if doubled else "something to measure")
    table = np.array([row + [0.0] * (fm.MEASURE - len(row)) for _, row in rows])
    conditions = np.array(list(stops.values())).reshape(-1, 3)
    return Measures(tuple(columns), table, tuple(stops), conditions, sample_ns, watched)


def _all_sample_times(watch: float, samples_ns: list[int], duration_ns: int) -> tuple[np.ndarray, np.ndarray]:
    watched_ns = {duration_ns}
    if watch:
        k = 0
        while (time_ns := publication_ns(k, watch)) < duration_ns:
            watched_ns.add(time_ns)
            k += 1
    times = sorted(watched_ns | set(samples_ns))
    return np.array(times, np.int64), np.array([time_ns in watched_ns for time_ns in times])


def _sample_times(spec: Any, duration_s: float, field: str) -> list[int]:
    spec = mapping(spec, field, ("at", "of"), ("at", "of"))
    times = spec["at"] if isinstance(spec["at"], list) else [spec["at"]]
    if not times:
        raise InputError(f"{field}, at", times, "a list of times [s]")
    return [nanoseconds(number(t, f"{field}, at", 0.0, duration_s)) for t in times]


def _expanded(quantities: list[str]) -> list[str]:
    """Parts of a state stand for their components."""
    found: list[str] = []
    for name in quantities:
        parts = [f"{name}.{axis}" for axis in "xyzw"[: _STATE_PARTS[name]]] if name in _STATE_PARTS else [name]
        found += parts
    return found


def _rows(kind: str, value: Any, field: str, sample_ns: np.ndarray) -> list[tuple[str, list[float]]]:
    known = (*_STATE_PARTS, *(name for name in NAMES if name not in _STATE_PARTS))
    if kind == "final":
        chosen = _expanded(names(value, field, known))
        return [(name, [fm.FINAL, NAMES.index(name)]) for name in chosen]
    if kind in ("max", "min"):
        code = fm.LARGEST if kind == "max" else fm.SMALLEST
        return [(f"{kind}.{name}", [code, NAMES.index(name)]) for name in names(value, field, NAMES)]
    if kind == "samples":
        chosen = _expanded(names(value["of"], f"{field}, of", known))
        times = value["at"] if isinstance(value["at"], list) else [value["at"]]
        at = [(float(t), int(np.searchsorted(sample_ns, nanoseconds(float(t))))) for t in times]
        return [(f"{name}@{t:g}", [fm.SAMPLE, NAMES.index(name), k]) for t, k in at for name in chosen]
    if kind == "first":
        return [(f"first.{name}", [fm.FIRST, *condition]) for name, condition in _conditions(value, field).items()]
    if kind == "flips":
        return [("flips", [fm.FLIPS, TURNED, *_flips(value, field)])]
    code = fm.DIFFERENCE if kind == "difference" else fm.LARGEST_DIFFERENCE
    listed = tuple(DIFFERENCES)
    return [(f"{kind}.{name}", [code, listed.index(name)]) for name in names(value, field, listed)]


def _flips(value: Any, field: str) -> list[float]:
    spec = mapping({} if value is True else value, field, ("axis", "margin"))
    axis = spec.get("axis", "spin")
    margin = number(spec.get("margin", 0.5), f"{field}, margin", 0.0, 0.99)
    if axis == "spin":
        return [margin, 0.0, 0.0, 0.0]
    if not isinstance(axis, list) or len(axis) != 3 or not any(axis):
        raise InputError(f"{field}, axis", axis, "spin, or a direction [x, y, z] of the body")
    return [margin, *(number(x, f"{field}, axis") for x in axis)]


def _conditions(spec: Any, field: str) -> dict[str, list[float]]:
    """Conditions by name: quantity number, sign and limit."""
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
