# SPDX-License-Identifier: MIT
"""Run time against error of the motion: our integrators and peers on the same problems, in one process.

    python benchmarks/work_precision.py [--quick] [--only P1,P2,...] [--tools ours,mujoco,...] [--out FOLDER]

References come from benchmarks/references and never compete. Times are medians; compiling stands apart; a failure is a row
of NaN with its reason. Writes work_precision.csv and prints the ratios that matter; benchmarks/plots.py draws from it.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import peers
import work_precision_ours as ours
from motion_measures import energy, errors, momentum_error, sane
from problem_references import reference_row
from problems import PROBLEMS, Problem
from result_table import ResultTable
from work_precision_ratios import ratios

CURVES = ("P1", "P1b", "P2", "P2x100", "P4rod", "P4plate", "heavy", "damped", "pokes")
STRINGS = tuple(name for name in PROBLEMS if name.startswith("P3"))
TOLERANCES = tuple(10.0**-k for k in range(3, 14))
WHOLE_ON_CURVES = ("auto", "free_body", "rk4", "dop853", "taylor")
STRING_TOLERANCES = (1e-6, 1e-9, 1e-12)
STRING_STEP = 1e-3
LONGEST_FOR_DRIFT = 0.2
"""Seconds; a string's drift takes ten times as long and a thousand looks."""
COLUMNS = (
    "problem",
    "tool",
    "version",
    "integrator",
    "knob",
    "step_or_tolerance",
    "steps",
    "compile_s",
    "median_s",
    "fastest_s",
    "repeats",
    "attitude_error_rad",
    "position_error_m",
    "rate_error_rad_s",
    "energy_drift",
    "momentum_drift",
    "status",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="short runs only, one repeat")
    parser.add_argument("--only", default=",".join((*CURVES, *STRINGS)), help="names of problems")
    parser.add_argument("--tools", default="", help="names of tools; all that are installed by default")
    parser.add_argument("--budget", type=float, default=0.1, help="longest run [s]; what would take longer is left out")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    options = parser.parse_args()
    found, missing = peers.installed_peers()
    for line in missing:
        print("left out:", line)
    everyone = ours.contestants() + found
    if options.tools:
        wanted = options.tools.split(",")
        everyone = [c for c in everyone if c.tool in wanted]
    budget_s = 0.05 if options.quick else options.budget
    jobs = [
        (problem, contestant, step)
        for problem in (PROBLEMS[name] for name in options.only.split(","))
        for contestant in everyone
        if wanted_on(problem, contestant)
        for step in steps_for(problem, contestant, budget_s)
    ]
    table = ResultTable(options.out / "work_precision.csv", COLUMNS)
    given_up: set[tuple[str, str, str]] = set()
    for k, (problem, contestant, step) in enumerate(jobs):
        progress(k, len(jobs), f"{problem.name} {contestant.tool} {contestant.name} {step:g}")
        key = (problem.name, contestant.tool, contestant.name)
        if k and jobs[k - 1][0] is not problem:
            # What has been measured is kept if the run is ended.
            table.write()
        if key in given_up:
            continue
        entry = measure(problem, contestant, step, 1 if options.quick else 5, budget_s)
        if entry is None:
            given_up.add(key)
            continue
        table.add(entry)
        # Steps come longest first and tolerances loosest first, so what follows would take longer still.
        if entry.get("median_s", 0.0) > budget_s:
            given_up.add(key)
    progress(len(jobs), len(jobs), "done")
    table.write()
    print(f"{table.path}: {len(table.rows)} rows")
    for line in ratios(table.rows):
        print(line)


def progress(k: int, of: int, what: str) -> None:
    """A bar on stderr; one line per tenth when stderr isn't a terminal."""
    bar = "#" * (30 * k // of) if of else ""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r[{bar:30s}] {k}/{of} {what:60.60s}" + ("\n" if k == of else ""))
    elif k == of or k % max(1, of // 10) == 0:
        sys.stderr.write(f"[{bar:30s}] {k}/{of} {what}\n")
    sys.stderr.flush()


def wanted_on(problem: Problem, contestant: peers.Contestant) -> bool:
    """Of ours, curves show the bare kernels and some as whole simulations; strings, whole simulations."""
    if problem.name in STRINGS:
        return contestant.tool != "ours (kernel)"
    return contestant.tool != "ours" or contestant.name in WHOLE_ON_CURVES


def steps_for(problem: Problem, contestant: peers.Contestant, budget_s: float) -> list[float]:
    """Steps of 1, 2, 5 per decade that divide the duration, fewest first, as far as one run stays within the budget."""
    if contestant.tolerance:
        return list(STRING_TOLERANCES if problem.name in STRINGS else TOLERANCES)
    if problem.name in STRINGS:
        return [STRING_STEP]
    counts = [n * 10**e for e in range(8) for n in (1, 2, 5)]
    affordable = budget_s / (contestant.cost * 1e-6)
    return [problem.duration / n for n in counts if n <= affordable]


def measure(problem: Problem, contestant: peers.Contestant, step: float, repeats: int, budget_s: float) -> dict | None:
    """One row; None when the contestant can't carry the problem at all, which leaves no row."""
    entry = {
        "problem": problem.name,
        "tool": contestant.tool,
        "version": contestant.version,
        "integrator": contestant.name,
        "knob": "tolerance" if contestant.tolerance else "step",
        "step_or_tolerance": step,
    }
    try:
        run = contestant.prepare(problem, step)
        if run is None:
            return None
        times = [timed(run, problem.duration)]
        end = run.row()
        entry.update(
            errors(problem, end, reference_row(problem) if problem.has_reference else None),
            steps=run.steps(),
            compile_s=run.compile_s,
        )
        # The first run may still meet cold caches; it counts alone only when it was long.
        while len(times) < repeats + 1 and sum(times) < 4 * budget_s:
            times.append(timed(run, problem.duration))
        times = times[1:] or times
        entry.update(median_s=float(np.median(times)), fastest_s=min(times), repeats=len(times))
        if not contestant.tolerance or float(np.median(times)) < LONGEST_FOR_DRIFT:
            entry.update(drifts(problem, run))
        entry["status"] = "ok" if sane(end) else "blew up"
    except Exception as error:  # a peer's failure is a result, whatever its kind
        entry["status"] = f"{type(error).__name__}: {error}".splitlines()[0][:120]
    return entry


def timed(run: peers.Run, duration: float) -> float:
    """Seconds of one run from the start to the end."""
    run.restart()
    begin = time.perf_counter()
    run.advance(duration)
    return time.perf_counter() - begin


def drifts(problem: Problem, run: peers.Run) -> dict:
    """Largest departure of energy and angular momentum at ten times of the flight, where they should stay."""
    if not problem.conservative:
        return {}
    strings = problem.name in STRINGS
    duration, portions = (10.0, 1000) if strings else (problem.duration, 10)
    run.restart()
    rows = [np.array(problem.row)]
    for k in range(1, portions + 1):
        run.advance(duration * k / portions)
        rows.append(run.row())
        if not sane(rows[-1]):
            return {}
    energies, kinetic = np.array([energy(problem, row) for row in rows]).T
    drift = {"energy_drift": float(np.abs(energies - energies[0]).max() / kinetic.max())}
    if problem.torque_free:
        drift["momentum_drift"] = max(momentum_error(problem, row) for row in rows)
    return drift


if __name__ == "__main__":
    main()
