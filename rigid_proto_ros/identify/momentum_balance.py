# SPDX-License-Identifier: MIT
"""A first body from measured poses alone, by linear least squares: no guess of the body, nothing is integrated.

With R the attitude, c the centre of mass and S the tensor divided by its trace, all measured samples obey

    p + R c = x0 + v0 t + ½ g t² + (1/m) ∬ F dt²,        R S ω = L0 + κ ∫ τ dt,    κ = 1 / tr I,

which are linear in c, 1/m and the start of the path, then in S, κ and L0. The trace of S is 1, so that rates that are
noise don't make the body small. Linear drag adds a term of ∫ p dt, angular damping one of ∫ ω dt. As the loads'
integrals are known, one poke in a long fall tells the mass as well as in a short one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..motion import loads as ld
from . import mass_parameters as mp
from . import measurements as ms
from . import rotations as rot
from .triangles import upper_triangle
from .unknowns import Unknowns, Values

TURN = 0.5
"""Between the two attitudes that give an angular velocity [rad]: farther apart the mean isn't the middle's."""
POINTS = 8
"""At which a load is looked at for each time between two samples, and at least."""
TOLD = 4.0
"""Standard deviations that 1/m and 1/tr I have to be above 0, to say the mass and the size of the tensor."""
THINNEST = 1e-2
"""Least second moment of the first body, of the largest."""
LOOSE = 3.0
"""Standard deviation of what is assumed of shape and, in sizes of the body, of the centre of mass."""
FEWEST = 8
"""Poses of a flight."""
MOST_POINTS = 200
MOST_LEFT_OUT = 0.3
"""Part of the rates that may be left out because a load begins or ends within them."""


@dataclass(frozen=True)
class _Poses:
    """What a flight's poses say. seconds (n,) from its begin, positions (n, 3) or None, attitudes (n, 4) xyzw."""

    flight: ms.MeasuredFlight
    seconds: np.ndarray
    positions: np.ndarray | None
    attitudes: np.ndarray

    def attitude_at(self, seconds: np.ndarray) -> np.ndarray:
        """Attitudes (m, 4) between the samples."""
        after = np.clip(np.searchsorted(self.seconds, seconds), 1, len(self.seconds) - 1)
        first, last = self.attitudes[after - 1], self.attitudes[after]
        begin, end = self.seconds[after - 1], self.seconds[after]
        part = np.clip((seconds - begin) / (end - begin), 0.0, 1.0)
        return rot.product(first, rot.exponential(part[:, None] * rot.logarithm(rot.product(rot.inverse(first), last))))


@dataclass(frozen=True)
class _Pushes:
    """Small pushes that stand for a flight's loads: seconds (k,) ascending, impulses (k, 3) [N s, world], and angular
    ones about the tracked frame's origin (k, 3) [N m s, world]; where their forces attack is given by ``about``.
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

    def momentum(self, seconds: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Sums (n, 3) of ``pushes`` (k, 3) up to each time."""
        sums = np.vstack([np.zeros(3), np.cumsum(pushes, axis=0)])
        return sums[np.searchsorted(self.seconds, seconds, side="right")]

    def way(self, seconds: np.ndarray) -> np.ndarray:
        """∬ F dt² (n, 3) up to each time [N s²]."""
        return self.momentum(seconds, self.impulses) * seconds[:, None] - self.momentum(
            seconds, self.impulses * self.seconds[:, None]
        )


def balanced_values(flights: Sequence[ms.MeasuredFlight], unknowns: Unknowns, values: Values) -> Values | None:
    """``values`` with the free ones of mass, COM, tensor and damping as the poses' balance of momentum says, where it
    does; None where a flight has no attitudes.
    """
    topics = list(dict.fromkeys(series.topic for flight in flights for series in flight.series))
    found = [_poses(flight, dict(zip(topics, values.offsets, strict=True))) for flight in flights]
    poses = [one for one in found if one is not None]
    if len(poses) < len(found):
        return None
    pushes = [_pushes(one) for one in poses]
    names = {mp.MASS: "mass", 7: "com", 8: "com", 9: "com"}
    free = {name for name, _ in unknowns.slots} | {names.get(index, "shape") for _, index in unknowns.theta_columns}
    body = values.body
    com, mass, drag = values.theta[mp.COM], body.mass, float(values.damping[0])
    for _ in range(2 if drag > 0.0 or "damping" in free else 1):
        # Drag is that of the centre of mass, whose path has to be known for it.
        com, mass, drag = _from_path(poses, pushes, values, com, free)
    inertia, damping = body.inertia * (mass / body.mass), float(values.damping[1])
    if "shape" in free:
        inertia, damping = _from_turns(poses, pushes, values, inertia, com, "damping" in free)
    return replace(values, theta=mp.parameters_of(mass, com, inertia), damping=np.array([drag, damping]))


