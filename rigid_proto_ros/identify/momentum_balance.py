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
from dataclasses import replace

import numpy as np

from . import mass_parameters as mp
from . import measurements as ms
from . import rotations as rot
from .poses import FEWEST, Poses, integral
from .pushes import Pushes, pushes_of
from .triangles import upper_triangle
from .unknowns import Unknowns, Values

TURN = 0.5
"""Between the two attitudes that give an angular velocity [rad]: farther apart the mean isn't the middle's."""
TOLD = 4.0
"""Standard deviations that 1/m and 1/tr I have to be above 0, to say the mass and the size of the tensor."""
THINNEST = 1e-2
"""Least second moment of the first body, of the largest."""
LOOSE = 3.0
"""Standard deviation of what is assumed of shape and, in sizes of the body, of the centre of mass."""
MOST_LEFT_OUT = 0.3
"""Part of the rates that may be left out because a load begins or ends within them."""


def balanced_values(poses: Sequence[Poses], unknowns: Unknowns, values: Values) -> Values:
    """``values`` with the free ones of mass, COM, tensor and damping as the poses' balance of momentum says, where it
    does.
    """
    pushes = [pushes_of(one) for one in poses]
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


def _from_path(
    poses: Sequence[Poses], pushes: Sequence[Pushes], values: Values, com: np.ndarray, free: set[str]
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
        moved = -integral(one.seconds, p + np.einsum("nij,j->ni", turns, com) - p[0])
        way = push.way(one.seconds, push.impulses)
        known = way + (0.0 if "damping" in free else drag) * moved
        right = -p + 0.5 * one.gravity * t * t
        parts = {"com": turns, "mass": -known[:, :, None], "damping": -moved[:, :, None]}
        parts["gravity"] = -0.5 * np.eye(3) * (t * t)[:, :, None]
        if "com" not in free:
            right = right - np.einsum("nij,j->ni", turns, com)
        if ("mass", 1) not in asked:
            right = right + known / body.mass
        block = np.zeros((len(t), 3, count + 9 * len(with_path)))
        at = 0
        for name, width in asked:
            block[:, :, at : at + width] = parts[name]
            at += width
        at += 9 * number
        block[:, :, at : at + 3], block[:, :, at + 3 : at + 6] = -np.eye(3), -np.eye(3) * t[:, :, None]
        if one.is_reckoned:
            # A first attitude that is a little off shows as gravity that is.
            block[:, :, at + 6 : at + 9] = -0.5 * np.eye(3) * (t * t)[:, :, None]
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
    poses: Sequence[Poses],
    pushes: Sequence[Pushes],
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
        slowing = -integral(seconds, turned)
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


def _rates(poses: Poses, pushes: Pushes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
