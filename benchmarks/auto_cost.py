# SPDX-License-Identifier: MIT
"""What `auto` costs against the cheapest catalogue integrator that keeps the same error rate.

For a scene and an accuracy, `auto` flies it first. Starts of steps are then taken from that flight, and each catalogue
integrator is given the largest fixed step of a √2 grid whose local error stays within accuracy·h on all of them; the
cheapest of these by run time is what a well-informed user would have picked. Both are timed as whole simulations. Every sixth
scene is a fast spin under weak loads, every sixth one has stiff damping; the others are test/random_scenes.py.

    python benchmarks/auto_cost.py [--scenes N]
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
from numba import njit

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

from flights import flight_setup, spinning, wrench
from random_scenes import DURATION_S, log_uniform, random_body, random_scene

from problems import PROBLEMS
from result_table import ResultTable
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.integrators.error_measure import FLOOR, scales
from rigid_proto_ros.motion.variables import SPIN
from rigid_proto_ros.simulation.simulation import Simulation
from work_precision_ours import simulation_of

ACCURACIES = (1e-3, 1e-6, 1e-9, 1e-12)
GRID = [2.0 ** (-k / 2) for k in range(44)]
"""Fixed steps [s] from 1 s down to 0.3 µs."""
STARTS = 40
MOST_EVALUATIONS = 2e7
"""Beyond it a fixed step takes seconds and is never the cheapest."""
SUBSTEPS, RADIANS = 16, 0.2
"""Of the judge in a step: so many at least, and none that turns the body by more."""
COLUMNS = (
    "scene",
    "accuracy",
    "auto_s",
    "auto_choice",
    "auto_steps",
    "floor_binds",
    "catalogue_s",
    "catalogue_integrator",
    "catalogue_step_s",
    "ratio",
)


@njit(cache=False)
def _difference(y, exact, p, elapsed):
    """Local error of y in the measure of ``accuracy``; the quaternion is taken in its nearer sign."""
    e = y - exact
    attitude, spin, place, speed = scales(exact, p, elapsed)
    found = max(attitude * np.linalg.norm(e[0:4]), spin * np.linalg.norm(e[4:7]))
    return max(found, place * np.linalg.norm(e[7:10]), speed * np.linalg.norm(e[10:13]))


def starts_of(simulation, until_ns: int, count: int) -> list[tuple]:
    """(problem, variables, time in the segment [s]) at a flight's start, where what dies out fast is still there, and at
    random times of it.
    """
    rng = np.random.default_rng(1)
    simulation.advance(1)
    flight = simulation.flight
    found = [(flight.problem.copy(), flight.variables.copy(), 0.0)]
    for at_ns in np.sort(rng.integers(2, until_ns, count)):
        simulation.advance(int(at_ns))
        if flight.start_ns == at_ns:
            continue
        # The shorter step that was taken to the time asked for, where there was one.
        y = flight.trial if flight.now_ns > flight.committed_ns else flight.variables
        found.append((flight.problem.copy(), y.copy(), (at_ns - int(flight.start_ns)) * 1e-9))
    return found


def keeps_rate(integrator, starts, h: float, accuracy: float) -> bool:
    """Whether one step of h from each start errs at most accuracy·h, judged by dop853 in many substeps."""
    exact = INTEGRATORS["dop853"]
    for p, y, elapsed in starts:
        mine, fine = y.copy(), y.copy()
        if integrator.kernel(mine, p, h, 1) != 1:
            return False
        substeps = max(SUBSTEPS, math.ceil(h * float(np.linalg.norm(y[SPIN : SPIN + 3])) / RADIANS))
        if exact.kernel(fine, p, h / substeps, substeps) != substeps:
            return False
        # Rounding of the judge's own substeps is not the judged one's.
        if not _difference(mine, fine, p, elapsed + h) <= accuracy * h + 2.0 * FLOOR:
            return False
    return True


def run_time(make, until_ns: int) -> tuple[float, object]:
    """Median seconds of whole flights, and the last of them."""
    times = []
    while len(times) < 3 or (len(times) < 15 and sum(times) < 0.05):
        simulation = make()
        begin = time.perf_counter()
        simulation.advance(until_ns)
        times.append(time.perf_counter() - begin)
        if sum(times) > 2.0:
            break
    return float(np.median(times)), simulation


def compare(name: str, make, until_ns: int, accuracy: float) -> dict:
    """One row: auto and the cheapest of the catalogue. make(integrator, accuracy, step) gives a fresh Simulation."""
    make("auto", accuracy, 1e-3).advance(until_ns)
    auto_s, flown = run_time(lambda: make("auto", accuracy, 1e-3), until_ns)
    starts = starts_of(make("auto", accuracy, 1e-3), until_ns, STARTS)
    best = (math.nan, "none", math.nan)
    for _, h, candidate in sorted(_able(make, starts, until_ns * 1e-9, accuracy)):
        # At 20 ns an evaluation, less than any takes, its steps alone would be longer than the best so far.
        if until_ns * 1e-9 / h * max(1, INTEGRATORS[candidate].evaluations) * 20e-9 > best[0]:
            continue
        make(candidate, accuracy, h).advance(min(until_ns, round(3e9 * h)))
        seconds, simulation = run_time(lambda c=candidate, h=h: make(c, accuracy, h), until_ns)
        if not (simulation.failure or simulation.refused) and not seconds >= best[0]:
            best = (seconds, candidate, h)
    return {
        "scene": name,
        "accuracy": accuracy,
        "auto_s": auto_s,
        "auto_choice": flown.choice.replace(",", ";"),
        "auto_steps": flown.steps,
        "floor_binds": bool(flown.accuracy_floor),
        "catalogue_s": best[0],
        "catalogue_integrator": best[1],
        "catalogue_step_s": best[2],
        "ratio": auto_s / best[0],
    }


def _able(make, starts, duration: float, accuracy: float) -> list[tuple[float, float, str]]:
    """(evaluations needed, step [s], name) of every catalogue integrator that keeps the rate at some step of the grid."""
    found = []
    for name, integrator in INTEGRATORS.items():
        if integrator.kernel is None:
            continue
        try:
            make(name, accuracy, 1e-3)
        except InputError:
            continue
        h = _largest_step(integrator, starts, duration, accuracy)
        if h is not None and duration / h * integrator.evaluations <= MOST_EVALUATIONS:
            found.append((duration / h * integrator.evaluations, h, name))
    return found


def _largest_step(integrator, starts, duration: float, accuracy: float) -> float | None:
    """The largest step of the grid at which the rate is kept, by bisection; the exact one may take the whole duration."""
    if integrator.order is None and keeps_rate(integrator, starts, duration, accuracy):
        return duration
    grid = [h for h in GRID if h <= duration]
    low, high = 0, len(grid)
    while low < high:
        middle = (low + high) // 2
        if keeps_rate(integrator, starts, grid[middle], accuracy):
            high = middle
        else:
            low = middle + 1
    return grid[low] if low < len(grid) else None


def fast_spin(seed: int, integrator: str, accuracy: float, step_s: float):
    """1e3 to 1e5 rad/s under one held torque, up to ten times as strong as auto's splitting takes, for 1e4 rad."""
    rng = np.random.default_rng(seed)
    body, spin = random_body(rng), log_uniform(rng, 1e3, 1e5)
    direction = rng.normal(size=3)
    strength = body.principal_moments.min() * log_uniform(rng, 1e-8, 1e-4) * spin
    setup = flight_setup(
        body,
        integrator=integrator,
        step_s=step_s,
        accuracy=accuracy,
        initial=spinning(spin * direction / np.linalg.norm(direction)),
    )
    simulation = Simulation(setup)
    axes = str(rng.choice(["world", "body"]))
    simulation.submit(wrench(axes, (0.0, 0.0, 0.0), (strength * rng.normal(size=3)).tolist()), 0)
    return simulation, 1e4 / spin


