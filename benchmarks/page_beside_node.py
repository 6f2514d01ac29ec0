# SPDX-License-Identifier: MIT
"""What a page costs the body that flies in a node's process: overruns and share of a core at 1 kHz, with a page that is open
and driven and without, by turns; with 50 that watch; from a move of the hand to the string in the picture that the page
gets; memory, while random hands drive, come and go.

A page is a process of its own that reads what a browser would be sent. ``--minutes`` is for the memory.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

FOLDER = Path(__file__).parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parent), str(FOLDER.parent / "test"), str(FOLDER.parent / "test" / "page")]

from live_rig import Beside, Page, until

from result_table import ResultTable

ROUNDS, ROUND_S = 5, 6.0
"""Of each, by turns."""
WATCHERS = 50
MOVES = 100
DRAG_S = 1 / 60


def drive(address: str, watchers: int) -> None:
    """The other process: a page that drags without end, or some that watch."""
    pages = [Page(address) for _ in range(max(watchers, 1))]
    first = pages[0]
    first.until(lambda: first.pictures, "picture")
    if not watchers:
        first.do(entry={"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.1]}})
    print("open", flush=True)
    while True:
        time.sleep(DRAG_S)
        for page in pages:
            page.take()
        if not watchers:
            first.begin(entry={"string": {"target": [random.uniform(-0.1, 0.1) for _ in range(3)]}})


@contextmanager
def opened(address: str, watchers: int = 0) -> Iterator[None]:
    page = subprocess.Popen(
        [sys.executable, __file__, "--drive", address, "--watchers", str(watchers)], stdout=subprocess.PIPE
    )
    assert page.stdout is not None
    page.stdout.readline()
    time.sleep(1.0)
    try:
        yield
    finally:
        page.kill()
        page.wait()


@contextmanager
def hand_without_page(flown: Beside) -> Iterator[None]:
    """The same drag by a thread of this process: what it costs to be pulled, whoever pulls."""
    stop = threading.Event()

    def pull() -> None:
        flown.live.schedule(json.dumps([{"t": 0, "string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.1]}}]))
        while not stop.wait(DRAG_S):
            target = [random.uniform(-0.1, 0.1) for _ in range(3)]
            flown.live.schedule(json.dumps([{"t": 0, "string": {"target": target}}]))
        flown.live.schedule(json.dumps([{"t": 0, "string": "release"}]))

    thread = threading.Thread(target=pull)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def load(flown: Beside) -> tuple[float, float]:
    """Overruns and CPU time, each a second, of this process."""
    before, cpu, wall = flown.live.loop.pace.overruns, time.process_time(), time.monotonic()
    time.sleep(ROUND_S)
    wall = time.monotonic() - wall
    return (flown.live.loop.pace.overruns - before) / wall, (time.process_time() - cpu) / wall


def drawn_string_ms(page: Page) -> list[float]:
    """From a move of the hand to the first picture with the string's new target."""
    found = []
    page.do(entry={"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.1]}})
    for k in range(MOVES):
        page.take(random.uniform(0.03, 0.07))
        target = [0.2 + 1e-3 * k, 0.0, 0.0]
        began = time.monotonic()
        page.begin(entry={"string": {"target": target}})
        while not (page.flight.tied and target[0] in page.flight.string):
            page.take(0.0005)
        found.append(1e3 * (time.monotonic() - began))
    page.do(entry={"string": "release"})
    return found


def hands(flown: Beside, end_s: float, chance: random.Random) -> None:
    """Random hands that come and go, one of three by the death of its connection; nothing stays tied behind them."""
    from test_live_page import random_take

    while time.monotonic() < end_s:
        page = Page(flown.page.address)
        page.until(lambda page=page: page.pictures, "picture")
        random_take(page, chance, chance.uniform(0.5, 5.0))
        if chance.random() < 0.3:
            page.do(entry={"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.1]}})
            page.socket.socket.close()
            page.socket.close()
        else:
            page.socket.close()
        until(lambda: flown.string is None, "release of the string")
        if chance.random() < 0.1:
            flown.live.reset()


def memory_mb(flown: Beside, minutes: float) -> list[tuple[float, float]]:
    """Of this process and of the page's, ten times."""
    chance, began, found = random.Random(1), time.monotonic(), []
    for k in range(10):
        hands(flown, began + 60.0 * minutes * (k + 1) / 10, chance)
        found.append((psutil.Process().memory_info().rss / 1e6, flown.child.memory_info().rss / 1e6))
        print(
            f"memory after {minutes * (k + 1) / 10:.1f} min: {found[-1][0]:.1f} MB here, {found[-1][1]:.1f} MB in the page's process",
            flush=True,
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--only", choices=("memory", "load"), default="")
    parser.add_argument("--drive", help=argparse.SUPPRESS)
    parser.add_argument("--watchers", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.drive:
        drive(args.drive, args.watchers)
        return
    table = ResultTable(
        FOLDER / "results" / "page_beside_node.csv", ("what", "without_page", "with_page", "ratio", "load")
    )

    def tell(what: str, without: float, with_page: float) -> None:
        row = {"what": what, "without_page": without, "with_page": with_page, "load": os.getloadavg()[0]}
        row["ratio"] = with_page / without if without else float("nan")
        table.add(row)
        print(f"{what}: {without:.3g} without a page, {with_page:.3g} with one (load {row['load']:.1f})", flush=True)

    flown = Beside({"mesh": "t_handle", "publish_rate": 1000.0, "initial.angular_velocity": [0.05, 0.1, 3.0]})
    # Somebody takes every state, as a subscriber to a topic does: each is due at its own moment.
    flown.live.endpoints.has_subscribers = lambda: True
    address = flown.page.address
    try:
        if args.only != "memory":
            rounds = []
            for _ in range(ROUNDS):
                alone = load(flown)
                with hand_without_page(flown):
                    pulled = load(flown)
                with opened(address):
                    driven = load(flown)
                with opened(address, WATCHERS):
                    rounds.append((alone, pulled, driven, load(flown)))
                time.sleep(1.0)
            for k, what in enumerate(("overruns a second", "share of a core")):
                alone_, pulled_, driven_, watched = (
                    statistics.median(one[side][k] for one in rounds) for side in range(4)
                )
                tell(f"{what}, a page that drags, against the same drag without one", pulled_, driven_)
                tell(f"{what}, {WATCHERS} pages that watch", alone_, watched)
            with Page(address) as page:
                page.until(lambda: page.pictures, "picture")
                found = drawn_string_ms(page)
            tell("move of the hand to picture with it [ms], median", float("nan"), statistics.median(found))
            tell("the same, 95 %", float("nan"), sorted(found)[int(0.95 * len(found))])
        if args.only != "load":
            flown.live.set_parameters({"publish_rate": 100.0})
            sizes = memory_mb(flown, args.minutes)
            for side, where in enumerate(("the node's process", "the page's process")):
                tell(
                    f"memory [MB] of {where}, middle and end of {args.minutes:g} minutes",
                    sizes[4][side],
                    sizes[-1][side],
                )
    finally:
        flown.end()
    table.write()


if __name__ == "__main__":
    main()
