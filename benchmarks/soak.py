# SPDX-License-Identifier: MIT
"""A long run of everything at once: random commands, clients that come and go, viewers killed, parameters changed.

python benchmarks/soak.py [--minutes 60] [--out FOLDER]     exits 1 when memory, handles, threads, rate or a count of messages is off.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from node_processes import Process, client, node, viewer
from result_table import ResultTable

RESULTS = Path(__file__).parent / "results"
MEMORY_GROWTH_MB = 30.0
"""Allowed between a third of the run, when caches and the viewer's bounded store are full, and its end."""


def main() -> int:
    """Run, report every minute, judge at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    random.seed(args.seed)
    table = ResultTable(args.out / "soak.csv", ("minute", "figure", "value"))
    folder = Path(tempfile.mkdtemp(prefix="soak"))
    history: list[dict] = []
    guests: list[tuple[float, Process | subprocess.Popen]] = []
    with (
        node("publish_rate:=500.0", "viewer:=web", "initial.angular_velocity:=[0.05, 0.1, 12.0]") as flying,
        client("soak", str(args.seed)) as commander,
    ):
        start = time.monotonic()
        end, next_report, next_guest = start + 60 * args.minutes, start + 20, start
        while time.monotonic() < end:
            now = time.monotonic()
            if flying.popen.poll() is not None:
                print("".join(flying.errors[-20:]), file=sys.stderr)
                print("the node ended", file=sys.stderr)
                return 1
            if commander.popen.poll() is not None:
                print("".join(commander.errors[-20:]), file=sys.stderr)
                print("who sends the commands ended", file=sys.stderr)
                return 1
            if now >= next_guest:
                next_guest = now + random.uniform(2.0, 8.0)
                guests.append((now + random.uniform(2.0, 20.0), _guest(flying)))
            guests = [guest for guest in guests if not _shown_out(guest, now)]
            if now >= next_report:
                next_report = now + 60
                history.append(_report(flying, (now - start) / 60))
                for figure, value in history[-1].items():
                    table.add({"minute": (now - start) / 60, "figure": figure, "value": value})
                # What has been seen is kept if the run is ended.
                table.write()
            time.sleep(0.2)
        for guest in guests:
            _shown_out(guest, float("inf"))
        time.sleep(2.0)
        said = commander.end().splitlines()
        if not said:
            print("".join(commander.errors[-20:]), file=sys.stderr)
            print("who sends the commands didn't say what it sent", file=sys.stderr)
        sent = json.loads(said[-1]) if said else {"messages": -1, "bad": 0}
        time.sleep(2.0)
        counters = _counters()
        history.append(_report(flying, args.minutes))
    table.write()
    folder.rmdir()
    return _verdict(history, sent, counters)


def _guest(flying: Process) -> Process | subprocess.Popen:
    """A subscriber, or a viewer of the live stream, that will leave by itself, be asked to, or be killed."""
    if random.random() < 0.85:
        return client("subscribe", random.choice(["pose", "twist"]))
    return viewer(flying)


def _shown_out(guest: tuple[float, Process | subprocess.Popen], now: float) -> bool:
    leaves, process = guest
    popen = process.popen if isinstance(process, Process) else process
    if popen.poll() is None and now < leaves:
        return False
    if popen.poll() is None:
        # Half of them leave without a word.
        popen.send_signal(random.choice([signal.SIGKILL, signal.SIGTERM]))
    try:
        popen.wait(10)
    except subprocess.TimeoutExpired:
        popen.kill()
        popen.wait()
    return True


def _report(flying: Process, minute: float) -> dict:
    with client("subscribe", "pose", "3") as listener:
        try:
            listener.popen.wait(60)
        except subprocess.TimeoutExpired:
            # Counted in the verdict: the run goes on and shows whether others hear the node.
            print("a listener that heard nothing in 60 s", flush=True)
        heard = listener.end().splitlines()[1:]
        rate = json.loads(heard[0])["rate"] if heard else math.nan
    figures = {
        "rate": rate,
        "rss": flying.memory_mb(),
        "handles": flying.system.num_fds(),
        "threads": flying.system.num_threads(),
        "cpu": flying.cpu_share(2.0),
        "load": psutil.getloadavg()[0],
    }
    print(f"{minute:6.1f} min  " + "  ".join(f"{k} {v:.5g}" for k, v in figures.items()), flush=True)
    return figures


def _counters() -> dict[str, str]:
    with client("diagnostics") as process:
        process.popen.wait(60)
        return json.loads(process.end())


def _verdict(history: list[dict], sent: dict, counters: dict[str, str]) -> int:
    after_start, last = history[len(history) // 3], history[-1]
    rates = sorted(report["rate"] for report in history if math.isfinite(report["rate"]))
    unheard = len(history) - len(rates)
    received = int(counters["commands_received"])
    checks = {
        f"memory {after_start['rss']:.1f} to {last['rss']:.1f} MB": last["rss"] - after_start["rss"]
        <= MEMORY_GROWTH_MB,
        f"handles {after_start['handles']} to {last['handles']}": last["handles"] <= after_start["handles"] + 10,
        f"threads {after_start['threads']} to {last['threads']}": last["threads"] <= after_start["threads"] + 4,
        f"rate {rates[0]:.2f} to {rates[-1]:.2f}, median {rates[len(rates) // 2]:.2f} of 500": abs(
            rates[len(rates) // 2] - 500.0
        )
        < 5.0,
        f"{unheard} of {len(history)} listeners heard nothing": unheard == 0,
        f"messages {received} received + {counters['messages_lost']} lost of {sent['messages']} sent": received
        + int(counters["messages_lost"])
        == sent["messages"],
        f"refused {counters['refused_total']} of {sent['bad']} bad ones": int(counters["refused_total"]) >= sent["bad"],
        f"real time lost {float(counters['real_time_lost_s']):.2f} s, overruns {counters['overruns']}, queue full "
        f"{counters['queue_full']} times": True,
    }
    for what, holds in checks.items():
        print(f"{'ok  ' if holds else 'FAIL'}  {what}")
    return 0 if all(checks.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
