# SPDX-License-Identifier: MIT
"""How a state is judged: against the reference, and by what physics says stays constant."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "test"))

from reference_motion import angle_between, rotation_of

from problems import Problem, rotation


def sane(row: np.ndarray) -> bool:
    """Finite, and small enough that squares of it are."""
    return bool((np.abs(row) < 1e100).all())


def errors(problem: Problem, row: np.ndarray, reference: list | None) -> dict:
    """Attitude error [rad], position error [m] and rate error [rad/s] of a row (13,) against the reference row, if any."""
    if reference is None or not sane(row):
        return dict.fromkeys(("attitude_error_rad", "position_error_m", "rate_error_rad_s"), np.nan)
    difference = [float(b - float(a)) for a, b in zip(row, reference, strict=True)]
    return {
        "attitude_error_rad": angle_between(row[3:7], rotation_of(reference[3:7])),
        "position_error_m": float(np.linalg.norm(difference[:3])),
        "rate_error_rad_s": float(np.linalg.norm(difference[10:])),
    }


def energy(problem: Problem, row: np.ndarray) -> tuple[float, float]:
    """Total energy [J], with gravity's and the string's potential, and the kinetic part of it."""
    if not sane(row):
        return float("nan"), float("nan")
    x, v, w = row[:3], row[7:10], row[10:]
    kinetic = 0.5 * problem.mass * (v @ v) + 0.5 * (w @ np.array(problem.inertia) @ w)
    total = kinetic - problem.mass * (np.array(problem.gravity) @ x)
    s = problem.spring
    if s is not None:
        stretch = np.linalg.norm(np.array(s.target) - x - rotation(row[3:7]) @ np.array(s.point)) - s.rest_length
        if s.bilateral or stretch > 0.0:
            total += 0.5 * s.stiffness * stretch**2
    return total, kinetic


def momentum_error(problem: Problem, row: np.ndarray) -> float:
    """|L − L(0)|/|L(0)| as vectors in the world."""
    I = np.array(problem.inertia)
    start = rotation(problem.row[3:7]) @ (I @ np.array(problem.row[10:]))
    if not sane(row):
        return float("nan")
    return float(np.linalg.norm(rotation(row[3:7]) @ (I @ row[10:]) - start) / np.linalg.norm(start))
