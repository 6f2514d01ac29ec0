# SPDX-License-Identifier: MIT
"""How long whole processes take, commands and node, beside what they can't do without: importing NumPy, or rclpy and
the messages.

    python benchmarks/start_up.py [--rounds 15]

The processes take turns, so that they share what else the machine does; medians of wall clock and processor time, and
the largest resident memory. Writes results/start_up.csv; docs/benchmarks.md shows it.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

COLUMNS = ("what", "beside", "seconds", "cpu_seconds", "ratio", "memory_mb", "load_1min")
NUMPY, MESSAGES = "import numpy", "import rclpy and the messages"
STL = "inspect of an .stl"
EXECUTABLES = (sys.executable, "-P", "-m", "rigid_proto_ros.cli.executables")
IMPORTS = "import rclpy, rclpy.node, rclpy.executors; from geometry_msgs.msg import WrenchStamped, PoseStamped, TwistStamped; "
IMPORTS += (
    "from nav_msgs.msg import Odometry; from std_srvs.srv import Trigger, SetBool; from std_msgs.msg import String; "
)
IMPORTS += "from diagnostic_msgs.msg import DiagnosticArray; from rcl_interfaces.srv import SetParameters"


WRITES_STL = "import sys, trimesh; from rigid_proto_ros.mesh.locate import resolve_mesh; "
WRITES_STL += "trimesh.load(resolve_mesh('hammer'), force='mesh').export(sys.argv[1])"
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parent.parent), "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}


def processes(folder: Path) -> dict[str, tuple[str, list[str]]]:
    """Of each what it is compared with, and its command."""
    own = {
        "--help": ["--help"],
        "inspect hammer": ["inspect", "hammer"],
        STL: ["inspect", str(folder / "hammer.stl")],
        "simulate t_handle --duration 10": ["simulate", "t_handle", "--duration", "10"],
    }
    return {
        NUMPY: (NUMPY, [sys.executable, "-c", "import numpy"]),
        **{name: (NUMPY, [*EXECUTABLES, "rigid_proto", *words]) for name, words in own.items()},
        MESSAGES: (MESSAGES, [sys.executable, "-c", IMPORTS]),
        "node, until it flies": (MESSAGES, [*EXECUTABLES, "rigid_body_node"]),
    }


def measured(command: list[str], until: str) -> tuple[float, float, float]:
    """Wall clock and processor time [s] and largest memory [MB] of a process, to its end or until it says something."""
    began = time.perf_counter()
    process = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    took = 0.0
    for line in process.stderr or ():
        if until and until in line.decode():
            took = time.perf_counter() - began
            process.terminate()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = status
    assert took or (status == 0 and not until), command
    return took or time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as work:
        subprocess.run([sys.executable, "-c", WRITES_STL, f"{work}/hammer.stl"], env=ENVIRONMENT, check=True)
        asked = processes(Path(work))
        found: dict[str, list[tuple[float, float, float]]] = {name: [] for name in asked}
        for number in range(rounds + 1):
            for name, (_, command) in asked.items():
                one = measured(command, "is simulating" if name.startswith("node") else "")
                if number:  # the first start may build the kernels, and writes bytecode
                    found[name].append(one)
    # Not before: a process's largest memory counts from the one that started it.
    from result_table import ResultTable

    table = ResultTable(Path(__file__).parent / "results" / "start_up.csv", COLUMNS)
    for name, (beside, _) in asked.items():
        seconds, cpu, memory = (statistics.median(values) for values in zip(*found[name], strict=True))
        ratio = seconds / statistics.median(first for first, *_ in found[beside])
        print(f"{name:34s} {seconds:7.3f} s, {ratio:5.2f} times {beside}, {cpu:7.3f} s of a core, {memory:6.1f} MB")
        row = {"what": name, "beside": beside, "seconds": seconds, "cpu_seconds": cpu, "ratio": ratio}
        table.add({**row, "memory_mb": memory, "load_1min": os.getloadavg()[0]})
    table.write()


if __name__ == "__main__":
    main()
