# SPDX-License-Identifier: MIT
"""A body that flies as a node's does, with its page, and pages as bare sockets."""

from __future__ import annotations

import json
import logging
import random
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import psutil
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.page.live_page import LivePage
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.flight import FLIGHT, LOAD_ROW

PATIENCE_S = 30.0

logging.getLogger("websockets.client").setLevel(logging.CRITICAL)  # which tells of sockets that tests cut off


def until(condition: Callable[[], Any], what: str, patience_s: float = PATIENCE_S) -> Any:
    """What condition() returns once that isn't nothing."""
    end_s = time.monotonic() + patience_s
    while not (found := condition()):
        assert time.monotonic() < end_s, f"no {what} within {patience_s} s"
        time.sleep(0.005)
    return found


class Beside:
    """live, with its page. said: what the terminal is told."""

    def __init__(self, values: dict[str, Any], host: str = "127.0.0.1") -> None:
        self.said: list[str] = []
        self.live = LiveSimulation(make_scenario(values))
        self.page = LivePage(self.live, None, host, self.said.append)
        self.live.announce()
        self.live.start()

    @property
    def child(self) -> psutil.Process:
        """The page's process."""
        return psutil.Process(self.page._child.pid)

    @property
    def port(self) -> int:
        return int(urlsplit(self.page.address).port or 0)

    @property
    def path(self) -> str:
        return urlsplit(self.page.address).path

    @property
    def string(self) -> Any:
        return self.live.call(lambda: self.live.loop.simulation.string)

    def end(self) -> None:
        self.page.close()
        self.live.stop()


@contextmanager
def beside(values: dict[str, Any] | None = None, host: str = "127.0.0.1") -> Iterator[Beside]:
    flown = Beside({"mesh": "t_handle", "initial.angular_velocity": [0.05, 0.1, 3.0], **(values or {})}, host)
    try:
        yield flown
    finally:
        flown.end()


class Page:
    """One page, as a socket. told: the last of what it was told, by its key; pictures: how many have come."""

    def __init__(self, address: str, **headers: str) -> None:
        url = address.replace("http:", "ws:")
        self.socket: ClientConnection = connect(
            url, compression=None, max_size=None, max_queue=None, additional_headers=headers, open_timeout=PATIENCE_S
        )
        self.told: dict[str, Any] = {}
        self.all: list[dict[str, Any]] = []
        self.answers: dict[int, str | None] = {}
        self.pictures = 0
        self.bytes = 0
        self.picture = b""
        self.sent = 0

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def take(self, seconds: float = 0.0) -> None:
        """Take what has come, or comes within so many seconds."""
        end_s = time.monotonic() + seconds
        while True:
            try:
                message = self.socket.recv(timeout=max(0.0, end_s - time.monotonic()))
            except TimeoutError:
                return
            self.bytes += len(message)
            if isinstance(message, bytes):
                self.pictures += 1
                self.picture = message
                continue
            found = json.loads(message)
            self.all.append(found)
            if "answer" in found:
                self.answers[found["answer"]] = found["refusal"]
            self.told |= found

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        def looked() -> Any:
            self.take(0.01)
            return condition()

        return until(looked, what)

    def send(self, message: Any) -> None:
        self.socket.send(json.dumps(message))

    def begin(self, **command: Any) -> int:
        """Send a command, and return its number."""
        self.sent += 1
        self.send({"id": self.sent, **command})
        return self.sent

    def do(self, **command: Any) -> str | None:
        """Send a command; why it was refused, or None."""
        number = self.begin(**command)
        self.until(lambda: number in self.answers, "answer")
        return self.answers[number]

    @property
    def flight(self) -> np.record:
        """Of the last picture."""
        return np.frombuffer(self.picture, FLIGHT, 1, 16)[0]

    @property
    def loads(self) -> np.ndarray:
        count = int(np.frombuffer(self.picture, np.uint32, 4)[1])
        return np.frombuffer(self.picture, LOAD_ROW, count, 16 + FLIGHT.itemsize)

    @property
    def is_ended(self) -> bool:
        try:
            self.take(0.01)
        except ConnectionClosed:
            return True
        return False


def random_take(page: Page, chance: random.Random, seconds: float) -> list[dict[str, Any]]:
    """Hands of all kinds; the commands that were acknowledged."""
    taken: list[dict[str, Any]] = []
    end_s = time.monotonic() + seconds

    def do(**command: Any) -> None:
        if page.do(**command) is None:
            taken.append(command)

    def vector(size: float) -> list[float]:
        return [chance.uniform(-size, size) for _ in range(3)]

    while time.monotonic() < end_s:
        kind = chance.randrange(9)
        if kind < 2:
            do(entry={"string": {"attach": vector(0.02), "target": vector(0.2)}})
            for _ in range(chance.randrange(20)):
                do(entry={"string": {"target": vector(0.2)}})
                page.take(chance.uniform(0.0, 0.03))
            do(entry={"string": "release"})
            continue
        command = (
            {
                "entry": {
                    "at": {"point": vector(0.02)},
                    "impulse": vector(0.01),
                    "axes": chance.choice(["world", "body"]),
                }
            },
            {"entry": {"at": "com", "force": vector(0.1), "torque": vector(0.001)}},
            {"entry": {"set": {"mass": chance.uniform(0.05, 0.5)}}},
            {"entry": {"set": {"scale": [chance.uniform(0.5, 2.0) for _ in range(3)]}}},
            {"entry": {"set": {"inertia_model": chance.choice(["solid", "bounding_box", "shell"])}}},
            {"time": chance.choice(["pause", "resume", "resume", "step"])},
            {"entry": {"set": {"gravity": [0.0, 0.0, chance.choice([0.0, -1.62])]}}},
        )[kind - 2]
        do(**command)
        page.take(chance.uniform(0.0, 0.05))
    return taken


def asked(port: int, path: str, *lines: str, method: str = "GET") -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of a plain request with these header lines."""
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as plain:
        plain.sendall("\r\n".join([f"{method} {path} HTTP/1.1", *lines, "", ""]).encode())
        answer = b"".join(iter(lambda: plain.recv(65536), b""))
    head, _, body = answer.partition(b"\r\n\r\n")
    if not head:
        return 0, {}, b""
    status, *rest = head.decode().split("\r\n")
    headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in rest)}
    return int(status.split()[1]), headers, body
