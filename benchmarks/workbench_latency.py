# SPDX-License-Identifier: MIT
"""From a callback of the interactive page to its message in another process, 200 clicks and 200 moves of the hand; from a move of
the hand to the string as it is drawn, 100 times; and frames a second of the page's server and of a browser.

The page server runs here, with its picture and its node; the listener is a process of its own. Both clocks are
CLOCK_MONOTONIC. The pointer's callbacks are called on viser's loop as viser calls them, at random moments of its frames. A
string counts as drawn when its new end goes to the browsers, which is after the node has taken the target and said so.
"""

from __future__ import annotations

import asyncio
import importlib.util
import os
import random
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parent)]

from node_processes import Process, environment
from result_table import ResultTable

EVENTS = 200
DRAWN_EVENTS = 100
TARGETS_MS = {"click": 15.0, "drag": 15.0, "drawn string": 60.0}
COUNTED_S = 5.0
"""[s] Over which frames are counted."""


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


def browser_frames(address: str) -> tuple[float, str] | None:
    """Frames a second of a page in headless Chromium, and what draws them; None where there is no Chromium."""
    chromium = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None or importlib.util.find_spec("playwright") is None:
        return None
    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=flags)
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.set_default_timeout(120e3)
        page.goto(address)
        page.wait_for_selector("canvas")
        time.sleep(COUNTED_S)
        frames = page.evaluate(
            """seconds => new Promise(done => {
                let frames = -3, began = 0;  // the first ones wait for shaders
                const count = () => {
                    if (++frames == 0) began = performance.now();
                    const passed = (performance.now() - began) / 1e3;
                    if (frames > 0 && passed >= seconds) done(frames / passed);
                    else requestAnimationFrame(count);
                };
                requestAnimationFrame(count);
            })""",
            COUNTED_S,
        )
        browser.close()
    return float(frames), "SwiftShader, without a graphics card"


def measure(tell: Callable[[dict[str, list[float]]], None]) -> dict[str, tuple[float, str]]:
    """Measure latencies [ms] by kind of event and tell them; returns frames a second and what was counted, by who draws them."""
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
    asyncio.run_coroutine_threadsafe(page.scenes.known(), loop).result(60)
    listener = Listener()
    publishers = (page.link._publishers["poke"], page.link._publishers["string/target"])
    while page.follower.state is None or any(publisher.get_subscription_count() < 2 for publisher in publishers):
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
    hand = page.view.hand

    async def until_drawn(event) -> float:
        before, began_ns = tuple(hand.position), time.monotonic_ns()
        await page.pointer._on_drag(event)
        while tuple(hand.position) == before:
            await asyncio.sleep(0.0005)
        return (time.monotonic_ns() - began_ns) * 1e-6

    found["drawn string"] = []
    for k in range(DRAWN_EVENTS):
        time.sleep(random.uniform(0.2, 0.24))  # the end has come to the target before, which takes 0.1 s
        moved = until_drawn(drag("update", 0.2 + 1e-3 * k))
        found["drawn string"].append(asyncio.run_coroutine_threadsafe(moved, loop).result(30))
    begin(page.pointer._on_drag, drag("end", 0.2))
    tell(found)  # before the browser, which takes its time on a busy machine
    ticks: list[float] = []
    tick = page.tick
    page.tick = lambda now_s: (ticks.append(now_s), tick(now_s))[1]
    time.sleep(COUNTED_S)
    frames = {"server": (len(ticks) / COUNTED_S, "no browser beside it")}
    shown = browser_frames(f"http://{LOOPBACK}:{port}")
    if shown is not None:
        frames["browser"] = shown
    running.cancel()
    stop_server(server)
    page.close()
    listener.end()
    return frames


def main() -> None:
    table = ResultTable(
        FOLDER / "results" / "workbench_latency.csv",
        ("event", "events", "p50_ms", "p95_ms", "max_ms", "frames_per_s", "load"),
    )
    with Process(
        "-m", "rigid_proto_ros.cli.executables", "rigid_body_node", "--ros-args", "-p", "mesh:=teapot"
    ) as node:
        node.wait_until_flying()
        frames = measure(lambda found: tell_latencies(found, table))
    for name, (rate, how) in frames.items():
        table.add({"event": f"frames of the {name}", "frames_per_s": rate, "load": os.getloadavg()[0]})
        print(f"{name}: {rate:.1f} frames a second ({how}; load {os.getloadavg()[0]:.1f})")
    table.write()


def tell_latencies(found: dict[str, list[float]], table: ResultTable) -> None:
    """Rows of the table, and a line of each."""
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
        target_ms = TARGETS_MS[event]
        verdict = "met" if row["p50_ms"] <= target_ms else "missed"
        print(
            f"{event}: median {row['p50_ms']:.2f} ms of {len(values)}, 95 % {row['p95_ms']:.2f}, worst {row['max_ms']:.2f}"
            f" (target {target_ms:g} ms {verdict}; load {row['load']:.1f})",
            flush=True,
        )


if __name__ == "__main__":
    if sys.argv[1:] == ["listen"]:
        listen()
    else:
        main()
