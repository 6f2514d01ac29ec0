# SPDX-License-Identifier: MIT
"""The thread that owns the simulation: it wakes at absolute deadlines and lets the loop do what is due.

Everybody else hands work over with ``call``; nothing else touches the simulation.
"""

from __future__ import annotations

import gc
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from ..base.errors import InputError
from .simulation_loop import SimulationLoop

SHORT_NS = 3_000_000
"""Waits below this [ns] are a plain sleep, a third of the cost of one that a request can end."""


class PhysicsThread:
    """on_crash() is called should the thread end by a fault of the program."""

    def __init__(self, loop: SimulationLoop, on_crash: Callable[[], None] = lambda: None) -> None:
        self._loop = loop
        self._on_crash = on_crash
        self._requests: list[tuple[Callable[[], Any], Future]] = []
        self._wake = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="physics", daemon=True)

    def start(self) -> None:
        """Simulated time begins."""
        # What start-up has made stays: the garbage collector going through it again would hold up the motion for 0.1 s.
        gc.freeze()
        self._thread.start()

    def stop(self) -> None:
        """End the thread; requests that still wait are cancelled."""
        self._stopping = True
        self._wake.set()
        if self._thread.ident is not None:
            self._thread.join(timeout=5.0)
        for _, future in self._requests:
            future.cancel()

    def call(self, function: Callable[[], Any], timeout_s: float = 10.0) -> Any:
        """Run ``function`` on the physics thread between two ticks and return what it returns, or raise what it raises;
        at once, before the thread is started.

        Raises InputError when the thread is too busy to begin it within timeout_s; then it is never run.
        """
        if self._thread.ident is None:
            return function()
        future: Future = Future()
        self._requests.append((function, future))
        self._wake.set()
        try:
            return future.result(timeout_s)
        except TimeoutError:
            if future.cancel():
                text = f"the simulation was too busy to begin it within {timeout_s:g} s"
                raise InputError("request", text) from None
        # It has begun, so it will end.
        return future.result()

    def _run(self) -> None:
        try:
            self._loop.start()
            wake_ns = self._loop.next_wake_ns()
            while not self._stopping:
                self._wait_until(wake_ns)
                if self._requests:
                    self._serve_requests()
                    wake_ns = self._loop.next_wake_ns()
                if wake_ns <= time.monotonic_ns():
                    self._loop.tick()
                    wake_ns = self._loop.next_wake_ns()
        except Exception:
            traceback.print_exc()
            self._on_crash()

    def _wait_until(self, wall_ns: int) -> None:
        rest_ns = wall_ns - time.monotonic_ns()
        if rest_ns <= 0 or self._requests:
            return
        if rest_ns < SHORT_NS:
            time.sleep(rest_ns * 1e-9)
        else:
            self._wake.wait(rest_ns * 1e-9)
            self._wake.clear()

    def _serve_requests(self) -> None:
        while self._requests:
            function, future = self._requests.pop(0)
            if future.set_running_or_notify_cancel():
                self._loop.prepare_request()
                try:
                    future.set_result(function())
                except BaseException as error:  # the caller's to handle
                    future.set_exception(error)
