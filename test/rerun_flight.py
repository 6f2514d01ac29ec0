# SPDX-License-Identifier: MIT
"""A hand-made sequence of observer calls, for the tests of recordings and pictures."""

from __future__ import annotations

import time

import numpy as np

from rigid_proto_ros.simulation.observer import (
    BodyChanged,
    BodySnapshot,
    LoadBegan,
    LoadEnded,
    Logged,
    Observer,
    Published,
    Refused,
    ShownLoad,
    Started,
)

VERTICES = np.array(
    [[x, y, z] for x in (0.0, 0.3) for y in (0.0, 0.2) for z in (0.0, 0.1)],
)
"""A brick in mesh coordinates, its corner at the origin."""

TRIANGLES = np.array(
    [
        *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
        *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
    ]
)

SCALE = np.array([2.0, 1.0, 1.0])
COM = np.array([0.3, 0.1, 0.05])
MASS = 12.0
INERTIA = np.diag([0.05, 0.37, 0.4])
GRAVITY = np.array([0.0, 0.0, -9.81])
BODY = BodySnapshot(MASS, COM, INERTIA, SCALE, GRAVITY, "solid", "rk4")
SCENE = "rigid_body:\n  ros__parameters:\n    mesh: brick.obj\n"
SHA256 = "5e" * 32

POKE = ShownLoad("poke", "world", np.array([0.3, 0.0, 0.0]), np.array([0.0, 3.0, 0.0]), np.zeros(3))
WRENCH = ShownLoad("wrench", "body", np.zeros(3), np.array([0.0, 0.0, 2.0]), np.array([0.5, 0.0, 0.0]))

PERIOD_NS = 10_000_000


def rows(count: int, seed: int = 7) -> np.ndarray:
    """Some states (count, 13) with unit quaternions, as different from float32 numbers as numbers get."""
    made = np.cumsum(np.random.default_rng(seed).normal(size=(count, 13)) * 0.05, axis=0) + 0.1
    made[:, 3:7] /= np.linalg.norm(made[:, 3:7], axis=1, keepdims=True)
    return made


def fly(observer: Observer, states: np.ndarray, body: BodySnapshot = BODY) -> None:
    """A run of ``states``: a poke from 200 to 400 ms, a wrench from 305 ms to the end, a refusal at 500 ms."""
    observer.on(Started(SCENE, VERTICES, TRIANGLES, SHA256))
    observer.on(BodyChanged(0, body))
    for k, row in enumerate(states):
        time_ns = k * PERIOD_NS
        observer.on(Published(time_ns, row))
        if time_ns == 200_000_000:
            observer.on(Logged(time_ns, event_line(time_ns, "poke")))
            observer.on(LoadBegan(time_ns, 1, POKE))
        if time_ns == 300_000_000:
            observer.on(Logged(305_000_000, event_line(305_000_000, "wrench")))
            observer.on(LoadBegan(305_000_000, 2, WRENCH))
        if time_ns == 400_000_000:
            observer.on(LoadEnded(time_ns, 1))
        if time_ns == 500_000_000:
            observer.on(Refused(time_ns, "frame", "frame_id: got 'mars'; accepted: world, body"))


def event_line(time_ns: int, kind: str) -> str:
    """A line as the event log writes it."""
    return f'{{"time_ns": {time_ns}, "kind": "{kind}", "content": {{"force": [0.0, 3.0, 0.0]}}, "sha256": "00"}}'


def flush(observer: Observer, timeout_s: float = 60.0) -> None:
    """Wait until everything so far was handed to the file and the viewers."""
    flusher, passes = observer._flusher, []
    own = flusher._flush

    def counted() -> None:
        own()
        passes.append(1)

    flusher._flush = counted
    flusher.mailbox.wake()
    deadline = time.monotonic() + timeout_s
    while not passes:
        assert time.monotonic() < deadline, "nothing was flushed"
        time.sleep(0.001)
    flusher._flush = own
