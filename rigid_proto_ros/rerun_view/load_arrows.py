# SPDX-License-Identifier: MIT
"""Arrows of the loads that act, from the moment each begins to the moment it ends."""

from __future__ import annotations

from collections import deque

import numpy as np
import rerun as rr

from ..base.rotation import matrix_from_quaternion
from ..simulation.mailbox import Block
from ..simulation.observer import ShownLoad
from . import entities as e
from .arrows import (
    IMPULSE_SHOWN_NS,
    Arrow,
    ArrowSamples,
    ArrowScale,
    arrows_of,
)
from .columns import Send, time_columns
from .derived import carried_along

PARTS = ("force", "torque")


def load_entity(kind: str, part: str) -> str:
    """Where the arrows of a kind of load are logged."""
    return f"{e.LOADS}/{kind}/{part}"


class LoadArrows:
    """Follows the loads of one run; call in the order of what happened."""

    def __init__(self) -> None:
        self.scale: ArrowScale | None = None
        self._acting: dict[int, tuple[str, Arrow | None, Arrow | None]] = {}
        self._not_placed: dict[int, ShownLoad] = {}
        self._impulses_end: deque[tuple[int, int]] = deque()
        self._last_row: np.ndarray | None = None
        self._last_row_ns = 0
        self._samples = {(kind, part): ArrowSamples() for kind in e.LOAD_COLOURS for part in PARTS}

    @property
    def kinds_acting(self) -> list[str]:
        """Kinds of the loads that act now, each once; an impulse doesn't last, though its arrow is shown a while."""
        shown = [load.kind for load in self._not_placed.values()] + [kind for kind, *_ in self._acting.values()]
        return [kind for kind in e.LOAD_COLOURS if kind in shown and kind != "impulse"]

    def began(self, time_ns: int, wall_ns: int, load_id: int, load: ShownLoad) -> None:
        """A load begins to act."""
        self._not_placed[load_id] = load
        if load.kind == "impulse":
            self._impulses_end.append((time_ns + IMPULSE_SHOWN_NS, load_id))
        self._sample(time_ns, wall_ns, load.kind)

    def ended(self, time_ns: int, wall_ns: int, load_id: int) -> None:
        """A load acts no longer."""
        self._sample(time_ns, wall_ns, self._forget(load_id))

    def rows(self, block: Block, begin: int, end: int) -> None:
        """States begin..end, between which no load begins or ends but impulses fade."""
        while begin < end:
            upto = end
            if self._impulses_end:
                ends_ns, load_id = self._impulses_end[0]
                upto = begin + int(np.searchsorted(block.times[begin:end], ends_ns))
            self._add(block.times[begin:upto], block.walls[begin:upto], block.rows[begin:upto])
            if upto < end:
                self._impulses_end.popleft()
                faded = self._forget(load_id)
                at = slice(upto, upto + 1)
                self._add(np.array([ends_ns]), block.walls[at], block.rows[at], faded)
            begin = upto
        if end:
            self._last_row, self._last_row_ns = block.rows[end - 1].copy(), int(block.times[end - 1])

    def send(self, send: Send) -> None:
        """Send the arrows collected so far."""
        for (kind, part), samples in self._samples.items():
            if not samples.times:
                continue
            counts = np.concatenate(samples.counts)
            some = bool(samples.vectors)
            columns = rr.Arrows3D.columns(
                vectors=np.concatenate(samples.vectors) if some else np.empty((0, 3)),
                origins=np.concatenate(samples.origins) if some else np.empty((0, 3)),
                labels=samples.labels,
            ).partition(counts)
            times = time_columns(np.concatenate(samples.times), np.concatenate(samples.walls))
            send(load_entity(kind, part), times, columns)
            samples.clear()

    def _forget(self, load_id: int) -> str:
        """Returns its kind, "" if it isn't known."""
        shown, load = self._acting.pop(load_id, None), self._not_placed.pop(load_id, None)
        return shown[0] if shown else load.kind if load else ""

    def _sample(self, time_ns: int, wall_ns: int, kind: str) -> None:
        """Arrows of one kind at a time between two states, the body carried along from the state before."""
        if self._last_row is None:
            return
        row = carried_along(self._last_row, 1e-9 * (time_ns - self._last_row_ns))
        self._add(np.array([time_ns]), np.array([wall_ns]), row[np.newaxis], kind)

    def _add(self, times_ns: np.ndarray, walls: np.ndarray, rows: np.ndarray, only: str = "") -> None:
        if not len(times_ns) or self.scale is None:
            return
        if self._not_placed:
            (R,) = matrix_from_quaternion(rows[:1, 3:7])
            for load_id, load in self._not_placed.items():
                self._acting[load_id] = (load.kind, *arrows_of(load, self.scale, R))
            self._not_placed.clear()
        for (kind, part), samples in self._samples.items():
            if (not self._acting and not samples.showing) or only not in ("", kind):
                continue
            index = 1 + PARTS.index(part)
            shown = [acting[index] for acting in self._acting.values() if acting[0] == kind]
            arrows = [arrow for arrow in shown if isinstance(arrow, Arrow)]
            samples.add(times_ns, walls, rows, arrows)
