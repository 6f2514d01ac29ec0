# SPDX-License-Identifier: MIT
"""`auto` against heyoka.py at equal error of the final attitude: the shortest of many runs taken in turn, in one process.

Each problem is flown from three starts, to two ends each. The error of a tool at an accuracy or tolerance is the largest
of the six flights, its time their mean; times at an error are read off the two curves (log-log). `kernel` is the compiled
loop over steps, one call from Python as heyoka's propagate_until is; `simulation` is Simulation.advance with its commands
and segments; `flight` is `Flight`, reset and commanded; `sweep` is a row of a sweep's compiled block, its body and end
state included, on one core; `heyoka batch` is a flight of eight side by side. What heyoka compiles, one system and
tolerance at a time, isn't counted.

    python benchmarks/heyoka_ratios.py [--only P2,damped,...] [--seconds 20] [--every 1]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import heyoka
import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import peers_heyoka
from motion_measures import errors
from problem_references import reference_row
from problems import JUDGED_BY_VARIANTS, PROBLEMS, Problem, variants
from result_table import ResultTable
from rigid_proto_ros.motion import loads as ld
from rigid_proto_ros.motion.integrators.integrator import ADAPTIVE
from rigid_proto_ros.motion.integrators.stepping import way_of
from rigid_proto_ros.simulation.batch import Batch, fly_rows
from rigid_proto_ros.simulation.commands import HELD_WRENCH, IMPULSE, NO_SLOT, PULSE, UNNAMED_SLOT
from rigid_proto_ros.simulation.flight import LOAD_ROW
from rigid_proto_ros.simulation.quantities import CODE, MEASURE
from rigid_proto_ros.simulation.record import SCENE
from work_precision_ours import first_segment, prepare_flight, prepare_simulation, setup_of
from work_precision_ratios import time_at_error

TARGETS = (1e-6, 1e-8, 1e-10)
KNOBS = [10.0 ** (-k / 2) for k in range(4, 29)]
FLIGHTS, ROWS, IN_A_ROW, LEAST_ROUNDS = 8, 256, 10, 3
SHARES = {"heyoka batch": FLIGHTS, "sweep": ROWS}
"""Flights in a run."""
COLUMNS = (
    "problem",
    "what",
    "error_rad",
    "us",
    "whole_us",
    "heyoka_us",
    "heyoka_whole_us",
    "ratio",
    "whole_ratio",
)
"""us: the flight alone. whole_us: set back and, of ours, commands submitted, then flown; nan of a kernel alone."""


def kernel_runs(problem: Problem, accuracy: float):
    """(run, row, restart) of the adaptive kernel on a problem of one segment; None where there are more."""
    segment, end_ns = first_segment(problem, "auto", 1e-3, accuracy), round(problem.duration * 1e9)
    if segment is None or way_of(int(segment.simulation.flight.method)) != ADAPTIVE:
        return None
    return lambda: segment.fly(end_ns), segment.row.copy, segment.restart


def whole(prepare):
    """(run, row, restart) of a contestant's own way."""

    def runs(problem: Problem, knob: float):
        contestant = prepare(problem, knob)
        if contestant is None:
            return None

        return lambda: contestant.advance(problem.duration), contestant.row, contestant.restart

    return runs


def batch_runs(problem: Problem, tolerance: float):
    """FLIGHTS flights side by side by heyoka, of which the first is the problem's and the others nearly so."""
    axes, start = peers_heyoka.start_of(problem)
    starts = np.repeat(start[:, None], FLIGHTS, axis=1)
    starts[4:7] *= 1.0 + 1e-3 * np.arange(FLIGHTS)
    integrator = heyoka.taylor_adaptive_batch(
        peers_heyoka.system(problem, axes),
        starts.copy(),
        pars=np.zeros((peers_heyoka.parameters(problem), FLIGHTS)),
        tol=tolerance,
    )
    pieces = peers_heyoka.pieces_of(problem, axes)

    def restart():
        integrator.set_time(0.0)
        integrator.state[:] = starts

    def run():
        for _, end, loads, kick in pieces:
            if loads is not None:
                integrator.pars[:] = loads[:, None]
            if kick is not None:
                kick(integrator.state)
            integrator.propagate_until(end)

    return run, lambda: peers_heyoka.row_of(integrator.state[:, 0], axes), restart


