# SPDX-License-Identifier: MIT
"""A backend that remembers what it was told, for tests of the picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from rigid_proto_ros.picture import style
from rigid_proto_ros.picture.backend import Backend


class Drawn(Backend):
    """parts: by name what was drawn, by time; of labels below ``<name>/label``. The other attributes as drawn last."""

    def __init__(self) -> None:
        self.parts: dict[str, dict[int, Any]] = {}
        self.origins: dict[str, dict[int, np.ndarray]] = {}
        self.texts: dict[str, list[str]] = {}
        self.meshes: dict[str, Any] = {}
        self.places: dict[str, tuple[Any, Any, Any]] = {}
        self.attitudes: dict[str, dict[int, np.ndarray]] = {}
        self.size = 0.0
        self._times = np.zeros(0, np.int64)

    def at_end(self, name: str) -> Any:
        """What was drawn of it last."""
        return list(self.parts.get(name, {-1: np.zeros(0)}).values())[-1]

    def _add(self, name: str, counts: np.ndarray, items: Any) -> None:
        assert len(counts) == len(self._times) and sum(counts) == len(items), name
        ends = np.cumsum(counts).tolist()
        for time_ns, count, end in zip(self._times.tolist(), counts.tolist(), ends, strict=True):
            self.parts.setdefault(name, {})[time_ns] = items[end - count : end]

    def begin(self, times_ns: np.ndarray) -> None:
        self._times = np.asarray(times_ns)

    def resize(self, size: float) -> None:
        self.size = size

    def mesh(self, name: str, surface: Any) -> None:
        self.meshes[name] = surface

    def place(self, name: str, positions: Any = None, attitudes: Any = None, scale: Any = None) -> None:
        for values in (positions, attitudes):
            assert values is None or len(values) == len(self._times), name
        if attitudes is not None:
            self.attitudes.setdefault(name, {}).update(zip(self._times.tolist(), attitudes, strict=True))
        self.places[name] = tuple(None if values is None else values[-1] for values in (positions, attitudes)) + (
            scale,
        )

    def arrows(self, name: str, counts: np.ndarray, vectors: Any, origins: Any = None) -> None:
        self._add(name, counts, vectors)
        if origins is not None:
            ends = np.cumsum(counts)
            for time_ns, count, end in zip(self._times.tolist(), counts, ends, strict=True):
                self.origins.setdefault(name, {})[time_ns] = origins[end - count : end]

    def lines(self, name: str, counts: np.ndarray, strips: Any, colours: Any = None) -> None:
        assert colours is None or len(colours) == len(strips)
        self._add(name, counts, list(strips))

    def points(self, name: str, counts: np.ndarray, positions: Any) -> None:
        self._add(name, counts, positions)

    def labels(self, name: str, counts: np.ndarray, positions: Any, texts: Any) -> None:
        assert len(texts) == len(positions)
        self._add(f"{name}/label", counts, positions)
        self.texts[name] = list(texts)

    def scalars(self, name: str, values: np.ndarray) -> None:
        assert len(values) == len(self._times) and values.shape[1] <= len(style.SERIES[name])
        self._add(name, np.ones(len(values), dtype=int), values)
        for time_ns, row in zip(self._times.tolist(), values, strict=True):
            self.parts[name][time_ns] = row
