# SPDX-License-Identifier: MIT
"""Estimates from measured poses alone: their noise, the start of a segment, and a first body by linear least squares.
This needs no guess of the body and no integration.

With the attitude R, the centre of mass c and the tensor divided by its trace S, all measured samples obey

    p + R c = x0 + v0 t + ½ g t² + (1/m) ∬ F dt² - (d/m) ∫ p dt,      R S ω = L0 + κ ∫ τ dt - κ a ∫ ω dt,  κ = 1 / tr I,

which are linear in c, 1/m and d/m, then in S, κ and κ a; d and a are the dampings. x0, v0 and L0 are projected out. The
trace of S is fixed at 1, so that rates that are only noise don't make the body small. Since the integrals of the loads
are known, one poke determines the mass in a long fall as well as in a short one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..base.vectors import BoolArray, FloatArray, IntArray, Points, StateRow, Vector3
from ..motion import loads as ld
from . import measurements as ms
from . import rotations as rot
from .unknowns import Unknowns, Values, possible_tensor

NEIGHBOURS = 9
"""Number of samples for a local parabola: at 100 Hz and .2 degrees of noise, its slope errs by some hundredths
rad/s.
"""
NEAR_TURN = 1.5
"""Rotation over which rotation vectors change nearly at the angular velocity [rad]."""
MOST_DIFFERENCES = 7
"""Highest order of differences. For noise all orders from the third on give the same spread, apart from their factor;
the higher ones contain less of the motion.
"""
MEDIAN = 0.6745
"""Median of the absolute value of a standard normal number."""
LEAST_NOISE = 1e-6
"""Least noise, relative to the largest value of a series: difference quotients of flights can't resolve less than that
from rounding.
"""
TURN = 0.5
"""Rotation between the two attitudes that give an angular velocity [rad]; over larger ones the mean isn't the value
midway.
"""
TOLD = 4.0
"""1/m and 1/tr I must be above 0 by this many standard deviations to determine the mass and the size of the tensor."""
THIN = 1e-2
"""Least second moment of the first body, relative to the largest."""
LOOSE = 3.0
"""Standard deviation of the prior of the shape and, in sizes of the body, of the centre of mass."""
POINTS = 8
"""Number of impulses that replace a load between two samples, and least number for each load."""
MOST_POINTS = 200
_SHAPES = [
    np.array(rows, float)
    for rows in (
        ((1, 0, 0), (0, 0, 0), (0, 0, -1)),
        ((0, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((0, 1, 0), (1, 0, 0), (0, 0, 0)),
        ((0, 0, 1), (0, 0, 0), (1, 0, 0)),
        ((0, 0, 0), (0, 0, 1), (0, 1, 0)),
    )
]
"""Basis of the shape's difference from a third of the unit tensor: symmetric, trace 0."""


def noise_by_differences(series: ms.Series) -> float:
    """Standard deviation of one component of the noise, from third and higher differences, which hardly contain a
    smooth motion. Rough if the samples aren't evenly spaced.
    """
    if len(series.values) < 5:
        return 1.0
    differences = rot.turns(series.values) if series.kind == ms.ATTITUDE else np.diff(series.values, axis=0)
    spread = np.inf
    for order in range(2, min(MOST_DIFFERENCES, len(series.values) - 2) + 1):
        differences = np.diff(differences, axis=0)
        if order >= 3:
            own = float(np.median(np.abs(differences))) / MEDIAN / math.sqrt(math.comb(2 * order, order))
            spread = min(spread, own)
    return max(spread, least_noise(series))


def least_noise(series: ms.Series) -> float:
    """Lower bound of a series' noise."""
    return LEAST_NOISE * max(1.0, float(np.max(np.abs(series.values))))


