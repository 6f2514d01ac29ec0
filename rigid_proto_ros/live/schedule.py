# SPDX-License-Identifier: MIT
"""Messages of the schedule topic: read, and checked as a whole before any of their entries is taken.

What takes long (a mesh to load, kernels to compile, a long text) is done on a thread in the background, and the message
counts as taken when that is done: the motion never waits for it.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from queue import SimpleQueue
from typing import Any

from ..base.errors import CommandRefused, InputError
from ..scene.scenario import BodyMesh, Scenario
from ..scene.script import expand_schedule, read_schedule, with_contacts
from ..simulation.checks import check_command
from ..simulation.commands import Change, Command, Listed
from ..simulation.setup import Setup
from .warm_up import warm_up_change

LONG_TEXT = 20_000
"""Characters of a message that is read in the background: some milliseconds."""

SLOW = frozenset(
    {
        *("mesh", "mesh_repair", "mesh_fallback", "integrator", "ghost.integrator"),
        *("inertia_model", "inertia_model_com", "ghost.inertia_model"),
    }
)
"""Parameters whose change may have to load a mesh, go over all of its triangles, or compile."""


@dataclass(frozen=True)
class Entry:
    """A command ready to be submitted: its place in its list, and what Simulation.submit takes as checked."""

    command: Command
    listed: Listed | None
    checked: tuple[bytes, Setup]


@dataclass
class ScheduleMessage:
    """One message, counted from 1 by ``number``. count: its entries, as messages are counted. commands: once read.
    entries: once checked. refusal: why none of it is taken. is_submitted: whether it is taken or refused by now.
    """

    number: int
    text: str = ""
    count: int = 1
    is_list: bool = False
    commands: list[Command] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    refusal: CommandRefused | None = None
    is_submitted: bool = False

    @property
    def is_slow(self) -> bool:
        """Whether it is to be checked in the background."""
        return any(isinstance(command, Change) and SLOW & command.content.keys() for command in self.commands)

    def decode(self, text: Callable[[], str]) -> None:
        """Fill ``text``."""

        def decode() -> None:
            self.text = text()

        self._keep_refusal(decode)

    def read(self, scenario: Scenario) -> None:
        """Fill ``commands``."""
        self._keep_refusal(self._read, scenario)

    def check(self, scenario: Scenario, setup_of: Callable[[Change, BodyMesh | None], Setup]) -> None:
        """Fill ``entries``, each checked in the scene that those before it have made of this one; setup_of(change, mesh
        at hand) is called when a ``set`` acts.
        """
        self._keep_refusal(self._check, scenario, setup_of)

    def _keep_refusal(self, work: Callable[..., None], *arguments: Any) -> None:
        """Do the message's work; what it raises becomes the refusal."""
        if self.refusal is None:
            try:
                work(*arguments)
            except CommandRefused as refusal:
                self.refusal = refusal
            except InputError as error:
                self.refusal = CommandRefused("schedule", error.field, error.received, error.accepted)

    def _read(self, scenario: Scenario) -> None:
        listed = read_schedule(self.text)
        self.is_list = isinstance(listed, list)
        self.count = len(listed) if self.is_list else 1
        commands = expand_schedule(listed)
        self.commands = with_contacts(commands, scenario.setup.contacts)

    def _check(self, scenario: Scenario, setup_of: Callable[[Change, BodyMesh | None], Setup]) -> None:
        # In order of time; those of one time in the order of the list.
        order = sorted(range(len(self.commands)), key=lambda k: self.commands[k].stamp_ns)
        for k in order:
            command = self.commands[k]
            if isinstance(command, Change):
                before, scenario = scenario, scenario.with_changes(command.content)
                warm_up_change(before, scenario)
                command = replace(command, apply=partial(setup_of, command, scenario.body_mesh))
            checked = (check_command(command, scenario.setup), scenario.setup)
            listed = (self.number, k) if self.is_list else None
            self.entries.append(Entry(command, listed, checked))


class BackgroundThread:
    """Does what takes long; messages come out in the order in which they were given."""

    def __init__(self) -> None:
        self._work: SimpleQueue = SimpleQueue()
        self._given: deque[tuple[ScheduleMessage, threading.Event]] = deque()
        self._thread: threading.Thread | None = None

    @property
    def is_empty(self) -> bool:
        """Nothing waits to be done or fetched."""
        return not self._given

    def give(self, message: ScheduleMessage, work: Callable[[], None]) -> None:
        """Do this work for a message."""
        if self._thread is None:
            # A daemon: the end of the process doesn't wait for a mesh.
            self._thread = threading.Thread(target=self._run, name="schedule", daemon=True)
            self._thread.start()
        done = threading.Event()
        self._given.append((message, done))
        self._work.put((work, message, done))

    def finished(self) -> Iterator[ScheduleMessage]:
        """Messages whose work is done, up to the first whose isn't."""
        while self._given and self._given[0][1].is_set():
            yield self._given.popleft()[0]

    def _run(self) -> None:
        while True:
            work, message, done = self._work.get()
            try:
                work()
            except Exception as error:
                message.refusal = CommandRefused(
                    "schedule", "schedule", repr(error)[:200], "a message that can be read"
                )
            done.set()
