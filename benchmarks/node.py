# SPDX-License-Identifier: MIT
"""What the node costs, in real processes: CPU, rate, jitter, latency, memory, floods, skipped work.

    python benchmarks/node.py [--short] [--only processor,rate,...] [--out FOLDER]

Writes node.csv and node_skips.csv, with the machine's load beside each figure; docs/benchmarks.md shows them.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).parent.parent))

from node_processes import Process, client, node, viewer
from node_skips import skips
from result_table import ResultTable

RESULTS = Path(__file__).parent / "results"
SPIN = "initial.angular_velocity:=[0.05, 0.1, 12.0]"
KILOHERTZ = "publish_rate:=1000.0"
VIEWER_S = 4.0
"""A viewer's life: it takes two seconds to connect."""
COLUMNS = ("what", "figure", "value", "unit", "load_1min", "cores")
SKIP_COLUMNS = ("skipped", "unit", "done", "as_it_is", "load_1min")


def main() -> None:
    """Measure, print and write."""
    parts = {
        "processor": processor,
        "baselines": baselines,
        "rate": rate,
        "latency": latency,
        "recording": recording,
        "viewers": viewers,
        "flood": flood,
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="a tenth of the time, for a look")
    parser.add_argument("--only", default=",".join((*parts, "skips")), help="names of parts")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    seconds, wanted = (2.0 if options.short else 15.0), options.only.split(",")
    table = ResultTable(options.out / "node.csv", COLUMNS)

    def note(what: str, figure: str, value: float, unit: str) -> None:
        load = psutil.getloadavg()[0]
        entry = {"what": what, "figure": figure, "value": value, "unit": unit, "load_1min": load}
        table.add({**entry, "cores": os.cpu_count()})
        print(f"{what:58s} {figure:10s} {value:12.4g} {unit:8s} (load {load:.1f})", flush=True)

    for name, part in parts.items():
        if name in wanted:
            part(note, seconds)
            # What has been measured is kept if the run is ended.
            table.write()
    if "skips" in wanted:
        skipped = ResultTable(options.out / "node_skips.csv", SKIP_COLUMNS)
        for what, unit, done, as_it_is in skips(seconds):
            load = psutil.getloadavg()[0]
            skipped.add({"skipped": what, "unit": unit, "done": done, "as_it_is": as_it_is, "load_1min": load})
            ratio = f"{done / as_it_is:8.3g} times" if as_it_is else "   never done"
            print(f"{what:88s} {done:10.4g} {as_it_is:10.4g} {unit:11s} {ratio} (load {load:.1f})", flush=True)
        skipped.write()


def listened_to(note, what: str, process: Process, seconds: float) -> None:
    """Share of a core with one subscriber each on pose and twist, and the rate that is held meanwhile."""
    with client("subscribe", "pose"), client("subscribe", "twist", str(seconds + 2)) as listener:
        listener.popen.stdout.readline()
        time.sleep(1.0)
        note(what, "cpu", process.cpu_share(seconds), "%")
        note(what, "rate", result_of(listener)["rate"], "1/s")


def processor(note, seconds: float) -> None:
    """CPU of our node as listeners and motion come and go: what isn't needed isn't done."""
    with node(KILOHERTZ, SPIN) as process:
        note("1 kHz, no subscriber", "cpu", process.cpu_share(seconds), "%")
        listened_to(note, "1 kHz, one subscriber each to pose and twist", process, seconds)
        note("1 kHz, memory after that", "rss", process.memory_mb(), "MB")
    with node(KILOHERTZ) as process:
        note("1 kHz, at rest, no subscriber", "cpu", process.cpu_share(seconds), "%")
        listened_to(note, "1 kHz, at rest, one subscriber each to pose and twist", process, seconds)
    with node(SPIN) as process:
        note("100 Hz, no subscriber", "cpu", process.cpu_share(seconds), "%")
        listened_to(note, "100 Hz, one subscriber each to pose and twist", process, seconds)


