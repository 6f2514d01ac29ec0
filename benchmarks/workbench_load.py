# SPDX-License-Identifier: MIT
"""What a page costs the body that flies in its process: overruns and share of a core at 1 kHz, with a page and without, by
turns; from a move of the hand to the string as it is sent to be drawn; memory, while somebody pokes and pulls.

The page is a process of its own that reads what a browser would be sent. For comparison, two processes that have nothing
to do with the simulation compute as much, as often, as the page's thread and the reader do. ``--minutes`` is for the
memory.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import resource
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parent), str(FOLDER.parent / "test")]

from result_table import ResultTable

ROUNDS, ROUND_S = 9, 6.0
"""Of each, by turns."""

OTHERS_MS = (2.5, 1.5)
"""Of computing by other processes, every 20 ms, as long as the page's thread and the reader take for a frame."""
MOVES = 100


def read(port: int) -> None:
    """The other process: a page."""
    from workbench_page import bare_page

    with bare_page(port) as page:
        print("open", flush=True)
        for _ in page:
            pass


@contextmanager
def opened(port: int):
    page = subprocess.Popen([sys.executable, __file__, "--read", str(port)], stdout=subprocess.PIPE)
    page.stdout.readline()
    time.sleep(1.0)
    try:
        yield
    finally:
        page.kill()
        page.wait()


@contextmanager
def others():
    """Other processes that compute as much."""
    processes = [subprocess.Popen([sys.executable, __file__, "--compute", str(ms)]) for ms in OTHERS_MS]
    time.sleep(1.0)
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def compute(ms: float) -> None:
    """One of these processes."""
    while True:
        began = time.monotonic()
        while time.monotonic() < began + 1e-3 * ms:
            pass
        time.sleep(0.02 - 1e-3 * ms)


def load(flown) -> tuple[float, float]:
    """Overruns and CPU time, each a second, of this process."""
    before, cpu, wall = flown.live.loop.pace.overruns, time.process_time(), time.monotonic()
    time.sleep(ROUND_S)
    wall = time.monotonic() - wall
    return (flown.live.loop.pace.overruns - before) / wall, (time.process_time() - cpu) / wall


def drawn_string_ms(flown) -> list[float]:
    """From a move of the hand to another end of the string in what the browsers are sent."""
    from rigid_proto_ros.picture import style

    page, loop, found = flown.page, flown.server.get_event_loop(), []

    async def moved(x: float) -> float:
        hand = page.backend._nodes.get(style.HAND)
        before, began = None if hand is None else tuple(hand.position), time.monotonic()
        page.pointer.pull((x, 0.0, 0.0))
        while (hand := page.backend._nodes.get(style.HAND)) is None or tuple(hand.position) == before:
            await asyncio.sleep(0.0005)
        return 1e3 * (time.monotonic() - began)

    async def grab() -> None:
        page.pointer.grab(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    asyncio.run_coroutine_threadsafe(grab(), loop).result(30.0)
    for k in range(MOVES):
        time.sleep(random.uniform(0.2, 0.24))  # the end has come to the target before, which takes 0.1 s
        found.append(asyncio.run_coroutine_threadsafe(moved(0.2 + 1e-3 * k), loop).result(30.0))
    loop.call_soon_threadsafe(page.pointer.let_go)
    return found


def memory_mb(flown, minutes: float) -> list[float]:
    """Of this process, ten times, while it is poked every second and reset now and then."""
    page, loop, found = flown.page, flown.server.get_event_loop(), []
    end = time.monotonic() + 60.0 * minutes
    for k in range(10):
        while time.monotonic() < end - 60.0 * minutes * (9 - k) / 10:
            loop.call_soon_threadsafe(page.flight.do, {"at": "com", "torque": [1e-3, 0.0, 0.0]})
            time.sleep(1.0)
        if k % 3 == 2:
            flown.live.reset()
        found.append(int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--read", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--compute", type=float, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.read or args.compute:
        read(args.read) if args.read else compute(args.compute)
        return
    from workbench_page import Flown

    from rigid_proto_ros.live.simulation_loop import Endpoints

    table = ResultTable(
        FOLDER / "results" / "workbench_load.csv", ("what", "without_page", "with_page", "ratio", "load")
    )

    def tell(what: str, without: float, with_page: float) -> None:
        row = {"what": what, "without_page": without, "with_page": with_page, "load": os.getloadavg()[0]}
        row["ratio"] = with_page / without if without else float("nan")
        table.add(row)
        print(f"{what}: {without:.3g} without a page, {with_page:.3g} with one (load {row['load']:.1f})", flush=True)

    # Somebody takes every state, as a subscriber to a topic does: each is due at its own moment.
    endpoints = Endpoints()
    endpoints.has_subscribers = lambda: True
    flown = Flown("t_handle", endpoints=endpoints)
    port = flown.server.get_port()
    try:
        flown.live.set_parameters({"publish_rate": 1000.0})
        rounds = []
        for _ in range(ROUNDS):
            time.sleep(3.0)  # the page before is forgotten
            alone = load(flown)
            with others():
                beside = load(flown)
            with opened(port):
                rounds.append((alone, load(flown), beside))
        for k, what in enumerate(("overruns a second", "share of a core")):
            without, with_page, beside = (statistics.median(found[side][k] for found in rounds) for side in range(3))
            tell(what, without, with_page)
            tell(f"{what}, other processes instead of the page", without, beside)
        with opened(port):
            found = drawn_string_ms(flown)
            tell("move of the hand to drawn string [ms], median", float("nan"), statistics.median(found))
            tell("the same, 95 %", float("nan"), sorted(found)[int(0.95 * len(found))])
            sizes = memory_mb(flown, args.minutes)
            tell(f"memory [MB] after a tenth of {args.minutes:g} minutes", float("nan"), sizes[0])
            tell("memory [MB] at their end", float("nan"), sizes[-1])
    finally:
        flown.end()
    table.write()


if __name__ == "__main__":
    main()
