# SPDX-License-Identifier: MIT
"""A first body from measured poses alone, by linear least squares: no guess of the body, nothing is integrated.

With R the attitude, c the centre of mass and S the tensor divided by its trace, all measured samples obey

    p + R c = x0 + v0 t + ½ g t² + (1/m) ∬ F dt² - (d/m) ∫ p dt,      R S ω = L0 + κ ∫ τ dt - κ a ∫ ω dt,  κ = 1 / tr I,

which are linear in c, 1/m, d/m, g and the start of the path, then in S, κ, κ a and L0; d and a: damping. The trace of S
is 1, so that rates that are noise don't make the body small. As the loads' integrals are known, one poke in a long fall
tells the mass as well as in a short one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..motion import loads as ld
from . import measurements as ms
from . import rotations as rot
from .incremental_qr import upper_triangle
from .unknowns import Unknowns, Values, possible_tensor

TURN = 0.5
"""Between the two attitudes that give an angular velocity [rad]: farther apart the mean isn't the middle's."""
TOLD = 4.0
"""Standard deviations that 1/m and 1/tr I have to be above 0, to say the mass and the size of the tensor."""
THIN = 1e-2
"""Least second moment of the first body, of the largest."""
LOOSE = 3.0
"""Standard deviation of what is assumed of shape and, in sizes of the body, of the centre of mass."""
MOST_LEFT_OUT = 0.3
"""Part of the rates that may be left out because a load begins or ends within them."""
POINTS = 8
"""Impulses that stand for a load between two samples, and at least for each load."""
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
"""What the shape may have beside a third of the unit tensor: symmetric, of trace 0."""


@dataclass(frozen=True)
class Impulses:
    """A flight's loads as small impulses, whose sums are the integrals that the balance of momentum needs.

    seconds (k,) ascending, impulses (k, 3) [N s, world], and angular ones about the tracked frame's origin (k, 3)
    [N m s, world], or about the centre of mass where ``at_com`` (k,); attitudes (k, 4): of the body then.
    """

    seconds: np.ndarray
    impulses: np.ndarray
    angular: np.ndarray
    at_com: np.ndarray
    attitudes: np.ndarray

    def about(self, com: np.ndarray) -> np.ndarray:
        """Angular impulses (k, 3) about the centre of mass [N m s, world]."""
        moved = self.angular - rot.cross(rot.turned(self.attitudes, com), self.impulses)
        return np.where(self.at_com[:, None], self.angular, moved)

    def momentum(self, seconds: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Sums (n, 3) of ``impulses`` (k, 3) up to each time."""
        sums = np.vstack([np.zeros(3), np.cumsum(impulses, axis=0)])
        return sums[np.searchsorted(self.seconds, seconds, side="right")]

    def path(self, seconds: np.ndarray) -> np.ndarray:
        """∬ F dt² (n, 3) up to each time [N s²]."""
        sums = self.momentum(seconds, self.impulses * self.seconds[:, None])
        return self.momentum(seconds, self.impulses) * seconds[:, None] - sums


@dataclass(frozen=True)
class _Poses:
    """Of a flight, seconds (n,) from its begin, positions (n, 3) [m], attitudes (n, 4) xyzw, and its loads."""

    seconds: np.ndarray
    positions: np.ndarray
    attitudes: np.ndarray
    impulses: Impulses


@dataclass(frozen=True)
class _Equations:
    """columns by unknown (n, 3, k) and right side (n, 3): the sum of columns times unknowns is the right side."""

    columns: Mapping[str, np.ndarray]
    right: np.ndarray


def initial_values(flights: Sequence[ms.MeasuredFlight], unknowns: Unknowns, values: Values) -> Values:
    """``values`` with the free ones of mass, COM, tensor, damping and gravity as the balance of momentum says, where it
    does.
    """
    poses = [_poses_of(flight, values) for flight in flights]
    for _ in range(2 if values.damping[0] > 0.0 or "damping" in unknowns else 1):
        # Drag is that of the centre of mass, whose path has to be known for it.
        values = _from_path(poses, unknowns, values)
    return _from_turns(poses, unknowns, values)


def _poses_of(flight: ms.MeasuredFlight, values: Values) -> _Poses:
    assert flight.pose is not None
    position, attitude = flight.pose
    seconds = 1e-9 * (attitude.times_ns - flight.begin_ns) + values.offset(attitude.topic)
    loads = flight.load_history.moved(values.offset(flight.load_history.topic), np.zeros(0))
    impulses = _impulses_of(loads, flight.begin_ns, seconds, attitude.values)
    return _Poses(seconds, position.values, attitude.values, impulses)


