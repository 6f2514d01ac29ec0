# SPDX-License-Identifier: MIT
"""The thread that owns the simulations: it wakes at absolute deadlines and lets each loop do what is due.

Everybody else hands work over with ``call``; nothing else touches a simulation.
"""

from __future__ import annotations

import gc
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

from ..base.errors import InputError
from .simulation_loop import SimulationLoop

Call = Callable[[Callable[[], Any]], Any]
"""Runs a function on the physics thread and returns what it returns; raises InputError when that is too busy."""

SHORT_NS = 3_000_000
"""Waits below this [ns] are a plain sleep, a third of the cost of one that a request can end."""

STEP_PATIENCE_S = 10.0
"""How long a request to step waits for the end of it."""


class PhysicsThread:
    """on_crash() is called should the thread end by a fault of the program."""

    def __init__(self, on_crash: Callable[[], None] = lambda: None) -> None:
        self._loops: list[SimulationLoop] = []
        self._on_crash = on_crash
        self._requests: list[tuple[SimulationLoop, Callable[[], Any], Future]] = []
        self._wake = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="physics", daemon=True)

    def start(self, loops: Sequence[SimulationLoop]) -> None:
        """Begin the simulated time of these."""
        self._loops = list(loops)
        # What start-up has made stays: the garbage collector going through it again would hold up the motion for 0.1 s.
        gc.freeze()
        self._thread.start()

    def stop(self) -> None:
        """End the thread; requests that still wait are cancelled."""
        self._stopping = True
        self._wake.set()
        if self._thread.ident is not None:
            self._thread.join(timeout=5.0)
        for _, _, future in self._requests:
            future.cancel()

    def call(self, loop: SimulationLoop, function: Callable[[], Any], timeout_s: float = 10.0) -> Any:
        """Run ``function`` on the physics thread between two ticks of this loop and return what it returns, or raise
        what it raises; at once, before the thread is started.

        Raises InputError when the thread is too busy to begin it within timeout_s; then it is never run.
        """
        if self._thread.ident is None:
            return function()
        future: Future = Future()
        self._requests.append((loop, function, future))
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
            for loop in self._loops:
                loop.start()
            # Kept from tick to tick: asking all loops at every wake-up of one would grow with their number squared.
            wakes = [loop.next_wake_ns() for loop in self._loops]
            while not self._stopping:
                self._wait_until(min(wakes))
                if self._serve_requests():
                    wakes = [loop.next_wake_ns() for loop in self._loops]
                now_ns = time.monotonic_ns()
                for number, loop in enumerate(self._loops):
                    if wakes[number] <= now_ns:
                        loop.tick()
                        wakes[number] = loop.next_wake_ns()
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

    def _serve_requests(self) -> bool:
        """Whether there were any."""
        served = bool(self._requests)
        while self._requests:
            loop, function, future = self._requests.pop(0)
            if future.set_running_or_notify_cancel():
                loop.prepare_request()
                try:
                    future.set_result(function())
                except BaseException as error:  # the caller's to handle
                    future.set_exception(error)
        return served


def step_over(call: Call, loop: SimulationLoop, periods: int = 1) -> int:
    """Do ``advance_by`` by ``call`` to the thread; returns the time reached [ns]."""
    steps = advance_by(loop, periods)
    while not call(lambda: next(steps, True)):
        pass
    return loop.simulation.time_ns


def advance_by(loop: SimulationLoop, periods: int) -> Iterator[None]:
    """While paused, advance over so many publications, on the physics thread; yields while its ticks make them.

    Raises InputError when that takes longer than STEP_PATIENCE_S; the step goes on by itself then.
    """
    end = time.monotonic() + STEP_PATIENCE_S
    begun = False
    # One after another: a step that somebody else has begun is made first.
    while loop.stepping or not begun:
        if time.monotonic() > end:
            reached_s = loop.simulation.time_ns / 1e9
            text = f"{reached_s:.9g} s reached after {STEP_PATIENCE_S:g} s of computing; the step continues"
            raise InputError("step", text)
        if not loop.stepping:
            begun = True
            if loop.step(periods):
                return
        yield
