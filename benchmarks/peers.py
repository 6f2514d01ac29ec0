# SPDX-License-Identifier: MIT
"""What every contestant of the work-precision comparison is: a problem and a step go in, state rows come out.

A peer that isn't installed is left out with a word; a problem that it can't express is left out of its rows.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from problems import Problem


@dataclass
class Run:
    """One contestant set up on one problem with one step.

    restart: back to time 0, not timed. advance(t): carry it to t [s] and return nothing; timed. row: the present state (13,).
    steps: taken so far, or 0 where the tool doesn't say. compile_s: what compiling cost, apart from every other time.
    """

    restart: Callable[[], None]
    advance: Callable[[float], None]
    row: Callable[[], np.ndarray]
    steps: Callable[[], int] = lambda: 0
    compile_s: float = 0.0


@dataclass(frozen=True)
class Contestant:
    """tool and its version; name of the integrator; prepare(problem, step) gives a Run, or None if it can't carry the problem.

    step is seconds, or a tolerance where ``tolerance`` is true. cost: microseconds of one step, to plan a run by.
    """

    tool: str
    version: str
    name: str
    prepare: Callable[[Problem, float], Run | None]
    tolerance: bool = False
    cost: float = 5.0


def installed_peers() -> tuple[list[Contestant], list[str]]:
    """Contestants of every peer that can be imported, and what is missing."""
    found, missing = [], []
    for module in ("mujoco", "drake", "pinocchio", "bullet", "scipy", "diffrax", "heyoka"):
        try:
            found += importlib.import_module(f"peers_{module}").contestants()
        except ImportError as error:
            missing.append(f"{module}: {error}")
    return found, missing


def quaternion_product(a, b) -> np.ndarray:
    """a ⊗ b, both xyzw."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def quaternion_of(R: np.ndarray) -> np.ndarray:
    """Quaternion xyzw of a proper rotation matrix: the largest column of 4 q qᵀ, so that nothing cancels."""
    K = np.empty((4, 4))
    K[:3, :3] = R + R.T + (1.0 - np.trace(R)) * np.eye(3)
    K[3, :3] = K[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = 1.0 + np.trace(R)
    column = K[:, np.argmax(np.diag(K))]
    return column / np.linalg.norm(column)
