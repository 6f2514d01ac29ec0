# SPDX-License-Identifier: MIT
"""One body in real time with all that surrounds it: thread, commands, parameters, observers and recording.

The node adds topics, services and ROS parameters to this; the interactive page uses it as it is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from typing import Any

from ..base.errors import CommandRefused, InputError
from ..motion.state import State
from ..scene.command_codec import entry_of, frame_names
from ..scene.offline import notify_start
from ..scene.parameters import with_mass_of_density
from ..scene.scenario import Scenario
from ..scene.yaml_text import flow
from ..simulation.commands import Change, ClearWrench, Command, ReleaseString
from ..simulation.observer import Observer
from .command_receiver import COUNTED_BY, CommandReceiver
from .endpoints import Endpoints
from .observers import LiveObservers
from .pacing import Stamps
from .physics_thread import PhysicsThread
from .simulation_loop import SimulationLoop
from .warm_up import warm_up_change

LISTS_S = 5.0
"""[s] That time stands still for a list sent before, until what it needs is loaded and compiled."""

LOOK_S = 0.002
"""Between looks whether lists are worked out, or a step is made [s]."""


class LiveSimulation:
    """A simulation on a thread of its own. Methods may be called from any thread, except where they say otherwise.

    name: the body's, and a recording's. endpoints: what it publishes to and takes commands from beside these methods.
    clock: simulated time follows this one [ns] instead of the wall's. Raises InputError when the recording that the
    scenario asks for can't be written.
    """

    def __init__(
        self,
        scenario: Scenario,
        name: str = "rigid_body",
        observers: Sequence[Observer] = (),
        endpoints: Endpoints | None = None,
        clock: Callable[[], int] | None = None,
    ) -> None:
        self.name = name
        self.endpoints = endpoints or Endpoints()
        self.stamps = Stamps(clock)
        self.frames = frame_names(scenario.parameters, name)
        self.observers = LiveObservers(name, observers, self._recording_failed)
        self.loop = SimulationLoop(scenario, self.observers.observer, self.endpoints, self.stamps)
        self.observers.record_to(self.observers.open_recorder(scenario))
        self.loop.watch(self.observers.observer)
        self._on_crash: Callable[[], None] = lambda: None
        self._thread = PhysicsThread(self.loop, lambda: self._on_crash())

    def announce(self) -> None:
        """Tell the observers what is going to fly; once, before ``start``."""
        notify_start(self.observers.observer, self.scenario)
        self.loop.simulation.announce()
        self.loop.notify_scene()

    def start(self, on_crash: Callable[[], None] = lambda: None) -> None:
        """Simulated time begins. on_crash() is called should the thread end by a fault of the program. What isn't
        compiled by then (warm_up.py) is compiled in flight, which holds the motion up.
        """
        self._on_crash = on_crash
        self._thread.start()

    def stop(self) -> None:
        """End the motion, then the observers: what they hold goes out."""
        self._thread.stop()
        self.loop.simulation.notify_end()
        self.observers.close()

    def call(self, function: Callable[[], Any], timeout_s: float = 10.0) -> Any:
        """Run a function on the physics thread between two ticks and return what it returns, or raise what it raises.

        Raises InputError when the thread is too busy to begin it within timeout_s; then it is never run.
        """
        return self._thread.call(function, timeout_s)

    # Reading

    @property
    def scenario(self) -> Scenario:
        """The scenario in force."""
        return self.loop.scenario

    @property
    def state(self) -> State:
        """The last state reached."""
        return self.loop.simulation.state

    @property
    def commands(self) -> CommandReceiver:
        """What counts commands; used on the physics thread."""
        return self.loop.commands

    @property
    def paused(self) -> bool:
        """Whether simulated time stands."""
        return self.loop.timekeeping.paused

    # Commands

    def submit(self, command: Command) -> None:
        """Take a command as if its message had come now: it acts at its stamp, or now where that is 0; raises
        CommandRefused, counted, for what can be checked now.
        """
        topic = COUNTED_BY.get(command.kind)
        if topic is not None:
            self.call(lambda: self.commands.receive(topic, lambda: command))
            return
        self.schedule(flow({"t": command.stamp_ns / 1e9, **entry_of(command)}, quoted=True))

    def schedule(self, text: str) -> None:
        """Take an entry of a script, or a list of entries, as YAML, ``t`` in simulated seconds; a list is taken or
        refused whole. Returns once it is taken, though that loads a mesh; raises CommandRefused, counted.
        """
        taken = self.call(lambda: self.commands.receive_schedule(lambda: text))
        while not taken.is_submitted:
            time.sleep(LOOK_S)
        if taken.refusal is not None:
            raise taken.refusal

    def clear_wrench(self) -> None:
        """End the held wrenches and the running pulses; scheduled ones stay."""
        self._service(ClearWrench())

    def release_string(self) -> None:
        """Release the string."""
        self._service(ReleaseString())

    def _service(self, command: Command) -> None:
        self.call(lambda: self.loop.simulation.submit(command))

    # Time

    def pause(self, paused: bool) -> None:
        """Stop simulated time, or let it run, once lists sent meanwhile are worked out."""
        if self.paused and not paused:
            for _ in self._take_lists(lambda: self.call(self.loop.take_commands)):
                time.sleep(LOOK_S)
        self.call(lambda: self.loop.pause(paused))

    def reset(self) -> None:
        """Time 0 and the initial state; paused or running stays."""
        self.call(self.loop.reset)

    def begin(self, scenario: Scenario) -> None:
        """Another scene, from its time 0; paused or running stays. Raises InputError, and then the present one begins
        anew.
        """

        def begin() -> None:
            # What acts now is no reason to refuse a scene that begins without it.
            self.loop.reset()
            self.loop.replace(scenario)
            self.loop.reset()

        warm_up_change(self.scenario, scenario)
        self.call(begin)
        self.endpoints.parameters_changed()

    def step(self, periods: int = 1) -> int:
        """While paused, advance over so many publications; returns the simulated time reached [ns]. Raises InputError
        while time runs, or when it takes too long.
        """
        steps = self.steps(periods)
        while not self.call(lambda: next(steps, True)):
            time.sleep(LOOK_S)
        return self.loop.simulation.time_ns

    def steps(self, periods: int = 1) -> Iterator[None]:
        """The same on the physics thread; yields between ticks."""
        if self.paused:
            yield from self._take_lists(self.loop.take_commands)
        if not self.paused:
            raise InputError("step", "the simulation is running; pause it first")
        yield from self.loop.steps(periods)

    def _take_lists(self, take_commands: Callable[[], None]) -> Generator[None, None, None]:
        """Before time goes on: a list sent while it stood acts then, though it has a mesh to be loaded. Yields while
        that is waited for; raises InputError when it takes longer than LISTS_S.
        """
        deadline = time.monotonic() + LISTS_S
        take_commands()
        while self.commands.in_progress:
            if time.monotonic() > deadline:
                raise InputError("schedule", f"a list is still being prepared after {LISTS_S:g} s; try again")
            yield
            take_commands()

    # Parameters

    def set_parameters(self, changes: Mapping[str, object]) -> None:
        """Change parameters all at once, or none: raises InputError, and then all stays as it was. Setting density sets
        mass to 0.
        """
        # Loading a mesh and compiling take time that the physics thread hasn't got: this fills the caches before it.
        loop = self.loop
        changes = with_mass_of_density(changes)
        present = loop.scenario
        planned = present.with_changes(changes)
        warm_up_change(present, planned)
        if changes.get("record", "") == present.parameters.record:
            changes = {name: value for name, value in changes.items() if name != "record"}

        def check() -> Scenario:
            scenario = loop.scenario.with_changes(changes, at_hand=planned.body_mesh)
            try:
                loop.check_change(scenario)
            except CommandRefused as refusal:
                loop.simulation.refuse(refusal)
                raise
            return scenario

        def change() -> None:
            setup = loop.replace(check())
            loop.simulation.submit(Change(dict(changes), lambda: setup))

        recorder = None
        if "record" in changes:
            # Opened last: a refused change must leave the file of that name as it is.
            self.call(check)
            recorder = self.observers.open_recorder(planned)
        try:
            self.call(change)
        except InputError:
            if recorder is not None:
                recorder.close()
            raise
        if "record" in changes:
            finished = self.call(lambda: self.observers.switch_recording(loop, recorder))
            if finished is not None:
                finished.close()

    # Observers

    def add_observer(self, observer: Observer) -> None:
        """Tell an observer what flies, and all that happens from now on; its methods run on the physics thread."""
        self.call(lambda: self.observers.add(self.loop, observer))

    def remove_observer(self, observer: Observer) -> None:
        """Tell this observer nothing more."""
        self.call(lambda: self.observers.remove(self.loop, observer))

    def _recording_failed(self, message: str) -> None:
        self.endpoints.failed(message)
        self.endpoints.parameters_changed()

    def give_up_failed_recording(self) -> None:
        """Where a recording has stopped by itself: close it, and ``record`` is empty from now on."""
        if not self.observers.has_failed_recording:
            return

        def give_up() -> Observer | None:
            recorder = self.observers.switch_recording(self.loop, None)
            self.loop.change({"record": ""})
            return recorder

        recorder = self.call(give_up)
        if recorder is not None:
            recorder.close()
