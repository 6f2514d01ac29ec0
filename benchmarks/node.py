# SPDX-License-Identifier: MIT
"""What the node costs, in real processes: CPU, rate, jitter, latency, start-up, memory, floods, several bodies.

python benchmarks/node.py [--short]      writes results/node.csv, with the machine's load beside each figure.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import statistics
import tempfile
import time
from pathlib import Path

import psutil

from node_processes import Process, client, node
from result_table import ResultTable

RESULTS = Path(__file__).parent / "results"
SPIN = "initial.angular_velocity:=[0.05, 0.1, 12.0]"
KILOHERTZ = "publish_rate:=1000.0"


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--short", action="store_true", help="a tenth of the time, for a look")
    seconds = 2.0 if parser.parse_args().short else 15.0
    table = ResultTable(RESULTS / "node.csv", ("what", "figure", "value", "unit", "load_1min"))

    def note(what: str, figure: str, value: float, unit: str) -> None:
        load = psutil.getloadavg()[0]
        table.add({"what": what, "figure": figure, "value": value, "unit": unit, "load_1min": load})
        print(f"{what:58s} {figure:10s} {value:12.4g} {unit:8s} (load {load:.1f})", flush=True)

    start_up(note)
    processor(note, seconds)
    baselines(note, seconds)
    rate_and_latency(note, seconds)
    recording(note, seconds)
    floods(note, 60.0 if seconds > 10 else 5.0)
    bodies(note, seconds)
    table.write()


@contextlib.contextmanager
def listeners():
    """One subscriber each on pose and twist."""
    with client("subscribe", "pose"), client("subscribe", "twist"):
        time.sleep(2.0)
        yield


def start_up(note) -> None:
    """From the start of the process until it says that it flies, kernels and mesh cached by a first start."""
    node().end()
    for label, parameters in (("start", []), ("start with recording", [f"record:={_recording()}"])):
        times = []
        for _ in range(5):
            began = time.monotonic()
            with node(*parameters, settle_s=0.0):
                times.append(time.monotonic() - began)
        note(label, "median", statistics.median(times), "s")


def processor(note, seconds: float) -> None:
    """CPU of our node as listeners and motion come and go: what isn't needed isn't done."""
    with node(KILOHERTZ, SPIN) as process:
        note("1 kHz, nobody listens", "cpu", process.cpu_share(seconds), "%")
        with listeners():
            note("1 kHz, pose and twist listened to", "cpu", process.cpu_share(seconds), "%")
        note("1 kHz, memory after that", "rss", process.memory_mb(), "MB")
    with node(KILOHERTZ) as process:
        note("1 kHz, at rest, nobody listens", "cpu", process.cpu_share(seconds), "%")
        with listeners():
            note("1 kHz, at rest, pose and twist listened to", "cpu", process.cpu_share(seconds), "%")
    with node(SPIN) as process:
        note("100 Hz, nobody listens", "cpu", process.cpu_share(seconds), "%")
        with listeners():
            note("100 Hz, pose and twist listened to", "cpu", process.cpu_share(seconds), "%")


def baselines(note, seconds: float) -> None:
    """The same job as a plain rclpy node does it."""
    for engine in ("ours", "mujoco"):
        with client("plain", engine, "1000") as process, listeners():
            if process.popen.poll() is None:
                note(
                    f"plain rclpy timer and messages, {engine} stepping, 1 kHz", "cpu", process.cpu_share(seconds), "%"
                )


def rate_and_latency(note, seconds: float) -> None:
    """Intervals between publications by the middleware's own stamps, and from wrench to the twist that shows it."""
    with node(KILOHERTZ, SPIN, "wrench_timeout:=0.0"):
        with client("subscribe", "twist", str(2 + seconds)) as listener:
            time.sleep(4 + seconds)
            for figure, value in json.loads(listener.end()).items():
                note(
                    "1 kHz, publications",
                    figure,
                    value,
                    "" if figure == "messages" else "1/s" if figure == "rate" else "ms",
                )
        with client("latency", str(int(20 * seconds))) as listener:
            listener.popen.wait(120)
            for figure, value in json.loads(listener.end()).items():
                note("wrench to first twist showing it, 1 kHz", figure, value, "" if figure == "count" else "ms")


def recording(note, seconds: float) -> None:
    """What a recording at 1 kHz adds."""
    path = _recording()
    with node(KILOHERTZ, SPIN, f"record:={path}") as process:
        note("1 kHz, recording, nobody listens", "cpu", process.cpu_share(seconds), "%")


def _recording() -> str:
    return str(Path(tempfile.mkdtemp()) / "benchmark.rrd")


def floods(note, seconds: float) -> None:
    """10 000 wrenches a second: rate, memory, and every message accounted for."""
    with node(KILOHERTZ, SPIN) as process, client("subscribe", "twist", str(seconds + 4)) as listener:
        time.sleep(2.0)
        before = process.memory_mb()
        with client("flood", "10000", str(seconds)) as flooder:
            share = process.cpu_share(seconds + 3)
            counters = diagnostics()
            sent = json.loads(flooder.end())["sent"]
        note("flood of 10 000 wrenches/s", "cpu", share, "%")
        note("flood of 10 000 wrenches/s", "sent", sent, "")
        note("flood of 10 000 wrenches/s", "received", float(counters["wrench_received"]), "")
        note("flood of 10 000 wrenches/s", "gaps", float(counters["sequence_gaps"]), "")
        note("flood of 10 000 wrenches/s", "lost time", float(counters["real_time_lost_s"]), "s")
        note("flood of 10 000 wrenches/s", "rss growth", process.memory_mb() - before, "MB")
        time.sleep(2.0)
        note("flood of 10 000 wrenches/s, publications", "rate", json.loads(listener.end())["rate"], "1/s")


def diagnostics() -> dict[str, str]:
    """The node's newest counters."""
    with client("diagnostics") as process:
        process.popen.wait(20)
        return json.loads(process.end())


def bodies(note, seconds: float) -> None:
    """Cost of each further body at 100 Hz, with nobody listening."""
    folder = Path(tempfile.mkdtemp())
    scenes = []
    for k in range(64):
        scenes.append(folder / f"body_{k}.yaml")
        scenes[k].write_text(f"/**:\n  ros__parameters:\n    {SPIN.replace(':=', ': ')}\n", encoding="utf-8")
    shares = {}
    for count in (1, 4, 16, 64):
        with Process("-m", "rigid_proto_ros.ros.main", "--bodies", *map(str, scenes[:count])) as process:
            process.wait_until_flying()
            time.sleep(2.0)
            shares[count] = process.cpu_share(seconds)
            note(f"{count} bodies at 100 Hz in one process", "cpu", shares[count], "%")
            note(f"{count} bodies at 100 Hz in one process", "rss", process.memory_mb(), "MB")
    note("each further body at 100 Hz", "cpu", (shares[64] - shares[1]) / 63, "%")


if __name__ == "__main__":
    main()
