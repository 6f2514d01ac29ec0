# SPDX-License-Identifier: MIT
"""`auto` against SciPy's Radau where damping is far faster than the motion beside it: time and error of whole flights.

Both take the scenes of test/stiff_scenes.py for 0.2 s, over a range of accuracies and tolerances; Radau steps the equations
of test/reference_flights.py, compiled, with the Jacobian by differences that it makes itself. `auto` is Simulation.advance, its
commands and segments included. The judge is Radau at 1e-12; how far `auto` at 1e-12 is from it stands in each row, and no error
below ten times that is told apart. Times are the shortest of runs in turn, in one process.

    python benchmarks/stiff_damping.py [--only "slaved spin,..."] [--seconds 4]
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

from flights import SECOND
from stiff_scenes import SCENES, START, distance, flown, still_flight

from result_table import ResultTable
from work_precision_ratios import time_at_error

DURATION_S = 0.2
JUDGED_AT = 1e-12
ACCURACIES = [10.0**-k for k in range(2, 12)]
TOLERANCES = [10.0**-k for k in range(3, 11)]
TARGETS = (1e-5, 1e-7, 1e-9)
COLUMNS = ("scene", "tool", "setting", "error", "seconds", "steps", "judge_and_auto_differ")


def ours(name: str, accuracy: float) -> tuple[Callable[[], None], Callable[[], tuple[np.ndarray, int]]]:
    """What flies the scene from a fresh Simulation on each call but the first, and the state row and steps of the last one."""
    body, scene = SCENES[name]
    made = [flown(body, START, scene, accuracy)]

    def run() -> None:
        simulation = made[-1]
        simulation.advance(round(DURATION_S * SECOND))

    def restart() -> tuple[np.ndarray, int]:
        found = made[-1].state.row.copy(), made[-1].steps
        made[-1] = flown(body, START, scene, accuracy)
        return found

    return run, restart


def radau(name: str, tolerance: float) -> tuple[Callable[[], None], Callable[[], tuple[np.ndarray, int]]]:
    """The same by SciPy's Radau."""
    body, scene = SCENES[name]
    tied = flown(body, START, scene, 1e-9).string
    flight = still_flight(body, START, **scene, tied=tied)
    found = {}

    def rates(_: float, Y: np.ndarray) -> np.ndarray:
        return flight.rates(Y, tied is not None)

    def run() -> None:
        found["last"] = solve_ivp(
            rates, (0.0, DURATION_S), flight.start, "Radau", rtol=tolerance, atol=0.01 * tolerance
        )

    def end() -> tuple[np.ndarray, int]:
        last = found["last"]
        row = flight.row(last.y[:, -1]) if last.success else np.full(13, math.nan)
        return row, len(last.t) - 1

    return run, end


TOOLS = {"rigid_proto auto": (ours, ACCURACIES), "SciPy Radau": (radau, TOLERANCES)}


def away(row: np.ndarray, exact: np.ndarray) -> float:
    """The error in the measure of ``accuracy``, by 1 m."""
    return distance(row, exact[3:7], exact[:3], exact[7:10], exact[10:])


def compare(name: str, seconds: float) -> list[dict]:
    """A row for each tool and setting."""
    ends = []
    for tool in (radau, ours):
        run, end = tool(name, JUDGED_AT)
        run()
        ends.append(end()[0])
    exact, differ = ends[0], away(ends[1], ends[0])
    known = []
    for tool, (make, settings) in TOOLS.items():
        for setting in settings:
            run, end = make(name, setting)
            run()
            row, steps = end()
            fixed = {"scene": name, "tool": tool, "setting": setting, "error": away(row, exact), "steps": steps}
            known.append(({**fixed, "judge_and_auto_differ": differ}, run, end, []))
    until = time.perf_counter() + seconds
    while time.perf_counter() < until or len(known[0][-1]) < 3:
        for _, run, end, times in known:
            begin = time.perf_counter()
            run()
            times.append(time.perf_counter() - begin)
            end()
    return [{**row, "seconds": min(times)} for row, _, _, times in known]


def ratios(rows: list[dict]) -> list[str]:
    """Radau's time over ours at equal errors that the judge can tell; by a tool's cheapest run where all of them err less."""
    name, differ = rows[0]["scene"], rows[0]["judge_and_auto_differ"]
    lines = []
    for target in (t for t in TARGETS if t >= 10.0 * differ):
        at, words = [], []
        for tool in TOOLS:
            runs = sorted((r for r in rows if r["tool"] == tool), key=lambda r: r["seconds"])
            curve = [{"median_s": r["seconds"], "attitude_error_rad": r["error"]} for r in runs]
            at.append(time_at_error(curve, target))
            less = " (all runs err less)" if all(r["error"] <= target for r in runs) else ""
            words.append(
                f"{tool} {1e3 * at[-1]:.3g} ms{less}" if math.isfinite(at[-1]) else f"{tool} comes not so near"
            )
        ratio = f": {at[1] / at[0]:.0f}" if all(map(math.isfinite, at)) else ""
        lines.append(f"{name} at an error of {target:g}: {', '.join(words)}{ratio}")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(SCENES))
    parser.add_argument("--seconds", type=float, default=4.0, help="of timing, for each scene")
    options = parser.parse_args()
    table = ResultTable(HERE / "results" / "stiff_damping.csv", COLUMNS)
    # A name may hold commas.
    for name in (n for n in SCENES if n in options.only):
        rows = compare(name, options.seconds)
        for row in rows:
            table.add(row)
        # Each scene is kept, however far the run comes.
        table.write()
        for line in ratios(rows):
            print(line, flush=True)


if __name__ == "__main__":
    main()
