# SPDX-License-Identifier: MIT
"""Loads of a wrench's messages: commands that hold until the next one, or samples of what changed in between."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.vectors import vector
from ..motion.loads import Load
from .measurements import LoadHistory, SampledChanges, load_history

WRENCH_TIMEOUT_NS = 1_500_000_000
"""A wrench holds until the next message, and at most as long as the node's own default."""
STEADY = 0.5
"""Gaps between messages that differ from the usual one by less than this part of it are of one rate."""
FEWEST_SAMPLED = 20
"""Messages of a wrench that is called sampled."""
LEAST_JUMP, MOST_CHANGES = 0.03, 16
"""A sampled load's jump counts where it is more than this part of the largest force or torque, and so many do."""


def wrench_history(
    topic: str, times: np.ndarray, numbers: np.ndarray, axes: str, where: tuple[float, float, float] | None
) -> LoadHistory:
    """Of messages at times (m,) [ns], ascending, with forces and torques (m, 6) along the axes of ``Load``, at a point
    of the tracked frame or, for None, at the centre of mass.
    """
    acts: np.ndarray = np.any(numbers != 0.0, axis=1)
    same = np.append(False, np.all(numbers[1:] == numbers[:-1], axis=1))
    begins, sds_s = _begins(times, acts)
    ends = np.minimum(np.append(begins[1:], times[-1] + WRENCH_TIMEOUT_NS), times + WRENCH_TIMEOUT_NS)
    rows: list[tuple[int, int, np.ndarray]] = []
    before, which = np.full(len(times), -1), np.full(len(times), -1)
    for k in range(len(times)):
        before[k] = which[k - 1] if k and ends[k - 1] == begins[k] else -1
        if not acts[k]:
            continue
        if same[k] and before[k] >= 0:
            rows[-1] = (rows[-1][0], int(ends[k]), rows[-1][2])
        else:
            load = Load(axes, where, vector(numbers[k, :3]), vector(numbers[k, 3:]))
            rows.append((int(begins[k]), int(ends[k]), load.row))
        which[k] = len(rows) - 1
    sds_s *= _sharpness(numbers)
    counted = np.sort(np.argsort(-sds_s)[:MOST_CHANGES])
    counted = counted[sds_s[counted] > 0.0]
    changes = SampledChanges(before[counted], which[counted], sds_s[counted])
    return replace(load_history(rows), topic=topic, changes=changes)


def _sharpness(numbers: np.ndarray) -> np.ndarray:
    """Which part of each change to the loads (m, 6) is a jump (m,): what changes steadily is known in between."""
    forces, torques = numbers[:, :3], numbers[:, 3:]
    parts = [part / max(float(np.linalg.norm(part, axis=1).max()), 1e-300) for part in (forces, torques)]
    steps = np.diff(np.hstack(parts), axis=0, prepend=np.hstack(parts)[:1])
    around = 0.5 * (np.vstack([steps[1:], steps[-1:]]) + np.vstack([steps[:1], steps[:-1]]))
    sizes, sharp = np.linalg.norm(steps, axis=1), np.linalg.norm(steps - around, axis=1)
    return np.where((sizes > 0.0) & (sharp > LEAST_JUMP), np.minimum(sharp / np.maximum(sizes, 1e-300), 1.0), 0.0)


def _begins(times_ns: np.ndarray, acts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """When the loads of messages at times_ns (m,) begin (m,), and how well that is known (m,) [s].

    A command acts from its stamp on. A wrench at a steady rate that is also sent while nothing acts was sampled: it
    changed at any time since the message before, on average in the middle.
    """
    gaps = np.diff(times_ns)
    if len(times_ns) < FEWEST_SAMPLED or not np.any(~acts[:-1] & acts[1:]):
        return times_ns, np.zeros(len(times_ns))
    usual = float(np.median(gaps))
    steady = np.append(False, np.abs(gaps - usual) < STEADY * usual)
    if steady.mean() < 0.5:
        return times_ns, np.zeros(len(times_ns))
    waited = np.where(steady, np.append(0, gaps), 0)
    return times_ns - waited // 2, 1e-9 * waited / np.sqrt(12.0)
