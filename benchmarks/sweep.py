# SPDX-License-Identifier: MIT
"""Sweeps against a Python loop over ``simulate`` and against mujoco.rollout, and what a row costs in small and large tables.

1. 10 000 variations of a 10 s scene with pokes (mass, first spin and two forces vary), only the end measured: by the sweep, by
   a loop over the offline run, by mujoco.rollout with as many threads. Errors are those of the final attitude against
   SciPy's DOP853 at rtol 1e-13, piece by piece between the pokes; MuJoCo takes the largest step of a grid whose median error
   still isn't smaller than ours, or its most accurate one.
2. Rows of a .1 s scene: time and memory from 1000 to 1 000 000.

    python benchmarks/sweep.py [--rows N] [--most N]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from result_table import ResultTable
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.sweep.rows import run_chunk
from rigid_proto_ros.sweep.study import Study, make_study
from rigid_proto_ros.sweep.table import run_study
from rigid_proto_ros.sweep.workers import cores

POKES = [(1.0, 0.1), (4.0, 0.2)]
"""When each poke begins and how long it lasts [s]: multiples of every MuJoCo step below."""
FLIGHT_S = 10.0
MUJOCO_STEPS = (5e-2, 2e-2, 1e-2, 5e-3, 2e-3)
SAMPLE = 24
"""Rows whose error is measured."""
COLUMNS = ("what", "rows", "threads", "us_per_row", "ratio", "median_error_rad", "worst_error_rad", "memory_mb", "note")


def flights(rows: int) -> Study:
    """The scene with pokes."""
    script = [{"t": t, "at": "com", "torque": [0, 0, 0], "force": [0, 0, 0], "duration": d} for t, d in POKES]
    vary = {
        "mass": {"uniform": [0.1, 0.3]},
        "initial.angular_velocity": {"direction": 6.0},
        "script.1.torque": {"direction": 2e-3},
        "script.2.torque": {"direction": 2e-3},
        "script.2.force": {"direction": 0.5},
    }
    spec = {"scene": "t_handle", "script": script, "duration": FLIGHT_S, "samples": rows, "seed": 1, "vary": vary}
    return make_study({**spec, "measure": {"final": ["position", "orientation", "velocity", "spin"]}})


def short(rows: int) -> Study:
    """The .1 s scene."""
    script = [{"t": 0.02, "at": "tip", "force": [0, 0, 0], "duration": 0.05}]
    vary = {"mass": {"uniform": [0.1, 0.3]}, "script.1.force": {"direction": 1.0}}
    spec = {"scene": "t_handle", "script": script, "duration": 0.1, "samples": rows, "seed": 1, "vary": vary}
    measure = {"final": ["position", "orientation", "velocity", "spin"], "max": ["spin", "turned"], "flips": True}
    return make_study({**spec, "measure": measure, "watch": 200})


def attitude_error(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between attitudes xyzw (n, 4) [rad]."""
    w = np.abs((a * b).sum(axis=1))
    v = a[:, :3] * b[:, 3:] - a[:, 3:] * b[:, :3] - np.cross(a[:, :3], b[:, :3])
    return 2.0 * np.arctan2(np.linalg.norm(v, axis=1), w)


