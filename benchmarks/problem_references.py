# SPDX-License-Identifier: MIT
"""References of the problems in high precision, computed once with mpmath and cached with their digits.

    python benchmarks/problem_references.py [NAME ...]    computes the missing ones

Each is computed twice, with different digits and therefore different orders and steps; what both agree on is kept.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import mpmath
import numpy as np
from mpmath import mp, mpf

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "test"))

import itertools

from reference_motion import free_motion, rotation_of
from reference_taylor import ReferenceProblem, ReferenceString, reference_motion

from problems import PROBLEMS, VARIANTS, Problem

FOLDER = HERE / "references"


def reference_row(problem: Problem) -> list:
    """The 13 numbers (mpf) of the state at the problem's end; raises FileNotFoundError or ValueError (another problem)."""
    cached = json.loads((FOLDER / f"{problem.name}.json").read_text())
    if cached["fingerprint"] != problem.fingerprint:
        raise ValueError(f"references/{problem.name}.json belongs to another problem; delete it to compute it anew")
    with mp.workdps(50):
        return [mpf(c) for c in cached["row"]]


def compute(problem: Problem, digits: int) -> list:
    """The state (13 mpf) at the problem's end, segment by segment between the times where loads begin and end."""
    edges = {0.0, problem.duration}
    for w in problem.wrenches:
        edges |= {t for t in (w.begin, w.end) if t is not None}
    times = sorted(t for t in edges if t <= problem.duration)
    row = problem.row
    with mp.workdps(digits + 5):
        for begin, end in itertools.pairwise(times):
            for w in problem.wrenches:
                if w.impulse and w.begin == begin:
                    row = _after_impulse(problem, row, w)
            acting = [
                w for w in problem.wrenches if not w.impulse and w.begin <= begin and not (w.end or np.inf) <= begin
            ]
            # Command times are integer nanoseconds, so a segment's length is their exact difference.
            span = mpf(round(end * 1e9) - round(begin * 1e9)) / 10**9
            (row,) = reference_motion(_loaded(problem, acting), row, [span], digits)
    return row


def _loaded(problem: Problem, acting) -> ReferenceProblem:
    sums = {name: [mpf(0)] * 3 for name in ("force_world", "force_body", "torque_world", "torque_body")}
    moment = [[mpf(0)] * 3 for _ in range(3)]
    for w in acting:
        force, torque, arm = ([mpf(c) for c in part] for part in (w.force, w.torque, w.point))
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            sums[f"force_{w.axes}"][k] += force[k]
            sums[f"torque_{w.axes}"][k] += torque[k]
            if w.axes == "body":
                sums["torque_body"][k] += arm[a] * force[b] - arm[b] * force[a]
            else:
                moment[k] = [m + arm[k] * f for m, f in zip(moment[k], force, strict=True)]
    s = problem.spring
    string = None
    if s is not None:
        string = ReferenceString(s.point, s.target, s.stiffness, s.damping, s.rest_length, s.bilateral)
    return ReferenceProblem(
        problem.mass,
        problem.inertia,
        problem.gravity,
        moment=moment,
        linear_damping=problem.linear_damping,
        angular_damping=problem.angular_damping,
        string=string,
        **sums,
    )


def _after_impulse(problem: Problem, row, w) -> list:
    row = [mpf(c) for c in row]
    R = rotation_of(row[3:7])
    impulse, arm, turn = ([mpf(c) for c in part] for part in (w.force, w.point, w.torque))
    world = impulse if w.axes == "world" else [sum(R[i][j] * impulse[j] for j in range(3)) for i in range(3)]
    body = [sum(R[j][i] * world[j] for j in range(3)) for i in range(3)]
    if w.axes == "world":
        turn = [sum(R[j][i] * turn[j] for j in range(3)) for i in range(3)]
    turn = [turn[k] + arm[(k + 1) % 3] * body[(k + 2) % 3] - arm[(k + 2) % 3] * body[(k + 1) % 3] for k in range(3)]
    change = mpmath.lu_solve(
        mpmath.matrix([[mpf(c) for c in r] for r in problem.inertia]),
        mpmath.matrix(turn),
    )
    for k in range(3):
        row[7 + k] += world[k] / mpf(problem.mass)
        row[10 + k] += change[k]
    return row


def _closed_form(problem: Problem) -> list:
    """Torque-free: attitude and ω by elliptic functions, translation by Newton."""
    R, w = free_motion(problem.inertia, problem.row[10:13], problem.duration, problem.row[3:7])
    with mp.workdps(60):
        t = mpf(problem.duration)
        x, v, g = ([mpf(c) for c in part] for part in (problem.row[0:3], problem.row[7:10], problem.gravity))
        position = [x[k] + t * v[k] + t * t / 2 * g[k] for k in range(3)]
        return [*position, *_quaternion(R), *(v[k] + t * g[k] for k in range(3)), *w]


def _quaternion(R) -> list:
    diagonal = [R[0][0], R[1][1], R[2][2], R[0][0] + R[1][1] + R[2][2]]
    k = max(range(4), key=lambda i: diagonal[i])
    if k == 3:
        q = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1], 1 + diagonal[3]]
    else:
        i, j, m = k, (k + 1) % 3, (k + 2) % 3
        q = [mpf(0)] * 4
        q[i], q[j], q[m] = (
            1 + R[i][i] - R[j][j] - R[m][m],
            R[j][i] + R[i][j],
            R[m][i] + R[i][m],
        )
        q[3] = R[m][j] - R[j][m]
    size = mpmath.sqrt(sum(c * c for c in q))
    return [c / size for c in q]


def cache(problem: Problem, digits: int = 25) -> dict:
    """Compute, check against a second computation, write and return one reference."""
    begin = time.perf_counter()
    if problem.torque_free:
        method, row = "closed form with elliptic functions", _closed_form(problem)
        with mp.workdps(60):
            R, w = free_motion(
                problem.inertia,
                problem.row[10:13],
                problem.duration,
                problem.row[3:7],
                digits=35,
            )
            other = [*row[:3], *_quaternion(R), *row[7:10], *w]
    else:
        method, row, other = (
            "Taylor series",
            compute(problem, digits + 6),
            compute(problem, digits),
        )
    with mp.workdps(60):
        scale = max(abs(c) for c in row)
        difference = max(abs(a - b) for a, b in zip(row, other, strict=True)) / scale
        agreed = min(45, int(-mpmath.log10(difference))) if difference else 45
        entry = {
            "problem": problem.name,
            "fingerprint": problem.fingerprint,
            "method": f"mpmath {mpmath.__version__}, {method}, computed twice",
            "agreed_digits": agreed,
            "time_s": problem.duration,
            "row": [mpmath.nstr(c, max(agreed, 17) + 3) for c in row],
        }
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{problem.name}.json").write_text(json.dumps(entry, indent=1) + "\n")
    print(
        f"{problem.name:16s} {agreed} digits, {time.perf_counter() - begin:.1f} s",
        flush=True,
    )
    return entry


def main() -> None:
    known = PROBLEMS | VARIANTS
    wanted = [p.name for p in known.values() if p.has_reference and not (FOLDER / f"{p.name}.json").exists()]
    names = sys.argv[1:] or wanted
    for name in names:
        cache(known[name])


if __name__ == "__main__":
    main()