def _attitudes_at(seconds: np.ndarray, known_s: np.ndarray, attitudes: np.ndarray) -> np.ndarray:
    """Attitudes (m, 4) at times between the samples (n, 4) at ``known_s`` (n,)."""
    after = np.clip(np.searchsorted(known_s, seconds), 1, len(known_s) - 1)
    first, last = attitudes[after - 1], attitudes[after]
    part = np.clip((seconds - known_s[after - 1]) / (known_s[after] - known_s[after - 1]), 0.0, 1.0)
    return rot.product(first, rot.exponential(part[:, None] * rot.logarithm(rot.product(rot.inverse(first), last))))


def _impulses_of(history: ms.LoadHistory, begin_ns: int, seconds: np.ndarray, attitudes: np.ndarray) -> Impulses:
    """Of a flight's loads, turned by its attitudes (n, 4) at seconds (n,) since ``begin_ns``."""
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
    rows, turns = history.loads[which[order]], _attitudes_at(middles, seconds, attitudes)
    in_body = rows[:, ld.LOAD_AXES, None] != ld.WORLD_AXES
    force, torque = (
        np.where(in_body, rot.turned(turns, vectors), vectors)
        for vectors in (rows[:, ld.FORCE : ld.FORCE + 3], rows[:, ld.TORQUE : ld.TORQUE + 3])
    )
    has_point = rows[:, ld.HAS_POINT] != 0.0
    arm = np.where(has_point[:, None], rot.turned(turns, rows[:, ld.POINT : ld.POINT + 3]), 0.0)
    return Impulses(middles, length * force, length * (torque + rot.cross(arm, force)), ~has_point, turns)


def _from_path(poses: Sequence[_Poses], unknowns: Unknowns, values: Values) -> Values:
    """With centre of mass, mass, linear damping and gravity from how the centre of mass moves."""
    com, mass, drag = values.center_of_mass, values.mass, float(values.damping[0])
    is_loaded = drag > 0.0 or any(len(one.impulses.seconds) for one in poses)
    equations = []
    for number, one in enumerate(poses):
        t = one.seconds[:, None]
        # Columns of the attitude's matrix are its turned axes.
        turns = rot.turned(one.attitudes[:, None], np.eye(3)[None]).transpose(0, 2, 1)
        moved = -integral(one.seconds, one.positions + turns @ com - one.positions[0])
        known = one.impulses.path(one.seconds) + (0.0 if "damping" in unknowns else drag) * moved
        columns = {
            f"place {number}": np.broadcast_to(-np.eye(3), turns.shape),
            f"velocity {number}": -np.eye(3) * t[:, :, None],
        }
        right = -one.positions
        if "com" in unknowns:
            columns["com"] = turns
        else:
            right = right - turns @ com
        if "mass" in unknowns and is_loaded:
            columns["1/m"] = -known[:, :, None]
        else:
            right = right + known / mass
        if "damping" in unknowns:
            columns["d/m"] = -moved[:, :, None]
        fall = 0.5 * np.eye(3) * (t * t)[:, :, None]
        if "gravity" in unknowns:
            columns["gravity"] = -fall
        else:
            right = right + fall @ values.gravity
        equations.append(_Equations(columns, right))
    found = _solved(equations, {"com": (com, LOOSE * values.size)})
    inverse, sd = found.get("1/m", (np.zeros(1), np.ones(1)))
    if inverse[0] > TOLD * sd[0]:
        mass = 1.0 / float(inverse[0])
    if "d/m" in found:
        drag = max(float(found["d/m"][0][0]) * mass, 0.0)
    return replace(
        values,
        mass=mass,
        inertia=values.inertia * (mass / values.mass),
        center_of_mass=found["com"][0] if "com" in found else com,
        damping=np.array([drag, values.damping[1]]),
        gravity=found["gravity"][0] if "gravity" in found else values.gravity,
    )