def reference_attitude(study: Study, row: int) -> np.ndarray:
    """Final attitude xyzw of a row by SciPy, torques fixed in the world."""
    from scipy.integrate import solve_ivp

    own = study.variation(row)
    body = own.scenario.setup.body
    inertia, y = body.inertia, np.array([*own.scenario.setup.initial[3:7], *own.scenario.setup.initial[10:13]])

    def rates(torque_world):
        def rate(_, y):
            x, yy, z, w = y[:4] / np.linalg.norm(y[:4])
            R = np.array(
                [
                    [1 - 2 * (yy * yy + z * z), 2 * (x * yy - w * z), 2 * (x * z + w * yy)],
                    [2 * (x * yy + w * z), 1 - 2 * (x * x + z * z), 2 * (yy * z - w * x)],
                    [2 * (x * z - w * yy), 2 * (yy * z + w * x), 1 - 2 * (x * x + yy * yy)],
                ]
            )
            a, b, c = spin = y[4:]
            turning = np.linalg.solve(inertia, R.T @ torque_world - np.cross(spin, inertia @ spin))
            q = 0.5 * np.array(
                [w * a + yy * c - z * b, w * b - x * c + z * a, w * c + x * b - yy * a, -x * a - yy * b - z * c]
            )
            return np.concatenate([q, turning])

        return rate

    pieces, now = [], 0.0
    for entry in own.script:
        pieces += [(now, entry["t"], np.zeros(3)), (entry["t"], entry["t"] + entry["duration"], entry["torque"])]
        now = entry["t"] + entry["duration"]
    for begin, end, torque in [*pieces, (now, FLIGHT_S, np.zeros(3))]:
        y = solve_ivp(rates(np.asarray(torque)), (begin, end), y, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    return y[:4] / np.linalg.norm(y[:4])


def sweep_time(study: Study) -> float:
    """Seconds of a whole run, the table included, with everything loaded."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        run_study(study, Path(folder) / "t.parquet", progress=False)
        return time.perf_counter() - start


def loop_time(study: Study, rows: int) -> float:
    """Seconds of a Python loop over the offline run, one row after another."""
    start = time.perf_counter()
    for row in range(rows):
        own = study.variation(row)
        OfflineRun(own.scenario, own.commands).advance(study.duration_ns)
    return time.perf_counter() - start


class Mujoco:
    """The same flights as models, one for each row, and controls in time."""

    def __init__(self, study: Study, rows: int) -> None:
        import mujoco

        self.mujoco = mujoco
        self.models, self.starts, self.torques = [], [], []
        chosen = [study.variation(row) for row in range(rows)]
        body = chosen[0].scenario.setup.body
        I = body.inertia / body.mass
        full = " ".join(repr(float(v)) for v in (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><option integrator="RK4" gravity="0 0 0"><flag contact="disable" constraint="disable"/></option>
            <compiler boundmass="0" boundinertia="0"/><worldbody><body name="b"><freejoint/>
            <inertial pos="0 0 0" mass="1" fullinertia="{full}"/></body></worldbody></mujoco>"""
        )
        unit = model.body_inertia[1].copy()
        for own in chosen:
            setup = own.scenario.setup
            twin = mujoco.MjModel.__copy__(model)
            twin.body_mass[1], twin.body_inertia[1] = setup.body.mass, unit * setup.body.mass
            x, q, v, w = (setup.initial[a:b] for a, b in ((0, 3), (3, 7), (7, 10), (10, 13)))
            self.models.append(twin)
            self.starts.append([0.0, *x, q[3], *q[:3], *v, *w])
            self.torques.append([[*entry["force"], *entry["torque"]] for entry in own.script])

    def fly(self, step: float, threads: int) -> tuple[float, np.ndarray]:
        """Seconds of the rollout, and final attitudes xyzw."""
        from mujoco import rollout

        steps = round(FLIGHT_S / step)
        spec = self.mujoco.mjtState.mjSTATE_XFRC_APPLIED.value
        times = (np.arange(steps) + 0.5) * step
        control = np.zeros((len(self.models), steps, 12))
        for row, torques in enumerate(self.torques):
            for (begin, duration), wrench in zip(POKES, torques, strict=True):
                control[row, (times > begin) & (times < begin + duration), 6:] = wrench
        for model in self.models:
            model.opt.timestep = step
        data = [self.mujoco.MjData(self.models[0]) for _ in range(threads)]
        start = time.perf_counter()
        states, _ = rollout.rollout(
            self.models, data, np.array(self.starts), control, control_spec=spec, skip_checks=False
        )
        wall = time.perf_counter() - start
        last = states[:, -1, 4:8]
        return wall, last[:, [1, 2, 3, 0]]