def _poses(flight: ms.MeasuredFlight, offsets: dict[str, float]) -> _Poses | None:
    attitude = next((s for s in flight.series if s.kind == ms.ATTITUDE), None)
    if attitude is None or len(attitude.times_ns) < FEWEST:
        return None
    seconds = 1e-9 * (attitude.times_ns - flight.begin_ns) + offsets[attitude.topic]
    position = next((s for s in flight.series if s.kind == ms.POSITION and s.topic == attitude.topic), None)
    return _Poses(flight, seconds, None if position is None else position.values, attitude.values)


def _pushes(poses: _Poses) -> _Pushes:
    acting, begin_ns = poses.flight.acting, poses.flight.begin_ns
    begin, end = (1e-9 * (edge - begin_ns) for edge in (acting.begin_ns, acting.end_ns))
    apart = float(np.median(np.diff(poses.seconds)))
    counts = np.clip(np.ceil(POINTS * (end - begin) / apart), POINTS, MOST_POINTS).astype(int)
    counts[begin == end] = 1
    which = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    length = np.where(begin == end, 1.0, end - begin)[which] / counts[which]
    seconds = begin[which] + (end - begin)[which] * (number + 0.5) / counts[which]
    order = np.argsort(seconds, kind="stable")
    which, seconds, length = which[order], seconds[order], length[order, None]
    rows, attitudes = acting.loads[which], poses.attitude_at(seconds)
    in_body = (rows[:, ld.LOAD_AXES] != ld.WORLD_AXES)[:, None]
    force, torque = (
        np.where(in_body, rot.turned(attitudes, vectors), vectors)
        for vectors in (rows[:, ld.FORCE : ld.FORCE + 3], rows[:, ld.TORQUE : ld.TORQUE + 3])
    )
    has_point = rows[:, ld.HAS_POINT] != 0.0
    arm = np.where(has_point[:, None], rot.turned(attitudes, rows[:, ld.POINT : ld.POINT + 3]), 0.0)
    return _Pushes(seconds, length * force, length * (torque + rot.cross(arm, force)), ~has_point, attitudes)


def _from_path(
    poses: Sequence[_Poses], pushes: Sequence[_Pushes], values: Values, com: np.ndarray, free: set[str]
) -> tuple[np.ndarray, float, float]:
    """Centre of mass [m, tracked frame], mass [kg] and linear damping [N s/m]."""
    body, drag = values.body, float(values.damping[0])
    shared = [("com", 3), ("mass", 1), ("damping", 1), ("gravity", 3)]
    loaded = any(len(push.seconds) for push in pushes)
    asked = [(n, k) for n, k in shared if n in free and (n != "mass" or loaded or drag > 0.0)]
    count = sum(k for _, k in asked)
    with_path = [(one, push) for one, push in zip(poses, pushes, strict=True) if one.positions is not None]
    blocks, rights = [], []
    for number, (one, push) in enumerate(with_path):
        t, p, turns = one.seconds[:, None], one.positions, rot.turned(one.attitudes[:, None], np.eye(3)[None])
        assert p is not None
        # Columns of the attitude's matrix are its turned axes.
        turns = turns.transpose(0, 2, 1)
        moved = -_integral(one.seconds, p + np.einsum("nij,j->ni", turns, com) - p[0])
        way = push.way(one.seconds)
        known = way + (0.0 if "damping" in free else drag) * moved
        right = -p + 0.5 * np.array(one.flight.gravity) * t * t
        parts = {"com": turns, "mass": -known[:, :, None], "damping": -moved[:, :, None]}
        parts["gravity"] = -0.5 * np.eye(3) * (t * t)[:, :, None]
        if "com" not in free:
            right = right - np.einsum("nij,j->ni", turns, com)
        if ("mass", 1) not in asked:
            right = right + known / body.mass
        block = np.zeros((len(t), 3, count + 6 * len(with_path)))
        at = 0
        for name, width in asked:
            block[:, :, at : at + width] = parts[name]
            at += width
        at += 6 * number
        block[:, :, at : at + 3], block[:, :, at + 3 : at + 6] = -np.eye(3), -np.eye(3) * t[:, :, None]
        blocks.append(block.reshape(-1, block.shape[2]))
        rights.append(right.ravel())
    if not blocks or not asked:
        return com, body.mass, drag
    size = float(np.sqrt(np.trace(body.inertia) / body.mass))
    assumed = values.theta[mp.COM] if "com" in free else np.zeros(0)
    prior = np.eye(len(assumed), blocks[0].shape[1]) / (LOOSE * size)
    found, sds = _solved(np.concatenate(blocks), np.concatenate(rights), prior, assumed / (LOOSE * size))
    numbers, errors = {}, {}
    at = 0
    for name, width in asked:
        numbers[name], errors[name] = found[at : at + width], sds[at : at + width]
        at += width
    com = numbers.get("com", com)
    mass = body.mass
    if "mass" in numbers and numbers["mass"][0] > TOLD * errors["mass"][0]:
        mass = 1.0 / float(numbers["mass"][0])
    if "damping" in numbers:
        drag = max(float(numbers["damping"][0]) * mass, 0.0)
    return com, mass, drag


