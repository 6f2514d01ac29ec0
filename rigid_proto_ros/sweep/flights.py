# SPDX-License-Identifier: MIT
"""Flights from Python, without ROS: load a scene, command, step, sample, record, and many of them on all cores.

    scene = load_scene("t_handle", {"publish_rate": 50.0})
    with Flight(scene, record="out/flight.mcap") as flight:
        while flight.sample().time_ns < 2_000_000_000:
            flight.command({"wrench": {"axes": "body", "torque": torque(flight.sample())}})
            flight.step(0.02)

Commands are entries of a poke script without their ``t``, and the motion is the one that the node flies: a recording
replays to the bit. msg_examples/06_python_flight.py tunes a controller.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..base.errors import CommandRefused, InputError
from ..base.yaml_text import plain
from ..motion.state import State
from ..scene.scenario import Scenario, read_scene
from ..scene.scenario_run import OfflineRun
from ..scene.script import MAX_TIME_S, expand_entry
from ..scene.sensitivity import sensitivity_of
from ..simulation.commands import Command, nanoseconds
from ..simulation.observer import Observer
from ..simulation.quantities import DIFFERENCES
from .study import make_study
from .table import chunks
from .workers import Threads, cores

Scene = Scenario
"""A checked scene. It can be flown any number of times, and goes to other processes."""

Commands = tuple[Command, ...]
"""What ``read_command`` makes of an entry."""

MOST_GIVEN = 100_000
"""Commands of a flight that are kept for ``Flight.sensitivity``: some tens of megabytes."""

_MAX_TIME_NS = nanoseconds(MAX_TIME_S)

Value = TypeVar("Value")
Result = TypeVar("Result")


def load_scene(name: str, settings: Mapping[str, object] | None = None) -> Scene:
    """A scene file by path or bundled name, parameters on top as ``{"gravity": [0, 0, -9.81]}``; raises InputError."""
    return read_scene(name, plain(settings or {}), lambda warning: print(warning, file=sys.stderr))


def read_command(entry: Mapping[str, object], now_ns: int = 0) -> Commands:
    """An entry of a poke script, read once: it can be given to any flight, any number of times, and acts at its ``t``,
    or ``now_ns``, or later. Raises InputError.
    """
    if not isinstance(entry, (dict, Mapping)):  # a mapping's own check is slow
        raise InputError("command", entry, "a mapping such as {'force': [0, 0, 1]}")
    return tuple(expand_entry(dict(entry), "command", now_ns=now_ns))


class Flight:
    """One body in flight, from time 0. record: an .mcap file for all states and commands; close the flight then, as the
    ``with`` statement does. observer: whoever else is told (simulation/observer.py).
    """

    def __init__(self, scene: Scene, record: str | Path = "", observer: Observer | None = None) -> None:
        if record:
            if observer is not None:
                raise InputError("record", str(record), "a file or an observer, not both")
            if Path(record).suffix.lower() != ".mcap":
                raise InputError("record", str(record), "a file that ends in .mcap")
            from ..session.mcap_observer import McapObserver

            observer = McapObserver(record, parameters=scene.parameters, simulated_log=True)
        self._observer = observer
        self._scene = scene
        self._run = OfflineRun(scene, observer=observer)
        self._simulation = self._run.simulation
        self._given: list[tuple[int, Sequence[Command]]] = []  # and when they were
        self._told: dict[str, int] = {}  # refused commands, by reason

    def __enter__(self) -> Flight:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def reset(self, scene: Scene | None = None) -> None:
        """Begin again at time 0 of the scene, or of another one, in a tenth of a new flight's time; what was commanded
        is dropped, and a recording has another run.
        """
        self._scene = scene or self._scene
        self._given.clear()
        self._run.restart(self._scene)

    def command(self, entry: Mapping[str, object] | Commands) -> None:
        """Let an entry of a poke script, or one that ``read_command`` has read, act now, after those given before; with
        ``t`` at that time [s, simulated] or later. Raises InputError for one that can't be taken.
        """
        run, now_ns = self._run, self._simulation.time_ns
        commands = entry if isinstance(entry, tuple) else read_command(entry, now_ns)
        run.submit(commands)
        if run.submitted <= MOST_GIVEN:
            self._given.append((now_ns, commands))

    def step(self, seconds: float) -> State:
        """Simulate so long, and return the state at the end. Raises InputError for no such time, when the motion fails,
        or when a command is refused as it comes to act.
        """
        simulation = self._simulation
        until_ns = _end_ns(simulation.time_ns, seconds)
        if self._observer is None:
            state = simulation.advance(until_ns)
        else:
            self._run.advance(until_ns)
            state = simulation.state
        if simulation.failure or simulation.refused != self._told:
            raise self._trouble()
        return state

    def fly(
        self, commands: Iterable[Mapping[str, object] | Commands], seconds: float, scene: Scene | None = None
    ) -> State:
        """``reset``, ``command`` for each and ``step`` in one, which is quicker: begin again at time 0 of the scene, or
        of another one, let these commands act, simulate so long, and return the state at the end. Raises InputError.
        """
        simulation, until_ns = self._simulation, _end_ns(0, seconds)
        read: list[Command] = []
        for entry in commands:
            read += entry if isinstance(entry, tuple) else read_command(entry)
        self._scene = scene = scene or self._scene
        self._given = [(0, read)]
        self._run.fly(scene, read, until_ns)
        if simulation.failure or simulation.refused != self._told:
            raise self._trouble()
        return simulation.state

    def _trouble(self) -> InputError:
        """Why the motion has failed, or which commands were refused as they came to act and haven't been told of."""
        simulation = self._simulation
        before, self._told = self._told, simulation.refused.copy()
        if simulation.failure:
            return InputError("step", simulation.failure)
        new = {reason: count - before.get(reason, 0) for reason, count in simulation.refused.items()}
        texts = [f"{count} {reason}, {simulation.refusals[reason]}" for reason, count in new.items() if count]
        return CommandRefused("schedule", "command", f"refused when it was due to act: {'; '.join(texts)}")

    def sample(self) -> State:
        """The state now: time_ns, position, orientation_xyzw, linear_velocity, angular_velocity, angular_velocity_body;
        before what was commanded at this very time has acted.
        """
        return self._simulation.state

    @property
    def accuracy_floor(self) -> str:
        """Why, since time 0, rounding and not the accuracy asked for has set what the motion errs; empty where it
        hasn't.
        """
        return self._simulation.accuracy_floor

    def sensitivity(self) -> dict[str, float]:
        """How far the present state is from that of a second flight, ten times as accurate, which this simulates from
        time 0 with the same commands: ``attitude`` [rad], ``position`` [m], ``velocity`` [m/s] and ``spin`` [rad/s].

        Raises InputError where nothing more accurate can be asked for, the motion failed, or more than MOST_GIVEN
        commands were given, which aren't kept.
        """
        if self._run.submitted > MOST_GIVEN:
            raise InputError("sensitivity", "more commands", f"a flight of at most {MOST_GIVEN} commands")
        given = [
            replace(command, stamp_ns=max(now_ns, command.stamp_ns))
            for now_ns, commands in self._given
            for command in commands
        ]
        found = sensitivity_of(self._simulation, self._scene, given)
        if found["attitude"] is None:
            raise InputError("sensitivity", self._simulation.failure or "a second flight that stops")
        return {name: found[name] for name in DIFFERENCES}

    def close(self) -> None:
        """Finish the recording."""
        if self._observer is not None:
            self._run.end()
            self._observer.close()


