# SPDX-License-Identifier: MIT
"""Lengths of arrows, and the arrows of acting loads, at their points of application and in their directions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..base.vectors import BoolArray, FloatArray, IntArray, Points
from ..motion.body import Body
from ..simulation.observer import ShownLoad
from . import style
from .backend import Backend

FIRST = 0.6
"""Length of the first arrow of its kind, in body sizes: it reaches out of most bodies, and an arrow four times as long
is still in view.
"""

FIRST_MOMENTUM = 0.75
"""The same for L, so that its end and label differ from those of ω if both have the same direction."""

LEAST, LONGEST = 0.005, 3.0
"""In body sizes: a shorter arrow is not drawn, nor its label; a longer one is cut to LONGEST, and its label has its
value.
"""

IMPULSE_SHOWN_NS = 150_000_000
"""How long the arrow of an impulse, which acts at an instant, is shown [ns of simulated time]."""


class ArrowScales:
    """Scale of each kind of arrow, as value per metre; it stays fixed once it is set."""

    def __init__(self) -> None:
        self._per_metre: dict[str, float] = {}

    def lengths(self, kind: str, values: FloatArray, size: float, usual: float = 0.0) -> FloatArray:
        """Lengths (n,) [m] of arrows for values (n,) >= 0 on a body of this size [m]; 0 where none is drawn.

        The first value of a kind sets its scale; if it is 0 or negligible compared to ``usual``, ``usual`` sets it.
        """
        known = self._per_metre.get(kind, 0.0)
        if known == 0.0 and len(values):
            first = float(values[0])
            known = (first if first > 1e-6 * usual else usual) / ((FIRST_MOMENTUM if kind == "L" else FIRST) * size)
            self._per_metre[kind] = known
        if not known > 0.0:
            return np.zeros(len(values))
        lengths = np.minimum(values / known, LONGEST * size)
        return np.where(lengths < LEAST * size, 0.0, lengths)

    def forget(self) -> None:
        """Reset the scales, for another body."""
        self._per_metre.clear()


@dataclass
class Acting:
    """A load that acts from begin_ns to end_ns. shown: whether it was drawn for some state. pushes: whether its force
    pushes into the body, determined at the first state.
    """

    load: ShownLoad
    begin_ns: int
    end_ns: float = np.inf
    shown: bool = False
    pushes: bool | None = None


class Loads:
    """The loads of one run. A load that ends before any state shows it is drawn for the next state.

    acting: loads that haven't ended, by number, without impulses.
    """

    def __init__(self) -> None:
        self.acting: dict[int, Acting] = {}
        self._ended: list[Acting] = []
        self._drawn: set[str] = set()
        self._any = False

    def began(self, time_ns: int, load_id: int, load: ShownLoad) -> None:
        """Add a load that starts to act."""
        if load.kind == "impulse":
            self._ended.append(Acting(load, time_ns, time_ns + IMPULSE_SHOWN_NS))
        else:
            self.acting[load_id] = Acting(load, time_ns)

    def ended(self, time_ns: int, load_id: int, poke_shown_ns: int) -> None:
        """End a load; the arrow of a poke is shown for at least ``poke_shown_ns``."""
        acting = self.acting.pop(load_id, None)
        if acting is not None:
            least_ns = poke_shown_ns if acting.load.kind == "poke" else 0
            acting.end_ns = max(time_ns, acting.begin_ns + least_ns)
            self._ended.append(acting)

    def body_changed(self, before: Body, after: Body) -> None:
        """Keep points of application fixed in the mesh after a change of the body; one at the COM stays at the COM."""
        for acting in (*self.acting.values(), *self._ended):
            if acting.load.point.any():
                point = before.mesh_point(acting.load.point) * after.scale - after.center_of_mass
                acting.load = replace(acting.load, point=point)

    def totals(self, times_ns: IntArray, R: FloatArray) -> FloatArray | None:
        """Magnitudes (n, 2) of the total force [N] and the total torque about the COM [N m] of all loads, without
        impulses, at times (n,) and attitudes R (n, 3, 3). None before the first load.
        """
        self._any |= bool(self.acting) or any(acting.load.kind != "impulse" for acting in self._ended)
        if not self._any:
            return None
        forces, torques = np.zeros((2, len(times_ns), 3))
        for acting in (*self.acting.values(), *self._ended):
            present = (times_ns >= acting.begin_ns) & (times_ns < acting.end_ns)
            if acting.load.kind == "impulse" or not present.any():
                continue
            turned, load = R[present], acting.load
            force, torque = (np.asarray(value, dtype=float) for value in (load.force, load.torque))
            if load.axes == "body":
                force, torque = turned @ force, turned @ torque
            forces[present] += force
            torques[present] += torque + np.cross(turned @ np.asarray(load.point, dtype=float), force)
        return np.column_stack([np.linalg.norm(forces, axis=1), np.linalg.norm(torques, axis=1)])

    def draw(
        self,
        backend: Backend,
        wanted: Callable[[str], bool],
        times_ns: IntArray,
        rows: FloatArray,
        R: FloatArray,
        scales: ArrowScales,
        size: float,
        weight: float,
    ) -> None:
        """Draw the arrows at times (n,), states (n, 13) and attitudes R (n, 3, 3), for a body of this size [m] and
        weight on earth [N]. Parts whose loads have ended are drawn once more, empty.
        """
        found: dict[str, list[tuple[BoolArray, Points, Points, Points, str]]] = {}
        for acting in (*self.acting.values(), *self._ended):
            present = (times_ns >= acting.begin_ns) & (times_ns < acting.end_ns)
            if not present.any() and not acting.shown and acting.end_ns < np.inf:
                present[np.searchsorted(times_ns, acting.begin_ns) :][:1] = True
            if present.any():
                acting.shown = True
                for name, arrow in _arrows(acting, present, rows, R, scales, size, weight):
                    found.setdefault(name, []).append((present, *arrow))
        self._ended = [acting for acting in self._ended if acting.end_ns > times_ns[-1] or not acting.shown]
        for name in filter(wanted, self._drawn - found.keys()):
            none = np.zeros(len(times_ns), dtype=int)
            backend.arrows(name, none, np.zeros((0, 3)), np.zeros((0, 3)))
            backend.labels(name, none, np.zeros((0, 3)), [])
        for name, arrows in found.items():
            if wanted(name):
                # Arrows of all loads, ordered by state.
                present = np.stack([arrow[0] for arrow in arrows], axis=1)
                vectors, origins, ends = (np.stack([arrow[k] for arrow in arrows], axis=1)[present] for k in (1, 2, 3))
                backend.arrows(name, present.sum(axis=1), vectors, origins)
                texts = [arrows[k][4] for k in np.nonzero(present)[1].tolist()]
                backend.labels(name, present.sum(axis=1), ends, texts)
        self._drawn = set(found)


def _arrows(
    acting: Acting,
    present: BoolArray,
    rows: FloatArray,
    R: FloatArray,
    scales: ArrowScales,
    size: float,
    weight: float,
) -> Iterator[tuple[str, tuple[Points, Points, Points, str]]]:
    """Yield the part's name and a load's arrows at all states: vectors, origins, label positions (n, 3),
    and the label.
    """
    load, point = acting.load, np.asarray(acting.load.point, dtype=float)
    if acting.pushes is None:
        force = load.force if load.axes == "body" else R[present][0].T @ load.force
        acting.pushes = bool(point @ force < 0.0)
    for part, value, unit in (("force", load.force, "N"), ("torque", load.torque, "N m")):
        value, unit = np.asarray(value, dtype=float), f"{unit} s" if load.kind == "impulse" else unit
        magnitude = float(np.linalg.norm(value))
        usual = weight * (1.0 if part == "force" else 0.5 * size)
        (length,) = scales.lengths(unit, np.array([magnitude]), size, usual) if magnitude else (0.0,)
        if length == 0.0:
            continue
        vectors = np.broadcast_to(value * (length / magnitude), (len(rows), 3))
        vectors = np.einsum("nij,nj->ni", R, vectors) if load.axes == "body" else vectors
        origins = rows[:, 0:3] + R @ point
        # The tip of a pushing force is at the point, like a finger; the arrow would be hidden inside the body.
        if part == "force" and acting.pushes:
            origins = origins - vectors
            ends = origins
        else:
            ends = origins + vectors
        yield style.load_part(load.kind, part), (vectors, origins, ends, f"{_short(magnitude)} {unit}")


def _short(value: float) -> str:
    """Three significant digits, without an exponent for 1,000 to 100,000."""
    return f"{value:.0f}" if 1e3 <= value < 1e5 else f"{value:.3g}"