def _from_turns(
    poses: Sequence[_Poses],
    pushes: Sequence[_Pushes],
    values: Values,
    before: np.ndarray,
    com: np.ndarray,
    damped: bool,
) -> tuple[np.ndarray, float]:
    """Tensor [kg m²] and angular damping [N m s]; before: the tensor where the turns don't say it."""
    known = 0.0 if damped else float(values.damping[1])
    loaded = known > 0.0 or any(len(push.seconds) for push in pushes)
    shared = 5 + loaded + damped
    blocks, rights = [], []
    for number, (one, push) in enumerate(zip(poses, pushes, strict=True)):
        seconds, attitudes, rates = _rates(one, push)
        turned = rot.turned(attitudes, rates)
        block = np.zeros((len(seconds), 3, shared + 3 * len(poses)))
        for k, basis in enumerate(_SHAPES):
            block[:, :, k] = rot.turned(attitudes, rates @ basis)
        slowing = -_integral(seconds, turned)
        if loaded:
            block[:, :, 5] = -(push.momentum(seconds, push.about(com)) + known * slowing)
        if damped:
            block[:, :, 5 + loaded] = -slowing
        at = shared + 3 * number
        block[:, :, at : at + 3] = -np.eye(3)
        blocks.append(block.reshape(-1, block.shape[2]))
        rights.append(-turned.ravel() / 3.0)
    shape = before / np.trace(before)
    prior = np.zeros((5, shared + 3 * len(poses)))
    prior[:, :5] = np.eye(5) / LOOSE
    assumed = np.array([np.sum(basis * shape) / np.sum(basis * basis) for basis in _SHAPES]) / LOOSE
    found, sds = _solved(np.concatenate(blocks), np.concatenate(rights), prior, assumed)
    shape = np.eye(3) / 3.0 + sum(number * basis for number, basis in zip(found[:5], _SHAPES, strict=True))
    trace = float(np.trace(before))
    if loaded and found[5] > TOLD * sds[5]:
        trace = 1.0 / float(found[5])
    damping = max(float(found[5 + loaded]) * trace, 0.0) if damped else known
    return trace * mp.possible_tensor(shape, THINNEST), damping


def _rates(poses: _Poses, pushes: _Pushes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Seconds (m,), attitudes (m, 4) and angular velocities (m, 3) [rad/s, body axes]: a gyro's, or midway between two
    attitudes.
    """
    flight = poses.flight
    rate = next((s for s in flight.series if s.kind == ms.RATE and s.in_body), None)
    if rate is not None and len(rate.times_ns) >= FEWEST:
        seconds = 1e-9 * (rate.times_ns - flight.begin_ns)
        inside = (seconds >= poses.seconds[0]) & (seconds <= poses.seconds[-1])
        if inside.sum() >= FEWEST:
            return seconds[inside], poses.attitude_at(seconds[inside]), rate.values[inside]
    step = np.linalg.norm(rot.logarithm(rot.product(rot.inverse(poses.attitudes[:-1]), poses.attitudes[1:])), axis=1)
    apart = int(np.clip(TURN / max(float(np.median(step)), 1e-9), 1, max(len(poses.seconds) // 8, 1)))
    begin, end = poses.seconds[:-apart], poses.seconds[apart:]
    turn = rot.logarithm(rot.product(rot.inverse(poses.attitudes[:-apart]), poses.attitudes[apart:]))
    middle = rot.product(poses.attitudes[:-apart], rot.exponential(0.5 * turn))
    # Over a gap the body may have turned by any number of times.
    kept = end - begin < 3.0 * float(np.median(end - begin))
    acts = np.searchsorted(pushes.seconds, begin) < np.searchsorted(pushes.seconds, end, side="right")
    if np.sum(kept & acts) < MOST_LEFT_OUT * np.sum(kept):
        kept &= ~acts
    return (0.5 * (begin + end))[kept], middle[kept], (turn / (end - begin)[:, None])[kept]


def _integral(seconds: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """∫ (n, 3) of vectors (n, 3) from the first time on, by trapezoids."""
    steps = 0.5 * np.diff(seconds)[:, None] * (vectors[1:] + vectors[:-1])
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])


def _solved(
    matrix: np.ndarray, right: np.ndarray, prior: np.ndarray, assumed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers and their standard deviations. The prior rows, in standard deviations, count as much as a sample's."""
    noise = 0.0
    triangle = upper_triangle(np.column_stack([matrix, right]).T)
    for _ in range(2):
        whole = np.vstack([triangle, noise * np.column_stack([prior, assumed])])
        left, sizes, axes = np.linalg.svd(whole[:, :-1], full_matrices=False)
        inverse = np.where(sizes > 1e-12 * sizes[0], 1.0 / np.maximum(sizes, 1e-300), 0.0)
        found = axes.T @ (inverse * (left.T @ whole[:, -1]))
        rest = float(np.linalg.norm(triangle[:, :-1] @ found - triangle[:, -1]))
        noise = max(rest / np.sqrt(len(matrix)), 1e-12 * float(np.abs(right).max()))
    return found, noise * np.linalg.norm(axes.T * inverse, axis=1)


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
