# SPDX-License-Identifier: MIT
"""Flights from Python, without ROS: load a scene, command, step, sample, record; or fly many on all cores.

    scene = load_scene("t_handle", {"publish_rate": 50.0})
    with Flight(scene, record="out/flight.mcap") as flight:
        while flight.sample().time_ns < 2_000_000_000:
            flight.command({"wrench": {"axes": "body", "torque": torque(flight.sample())}})
            flight.step(0.02)

Commands are poke script entries without ``t``. The motion is the node's: a recording replays bit for bit.
msg_examples/06_python_flight.py tunes a controller.
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
"""A checked scene. It can be flown any number of times and can be pickled for other processes."""

Commands = tuple[Command, ...]
"""The commands of an entry, as ``read_command`` returns them."""

MOST_GIVEN = 100_000
"""Largest number of commands that a flight keeps for ``Flight.sensitivity``: some tens of megabytes."""

_MAX_TIME_NS = nanoseconds(MAX_TIME_S)

Value = TypeVar("Value")
Result = TypeVar("Result")


def load_scene(name: str, settings: Mapping[str, object] | None = None) -> Scene:
    """Load a scene file by path or bundled name, with parameters on top, such as ``{"gravity": [0, 0, -9.81]}``. Raises
    InputError.
    """
    return read_scene(name, plain(settings or {}), lambda warning: print(warning, file=sys.stderr))


def read_command(entry: Mapping[str, object], now_ns: int = 0) -> Commands:
    """Read a poke script entry once. The result can be given to any flight any number of times. It acts at its ``t``,
    or at ``now_ns`` without one; if that is past, at once. Raises InputError.
    """
    if not isinstance(entry, (dict, Mapping)):  # the check for Mapping is slow
        raise InputError("command", entry, "a mapping such as {'force': [0, 0, 1]}")
    return tuple(expand_entry(dict(entry), "command", now_ns=now_ns))


class Flight:
    """A flight of one body from time 0. record: an .mcap file for all states and commands; it is complete once the
    flight is closed, which the ``with`` statement does. observer: is notified of events (simulation/observer.py).
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
        self._given: list[tuple[int, Sequence[Command]]] = []  # each with the time at which it was given
        self._reported: dict[str, int] = {}  # number of refused commands already reported, by reason

    def __enter__(self) -> Flight:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def reset(self, scene: Scene | None = None) -> None:
        """Start again at time 0 of the scene, or of another one, in a tenth of the time of a new flight. Pending
        commands are dropped, and a recording gets another run.
        """
        self._scene = scene or self._scene
        self._given.clear()
        self._run.restart(self._scene)

    def command(self, entry: Mapping[str, object] | Commands) -> None:
        """Give a poke script entry or the result of ``read_command``. It acts now, after those given before; an entry
        with ``t`` acts at that simulated time [s] or later. Raises InputError for a command that is refused.
        """
        run, now_ns = self._run, self._simulation.time_ns
        commands = entry if isinstance(entry, tuple) else read_command(entry, now_ns)
        run.submit(commands)
        if run.submitted <= MOST_GIVEN:
            self._given.append((now_ns, commands))

    def step(self, seconds: float) -> State:
        """Simulate for a duration [s] and return the final state. Raises InputError for an invalid duration, if the
        motion fails, or if a command is refused when it is due.
        """
        simulation = self._simulation
        until_ns = _end_ns(simulation.time_ns, seconds)
        if self._observer is None:
            state = simulation.advance(until_ns)
        else:
            self._run.advance(until_ns)
            state = simulation.state
        if simulation.failure or simulation.refused != self._reported:
            raise self._failure()
        return state

    def fly(
        self, commands: Iterable[Mapping[str, object] | Commands], seconds: float, scene: Scene | None = None
    ) -> State:
        """Do ``reset``, ``command`` for each and ``step`` in one faster call: start at time 0 of the scene, or of
        another one, give these commands, simulate for a duration [s], and return the final state. Raises InputError.
        """
        simulation, until_ns = self._simulation, _end_ns(0, seconds)
        read: list[Command] = []
        for entry in commands:
            read += entry if isinstance(entry, tuple) else read_command(entry)
        self._scene = scene = scene or self._scene
        self._given = [(0, read)]
        self._run.fly(scene, read, until_ns)
        if simulation.failure or simulation.refused != self._reported:
            raise self._failure()
        return simulation.state

    def _failure(self) -> InputError:
        """The error of a failed motion, or of commands that were refused when due and not yet reported."""
        simulation = self._simulation
        before, self._reported = self._reported, simulation.refused.copy()
        if simulation.failure:
            return InputError("step", simulation.failure)
        new = {reason: count - before.get(reason, 0) for reason, count in simulation.refused.items()}
        texts = [f"{count} {reason}, {simulation.refusals[reason]}" for reason, count in new.items() if count]
        return CommandRefused("schedule", "command", f"refused when it was due to act: {'; '.join(texts)}")

    def sample(self) -> State:
        """The present state: time_ns, position, orientation_xyzw, linear_velocity, angular_velocity,
        angular_velocity_body. Commands given at this very time have not acted in it.
        """
        return self._simulation.state

    @property
    def accuracy_floor(self) -> str:
        """Why rounding, and not the requested accuracy, has determined the error of the motion since time 0; empty if
        it has not.
        """
        return self._simulation.accuracy_floor

    def sensitivity(self) -> dict[str, float]:
        """The difference between the present state and that of a second flight, ten times as accurate, which is
        simulated from time 0 with the same commands: ``attitude`` [rad], ``position`` [m], ``velocity`` [m/s] and
        ``spin`` [rad/s].

        Raises InputError if no finer accuracy is permitted, if the motion failed, or after more than MOST_GIVEN
        commands, since further ones are not kept.
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
    """Time at which a step ends [ns]. Raises InputError."""
    # Not < 0: the difference of two times may be slightly negative by rounding.
    step_ns = nanoseconds(seconds) if isinstance(seconds, (float, Real)) and abs(seconds) <= MAX_TIME_S else -1
    if step_ns < 0:
        raise InputError("step", seconds, f"a number of seconds from 0 to {MAX_TIME_S:g}")
    if begin_ns + step_ns > _MAX_TIME_NS:
        raise InputError("step", seconds, f"a step that ends by {MAX_TIME_S:g} s of simulated time")
    return begin_ns + step_ns


def fly_study(spec: Mapping[str, object]) -> dict[str, NDArray[Any]]:
    """Fly all rows of a study on all cores. spec: the content of a study file. Returns the columns of its table by
    name. Rows that differ only in numbers are flown in compiled code throughout. Raises InputError.
    """
    study = make_study(plain(spec))
    workers = Threads(study)
    try:
        parts = [chunk.columns for chunk in chunks(study, 0, workers)]
    finally:
        workers.close()
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def fly_all(function: Callable[[Value], Result], values: Iterable[Value], workers: int = 0) -> Iterator[Result]:
    """Apply ``function`` to each value in worker processes, one per core by default, and yield the results in the order
    of values. function: importable by other processes.
    """
    values = list(values)
    workers = workers or cores()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_bind_to_parent) as pool:
        yield from pool.map(function, values, chunksize=max(1, min(32, len(values) // (4 * workers))))


def _bind_to_parent() -> None:
    """Leave interrupts to the parent, and end if the parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
