# SPDX-License-Identifier: MIT
"""What recording costs: processor time a state, the file's size and memory, against the same states handed to nobody.

Ten simulated minutes at 1 kHz of a body that is poked, computed without ROS as fast as the machine goes, to .rrd and to .mcap;
and the usual way to use the SDK, a call of rr.log for each value, over ten seconds. All threads' time counts.

    python benchmarks/recording.py [--minutes N]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import rerun as rr

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from result_table import ResultTable
from rigid_proto_ros.base.bundled import example_path
from rigid_proto_ros.rerun_view.observer import FileRecorder
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.mcap_observer import McapObserver
from rigid_proto_ros.simulation.observer import Event, Observer, Published

REPEATS = 5
SECOND = 10**9
COLUMNS = ("recorder", "states", "us_per_state", "ratio", "file_mb", "memory_mb_at_a_third", "memory_mb_at_the_end")


class Nobody(Observer):
    """Takes every state and keeps none."""

    takes = frozenset({Published})

    def close(self) -> None:
        """Nothing to finish."""


class OneByOne(Observer):
    """Position, attitude, velocity and spin of each state by rr.log, as the SDK's first examples do it."""

    def __init__(self, path: Path) -> None:
        self._recording = rr.RecordingStream("one_by_one")
        self._recording.save(path)

    takes = frozenset({Published})

    def on(self, event: Event) -> None:
        """Log one state."""
        if not isinstance(event, Published):
            return
        time_ns, row = event
        to = self._recording
        to.set_time("sim_time", duration=1e-9 * time_ns)
        to.log("body", rr.Transform3D(translation=row[0:3], quaternion=row[3:7]))
        for k, name in enumerate(("vx", "vy", "vz", "wx", "wy", "wz")):
            to.log(f"twist/{name}", rr.Scalars(row[7 + k]))

    def close(self) -> None:
        """Finish the file."""
        self._recording.disconnect()


RECORDERS: dict[str, tuple[str, Callable[[Path], Observer]]] = {
    ".rrd": (".rrd", lambda path: FileRecorder(str(path))),
    ".mcap": (".mcap", McapObserver),
    "rr.log for each value": (".rrd", OneByOne),
}


def flight(observer: Observer, seconds: int) -> tuple[float, list[float]]:
    """Processor seconds of a flight with this observer, and the process's memory [MB] at each third of it."""
    run = OfflineRun(
        read_scene("t_handle", {"publish_rate": 1000.0}), read_script(example_path("flip_and_poke")), observer
    )
    memory, start = [], time.process_time()
    for third in (1, 2, 3):
        assert run.advance(third * seconds * SECOND // 3)
        memory.append(psutil.Process().memory_info().rss / 1e6)
    observer.close()
    return time.process_time() - start, memory


def main() -> None:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    seconds = round(60 * parser.parse_args().minutes)
    table = ResultTable(HERE / "results" / "recording.csv", COLUMNS)
    costs: dict[str, float] = {}
    for name, (suffix, recorder) in RECORDERS.items():
        flown = 9 if recorder is OneByOne else seconds
        states = 1000 * flown
        recorded, bare = [], []
        for repeat in range(REPEATS):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"session{suffix}"
                bare.append(flight(Nobody(), flown)[0])
                # The first run loads what it needs: it's a short one, thrown away.
                if repeat == 0:
                    flight(recorder(path), 3)
                taken, memory = flight(recorder(path), flown)
                recorded.append(taken)
                size = path.stat().st_size / 1e6
        costs[name] = 1e6 * (float(np.median(recorded)) - float(np.median(bare))) / states
        row = {"recorder": name, "states": states, "us_per_state": costs[name], "ratio": costs[name] / costs[".rrd"]}
        row |= {"file_mb": size, "memory_mb_at_a_third": memory[0], "memory_mb_at_the_end": memory[2]}
        table.add(row)
        print("  ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{v}" for k, v in row.items()), flush=True)
    table.write()


if __name__ == "__main__":
    main()
