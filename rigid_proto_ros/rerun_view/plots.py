# SPDX-License-Identifier: MIT
"""Plotted values of one run, computed over a batch of states at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..mass.tensor import principal_axes
from ..simulation.observer import BodySnapshot
from . import entities as e
from .columns import Send, scalar_columns, time_columns
from .derived import angle_to, derive
from .plot_range import plot_range, with_two_ticks


class Ranges:
    """The least and the largest value of each plotted entity in one run: what its axis must show."""

    def __init__(self) -> None:
        self._found: dict[str, tuple[float, float]] = {}

    def note(self, entity: str, values: np.ndarray) -> None:
        """Values that are plotted."""
        finite = values[np.isfinite(values)]
        if finite.size:
            low, high = self._found.get(entity, (np.inf, -np.inf))
            self._found[entity] = (min(low, float(finite.min())), max(high, float(finite.max())))

    def axes(self) -> dict[str, tuple[float, float]]:
        """Ends of the axis by entity: no curve lies on the frame's edge, rounding doesn't fill the plot,
        two ticks have numbers.
        """
        return {
            entity: with_two_ticks(*plot_range(np.array(found), LEAST_ANGLE if entity in ANGLES else 0.0).bounds)
            for entity, found in self._found.items()
        }


LEAST_ANGLE = 1.0
"""[°] That the axis of an angle spans at least."""

ANGLES = (e.ANGULAR_MOMENTUM_ANGLE, e.GHOST_ANGLE)


class Plots:
    """Remembers the run's start, and the last moment from which nothing has acted on the body."""

    def __init__(self, ranges: Ranges) -> None:
        self._ranges = ranges
        self._momentum_at_start: np.ndarray | None = None
        self._free_from: tuple[float, np.ndarray] | None = None
        self._effort_before: tuple[int, int, int] | None = None
        self._efforts: list[tuple[int, int, float, float]] = []

    def effort(self, time_ns: int, wall_ns: int, steps: int, force_evaluations: int) -> None:
        """What the motion has cost up to ``time_ns``; plotted as rates since it was told before."""
        if self._effort_before is not None and time_ns > self._effort_before[0]:
            before_ns, steps_before, evaluations_before = self._effort_before
            seconds = 1e-9 * (time_ns - before_ns)
            rates = ((steps - steps_before) / seconds, (force_evaluations - evaluations_before) / seconds)
            self._efforts.append((time_ns, wall_ns, *rates))
        self._effort_before = (time_ns, steps, force_evaluations)

    def send_effort(self, send: Send) -> None:
        """Send the rates collected so far."""
        if self._efforts:
            times_ns, walls, *rates = zip(*self._efforts, strict=True)
            self._ranges.note(e.EFFORT, np.column_stack(rates))
            send(e.EFFORT, time_columns(np.array(times_ns), np.array(walls)), scalar_columns(np.column_stack(rates)))
            self._efforts.clear()

    def disturbed(self) -> None:
        """A load or a change of the body: drift counts anew from the next state."""
        self._free_from = None

    def rows(
        self, times: list[Any], rows: np.ndarray, body: BodySnapshot, disturbed: np.ndarray, send: Send
    ) -> np.ndarray:
        """Send what is plotted of states (n, 13) and return their angular momenta (n, 3).

        disturbed (n,) says at which states a load acts or has acted since the state before.
        """
        derived = derive(rows, body)
        L, energies = derived.angular_momentum, derived.energies
        if self._momentum_at_start is None:
            self._momentum_at_start = L[0].copy()
        plotted = {
            e.DRIFT: self._drift(energies, L, disturbed),
            e.ENERGY: energies,
            e.ANGULAR_MOMENTUM: np.column_stack([L, np.linalg.norm(L, axis=1)]),
            e.ANGULAR_MOMENTUM_ANGLE: np.degrees(angle_to(self._momentum_at_start, L))[:, np.newaxis],
            e.ANGULAR_VELOCITY_PRINCIPAL: rows[:, 10:13] @ principal_axes(np.asarray(body.inertia))[1],
        }
        if np.any(body.gravity) or rows[:, 7:10].any():
            plotted[e.POSITION] = rows[:, 0:3]
        for entity, values in plotted.items():
            self._ranges.note(entity, values)
            send(entity, times, scalar_columns(values))
        return L

    def _drift(self, energies: np.ndarray, L: np.ndarray, disturbed: np.ndarray) -> np.ndarray:
        """Relative change (n, 2) of the total energy and of L since the last disturbance; 0 while there is one."""
        total = energies[:, 3]
        size = np.abs(energies[:, :3]).sum(axis=1)
        drift = np.zeros((len(L), 2))
        borders = [0, *(np.flatnonzero(np.diff(disturbed)) + 1).tolist(), len(L)]
        for begin, end in zip(borders[:-1], borders[1:], strict=True):
            if disturbed[begin]:
                self._free_from = (float(total[end - 1]), L[end - 1].copy())
                continue
            if self._free_from is None:
                self._free_from = (float(total[begin]), L[begin].copy())
            energy, momentum = self._free_from
            drift[begin:end, 0] = _relative(total[begin:end] - energy, size[begin:end])
            drift[begin:end, 1] = _relative(
                np.linalg.norm(L[begin:end] - momentum, axis=1), np.full(end - begin, np.linalg.norm(momentum))
            )
        return drift


def _relative(difference: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.divide(difference, size, out=np.zeros(len(difference)), where=size > 0.0)
