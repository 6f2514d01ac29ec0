# SPDX-License-Identifier: MIT
"""Gallery of wrong motion: the T-handle left alone, by engines at their default steps and by equations that drop a term.

    python benchmarks/work_precision_gallery.py [--out FOLDER]

Nothing acts, so energy and the angular momentum's direction must stay. Writes work_precision_gallery.csv.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

from flights import flight, spinning

import peers
from motion_measures import energy, sane
from problems import Problem, rotation, tuples
from result_table import ResultTable
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.body import make_body

DURATION, SAMPLES = 20.0, 160
SHORTER = 4.0
"""s; enough to see L turn away and come back."""
SPIN = 10.0
"""rad/s beside the middle axis, where the handle flips."""
DEFAULT_STEPS = {"mujoco": 2e-3, "bullet": 1.0 / 240.0}
COLUMNS = ("panel", "curve", "time_s", "energy_ratio", "momentum_angle_rad")


def handle(model: str):
    """The bundled T-handle as a body under an inertia model."""
    mesh = load_mesh("t_handle")
    properties = MeshMoments(mesh.vertices, mesh.triangles).mass_properties(model)
    return make_body(properties.mass, properties.center_of_mass, properties.inertia)


def free_problem(direction) -> Problem:
    """The true handle spinning about a direction given in its principal axes."""
    body = handle("solid")
    spin = SPIN * body.principal_axes @ (np.array(direction) / np.linalg.norm(direction))
    return Problem("handle", "T-handle", DURATION, body.mass, tuples(body.inertia), tuple(map(float, spinning(spin))))


def measures(problem: Problem, row: np.ndarray) -> tuple[float, float]:
    """Energy over its start, and the angle of the world's L to its start [rad]."""
    if not sane(row):
        return math.nan, math.nan
    start = np.array(problem.row)
    I = np.array(problem.inertia)
    a, b = (rotation(r[3:7]) @ I @ r[10:13] for r in (start, row))
    angle = math.atan2(np.linalg.norm(np.cross(a, b)), a @ b)
    return energy(problem, row)[0] / energy(problem, start)[0], angle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE / "results")
    options = parser.parse_args()
    table = ResultTable(options.out / "work_precision_gallery.csv", COLUMNS)
    problem = free_problem((0.01, 1.0, 0.01))

    def record(panel, curve, judged, time, row):
        ratio, angle = measures(judged, row)
        table.add({"panel": panel, "curve": curve, "time_s": time, "energy_ratio": ratio, "momentum_angle_rad": angle})

    for contestant in peers.installed_peers()[0]:
        step = DEFAULT_STEPS.get(contestant.tool)
        if step is None:
            continue
        run = contestant.prepare(problem, step)
        for k in range(SAMPLES + 1):
            run.advance(round(DURATION * k / SAMPLES / step) * step)
            curve = f"{contestant.tool} {contestant.name}, its default step of {1e3 * step:.3g} ms"
            record("engines", curve, problem, DURATION * k / SAMPLES, run.row())
    for label, name in (("ours: free_body, exact", "free_body"), ("ours: rk4, 2 ms", "rk4")):
        simulation = flight(handle("solid"), integrator=name, step_s=2e-3, initial=problem.row)
        for k in range(SAMPLES + 1):
            row = simulation.advance(round(DURATION * 1e9) * k // SAMPLES).row
            record("engines", label, problem, DURATION * k / SAMPLES, row)
    tumbling = free_problem((0.6, 0.64, 0.48))
    for model, shown in (("solid", "true tensor"), ("bounding_box", "bounding box")):
        body = handle(model)
        judged = replace(tumbling, mass=body.mass, inertia=tuples(body.inertia))
        for gyroscopic, term in ((True, "with the gyroscopic term"), (False, "term dropped")):
            simulation = flight(body, integrator="rk4", initial=tumbling.row, gyroscopic=gyroscopic)
            for k in range(SAMPLES + 1):
                row = simulation.advance(round(SHORTER * 1e9) * k // SAMPLES).row
                record("dropped term", f"{shown}, {term}", judged, SHORTER * k / SAMPLES, row)
    table.write()
    print(f"{table.path}: {len(table.rows)} rows")


if __name__ == "__main__":
    main()
