# SPDX-License-Identifier: MIT
"""A flight at as many times as it takes for straight lines between them to be the motion, within a tolerance.

Published states are often too far apart for that, or closer than needed. The flight is simulated again, and looked at
wherever interpolation at the middle of two times errs; looking changes no bit of the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base.errors import InputError
from ..mass.tensor import equimomental_shapes, principal_axes
from .flight_record import DrawnBody, FlightRecord
from .interpolation import attitude_angles, blend
from .state_source import POSE, StateSource
from .string_line import shapes_apart, string_breaks, string_changes, string_shapes

TURN_MAX = 0.5
"""[rad] Between two samples at most, so that no turn is missed."""
SHARE = 0.25
"""Of the tolerance, for what happens between two samples."""
PASSES = 24
SAMPLES_MAX = 4_000_000
AGREES = 0.1
"""Of the tolerance: how near the flight must come to a recorded state to be taken for the recorded one."""


@dataclass(frozen=True)
class Tolerance:
    """What an export may err by: position [m] and attitude [rad]."""

    position: float
    angle: float

    @staticmethod
    def of(share: float, size: float) -> Tolerance:
        """``share`` of the body's size [m], and as many hundred degrees: 1e-3 means 0.1 degree."""
        return Tolerance(share * size, float(np.radians(100.0 * share)))

    def worst(self, position: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Errors (n,) in units of the tolerance."""
        return np.maximum(position / self.position, angle / self.angle)


def body_size(record: FlightRecord) -> float:
    """A length [m] that stands for the body, where it is smallest: the diagonal of its box, or of the box of equal
    inertia.
    """

    def size(drawn: DrawnBody) -> float:
        if drawn.mesh >= 0:
            return float(np.linalg.norm(np.ptp(record.meshes[drawn.mesh].vertices, axis=0) * drawn.body.scale))
        moments, _ = principal_axes(drawn.body.inertia)
        return float(np.linalg.norm(equimomental_shapes(drawn.body.mass, moments)[0]))

    return min(map(size, record.bodies), default=0.0) or 1.0


@dataclass(frozen=True)
class Span:
    """StateSource begin to end − 1, through which the body is drawn alike."""

    begin: int
    end: int
    drawn: DrawnBody


@dataclass(frozen=True)
class Track:
    """One body. poses (n, 7): position [m, world] and attitude xyzw, NaN while there is none. bodies: as recorded."""

    poses: np.ndarray
    bodies: list[DrawnBody]

    @cached_property
    def shown(self) -> np.ndarray:
        """Whether (n,) there is a body."""
        return ~np.isnan(self.poses[:, 0])


@dataclass(frozen=True)
class Motion:
    """times_ns (n,), ascending, and the tracks of body and ghost at these times."""

    times_ns: np.ndarray
    body: Track
    ghost: Track | None

    @cached_property
    def seconds(self) -> np.ndarray:
        """Times (n,) [s] from the first, as float64 numbers that are single precision exactly."""
        return single(self.times_ns - self.times_ns[0])

    @property
    def tracks(self) -> list[Track]:
        """Those there are."""
        return [self.body] if self.ghost is None else [self.body, self.ghost]

    def spans(self, track: Track) -> list[Span]:
        """The samples, by how the body is drawn."""
        found = drawn_alike(track.bodies)
        # A state at the time of a change is the one before it.
        begins = [0, *np.searchsorted(self.times_ns, [b.time_ns for b in found[1:]], side="right").tolist()]
        ends = [*begins[1:], len(self.times_ns)]
        return [Span(b, e, drawn) for b, e, drawn in zip(begins, ends, found, strict=True) if e > b]


def drawn_alike(bodies: Iterable[DrawnBody]) -> list[DrawnBody]:
    """Those that look other than the one before: another mesh, scale or centre of mass; the last of one time."""
    kept: list[DrawnBody] = []
    for drawn in bodies:
        if kept and kept[-1].time_ns == drawn.time_ns:
            kept.pop()
        if not kept or not _alike(kept[-1], drawn):
            kept.append(drawn)
    return kept


def _alike(a: DrawnBody, b: DrawnBody) -> bool:
    return (
        a.mesh == b.mesh
        and np.array_equal(a.body.scale, b.body.scale)
        and np.array_equal(a.body.center_of_mass, b.body.center_of_mass)
    )


def single(times_ns: np.ndarray) -> np.ndarray:
    """Times [s] rounded to single precision, which exchange formats have, as float64."""
    return (times_ns * 1e-9).astype(np.float32).astype(float)


class Sampler:
    """Samples of a flight. source: None for one that can't be simulated again; then its recorded states are all there
    is, as ``note`` says. With ``ghost`` the ghost's motion counts too, with ``string`` that of the string.
    """

    def __init__(
        self,
        record: FlightRecord,
        source: StateSource | None,
        tolerance: Tolerance,
        ghost: bool = False,
        string: bool = False,
    ) -> None:
        self.record = record
        self.source = source
        self.tolerance = tolerance
        self.note = ""
        self._ghost = ghost
        self._string = string
        self.start_ns, self.end_ns = int(record.times_ns[0]), int(record.times_ns[-1])
        if source is None:
            self.note = "the session can't be simulated again: between its states nothing is known"
        elif not self._agrees():
            self.source = None
            self.note = "simulated again here the motion isn't the recorded one: between its states nothing is known"

    def at(self, times_ns: np.ndarray) -> Motion:
        """The motion at these times (n,), ascending; between recorded states where it can't be looked at."""
        if self.source is not None:
            return self._motion(times_ns, *self.source.at(times_ns))
        known, rows = self.record.times_ns, self.record.rows
        if len(known) == 1:
            return self._motion(known, rows, np.full((1, POSE), np.nan))
        at = np.clip(np.searchsorted(known, times_ns), 1, len(known) - 1)
        u = ((times_ns - known[at - 1]) / (known[at] - known[at - 1]))[:, np.newaxis]
        poses = blend(rows[at - 1, :POSE], rows[at, :POSE], np.clip(u, 0.0, 1.0))
        return self._motion(times_ns, poses, np.full((len(times_ns), POSE), np.nan))

    def evenly(self, fps: float) -> np.ndarray:
        """Times (n,) [ns] of pictures, with the end, and both sides of every change of what is drawn."""
        count = int(np.floor((self.end_ns - self.start_ns) * 1e-9 * fps)) + 1
        if count > SAMPLES_MAX:
            raise InputError("--fps", fps, f"at most {SAMPLES_MAX} pictures of the flight")
        pictures = np.rint(np.arange(count) / fps * 1e9).astype(np.int64) + self.start_ns
        return np.union1d(pictures, [self.end_ns, *self._changes()]).astype(np.int64)

    def within(self, progress: Callable[[float, float], None] = lambda *_: None) -> Motion:
        """The motion at times between which straight lines, and turns at constant rate, err by less than a part of the
        tolerance. Raises InputError where that takes too many.
        """
        tolerance = self.tolerance
        if self.source is None:
            return self.at(self.record.times_ns)
        marks = [*self.record.breaks, *string_breaks(self.record), *(t for t, _ in self.record.strings)]
        breaks = [t for t in marks if self.start_ns <= t <= self.end_ns]
        times = np.union1d(self._snapped(np.union1d(self.record.times_ns, breaks)), self._changes()).astype(np.int64)
        rows, ghosts = self.source.at(times)
        times, rows, ghosts = self._turned(times, rows, ghosts)
        active = np.ones(len(times) - 1, dtype=bool)
        for number in range(PASSES):
            progress(number, PASSES)
            where = np.flatnonzero(active)
            middles = self._snapped(times[where] // 2 + times[where + 1] // 2)
            inside = (middles > times[where]) & (middles < times[where + 1])
            where, middles = where[inside], middles[inside]
            if not len(where):
                break
            if len(times) + len(where) > SAMPLES_MAX:
                raise InputError(
                    "--tolerance",
                    tolerance.position,
                    f"a larger tolerance; this one needs more than {SAMPLES_MAX} samples",
                )
            found, ghosts_found = self.source.at(middles)
            u = ((middles - times[where]) / (times[where + 1] - times[where]))[:, np.newaxis]
            errs = _errs(tolerance, rows[:, :POSE], where, u, found[:, :POSE])
            if self._ghost:
                errs = np.fmax(errs, _errs(tolerance, ghosts, where, u, ghosts_found))
            if self._string:
                shapes = string_shapes(self.record, times, rows[:, :POSE])
                now = string_shapes(self.record, middles, found[:, :POSE])
                seen = (1.0 - u) * shapes[where] + u * shapes[where + 1]
                errs = np.fmax(errs, shapes_apart(seen, now) / tolerance.position)
            again = np.repeat(errs > SHARE, 2)
            times, rows, ghosts = (
                np.insert(old, where + 1, new, axis=0)
                for old, new in ((times, middles), (rows, found), (ghosts, ghosts_found))
            )
            active = np.zeros(len(times) - 1, dtype=bool)
            first = where + np.arange(len(where))
            active[np.column_stack([first, first + 1]).ravel()] = again
        return self._motion(times, rows, ghosts)

    def _turned(
        self, times: np.ndarray, rows: np.ndarray, ghosts: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """More samples where the body turns far between two."""
        assert self.source is not None
        spin = np.linalg.norm(rows[:, 10:13], axis=1)
        turn = np.fmax(spin[1:], spin[:-1]) * np.diff(times) * 1e-9
        parts = np.where(np.isfinite(turn), np.ceil(turn / TURN_MAX), 1.0)
        if parts.sum() > SAMPLES_MAX:
            raise InputError(
                "--gltf",
                f"{parts.sum():.3g} samples, because the body turns fast",
                f"flights of at most {SAMPLES_MAX:g} samples",
            )
        counts = np.maximum(parts, 1.0).astype(int)
        if counts.max(initial=1) == 1:
            return times, rows, ghosts
        piece = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
        more = times[piece] + np.rint(np.diff(times)[piece] * (within / counts[piece])).astype(np.int64)
        times = np.union1d(np.where(within > 0, self._snapped(more), more), times[-1:])
        return times, *self.source.at(times)

    def _snapped(self, times_ns: np.ndarray) -> np.ndarray:
        """The nearest times [ns] at which single precision has a number, within the flight."""
        near = np.rint(single(times_ns - self.start_ns) * 1e9).astype(np.int64) + self.start_ns
        return np.clip(near, self.start_ns, self.end_ns)

    def without_changes(self, times_ns: np.ndarray) -> np.ndarray:
        """Those of the times [ns] that single precision tells from each change of what is drawn."""
        changes = np.array(self._changes()) - self.start_ns
        apart = np.abs((times_ns - self.start_ns)[:, np.newaxis] - changes)
        return times_ns[(apart > 1e9 * np.spacing((changes * 1e-9).astype(np.float32))).all(axis=1)]

    def _changes(self) -> list[int]:
        """The last time before, and the first after, each change of what is drawn."""
        ghosts = drawn_alike(self.record.ghosts) if self._ghost else []
        bodies = [*drawn_alike(self.record.bodies)[1:], *ghosts[1:]]
        changes = [body.time_ns for body in bodies]
        changes += string_changes(self.record) if self._string else []
        times = {t for change in changes for t in (change, change + 1)}
        return sorted(t for t in times if self.start_ns <= t <= self.end_ns)

    def _agrees(self) -> bool:
        """Whether the motion simulated again is the recorded one; it isn't quite on another kind of processor."""
        assert self.source is not None
        rows, _ = self.source.at(self.record.times_ns)
        errs = self.tolerance.worst(*_apart(rows[:, :POSE], self.record.rows[:, :POSE]))
        return bool(np.all(errs <= AGREES))

    def _motion(self, times: np.ndarray, rows: np.ndarray, ghosts: np.ndarray) -> Motion:
        stopped = np.flatnonzero(np.isnan(rows[:, 0]))
        end = int(stopped[0]) if len(stopped) else len(times)
        ghost = None
        if self._ghost and self.record.ghosts and not np.isnan(ghosts[:end, :1]).all():
            ghost = Track(ghosts[:end], self.record.ghosts)
        return Motion(times[:end], Track(rows[:end, :POSE], self.record.bodies), ghost)


def _errs(tolerance: Tolerance, poses: np.ndarray, where: np.ndarray, u: np.ndarray, found: np.ndarray) -> np.ndarray:
    seen = blend(poses[where], poses[where + 1], u)
    return tolerance.worst(*_apart(seen, found))


def _apart(seen: np.ndarray, found: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances [m] and angles [rad] (n,) between poses (n, 7)."""
    return np.linalg.norm(seen[:, :3] - found[:, :3], axis=1), attitude_angles(seen[:, 3:], found[:, 3:])