def baselines(note, seconds: float) -> None:
    """The same job as a plain rclpy node does it."""
    for engine, tool in (("ours", "rigid_proto"), ("mujoco", "MuJoCo")):
        with client("plain", engine, "1000") as process:
            listened_to(note, f"a plain rclpy node that steps {tool}, 1 kHz", process, seconds)


def rate(note, seconds: float) -> None:
    """Intervals between publications by the middleware's own stamps: rate and jitter."""
    with node(KILOHERTZ, SPIN), client("subscribe", "twist", str(2 + seconds)) as listener:
        units = {"messages": "", "rate": "1/s"}
        for figure, value in result_of(listener).items():
            note("1 kHz, publications", figure, value, units.get(figure, "ms"))


def latency(note, seconds: float) -> None:
    """From the publication of a wrench to that of the first twist that shows it."""
    with node(KILOHERTZ, SPIN, "wrench_timeout:=0.0"), client("latency", str(int(20 * seconds))) as sender:
        for figure, value in result_of(sender).items():
            note("wrench to first twist showing it, 1 kHz", figure, value, "" if figure == "count" else "ms")


def result_of(process: Process) -> dict:
    """What a client prints when it is done."""
    process.popen.wait(600)
    return json.loads(process.end().splitlines()[-1])


def recording(note, seconds: float) -> None:
    """What a recording at 1 kHz costs."""
    with node(KILOHERTZ, SPIN, f"record:={_recording()}") as process:
        note("1 kHz, recording, no subscriber", "cpu", process.cpu_share(seconds), "%")


def viewers(note, seconds: float) -> None:
    """The rate that is held at 1 kHz while nobody watches the live stream, and while viewers are killed one after the other."""
    with node(KILOHERTZ, SPIN, "viewer:=web") as process:
        for what, count in (("nobody watches", 0), ("20 viewers are killed", 20)):
            lost = float(diagnostics()["real_time_lost_s"])
            with client("subscribe", "twist", str(2.0 + (count * VIEWER_S or seconds))) as listener:
                for _ in range(count):
                    watching = viewer(process)
                    time.sleep(VIEWER_S)
                    watching.kill()
                    watching.wait()
                what = f"1 kHz, live stream, {what}"
                note(what, "rate", result_of(listener)["rate"], "1/s")
            note(what, "lost time", float(diagnostics()["real_time_lost_s"]) - lost, "s")
            note(what, "rss", process.memory_mb(), "MB")


def _recording() -> str:
    return str(Path(tempfile.mkdtemp()) / "benchmark.rrd")


def flood(note, seconds: float) -> None:
    """10 000 wrenches a second for a minute: rate, memory, and every message accounted for."""
    seconds = 60.0 if seconds > 10.0 else 5.0
    what = "10 000 wrenches per second"
    with node(KILOHERTZ, SPIN) as process, client("subscribe", "twist", str(seconds + 4)) as listener:
        time.sleep(2.0)
        with client("flood", "10000", str(seconds)) as flooder:
            time.sleep(2.0)
            before = process.memory_mb()
            share = process.cpu_share(seconds - 2.0)
            growth = process.memory_mb() - before
            sent = json.loads(flooder.popen.stdout.readline())["sent"]
            time.sleep(1.0)
            counters = diagnostics()
        note(what, "cpu", share, "%")
        note(what, "sent", sent, "")
        note(what, "received", float(counters["wrench_received"]), "")
        note(what, "lost", float(counters["messages_lost"]), "")
        note(what, "lost time", float(counters["real_time_lost_s"]), "s")
        note(what, "rss growth", growth, "MB")
        note(f"{what}, publications", "rate", result_of(listener)["rate"], "1/s")


def diagnostics() -> dict[str, str]:
    """The node's newest counters."""
    with client("diagnostics") as process:
        return result_of(process)


if __name__ == "__main__":
    main()
