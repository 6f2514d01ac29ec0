# SPDX-License-Identifier: MIT
"""A node and its page while hands come, drag and go, browsers are killed, and other nodes are: nothing grows, no string
stays tied, and what was acknowledged is recorded. MINUTES says for how long, 10 if it says nothing.
"""

from __future__ import annotations

import json
import os
import random
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest

pytest.importorskip("websockets", reason="websockets is not installed: no page of a node")

sys.path.append(str(Path(__file__).resolve().parents[1] / "page"))

from live_rig import Page, random_take, until
from page_browser import CHROMIUM, SOFTWARE, Opened
from ros_process import RosProcess, running_node, start_node

from rigid_proto_ros.session.bag import read_runs, repair

MINUTES = float(os.environ.get("MINUTES", "10"))
FLAT = 0.02
"""Of the memory in the second half: how far the medians of its minutes may lie apart."""
LOST_S = 2.0
"""[s] What is acknowledged so shortly before a node is killed may be lost; docs/sessions.md says one second."""

ADDRESS = re.compile(r"the workbench is at (http://127\.0\.0\.1:\d+/live/\S+)")
VALUES = {
    "viewer": "workbench",
    "initial.angular_velocity": [0.05, 0.1, 3.0],
    "string.timeout": 0.0,  # a string that nobody releases stays
    "record": "soak.mcap",
}


def address_of(node: RosProcess) -> str:
    node.wait_for("the workbench is at")
    return ADDRESS.search(node.errors)[1]


def child_of(node: RosProcess) -> psutil.Process:
    children = psutil.Process(node.pid).children()
    return next(child for child in children if "rigid_proto_ros.page.watchers" in child.cmdline())