def stiff_damping(seed: int, integrator: str, accuracy: float, step_s: float):
    """Angular damping of 1e4 to 1e8 /s under one held torque that keeps up some spin, for 0.1 s."""
    rng = np.random.default_rng(seed)
    body = random_body(rng)
    damping = body.principal_moments.min() * log_uniform(rng, 1e4, 1e8)
    setup = flight_setup(
        body,
        integrator=integrator,
        step_s=step_s,
        accuracy=accuracy,
        initial=spinning(rng.normal(size=3)),
        angular_damping=damping,
    )
    simulation = Simulation(setup)
    axes = str(rng.choice(["world", "body"]))
    simulation.submit(wrench(axes, (0.0, 0.0, 0.0), (damping * rng.normal(size=3)).tolist()), 0)
    return simulation, 0.1


def scene(seed: int, integrator: str, accuracy: float, step_s: float):
    """A Simulation at time 0 and how long it flies [s]."""
    if seed % 6 == 4:
        return fast_spin(seed, integrator, accuracy, step_s)
    if seed % 6 == 5:
        return stiff_damping(seed, integrator, accuracy, step_s)
    return random_scene(seed, integrator, accuracy, step_s), DURATION_S


KINDS = {4: "random_fast_spin", 5: "random_stiff_damping"}
"""By seed modulo 6."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=90)
    parser.add_argument("--out", type=Path, default=HERE / "results")
    options = parser.parse_args()
    table = ResultTable(options.out / "work_precision_auto.csv", COLUMNS)
    for name in ("P1", "P2", "P2x100", "P4rod", "P4plate", "heavy", "damped", "pokes"):
        problem = PROBLEMS[name]
        for accuracy in ACCURACIES:
            table.add(
                compare(
                    name,
                    lambda integrator, accuracy, step, p=problem: _checked(
                        simulation_of(p, integrator, step, accuracy)
                    ),
                    round(problem.duration * 1e9),
                    accuracy,
                )
            )
    table.write()
    for seed in range(options.scenes):
        sys.stderr.write(f"\rscene {seed + 1}/{options.scenes}")
        duration_s = scene(seed, "auto", 1e-9, 1e-3)[1]
        for accuracy in ACCURACIES:
            table.add(
                compare(
                    f"{KINDS.get(seed % 6, 'random')}{seed}",
                    lambda integrator, accuracy, step, s=seed: scene(s, integrator, accuracy, step)[0],
                    round(duration_s * 1e9),
                    accuracy,
                )
            )
        # Each scene is kept, however far the run comes.
        table.write()
    sys.stderr.write("\n")
    for line in summary(table.rows):
        print(line)


def _checked(simulation):
    if simulation is None:
        raise InputError("integrator", "", "one that carries the problem")
    return simulation


def summary(rows: list[dict]) -> list[str]:
    """Median, 95 % and worst of the ratio over all scenes, and the problems one by one."""
    lines = []
    for kind in ("random", *KINDS.values()):
        ratios = np.array([r["ratio"] for r in rows if str(r["scene"]).startswith(kind) and math.isfinite(r["ratio"])])
        if ratios.size:
            lines.append(
                f"auto / cheapest catalogue, {ratios.size} of {kind} scenes and accuracies: median {np.median(ratios):.2f} "
                f"(target 1.5), 95 % {np.quantile(ratios, 0.95):.2f} (target 3), worst {ratios.max():.2f}"
            )
    alone = sum(str(r["scene"]).startswith("random") and not math.isfinite(r["ratio"]) for r in rows)
    lines.append(f"kept by auto alone, by no fixed step of the catalogue: {alone}")
    lines += [
        f"{r['scene']} at {r['accuracy']:g}: auto {r['auto_s'] * 1e6:.0f} us, {r['catalogue_integrator']} "
        f"{r['catalogue_s'] * 1e6:.0f} us at h = {r['catalogue_step_s']:.3g} s: {r['ratio']:.2f}"
        for r in rows
        if not str(r["scene"]).startswith("random")
    ]
    return lines


if __name__ == "__main__":
    main()
