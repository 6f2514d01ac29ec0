# SPDX-License-Identifier: MIT
"""From a callback of the interactive page to its message in another process: 200 clicks and 200 moves of the hand.

The page server runs here, with its picture and its node; the listener is a process of its own. Both clocks are
CLOCK_MONOTONIC. The pointer's callbacks are called on viser's loop as viser calls them, at random moments of its frames.
"""

from __future__ import annotations

import asyncio
import os
import random
import statistics
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parent)]

from node_processes import Process, environment
from result_table import ResultTable

EVENTS = 200
TARGET_MS = 15.0


def listen() -> None:
    """The other process: prints topic and arrival [ns] of each message, until its input ends."""
    import rclpy
    from geometry_msgs.msg import PointStamped, WrenchStamped

    rclpy.init()
    node = rclpy.create_node("listener")

    def note(topic: str):
        return lambda _: print(topic, time.monotonic_ns(), flush=True)

    node.create_subscription(WrenchStamped, "/rigid_body/poke", note("poke"), 100, raw=True)
    node.create_subscription(PointStamped, "/rigid_body/string/target", note("target"), 100, raw=True)
    print("listening", 0, flush=True)
    rclpy.spin(node)


class Listener:
    """The process of ``listen``."""

    def __init__(self) -> None:
        command = [sys.executable, __file__, "listen"]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, env=environment(), text=True)
        self.next()

    def next(self) -> tuple[str, int]:
        topic, arrival_ns = self._process.stdout.readline().split()
        return topic, int(arrival_ns)

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


def measure() -> dict[str, list[float]]:
    """Latencies [ms] by kind of event."""
    os.environ.update(environment())
    import rclpy

    from rigid_proto_ros.rerun_view.ports import LOOPBACK, any_free_port
    from rigid_proto_ros.workbench.page import Page
    from rigid_proto_ros.workbench.server import make_server, stop_server

    rclpy.init()
    port = any_free_port()
    server = make_server(LOOPBACK, port, lambda _: None)
    page = Page(server, "/rigid_body", f"http://{LOOPBACK}:{port}")
    loop = server.get_event_loop()
    running = asyncio.run_coroutine_threadsafe(page.run(), loop)
    asyncio.run_coroutine_threadsafe(page._on_connect(None), loop).result()
    asyncio.run_coroutine_threadsafe(page.known(), loop).result(60)
    listener = Listener()
    publishers = (page.link._publishers["poke"], page.link._publishers["string/target"])
    while page.state is None or any(publisher.get_subscription_count() < 2 for publisher in publishers):
        time.sleep(0.05)
    time.sleep(1.0)

    async def timed(callback, event) -> int:
        began_ns = time.monotonic_ns()
        await callback(event)
        return began_ns

    def begin(callback, event) -> int:
        return asyncio.run_coroutine_threadsafe(timed(callback, event), loop).result()

    def drag(phase: str, x: float):
        return SimpleNamespace(phase=phase, client_id=1, start_position=(0.0, 0.0, 0.0), end_position=(x, 0.0, 0.0))

    click = SimpleNamespace(modifier=None, ray_origin=(1.45, -2.45, 1.2), ray_direction=(-1.45, 2.45, -1.2))
    page.tools.force = 1e-9
    found: dict[str, list[float]] = {"click": [], "drag": []}
    for _ in range(EVENTS):
        began_ns = begin(page.pointer._on_click, click)
        found["click"].append((listener.next()[1] - began_ns) * 1e-6)
        time.sleep(random.uniform(0.02, 0.06))
    begin(page.pointer._on_drag, drag("start", 0.0))
    listener.next()
    for k in range(EVENTS):
        began_ns = begin(page.pointer._on_drag, drag("update", 1e-3 * k))
        while (arrival_ns := listener.next()[1]) < began_ns:
            pass  # a still hand's own word, said before
        found["drag"].append((arrival_ns - began_ns) * 1e-6)
        time.sleep(random.uniform(0.02, 0.06))
    begin(page.pointer._on_drag, drag("end", 0.2))
    running.cancel()
    stop_server(server)
    page.close()
    listener.end()
    return found


def main() -> None:
    table = ResultTable(
        FOLDER / "results" / "workbench_latency.csv", ("event", "events", "p50_ms", "p95_ms", "max_ms", "load")
    )
    with Process("-m", "rigid_proto_ros.ros.main", "--ros-args", "-p", "mesh:=teapot") as node:
        node.wait_until_flying()
        found = measure()
    for event, values in found.items():
        values.sort()
        row = {
            "event": event,
            "events": len(values),
            "p50_ms": statistics.median(values),
            "p95_ms": values[int(0.95 * len(values))],
            "max_ms": values[-1],
            "load": os.getloadavg()[0],
        }
        table.add(row)
        verdict = "met" if row["p50_ms"] <= TARGET_MS else "missed"
        print(
            f"{event}: median {row['p50_ms']:.2f} ms of {len(values)}, 95 % {row['p95_ms']:.2f}, worst {row['max_ms']:.2f}"
            f" (target {TARGET_MS:g} ms {verdict}; load {row['load']:.1f})"
        )
    table.write()


if __name__ == "__main__":
    if sys.argv[1:] == ["listen"]:
        listen()
    else:
        main()