def _end_ns(begin_ns: int, seconds: float) -> int:
    """When a step ends. Raises InputError."""
    # A difference of two times may be a rounding below 0.
    step_ns = nanoseconds(seconds) if isinstance(seconds, (float, Real)) and abs(seconds) <= MAX_TIME_S else -1
    if step_ns < 0:
        raise InputError("step", seconds, f"a number of seconds from 0 to {MAX_TIME_S:g}")
    if begin_ns + step_ns > _MAX_TIME_NS:
        raise InputError("step", seconds, f"a step that ends by {MAX_TIME_S:g} s of simulated time")
    return begin_ns + step_ns


def fly_study(spec: Mapping[str, object]) -> dict[str, NDArray[Any]]:
    """All rows of a study, which is given as its file says it, on all cores: the columns of its table by name. Rows
    that differ in numbers alone are flown without any Python code in between. Raises InputError.
    """
    study = make_study(plain(spec))
    workers = Threads(study)
    try:
        parts = [chunk.columns for chunk in chunks(study, 0, workers)]
    finally:
        workers.close()
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def fly_all(function: Callable[[Value], Result], values: Iterable[Value], workers: int = 0) -> Iterator[Result]:
    """``function`` of each value, in their order, by so many processes, or one a core. function: one that other
    processes can import.
    """
    values = list(values)
    workers = workers or cores()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_depend_on_the_parent) as pool:
        yield from pool.map(function, values, chunksize=max(1, min(32, len(values) // (4 * workers))))


def _depend_on_the_parent() -> None:
    """Interrupts are the parent's to handle; and a worker doesn't outlive a parent that was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