def compare(table: ResultTable, rows: int) -> None:
    """Part 1."""
    study, threads = flights(rows), cores()
    run_chunk(study, 0, 2)
    taken = [sweep_time(study) for _ in range(3)]
    ours = float(np.median(taken)) / rows
    loop_rows = min(rows, 300)
    loop = loop_time(study, loop_rows) / loop_rows
    sample = run_chunk(study, 0, SAMPLE).columns
    exact = np.array([reference_attitude(study, row) for row in range(SAMPLE)])
    errors = attitude_error(np.stack([sample[f"orientation.{axis}"] for axis in "xyzw"], axis=1), exact)

    def add(what, seconds, used, note, error=None, count=rows):
        known = {} if error is None else {"median_error_rad": np.median(error), "worst_error_rad": error.max()}
        row = {"what": what, "rows": count, "threads": used, "us_per_row": 1e6 * seconds, "ratio": seconds / ours}
        table.add({**row, **known, "note": note})
        print(f"{what:<22} {1e6 * seconds:10.1f} us a row, {seconds / ours:8.1f} times ours", known, flush=True)

    add("sweep", ours, threads, "auto, accuracy 1e-9; with its table", errors)
    add("loop over simulate", loop, 1, f"measured over {loop_rows} rows", errors, loop_rows)
    mujoco_rows = min(rows, 500)
    try:
        peer = Mujoco(study, mujoco_rows)
    except ImportError:
        print("mujoco isn't installed: not compared")
        return
    for step in MUJOCO_STEPS:
        wall, attitudes = peer.fly(step, threads)
        error = attitude_error(attitudes[:SAMPLE], exact)
        add("mujoco.rollout RK4", wall / mujoco_rows, threads, f"step {step:g} s", error, mujoco_rows)
        if np.median(error) <= np.median(errors):
            break


def scale_one(rows: int) -> dict:
    """Part 2 for one size, in a process of its own: time a row and the peak of memory beyond the start."""
    study = short(rows)
    sweep_time(short(1000))
    # Compiling takes more memory than flying: the mark is set back to what is in use now.
    Path("/proc/self/clear_refs").write_text("5")
    repeats = max(1, min(15, 100_000 // rows))
    walls, works = [], []
    for _ in range(repeats):
        worked = time.process_time()
        walls.append(sweep_time(study))
        works.append(time.process_time() - worked)
    status = Path("/proc/self/status").read_text()
    peak = int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024
    return {
        "us_per_row": 1e6 * float(np.median(walls)) / rows,
        "cpu_us_per_row": 1e6 * float(np.median(works)) / rows,
        "memory_mb": peak,
    }


def scaling(table: ResultTable, most: int) -> None:
    """Part 2."""
    first = None
    for rows in (1000, 10_000, 100_000, 1_000_000):
        if rows > most:
            break
        done = subprocess.run(
            [sys.executable, __file__, "--one", str(rows)], capture_output=True, text=True, check=True
        )
        found = json.loads(done.stdout)
        first = first or found["cpu_us_per_row"]
        row = {"what": "rows of .1 s", "rows": rows, "threads": cores(), "us_per_row": found["us_per_row"]}
        cpu = found["cpu_us_per_row"]
        note = f"{cpu:.4g} us of processor time a row, of which the ratio is; peak RSS"
        table.add({**row, "ratio": cpu / first, "memory_mb": found["memory_mb"], "note": note})
        wall, peak = found["us_per_row"], found["memory_mb"]
        print(f"{rows:>9} rows: {wall:.2f} us a row, {cpu:.2f} of processor time, peak {peak:.0f} MB", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=10_000)
    parser.add_argument("--most", type=int, default=1_000_000)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        print(json.dumps(scale_one(args.one)))
        return
    table = ResultTable(HERE / "results" / "sweep.csv", COLUMNS)
    compare(table, args.rows)
    scaling(table, args.most)
    table.write()


if __name__ == "__main__":
    main()