def local_start(flight: ms.MeasuredFlight, time_ns: int) -> StateRow:
    """The tracked frame's state (13,) at a time: position, attitude xyzw, velocity, angular velocity in body axes."""
    position, attitude = flight.pose
    start = np.zeros(13)
    start[:3], start[7:10] = _parabola(position.times_ns, position.values, time_ns, NEIGHBOURS)
    turn = float(np.median(np.linalg.norm(rot.turns(attitude.values), axis=1)))
    # Over a larger rotation a parabola doesn't fit.
    count = min(NEIGHBOURS, max(3, int(NEAR_TURN / max(turn, 1e-9)) + 1))
    near = int(np.clip(np.searchsorted(attitude.times_ns, time_ns), 0, len(attitude.values) - 1))
    middle = attitude.values[near]
    around = slice(max(near - count, 0), near + count + 1)
    turns = rot.logarithm(rot.product(rot.inverse(middle), attitude.values[around]))
    turn_now, slope = _parabola(attitude.times_ns[around], turns, time_ns, count)
    # The angular velocity is a rotation vector's rate minus half its cross product with the rate, plus higher terms,
    # which vanish for a small rotation.
    start[3:7] = rot.product(middle, rot.exponential(turn_now))
    start[10:13] = slope - 0.5 * rot.cross(turn_now, slope)
    return start