def sweep_runs(problem: Problem, accuracy: float):
    """ROWS rows by a sweep's compiled block, of which the first is the problem's and the others nearly so."""
    setup = setup_of(problem, "auto", 1e-3, accuracy)
    own = np.repeat(np.array([setup.scene], SCENE), ROWS)
    own["initial_angular_velocity"] *= 1.0 + 1e-3 * np.arange(ROWS)[:, None] / ROWS
    commands = np.zeros((1, len(problem.wrenches)), LOAD_ROW)
    for command, w in zip(commands[0], problem.wrenches, strict=True):
        command.kind = IMPULSE if w.impulse else HELD_WRENCH if w.end is None else PULSE
        command.duration_ns = -1 if w.end is None else round(w.end * 1e9) - round(w.begin * 1e9)
        command.slot = UNNAMED_SLOT if command.kind == HELD_WRENCH else NO_SLOT
        load, command.at_ns = command.load, round(w.begin * 1e9)
        load[ld.LOAD_AXES] = ld.BODY_AXES if w.axes == "body" else ld.WORLD_AXES
        load[ld.PLACE], load[ld.POINT : ld.POINT + 3] = ld.AT_POINT, w.point
        load[ld.FORCE : ld.FORCE + 3], load[ld.TORQUE : ld.TORQUE + 3] = w.force, w.torque
    batch = Batch(own, setup.mesh, commands)
    end = np.zeros((13, MEASURE))  # of kind FINAL
    end[:, CODE] = np.arange(13)
    looks = np.array([round(problem.duration * 1e9)]), end
    found = {}

    def run():
        found["results"] = fly_rows(batch, None, *looks)

    return run, lambda: found["results"].measured[0], lambda: None


CURVES = {
    "sweep": sweep_runs,
    "flight": whole(prepare_flight),
    "heyoka": whole(peers_heyoka.prepare),
    "heyoka batch": batch_runs,
    "kernel": kernel_runs,
    "simulation": whole(lambda problem, accuracy: prepare_simulation(problem, accuracy, "auto")),
}


def curves(problem: Problem, seconds: float, every: int = 1) -> dict[str, list[dict]]:
    """For each way rows of a flight's time [s] and error [rad]. The time is the shortest: whatever else the machine does only
    adds to it.
    """
    flown = variants(problem)
    references = [reference_row(variant) for variant in flown]
    known: list[tuple[str, list, float, list]] = []
    for what, prepare in CURVES.items():
        for knob in KNOBS[::every]:
            made = [prepare(variant, knob) for variant in flown]
            if None in made:
                break
            wrong = []
            for variant, reference, (run, row, restart) in zip(flown, references, made, strict=True):
                restart()
                run()
                wrong.append(errors(variant, row(), reference)["attitude_error_rad"])
            known.append((what, made, float(np.max(wrong)), [[] for _ in flown]))
    until, rounds = time.perf_counter() + seconds, 0
    while time.perf_counter() < until or rounds < LEAST_ROUNDS:
        rounds += 1
        for what, made, _, times in known:
            for (run, _, restart), taken in zip(made, times, strict=True):
                # Several in a row: code and data are then where they are while one tool is used.
                for _ in range(1 if what == "sweep" else IN_A_ROW):
                    first = time.perf_counter()
                    restart()
                    begin = time.perf_counter()
                    run()
                    end = time.perf_counter()
                    taken.append((end - begin, end - first))
    found: dict[str, list[dict]] = {what: [] for what in CURVES}
    for what, _, error, times in known:
        alone, whole_s = np.mean([np.min(taken, axis=0) for taken in times], axis=0) / SHARES.get(what, 1)
        found[what].append({"median_s": alone, "whole_s": whole_s, "attitude_error_rad": error})
    return {what: sorted(rows, key=lambda r: r["median_s"]) for what, rows in found.items() if rows}


def whole_at_error(rows: list[dict], target: float) -> float:
    """``time_at_error`` of all that a flight takes."""
    return time_at_error([{**row, "median_s": row["whole_s"]} for row in rows], target)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default=",".join(JUDGED_BY_VARIANTS))
    parser.add_argument("--seconds", type=float, default=20.0, help="of timing, for each problem")
    parser.add_argument("--every", type=int, default=1, help="of the tolerances, to compile fewer systems")
    options = parser.parse_args()
    table = ResultTable(Path(__file__).parent / "results" / "heyoka.csv", COLUMNS)
    for name in options.only.split(","):
        found = curves(PROBLEMS[name], options.seconds, options.every)
        for target in TARGETS:
            theirs, all_theirs = time_at_error(found["heyoka"], target), whole_at_error(found["heyoka"], target)
            for what, rows in found.items():
                mine = time_at_error(rows, target)
                all_mine = float("nan") if what == "kernel" else whole_at_error(rows, target)
                row = {"problem": name, "what": what, "error_rad": target, "us": 1e6 * mine, "whole_us": 1e6 * all_mine}
                row |= {"heyoka_us": 1e6 * theirs, "heyoka_whole_us": 1e6 * all_theirs, "ratio": theirs / mine}
                table.add({**row, "whole_ratio": all_theirs / all_mine})
                print(
                    f"{name} at {target:g} rad: {what} {1e6 * mine:.2f} us, heyoka {1e6 * theirs:.2f} us: "
                    f"{theirs / mine:.2f}; set back and submitted too {all_theirs / all_mine:.2f}",
                    flush=True,
                )
    table.write()


if __name__ == "__main__":
    main()
