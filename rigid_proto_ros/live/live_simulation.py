# SPDX-License-Identifier: MIT
"""One body in real time with all that surrounds it: thread, commands, parameters, observers and recording.

The thread owns the simulation: it wakes at absolute deadlines and lets the loop do what is due. Everybody else hands
work over with ``call``; nothing else touches the simulation. The node adds topics, services and ROS parameters to this;
the interactive page uses it as it is.
"""

from __future__ import annotations

import gc
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError, Future
from functools import partial
from typing import Any

from ..base.errors import CommandRefused, InputError
from ..motion.frames import body_names
from ..motion.state import State
from ..parameters.declarations import with_mass_of_density
from ..scene.command_codec import frame_names
from ..scene.scenario import Scenario
from ..scene.scenario_run import notify_start
from ..session.mailbox import WritingObserver
from ..simulation.commands import Change, Command
from ..simulation.observer import Observer, Observers, SceneChanged
from .pacing import Stamps, ask_for_short_slices
from .simulation_loop import Endpoints, SimulationLoop

BUSY_S = 10.0
"""How long a request waits to be begun [s]."""

LOOK_S = 0.002
"""Between looks whether a step is made [s]."""

SHORT_NS = 3_000_000
"""Shorter waits [ns] are a plain sleep, which costs half of a wait that an arrival ends."""

SPACING_NS = 1_000_000
"""In running time what arrives is taken at most this often [ns of wall time]."""