def _from_turns(poses: Sequence[_Poses], unknowns: Unknowns, values: Values) -> Values:
    """With tensor and angular damping from how the body turns."""
    if "inertia" not in unknowns:
        return values
    is_damped, known = "damping" in unknowns, float(values.damping[1])
    is_loaded = known > 0.0 or any(len(one.impulses.seconds) for one in poses)
    equations = []
    for number, one in enumerate(poses):
        seconds, attitudes, rates = _rates(one)
        turned = rot.turned(attitudes, rates)
        shape = np.stack([rot.turned(attitudes, rates @ basis) for basis in _SHAPES], axis=2)
        columns = {"shape": shape, f"momentum {number}": np.broadcast_to(-np.eye(3), (len(seconds), 3, 3))}
        slowing = -integral(seconds, turned)
        if is_loaded:
            torques = one.impulses.momentum(seconds, one.impulses.about(values.center_of_mass))
            columns["1/trace"] = -(torques + (0.0 if is_damped else known) * slowing)[:, :, None]
        if is_damped:
            columns["a/trace"] = -slowing[:, :, None]
        equations.append(_Equations(columns, -turned / 3.0))
    trace = float(np.trace(values.inertia))
    before = values.inertia / trace
    assumed = np.array([np.sum(basis * before) / np.sum(basis * basis) for basis in _SHAPES])
    found = _solved(equations, {"shape": (assumed, LOOSE)})
    tensor = np.eye(3) / 3.0 + np.tensordot(found["shape"][0], _SHAPES, 1)
    if is_loaded:
        inverse, sd = found["1/trace"]
        trace = 1.0 / float(inverse[0]) if inverse[0] > TOLD * sd[0] else trace
    damping = max(float(found["a/trace"][0][0]) * trace, 0.0) if is_damped else known
    return replace(
        values, inertia=trace * possible_tensor(tensor, THIN), damping=np.array([values.damping[0], damping])
    )


def _rates(poses: _Poses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Seconds (m,), attitudes (m, 4) and angular velocities (m, 3) [rad/s, body axes] midway between two attitudes."""
    step = np.linalg.norm(rot.logarithm(rot.product(rot.inverse(poses.attitudes[:-1]), poses.attitudes[1:])), axis=1)
    apart = int(np.clip(TURN / max(float(np.median(step)), 1e-9), 1, max(len(poses.seconds) // 8, 1)))
    begin, end = poses.seconds[:-apart], poses.seconds[apart:]
    turn = rot.logarithm(rot.product(rot.inverse(poses.attitudes[:-apart]), poses.attitudes[apart:]))
    middle = rot.product(poses.attitudes[:-apart], rot.exponential(0.5 * turn))
    # Over a gap the body may have turned by any number of times.
    kept = end - begin < 3.0 * float(np.median(end - begin))
    pushed = poses.impulses.seconds
    acts = np.searchsorted(pushed, begin) < np.searchsorted(pushed, end, side="right")
    if np.sum(kept & acts) < MOST_LEFT_OUT * np.sum(kept):
        kept &= ~acts
    return (0.5 * (begin + end))[kept], middle[kept], (turn / (end - begin)[:, None])[kept]


def integral(seconds: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """∫ (n, 3) of vectors (n, 3) from the first time on, by trapezoids."""
    steps = 0.5 * np.diff(seconds)[:, None] * (vectors[1:] + vectors[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def _solved(
    equations: Sequence[_Equations], assumed: Mapping[str, tuple[np.ndarray, float]]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Numbers (k,) by unknown and their standard deviations. assumed: numbers and their standard deviation, which count
    as much as one sample.
    """
    widths = {name: column.shape[2] for one in equations for name, column in one.columns.items()}
    ends = np.cumsum(list(widths.values()))
    places = {name: slice(end - width, end) for (name, width), end in zip(widths.items(), ends, strict=True)}
    rows = []
    for one in equations:
        block = np.zeros((*one.right.shape, ends[-1] + 1))
        for name, column in one.columns.items():
            block[:, :, places[name]] = column
        block[:, :, -1] = one.right
        rows.append(block.reshape(-1, ends[-1] + 1))
    matrix = np.concatenate(rows)
    prior = np.zeros((ends[-1], ends[-1] + 1))
    for name, (numbers, sd) in assumed.items():
        if name in places:
            prior[places[name], places[name]] = np.eye(len(numbers)) / sd
            prior[places[name], -1] = numbers / sd
    noise = 0.0
    triangle = upper_triangle(matrix.T)
    for _ in range(2):
        whole = np.vstack([triangle, noise * prior])
        left, sizes, axes = np.linalg.svd(whole[:, :-1], full_matrices=False)
        inverse = np.where(sizes > 1e-12 * sizes[0], 1.0 / np.maximum(sizes, 1e-300), 0.0)
        found = axes.T @ (inverse * (left.T @ whole[:, -1]))
        rest = float(np.linalg.norm(triangle[:, :-1] @ found - triangle[:, -1]))
        noise = max(rest / np.sqrt(len(matrix)), 1e-12 * float(np.abs(matrix[:, -1]).max()))
    sds = noise * np.linalg.norm(axes.T * inverse, axis=1)
    return {name: (found[place], sds[place]) for name, place in places.items()}