def _parabola(times_ns: IntArray, values: Points, time_ns: int, count: int) -> tuple[Vector3, Vector3]:
    """Value (3,) and slope (3,) [1/s] at a time, from the ``count`` samples (n, 3) nearest to it."""
    count = min(count, len(times_ns))
    first = int(np.clip(np.searchsorted(times_ns, time_ns) - count // 2, 0, len(times_ns) - count))
    seconds = 1e-9 * (times_ns[first : first + count] - time_ns)
    span = max(float(np.ptp(seconds)), 1e-9)
    fit = np.polynomial.polynomial.polyfit(seconds / span, values[first : first + count], min(2, count - 1))
    return fit[0], fit[1] / span


@dataclass(frozen=True)
class Impulses:
    """A flight's loads as small impulses, whose sums are the integrals in the balance of momentum.

    seconds (k,): ascending. impulses (k, 3): [N s, world]. angular (k, 3): about the tracked frame's origin [N m s,
    world], or about the centre of mass where ``at_com`` (k,). attitudes (k, 4): of the body at these times.
    """

    seconds: FloatArray
    impulses: Points
    angular: Points
    at_com: BoolArray
    attitudes: FloatArray

    def about(self, com: Vector3) -> Points:
        """Angular impulses (k, 3) about the centre of mass [N m s, world]."""
        moved = self.angular - rot.cross(rot.turned(self.attitudes, com), self.impulses)
        return np.where(self.at_com[:, None], self.angular, moved)

    def momentum(self, seconds: FloatArray, impulses: Points) -> Points:
        """Sums (n, 3) of ``impulses`` (k, 3) up to each time."""
        sums = np.vstack([np.zeros(3), np.cumsum(impulses, axis=0)])
        return sums[np.searchsorted(self.seconds, seconds, side="right")]

    def path(self, seconds: FloatArray) -> Points:
        """∬ F dt² (n, 3) up to each time [N s²]."""
        sums = self.momentum(seconds, self.impulses * self.seconds[:, None])
        return self.momentum(seconds, self.impulses) * seconds[:, None] - sums


@dataclass(frozen=True)
class _Poses:
    """A flight's seconds (n,) from its begin, positions (n, 3) [m], attitudes (n, 4) xyzw, and loads."""

    flight: ms.MeasuredFlight
    seconds: FloatArray
    positions: Points
    attitudes: FloatArray
    impulses: Impulses


def initial_values(flights: Sequence[ms.MeasuredFlight], unknowns: Unknowns, values: Values) -> Values:
    """``values`` with mass, centre of mass, tensor and damping from the balance of momentum, as far as they are
    unknowns and it determines them.
    """
    poses = []
    for flight in flights:
        position, attitude = flight.pose
        seconds = 1e-9 * (attitude.times_ns - flight.begin_ns).astype(float)
        impulses = _impulses_of(flight.load_history, flight.begin_ns, seconds, attitude.values)
        poses.append(_Poses(flight, seconds, position.values, attitude.values, impulses))
    is_slowed = any(flight.own(values).damping[0] > 0.0 for flight in flights)
    for _ in range(2 if is_slowed or "damping" in unknowns else 1):
        # Drag acts at the centre of mass, so its path is needed, and found in a second pass.
        values = _from_path(poses, unknowns, values)
    return _from_turns(poses, unknowns, values)


def _integral(seconds: FloatArray, vectors: Points) -> Points:
    """∫ (n, 3) of vectors (n, 3) from the first time on, by the trapezoidal rule."""
    steps = 0.5 * np.diff(seconds)[:, None] * (vectors[1:] + vectors[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def _impulses_of(history: ms.LoadHistory, begin_ns: int, seconds: FloatArray, attitudes: FloatArray) -> Impulses:
    """Impulses of a flight's loads, turned by its attitudes (n, 4) at seconds (n,) since ``begin_ns``."""
    begin, end = (1e-9 * (edge - begin_ns) for edge in (history.begin_ns, history.end_ns))
    apart = float(np.median(np.diff(seconds)))
    counts = np.clip(np.ceil(POINTS * (end - begin) / apart), POINTS, MOST_POINTS).astype(int)
    counts[begin == end] = 1
    which = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = np.where(begin == end, 1.0, end - begin)[which] / counts[which]
    middles = begin[which] + (end - begin)[which] * (number + 0.5) / counts[which]
    order = np.argsort(middles, kind="stable")
    middles, length = middles[order], length[order, None]
    after = np.clip(np.searchsorted(seconds, middles), 1, len(seconds) - 1)
    part = np.clip((middles - seconds[after - 1]) / (seconds[after] - seconds[after - 1]), 0.0, 1.0)
    between = rot.turns(attitudes)[after - 1] * part[:, None]
    turns = rot.product(attitudes[after - 1], rot.exponential(between))
    rows = history.loads[which[order]]
    in_body = rows[:, ld.LOAD_AXES, None] != ld.WORLD_AXES
    force, torque = (
        np.where(in_body, rot.turned(turns, vectors), vectors)
        for vectors in (rows[:, ld.FORCE : ld.FORCE + 3], rows[:, ld.TORQUE : ld.TORQUE + 3])
    )
    has_point = rows[:, ld.PLACE] != ld.AT_COM
    arm = np.where(has_point[:, None], rot.turned(turns, rows[:, ld.POINT : ld.POINT + 3]), 0.0)
    return Impulses(middles, length * force, length * (torque + rot.cross(arm, force)), ~has_point, turns)


def _from_path(poses: Sequence[_Poses], unknowns: Unknowns, values: Values) -> Values:
    """``values`` with centre of mass, mass and linear damping from the path of the centre of mass."""
    is_damped, drags, rows = "damping" in unknowns, [one.flight.own(values).damping[0] for one in poses], []
    for one, drag in zip(poses, drags, strict=True):
        t = one.seconds[:, None]
        # The columns of the rotation matrix are the body's axes in the world.
        turns = rot.turned(one.attitudes[:, None], np.eye(3)[None]).transpose(0, 2, 1)
        right = 0.5 * t * t * one.flight.own(values).gravity - one.positions
        moved = -_integral(one.seconds, one.positions + turns @ values.center_of_mass - one.positions[0])
        pushed = one.impulses.path(one.seconds) + (0.0 if is_damped else drag) * moved
        columns = [turns, -pushed[:, :, None], -moved[:, :, None], right[:, :, None]]
        rows.append(_project_out(np.hstack([np.ones_like(t), t]), np.concatenate(columns, axis=2)))
    is_pushed = any(drag > 0.0 for drag in drags) or any(len(one.impulses.seconds) for one in poses)
    free = np.array(["com" in unknowns] * 3 + ["mass" in unknowns and is_pushed, is_damped])
    known = np.array([*values.center_of_mass, 1.0 / values.mass, 0.0])
    found, sds = _least_squares(np.concatenate(rows), free, known, np.array([LOOSE * values.size] * 3 + [np.inf] * 2))
    mass = 1.0 / _inverse(found[3], sds[3], values.mass) if free[3] else values.mass
    inertia = values.inertia * (mass / values.mass)
    damping = np.array([max(float(found[4]) * mass, 0.0) if is_damped else values.damping[0], values.damping[1]])
    return replace(values, mass=mass, inertia=inertia, center_of_mass=found[:3], damping=damping)


def _from_turns(poses: Sequence[_Poses], unknowns: Unknowns, values: Values) -> Values:
    """``values`` with tensor and angular damping from the rotation."""
    if "inertia" not in unknowns:
        return values
    is_damped, drags, rows = "damping" in unknowns, [one.flight.own(values).damping[1] for one in poses], []
    for one, drag in zip(poses, drags, strict=True):
        begin, end, attitudes, rates = _rates(one)
        seconds = 0.5 * (begin + end)
        shape = np.stack([rot.turned(attitudes, rates @ basis) for basis in _SHAPES], axis=2)
        angular = replace(one.impulses, impulses=one.impulses.about(values.center_of_mass))
        # A rate is a mean over its interval, so the momentum is averaged, too: a load may begin, end or act as an
        # impulse within it.
        pushed = (angular.path(end) - angular.path(begin)) / (end - begin)[:, None]
        turned = rot.turned(attitudes, rates)
        slowed = -_integral(seconds, turned)
        pushed = pushed + (0.0 if is_damped else drag) * slowed
        columns = [shape, -pushed[:, :, None], -slowed[:, :, None], -turned[:, :, None] / 3.0]
        rows.append(_project_out(np.ones((len(seconds), 1)), np.concatenate(columns, axis=2)))
    is_pushed = any(drag > 0.0 for drag in drags) or any(len(one.impulses.seconds) for one in poses)
    trace = float(np.trace(values.inertia))
    before = [np.sum(basis * values.inertia) / trace / np.sum(basis * basis) for basis in _SHAPES]
    free, known = np.array([True] * 5 + [is_pushed, is_damped]), np.array([*before, 1.0 / trace, 0.0])
    found, sds = _least_squares(np.concatenate(rows), free, known, np.array([LOOSE] * 5 + [np.inf] * 2))
    tensor = possible_tensor(np.eye(3) / 3.0 + np.tensordot(found[:5], _SHAPES, 1), THIN)
    if is_pushed:
        trace = 1.0 / _inverse(found[5], sds[5], trace)
    damping = np.array([values.damping[0], max(float(found[6]) * trace, 0.0) if is_damped else values.damping[1]])
    return replace(values, inertia=trace * tensor, damping=damping)


def _inverse(found: float, sd: float, guess: float) -> float:
    """The value found for 1/guess if it is determined, otherwise 1/guess, limited to the largest likely value: the
    loads would throw a body that is far too light about.
    """
    most = found + TOLD * sd
    return float(found) if found > TOLD * sd else min(1.0 / guess, most) if most > 0.0 else 1.0 / guess


def _rates(poses: _Poses) -> tuple[FloatArray, FloatArray, FloatArray, Points]:
    """Begin and end (m,) [s] of intervals between two attitudes, attitudes midway (m, 4), and mean angular velocities
    (m, 3) [rad/s, body axes].
    """
    step = float(np.median(np.linalg.norm(rot.turns(poses.attitudes), axis=1)))
    apart = int(np.clip(TURN / max(step, 1e-9), 1, max(len(poses.seconds) // 8, 1)))
    begin, end = poses.seconds[:-apart], poses.seconds[apart:]
    turn = rot.logarithm(rot.product(rot.inverse(poses.attitudes[:-apart]), poses.attitudes[apart:]))
    middle = rot.product(poses.attitudes[:-apart], rot.exponential(0.5 * turn))
    # Within a gap the body may have made any number of turns.
    kept = end - begin < 3.0 * float(np.median(end - begin))
    return begin[kept], end[kept], middle[kept], (turn / (end - begin)[:, None])[kept]


def _project_out(basis: FloatArray, columns: FloatArray) -> FloatArray:
    """Rows (3 n, k) of columns (n, 3, k) minus their projection onto ``basis`` (n, b), for each axis."""
    Q, _ = np.linalg.qr(basis)
    rest = columns - np.tensordot(Q, np.tensordot(Q.T, columns, 1), 1)
    return rest.reshape(-1, columns.shape[2])


def _least_squares(
    rows: FloatArray, free: BoolArray, known: FloatArray, widths: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least-squares solution (k,) of rows (n, k + 1), whose last column is the right side, and standard deviations
    (k,). Only numbers that are ``free`` change from ``known``. widths: standard deviations of the prior of the free
    ones, which has the weight of one sample.
    """
    matrix, right = rows[:, :-1][:, free], rows[:, -1] - rows[:, :-1][:, ~free] @ known[~free]
    found, sds, noise = np.array(known), np.zeros(len(known)), 0.0
    for _ in range(2):
        whole = np.vstack([matrix, np.diag(noise / widths[free])])
        inverse = np.linalg.pinv(whole, rcond=1e-12)
        found[free] = inverse @ np.append(right, noise * known[free] / widths[free])
        rest = float(np.linalg.norm(matrix @ found[free] - right))
        noise = max(rest / np.sqrt(len(right)), 1e-12 * float(np.abs(right).max()))
        sds[free] = noise * np.linalg.norm(inverse, axis=1)
    return found, sds
