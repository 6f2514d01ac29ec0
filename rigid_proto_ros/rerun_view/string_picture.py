# SPDX-License-Identifier: MIT
"""The string from the hand to its knot: straight while it pulls, hanging through while it is slack."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ..base.rotation import matrix_from_quaternion
from ..simulation.mailbox import Block
from ..simulation.observer import ShownString
from . import appearance
from . import entities as e
from .columns import Send, Ticks, scalar_columns, time_columns
from .derived import to_world
from .plots import Ranges
from .string_curve import string_curves

RATE = 100
"""[1/s, simulated] of the picture; tension is plotted at it too."""

LINE_SIZES = 1.1
"""Body sizes that the line of a string that pulls is drawn on beyond its knot."""

NO_DIRECTION = 1e-12
"""In rest lengths: a string shorter than this has no direction to pull in."""


class StringPicture:
    """Follows the string of one run; call in the order of what happened."""

    def __init__(self, ranges: Ranges) -> None:
        self._ranges = ranges
        self.size = 1.0
        """[m] Of the body, through which the string's line is drawn on."""
        self.gravity = np.zeros(3)
        """[m/s², world], along which a slack string hangs."""
        self._string: ShownString | None = None
        self._ticks = Ticks(RATE)
        self._shown = False
        self._reset()

    def _reset(self) -> None:
        self._times: list[np.ndarray] = []
        self._walls: list[np.ndarray] = []
        self._strips: list[np.ndarray] = []
        self._hands: list[np.ndarray] = []
        self._tensions: list[np.ndarray] = []
        self._energies: list[np.ndarray] = []
        self._lines: list[np.ndarray] = []
        self._distances: list[np.ndarray] = []
        self._counts: list[np.ndarray] = []

    @property
    def tied(self) -> bool:
        """Whether there is a string."""
        return self._string is not None

    def change(self, time_ns: int, wall_ns: int, string: ShownString | None) -> None:
        """Another target, another knot, tied or let go."""
        if string is None and self._shown:
            # A row without a string ends the picture of the one before.
            self._times.append(np.array([time_ns]))
            self._walls.append(np.array([wall_ns]))
            self._counts.append(np.zeros(1, dtype=int))
            self._tensions.append(np.zeros(1))
            self._energies.append(np.zeros(1))
            self._distances.append(np.zeros(1))
            self._shown = False
        self._string = string

    def rows(self, block: Block, begin: int, end: int) -> None:
        """States begin..end, between which the string isn't changed."""
        string = self._string
        if begin == end or string is None:
            return
        chosen = begin + self._ticks.choose(block.times[begin:end])
        if not len(chosen):
            return
        times_ns, rows = block.times[chosen], block.rows[chosen]
        arm = to_world(matrix_from_quaternion(rows[:, 3:7]), np.asarray(string.attach, dtype=float))
        spin = to_world(matrix_from_quaternion(rows[:, 3:7]), rows[:, 10:13])
        free_end, velocity = _hand(string, times_ns)
        span = rows[:, 0:3] + arm - free_end
        distance = np.linalg.norm(span, axis=1)
        tension = _tension(string, span, distance, rows[:, 7:10] + np.cross(spin, arm) - velocity)
        self._times.append(times_ns.copy())
        self._walls.append(block.walls[chosen])
        self._counts.append(np.ones(len(chosen), dtype=int))
        self._tensions.append(tension)
        stretch = distance - string.rest_length
        stretch = stretch if string.bilateral else np.maximum(stretch, 0.0)
        self._energies.append(0.5 * string.stiffness * stretch**2)
        self._hands.append(free_end)
        along = span / np.maximum(distance, np.finfo(float).tiny)[:, np.newaxis]
        knots = free_end + span
        self._lines.append(np.stack([knots, knots + LINE_SIZES * self.size * along], axis=1)[tension > 0.0])
        away = rows[:, 0:3] - free_end
        self._distances.append(np.linalg.norm(np.cross(along, away), axis=1))
        self._strips.extend(_drawn(string, free_end, knots, self.gravity))
        self._shown = True

    def send(self, send: Send) -> None:
        """Send what was collected."""
        if not self._times:
            return
        times_ns, walls = np.concatenate(self._times), np.concatenate(self._walls)
        counts, tensions = np.concatenate(self._counts), np.concatenate(self._tensions)
        times = time_columns(times_ns, walls)
        pulls = [bool(tension) for tension, count in zip(tensions, counts, strict=True) if count]
        colours = [appearance.STRING_COLOUR if taut else e.SLACK_COLOUR for taut in pulls]
        send(e.STRING, times, rr.LineStrips3D.columns(strips=self._strips, colors=colours).partition(counts))
        hands = np.concatenate(self._hands) if self._hands else np.empty((0, 3))
        send(e.HAND, times, rr.Points3D.columns(positions=hands).partition(counts))
        send(e.STRING_TENSION, times, scalar_columns(tensions[:, np.newaxis]))
        send(e.STRING_ENERGY, times, scalar_columns(np.concatenate(self._energies)[:, np.newaxis]))
        lines = [line for several in self._lines for line in several]
        pulling = np.array([1 if pull else 0 for pull in pulls])
        drawn = np.zeros(len(counts), dtype=int)
        drawn[counts > 0] = pulling
        send(e.STRING_LINE, times, rr.LineStrips3D.columns(strips=lines).partition(drawn))
        distances = np.concatenate(self._distances)
        send(e.STRING_LINE_DISTANCE, times, scalar_columns(distances[:, np.newaxis]))
        self._ranges.note(e.STRING_TENSION, tensions)
        self._ranges.note(e.ENERGY, np.concatenate(self._energies))
        self._ranges.note(e.STRING_LINE_DISTANCE, distances)
        self._reset()


def _hand(string: ShownString, times_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity (n, 3) of the free end at each time."""
    way = np.asarray(string.target, dtype=float) - string.origin
    lasts_ns = string.end_ns - string.begin_ns
    speed = way / (1e-9 * lasts_ns) if lasts_ns > 0 else np.zeros(3)
    return string.free_end(times_ns), (times_ns < string.end_ns)[:, np.newaxis] * speed


def _tension(string: ShownString, span: np.ndarray, distance: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Tension (n,) [N]: k x + c ẋ, and nothing for a string that would have to push."""
    if string.rest_length == 0.0:
        return np.linalg.norm(string.stiffness * span + string.damping * velocity, axis=1)
    direction = span / np.maximum(distance, np.finfo(float).tiny)[:, np.newaxis]
    stretch = distance - string.rest_length
    tension = string.stiffness * stretch + string.damping * np.einsum("ij,ij->i", direction, velocity)
    if not string.bilateral:
        tension = np.where(stretch > 0.0, np.maximum(tension, 0.0), 0.0)
    return np.where(distance < NO_DIRECTION * string.rest_length, 0.0, tension)


def _drawn(string: ShownString, free_end: np.ndarray, knots: np.ndarray, gravity: np.ndarray) -> list[np.ndarray]:
    """Per state the string as points: its two ends, or as long a curve as it is, hanging along gravity."""
    length = 0.0 if string.bilateral else string.rest_length
    slack = np.linalg.norm(knots - free_end, axis=1) < length
    curves = iter(string_curves(free_end[slack], knots[slack], length, gravity))
    return [next(curves) if slack[k] else np.array([free_end[k], knots[k]]) for k in range(len(slack))]