class LiveSimulation:
    """A simulation on a thread of its own. Methods may be called from any thread, except where they say otherwise.

    name: the body's, and a recording's. endpoints: what it publishes to and takes commands from beside these methods.
    stamps: with a clock, simulated time follows that one instead of the wall's. Raises InputError for contacts that no
    command could name.
    """

    def __init__(
        self,
        scenario: Scenario,
        name: str = "rigid_body",
        observers: Sequence[Observer] = (),
        endpoints: Endpoints | None = None,
        stamps: Stamps | None = None,
    ) -> None:
        self.name = name
        self.endpoints = endpoints or Endpoints()
        self.stamps = stamps or Stamps()
        self.frames = frame_names(scenario.parameters, name)
        self._check_contacts(scenario)
        self._observers = tuple(observers)
        self._recording_error = ""
        self._recorders: list[WritingObserver] = []
        self.loop = SimulationLoop(scenario, Observers(*observers), self.endpoints, self.stamps)
        self._requests: list[tuple[Callable[[], Any], Future[Any]]] = []
        # Held while a request is taken, and while the thread begins or is to end.
        self._handing_over = threading.Lock()
        self._stopping = False
        self._thread: threading.Thread | None = None

    def _check_contacts(self, scenario: Scenario) -> None:
        """Raises InputError for a contact that no command could name, since its name is that of a frame."""
        for name in sorted(scenario.parameters.contacts.keys() & {self.frames[0], *body_names(self.frames[1])}):
            accepted = (
                "a name that is neither that of the world's frame nor that of the body's (the node's name by default)"
            )
            raise InputError(f"contacts.{name}", name, accepted)

    # The physics thread

    def announce(self) -> None:
        """Begin the recording that the scenario asks for, and tell the observers what is going to fly; once, before
        ``start``, when nothing else can be refused any more. Raises InputError when the recording can't be written.
        """

        def announce() -> None:
            self._recorders = self._open_recorders(self.scenario)
            self._say_recording([], self._recorders)
            self._watch()
            self._introduce(self.loop.observer)

        self.call(announce)

    def start(self, on_crash: Callable[[], None] = lambda: None) -> None:
        """Simulated time begins. on_crash() is called should the thread end by a fault of the program."""
        # What start-up has made stays: the garbage collector going through it again would hold up the motion (30 ms).
        gc.freeze()
        with self._handing_over:
            self._thread = threading.Thread(target=self._run, args=(on_crash,), name="physics", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End the motion, then the observers: what they hold goes out. Requests that still wait are refused."""
        with self._handing_over:
            self._stopping = True
        self.endpoints.wake()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        for _, future in self._requests:
            future.cancel()
        self.loop.simulation.notify_floor(at_end=True)
        self.loop.observer.close()
        self._say_recording(self._recorders, [])

    def post(self, function: Callable[[], Any]) -> Future[Any]:
        """Let the physics thread run a function between two ticks, in the order of posting, without waiting for it; at
        once, before the thread is started. Raises InputError when the simulation has ended.
        """
        future: Future[Any] = Future()
        with self._handing_over:
            if self._stopping:
                raise InputError("request", "the simulation has ended")
            if self._thread is None:
                _fulfil(future, function)
            else:
                self._requests.append((function, future))
        self.endpoints.wake()
        return future

    def call(self, function: Callable[[], Any]) -> Any:
        """Post a function, and return what it returns, or raise what it raises. Raises InputError where the thread is
        too busy to begin it within BUSY_S; then it is never run.
        """
        future = self.post(function)
        try:
            return future.result(BUSY_S)
        except CancelledError:
            raise InputError("request", "the simulation has ended") from None
        except TimeoutError:
            if future.cancel():
                text = f"the simulation was too busy to start this request within {BUSY_S:g} s"
                raise InputError("request", text) from None
        # It has begun, so it will end.
        return future.result()

    def _run(self, on_crash: Callable[[], None]) -> None:
        loop = self.loop
        ask_for_short_slices()
        try:
            loop.start()
            wake_ns, arrived = loop.next_wake_ns(), False
            while not self._stopping:
                rest_ns = wake_ns - time.monotonic_ns()
                if rest_ns > 0 and not self._requests:
                    if rest_ns < SHORT_NS:
                        arrived = False
                        time.sleep(rest_ns * 1e-9)
                    else:
                        if arrived and not loop.paused:
                            time.sleep(SPACING_NS * 1e-9)
                        arrived = self.endpoints.wait((wake_ns - time.monotonic_ns()) * 1e-9)
                if self._requests:
                    self._serve_requests()
                    wake_ns = loop.next_wake_ns()
                if arrived or wake_ns <= time.monotonic_ns():
                    loop.tick(arrived)
                    wake_ns = loop.next_wake_ns()
        except Exception:
            traceback.print_exc()
            on_crash()

    def _serve_requests(self) -> None:
        while self._requests:
            function, future = self._requests.pop(0)
            if future.set_running_or_notify_cancel():
                self.loop.prepare_request()
                _fulfil(future, function)

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
    def paused(self) -> bool:
        """Whether simulated time is paused."""
        return self.loop.paused

    # Commands

    def submit(self, command: Command) -> None:
        """Take a command of a service, which acts now and is counted by no topic."""

        def submit() -> None:
            self.loop.settle()
            self.loop.take(command)

        self.call(submit)

    def schedule(self, text: str) -> None:
        """Take an entry of a script, or a list of entries, as YAML, ``t`` in simulated seconds; a list is taken or
        refused whole. Raises CommandRefused, counted.
        """
        self.call(self.scheduling(text))

    def scheduling(self, text: str) -> Callable[[], None]:
        """What ``schedule`` has the physics thread do."""
        return lambda: self.loop.commands.receive_schedule(lambda: text)

    # Time

    def pause(self, paused: bool) -> None:
        """Stop simulated time, or let it run, once what was sent meanwhile is taken."""
        self.call(lambda: self.loop.pause(paused))

    def reset(self) -> None:
        """Time 0 and the initial state; paused or running stays."""

        def reset() -> None:
            self.loop.settle()  # what was sent before goes with what it did
            self.loop.reset()

        self.call(reset)

    def begin(self, scenario: Scenario) -> None:
        """Another scene, from its time 0; paused or running stays. Raises InputError, and then the present one begins
        anew.
        """

        def begin() -> None:
            # What acts now is no reason to refuse a scene that begins without it.
            self.loop.reset()
            self.loop.replace(scenario)
            self.loop.reset()

        self._check_contacts(scenario)
        self.call(begin)

    def step(self, periods: int = 1) -> int:
        """While paused, advance over so many publications; returns the simulated time reached [ns]. Raises InputError
        while time runs, or when it takes too long.
        """
        steps = self.loop.steps(periods)
        while not self.call(lambda: next(steps, True)):
            time.sleep(LOOK_S)
        return self.loop.simulation.time_ns

    # Parameters

    @property
    def parameters_now(self) -> dict[str, Any]:
        """The parameters in force by name, behind everything sent before."""

        def now() -> dict[str, Any]:
            self.loop.settle()
            return self.scenario.parameters.named()

        named: dict[str, Any] = self.call(now)
        return named

    def set_parameters(self, changes: Mapping[str, object]) -> None:
        """Change parameters all at once, or none: raises InputError, and then all stays as it was. Setting density sets
        mass to 0.
        """
        self.give_up_failed_recording()
        # Loading a mesh takes time that the physics thread hasn't got: this fills the cache before it.
        loop = self.loop
        changes = with_mass_of_density(changes)
        present = loop.scenario
        try:
            planned = present.with_changes(changes)
        except CommandRefused as refusal:
            self.call(partial(loop.simulation.refuse, refusal))
            raise
        if changes.get("record", "") == present.parameters.record:
            changes = {name: value for name, value in changes.items() if name != "record"}
        if not changes:
            return

        def change() -> list[WritingObserver]:
            scenario = loop.planned(changes, planned)
            # A recording begins in the scene before the change that begins it, and has that as its first event.
            finished = self._switch_recording(recorders) if "record" in changes else []
            loop.change(changes, scenario)
            return finished

        recorders: list[WritingObserver] = []
        if "record" in changes:
            # Opened last: a refused change must leave the file of that name as it is.
            self.call(partial(loop.planned, changes, planned))
            recorders = self._open_recorders(planned)
        try:
            finished = self.call(change)
        except InputError:
            _close([recorder for recorder in recorders if recorder not in self._recorders])
            raise
        _close(finished)

    # Observers

    def _watch(self) -> None:
        self.loop.watch(Observers(*self._observers, *self._recorders))

    def _introduce(self, observer: Observer) -> None:
        notify_start(observer, self.scenario)
        observer.on(SceneChanged(self.loop.simulation.time_ns, self.scenario.text))
        self.loop.simulation.introduce(observer)

    def add_observer(self, observer: Observer) -> None:
        """Notify an observer of the present body and of all further events; its methods run on the physics thread."""

        def add() -> None:
            self._observers = (*self._observers, observer)
            self._watch()
            self._introduce(observer)

        self.call(add)

    def remove_observer(self, observer: Observer) -> None:
        """Tell this observer nothing more."""

        def remove() -> None:
            self._observers = tuple(other for other in self._observers if other is not observer)
            self._watch()

        self.call(remove)

    # The recording, which can be changed in flight

    def _open_recorders(self, scenario: Scenario) -> list[WritingObserver]:
        """The recorders that ``record`` asks for, of which those that record already go on; raises InputError when a
        file can't be written.
        """
        if not scenario.parameters.record:
            return []
        from ..rerun_view.recorders import make_recorders, recording_names

        names = recording_names(scenario.parameters.record)
        going_on = [recorder for recorder in self._recorders if recorder.place in names]
        new = ",".join(name for name in names if name not in (recorder.place for recorder in going_on))
        return going_on + make_recorders(new, self.name, scenario.parameters, self._recording_failed)

    def _say_recording(self, before: list[WritingObserver], now: list[WritingObserver]) -> None:
        for recorder in before:
            if recorder not in now:
                self.endpoints.say(f"the recording to {recorder.place} ends")
        for recorder in now:
            if recorder not in before:
                self.endpoints.say(f"a recording to {recorder.place} begins")

    def _switch_recording(self, recorders: list[WritingObserver]) -> list[WritingObserver]:
        """On the physics thread: switch recorders; new ones are told what flies. Returns those that have finished; the
        caller closes them outside the physics thread.
        """
        before, self._recorders = self._recorders, recorders
        self._say_recording(before, recorders)
        self.loop.simulation.notify_floor(at_end=True)
        finished = [recorder for recorder in before if recorder not in recorders]
        errors = [recorder.error for recorder in finished if recorder.error]
        self._recording_error = errors[0] if errors and set(recorders) <= set(before) else ""
        self._watch()
        for recorder in recorders:
            if recorder not in before:
                self._introduce(recorder)
        return finished

    @property
    def recording_trouble(self) -> str:
        """Why the last recording has stopped, or that the present one takes nothing; empty when all is well."""
        return self._recording_error or next(filter(None, (recorder.stalled for recorder in self._recorders)), "")

    def _recording_failed(self, message: str) -> None:
        self.endpoints.warn(message)
        self.endpoints.parameters_changed()

    def give_up_failed_recording(self) -> None:
        """Where a recording has stopped by itself: close it, and ``record`` names only those that go on."""
        recorders = self._recorders
        if not any(recorder.error for recorder in recorders):
            return

        def give_up() -> list[WritingObserver]:
            if self._recorders is not recorders:  # others have taken their place
                return []
            going_on = [recorder for recorder in recorders if not recorder.error]
            finished = self._switch_recording(going_on)
            left = ",".join(recorder.place for recorder in going_on)
            self.loop.setup_of(Change({"record": left}))  # no event, since the motion stays
            return finished

        _close(self.call(give_up))


def _fulfil(future: Future[Any], function: Callable[[], Any]) -> None:
    try:
        future.set_result(function())
    except BaseException as error:  # the caller's to handle
        future.set_exception(error)


def _close(recorders: list[WritingObserver]) -> None:
    for recorder in recorders:
        recorder.close()
