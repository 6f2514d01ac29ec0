# SPDX-License-Identifier: MIT
"""What a player makes of keys: straight lines for places, slerp the short way for attitudes; and the fewest keys that
keep within a tolerance of a motion.

Slerp: Shoemake, "Animating rotation with quaternion curves" (1985), as glTF 2.0, appendix C, has it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.compilation import njit
from ..simulation.quantities import attitude_angle

NEARLY_ALIKE = 1.0 - 1e-12
"""Cosine of half an angle so small that slerp is a straight line."""


def slerp(a: np.ndarray, b: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Attitudes (n, 4) at the shares u (n, 1) of the way from a to b (n, 4), the short way."""
    cosine = np.sum(a * b, axis=1, keepdims=True)
    b = np.where(cosine < 0.0, -b, b)
    cosine = np.abs(cosine)
    half = np.arccos(np.minimum(cosine, 1.0))
    near = cosine > NEARLY_ALIKE
    sine = np.where(near, 1.0, np.sin(half))
    own = np.where(near, 1.0 - u, np.sin((1.0 - u) * half) / sine)
    other = np.where(near, u, np.sin(u * half) / sine)
    mixed = own * a + other * b
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def blend(a: np.ndarray, b: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Poses (n, 7), position and attitude, at the shares u (n, 1) of the way from a to b."""
    return np.hstack([(1.0 - u) * a[:, :3] + u * b[:, :3], slerp(a[:, 3:], b[:, 3:], u)])


def attitude_angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles (n,) [rad, 0 to π] between attitudes (n, 4)."""
    along = np.abs(np.sum(a * b, axis=1))
    # The sine of half the angle: |a − b| of two unit vectors is twice the sine of half of theirs.
    apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return 2.0 * np.arctan2(apart * np.sqrt(np.maximum(1.0 - 0.25 * apart * apart, 0.0)), along)


@njit(cache=True, error_model="numpy")
def _place_error(times: np.ndarray, keys: np.ndarray, truth: np.ndarray, i: int, j: int, k: int) -> float:
    u = (times[k] - times[i]) / (times[j] - times[i])
    total = 0.0
    for c in range(keys.shape[1]):
        d = (1.0 - u) * keys[i, c] + u * keys[j, c] - truth[k, c]
        total += d * d
    return math.sqrt(total)


@njit(cache=True, error_model="numpy")
def _turn_error(
    times: np.ndarray, keys: np.ndarray, truth: np.ndarray, i: int, j: int, k: int, mixed: np.ndarray
) -> float:
    u = (times[k] - times[i]) / (times[j] - times[i])
    cosine = 0.0
    for c in range(4):
        cosine += keys[i, c] * keys[j, c]
    sign = -1.0 if cosine < 0.0 else 1.0
    cosine = abs(cosine)
    own, other = 1.0 - u, u
    if cosine < NEARLY_ALIKE:
        half = math.acos(min(cosine, 1.0))
        own, other = math.sin((1.0 - u) * half) / math.sin(half), math.sin(u * half) / math.sin(half)
    for c in range(4):
        mixed[c] = own * keys[i, c] + sign * other * keys[j, c]
    return attitude_angle(mixed, truth[k])


@njit(cache=True, error_model="numpy")
def _within(
    times: np.ndarray, keys: np.ndarray, truth: np.ndarray, i: int, j: int, tolerance: float, mixed: np.ndarray
) -> bool:
    for k in range(i + 1, j):
        if keys.shape[1] == 4:
            error = _turn_error(times, keys, truth, i, j, k, mixed)
        else:
            error = _place_error(times, keys, truth, i, j, k)
        if not error <= tolerance:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _kept(times: np.ndarray, keys: np.ndarray, truth: np.ndarray, tolerance: float, kept: np.ndarray) -> None:
    """Mark in kept (n,) the keys: from each to a far one that can follow it, found by steps that double, then halve."""
    n, i = len(times), 0
    mixed = np.empty(4)
    kept[0] = True
    while i < n - 1:
        good, step = i + 1, 1
        while good + step < n and _within(times, keys, truth, i, good + step, tolerance, mixed):
            good += step
            step *= 2
        while step > 1:
            step //= 2
            if good + step < n and _within(times, keys, truth, i, good + step, tolerance, mixed):
                good += step
        i = good
        kept[i] = True


def fewest_keys(times: np.ndarray, truth: np.ndarray, tolerance: float) -> np.ndarray:
    """Numbers (k,) of the times (n,) to keep, so that what is played from their single-precision values stays within
    ``tolerance`` of the truth (n, c) [m], or (n, 4) of attitudes [rad], at all times.
    """
    kept = np.zeros(len(times), dtype=bool)
    _kept(times, rounded(truth), np.ascontiguousarray(truth), tolerance, kept)
    return np.flatnonzero(kept)


def rounded(values: np.ndarray) -> np.ndarray:
    """Values in single precision, as float64."""
    return np.ascontiguousarray(values.astype(np.float32).astype(float))


@dataclass(frozen=True)
class Keys:
    """times (k,) [s], strictly ascending, and values (k, c), of attitudes where c is 4: what is written, in single
    precision."""

    times: np.ndarray
    values: np.ndarray

    def played(self, times: np.ndarray) -> np.ndarray:
        """What a player shows at these times (n,): values held before the first key and after the last."""
        if len(self.times) == 1:
            return np.repeat(self.values.astype(float), len(times), axis=0)
        at = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self.times) - 1)
        u = np.clip((times - self.times[at - 1]) / (self.times[at] - self.times[at - 1]), 0.0, 1.0)[:, np.newaxis]
        a, b = self.values[at - 1].astype(float), self.values[at].astype(float)
        return slerp(a, b, u) if a.shape[1] == 4 else (1.0 - u) * a + u * b