class Memory(threading.Thread):
    """Resident memory [MB] of processes, twice a second."""

    def __init__(self, processes: dict[str, psutil.Process]) -> None:
        super().__init__(daemon=True)
        self.processes, self.began_s = processes, time.monotonic()
        self.seen: dict[str, list[tuple[float, float]]] = {name: [] for name in processes}
        self.ended = threading.Event()

    def run(self) -> None:
        while not self.ended.wait(0.5) and all(process.is_running() for process in self.processes.values()):
            for name, process in self.processes.items():
                self.seen[name].append((time.monotonic() - self.began_s, process.memory_info().rss / 1e6))

    def medians(self, name: str) -> list[float]:
        """Of each whole minute."""
        by_minute: dict[int, list[float]] = {}
        for at_s, megabytes in self.seen[name]:
            by_minute.setdefault(int(at_s // 60), []).append(megabytes)
        return [statistics.median(by_minute[k]) for k in sorted(by_minute)][: int(self.seen[name][-1][0] // 60)]


def numbers_of(value: Any) -> Iterator[tuple[float, ...]]:
    """All numbers of three or one that stand in it."""
    if isinstance(value, dict):
        for name, part in value.items():
            if name not in ("at", "t"):  # a point is recorded as text
                yield from numbers_of(part)
    elif isinstance(value, list):
        yield tuple(map(float, value))
    elif isinstance(value, float):
        yield (value,)


def recorded(file: Path) -> set[tuple[float, ...]]:
    return {
        found for run in read_runs(file) for _, line in run.events for found in numbers_of(json.loads(line)["content"])
    }


def lost(acknowledged: list[dict[str, Any]], file: Path) -> list[tuple[float, ...]]:
    """What was acknowledged and isn't recorded; that a value is set which is in force already isn't."""
    again = {(0.0, 0.0, 0.0), (0.0, 0.0, -1.62)}
    found = recorded(file) | again
    return [one for command in acknowledged for one in numbers_of(command.get("entry", {})) if one not in found]


def check_released(address: str) -> None:
    with Page(address) as watcher:
        watcher.until(lambda: watcher.picture and not watcher.flight.tied, "release of the string")


def comes_and_goes(address: str, chance: random.Random) -> list[dict[str, Any]]:
    """A hand that drags when it goes, with a goodbye or without."""
    page = Page(address)
    done = random_take(page, chance, chance.uniform(1.0, 5.0))
    if page.do(time="resume") is None and page.do(entry={"string": {"attach": [0, 0, 0], "target": [0, 0, 0.3]}}):
        raise AssertionError("no string")
    if chance.random() < 0.5:
        page.socket.close()
    else:
        plain = page.socket.socket
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        plain.close()
    return done


@contextmanager
def killed_browser(driver: Any, profile: Path) -> Iterator[Any]:
    """A browser of its own processes, all of which are killed at the end."""
    profile.mkdir(parents=True, exist_ok=True)
    port = profile / "DevToolsActivePort"
    port.unlink(missing_ok=True)
    options = ["--headless", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-port=0", *SOFTWARE]
    process = subprocess.Popen(
        [CHROMIUM, *options, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        until(lambda: port.is_file() and "\n" in port.read_text(), "port of the browser")
        yield driver.chromium.connect_over_cdp(f"http://127.0.0.1:{port.read_text().split()[0]}")
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def is_killed_while_it_drags(driver: Any, address: str, profile: Path) -> list[dict[str, Any]]:
    """Pokes by the mouse in a real browser, which is killed in the midst of a drag; what it has shown as done."""
    with killed_browser(driver, profile) as browser:
        page = Opened(browser, address=address, bypass_csp=True)
        page.page.locator("#reset").click()  # it may have fallen far
        page.pause()  # what is aimed at stays there
        page.page.wait_for_function("page.clock.paused && page.motion.snapshot().timeNs < 1e10")
        page.drawn(10)
        for away in (0, 20):
            place = page.on_body(away)
            page.page.mouse.click(place["x"], place["y"])
        page.page.wait_for_function("page.motion.history().script.filter(entry => 'impulse' in entry).length > 1")
        done = [{"entry": entry} for entry in page.script if "impulse" in entry]
        place = page.on_body(10)
        page.page.mouse.move(place["x"], place["y"])
        page.page.mouse.down()
        for k in range(1, 6):
            page.page.mouse.move(place["x"] + 15 * k, place["y"] - 6 * k)
        page.page.wait_for_function("page.motion.snapshot().body.string !== null")
        page.js("page.clock.setPaused(false)")
        page.page.wait_for_function("!page.clock.paused && page.motion.snapshot().body.string?.tension > 0")
    return done


def another_node_is_killed(environment: dict[str, str], folder: Path, chance: random.Random) -> None:
    folder.mkdir()
    node = start_node(environment, folder / "node", VALUES)
    address, child = address_of(node), child_of(node)
    with Page(address) as page:
        done = random_take(page, chance, 2.0)
        time.sleep(LOST_S)
        random_take(page, chance, 1.0)
        node.process.kill()
        node.process.wait()
        child.wait(10.0)
        until(lambda: page.is_ended, "end of the page's socket")
    repair(folder / "soak.mcap", folder / "whole.mcap")
    assert len(done) > 10 and lost(done, folder / "whole.mcap") == []


@pytest.mark.soak
@pytest.mark.drawn
def test_nothing_grows_stays_tied_or_is_lost_while_hands_browsers_and_nodes_come_and_go(
    ros_environment, tmp_path: Path
) -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("there is no browser to drive")
    chance, acknowledged = random.Random(57), []
    counts = {"hands": 0, "browsers": 0, "nodes": 0}
    with (
        running_node(ros_environment, tmp_path / "node", VALUES) as node,
        playwright.sync_playwright() as driver,
    ):
        address = address_of(node)
        memory = Memory({"node": psutil.Process(node.pid), "page": child_of(node)})
        memory.start()
        end_s = memory.began_s + 60 * MINUTES + 1
        next_browser_s = next_node_s = memory.began_s
        while (now_s := time.monotonic()) < end_s:
            if now_s >= next_node_s:
                next_node_s = now_s + 90.0
                counts["nodes"] += 1
                another_node_is_killed(ros_environment, tmp_path / f"node{counts['nodes']}", chance)
            elif now_s >= next_browser_s:
                next_browser_s = now_s + 15.0
                counts["browsers"] += 1
                acknowledged += is_killed_while_it_drags(driver, address, tmp_path / "profile")
            else:
                counts["hands"] += 1
                acknowledged += comes_and_goes(address, chance)
            check_released(address)
        memory.ended.set()
    missing = lost(acknowledged, tmp_path / "soak.mcap")
    print(f"{counts}; {len(acknowledged)} acknowledged, {len(missing)} lost")
    apart = {}
    for name in memory.seen:
        medians = memory.medians(name)
        late = medians[len(medians) // 2 :]
        apart[name] = max(late) / min(late) - 1.0
        print(
            f"{name}: {' '.join(f'{one:.1f}' for one in medians)} MB; {100 * apart[name]:.2f} % apart in the second half"
        )
    assert missing == [] and len(acknowledged) > 50 * MINUTES
    assert all(part <= FLAT for part in apart.values())
