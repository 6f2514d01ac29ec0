# SPDX-License-Identifier: MIT
"""One body in real time: the physics thread, commands, parameters, observers and recording.

The physics thread owns the simulation. It wakes at absolute deadlines and runs the loop. Other threads access the
simulation only by functions that they pass to ``call``. The node adds topics, services and ROS parameters; the
interactive page uses this class directly.
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
"""Timeout of a request that has not started [s]."""

LOOK_S = 0.002
"""Polling period of a step's completion [s]."""

SHORT_NS = 3_000_000
"""Waits shorter than this [ns] are a plain sleep, which costs half as much as a wait that arrivals interrupt."""

SPACING_NS = 1_000_000
"""Shortest period [ns of wall time] of taking arrivals while time runs."""


class LiveSimulation:
    """A simulation on its own thread. Methods may be called from any thread unless they say otherwise.

    name: name of the body and of its recording. endpoints: publishers and sources of commands besides these methods.
    stamps: with a clock, simulated time follows it instead of the wall clock. Raises InputError for contacts that no
    command can name.
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
        # Held while a request is queued and while the thread starts or stops.
        self._requests_lock = threading.Lock()
        self._stopping = False
        self._thread: threading.Thread | None = None

    def _check_contacts(self, scenario: Scenario) -> None:
        """Raises InputError for a contact that no command can name because a frame has the same name."""
        for name in sorted(scenario.parameters.contacts.keys() & {self.frames[0], *body_names(self.frames[1])}):
            accepted = (
                "a name that is neither that of the world's frame nor that of the body's (the node's name by default)"
            )
            raise InputError(f"contacts.{name}", name, accepted)

    # The physics thread

    def announce(self) -> None:
        """Start the scenario's recording and send the observers the scene and the body. Call once, before ``start``,
        after everything else has been checked. Raises InputError if the recording can't be written.
        """

        def announce() -> None:
            self._recorders = self._open_recorders(self.scenario)
            self._log_recordings([], self._recorders)
            self._watch()
            self._introduce(self.loop.observer)

        self.call(announce)

    def start(self, on_crash: Callable[[], None] = lambda: None) -> None:
        """Start simulated time. on_crash() is called if the thread ends by an unexpected exception."""
        # Objects made at start-up persist; without this, a garbage collection scans them and delays the motion by 30
        # ms.
        gc.freeze()
        with self._requests_lock:
            self._thread = threading.Thread(target=self._run, args=(on_crash,), name="physics", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Stop the motion, then close the observers, which write out what they buffer. Pending requests are refused."""
        with self._requests_lock:
            self._stopping = True
        self.endpoints.wake()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        for _, future in self._requests:
            future.cancel()
        self.loop.simulation.notify_floor(at_end=True)
        self.loop.observer.close()
        self._log_recordings(self._recorders, [])

    def post(self, function: Callable[[], Any]) -> Future[Any]:
        """Queue a function for the physics thread, which runs it between two ticks, in the order of posting. Before the
        thread is started, run it at once. Raises InputError if the simulation has ended.
        """
        future: Future[Any] = Future()
        with self._requests_lock:
            if self._stopping:
                raise InputError("request", "the simulation has ended")
            if self._thread is None:
                _fulfil(future, function)
            else:
                self._requests.append((function, future))
        self.endpoints.wake()
        return future

    def call(self, function: Callable[[], Any]) -> Any:
        """Post a function and wait: returns its result or raises its exception. Raises InputError if the thread is too
        busy to start it within BUSY_S; then it never runs.
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
        # It has started, so it will end.
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
        """The present scenario."""
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
        """Apply a command of a service now; no topic counts it."""

        def submit() -> None:
            self.loop.settle()
            self.loop.take(command)

        self.call(submit)

    def schedule(self, text: str) -> None:
        """Take one script entry or a list of entries, as YAML, ``t`` in simulated seconds; a list is accepted or
        refused as a whole. Raises CommandRefused, counted.
        """
        self.call(self.scheduling(text))

    def scheduling(self, text: str) -> Callable[[], None]:
        """The function that ``schedule`` runs on the physics thread."""
        return lambda: self.loop.commands.receive_schedule(lambda: text)

    # Time

    def pause(self, paused: bool) -> None:
        """Pause or resume simulated time, after the commands sent before are taken."""
        self.call(lambda: self.loop.pause(paused))

    def reset(self) -> None:
        """Return to time 0 and the initial state; keeps paused or running."""

        def reset() -> None:
            self.loop.settle()  # commands sent before act before the reset, so it discards them
            self.loop.reset()

        self.call(reset)

    def begin(self, scenario: Scenario) -> None:
        """Start another scene at its time 0; keeps paused or running. Raises InputError, after which the present scene
        starts again.
        """

        def begin() -> None:
            # A load or string that acts now must not be a reason to refuse the new scene.
            self.loop.reset()
            self.loop.replace(scenario)
            self.loop.reset()

        self._check_contacts(scenario)
        self.call(begin)

    def step(self, periods: int = 1) -> int:
        """While paused, advance over ``periods`` publications; returns the simulated time reached [ns]. Raises
        InputError while time runs, or if it takes too long.
        """
        steps = self.loop.steps(periods)
        while not self.call(lambda: next(steps, True)):
            time.sleep(LOOK_S)
        return self.loop.simulation.time_ns

    # Parameters

    @property
    def parameters_now(self) -> dict[str, Any]:
        """The present parameters by name, after all commands sent before."""

        def now() -> dict[str, Any]:
            self.loop.settle()
            return self.scenario.parameters.named()

        named: dict[str, Any] = self.call(now)
        return named

    def set_parameters(self, changes: Mapping[str, object]) -> None:
        """Change all these parameters at once. Raises InputError and then changes none. Setting density
        sets mass to 0.
        """
        self.give_up_failed_recording()
        # Loading a mesh takes too long for the physics thread: ``with_changes`` here fills the cache.
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
            # A recording starts with the scene before the change that starts it; that change is its first event.
            finished = self._switch_recording(recorders) if "record" in changes else []
            loop.change(changes, scenario)
            return finished

        recorders: list[WritingObserver] = []
        if "record" in changes:
            # Opened after all checks: a refused change must not truncate an existing file.
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
        """Stop notifying this observer."""

        def remove() -> None:
            self._observers = tuple(other for other in self._observers if other is not observer)
            self._watch()

        self.call(remove)

    # The recording, which can be changed in flight

    def _open_recorders(self, scenario: Scenario) -> list[WritingObserver]:
        """The recorders that ``record`` names; recorders already running are kept. Raises InputError if a file can't be
        written.
        """
        if not scenario.parameters.record:
            return []
        from ..rerun_view.recorders import make_recorders, recording_names

        names = recording_names(scenario.parameters.record)
        going_on = [recorder for recorder in self._recorders if recorder.place in names]
        new = ",".join(name for name in names if name not in (recorder.place for recorder in going_on))
        return going_on + make_recorders(new, self.name, scenario.parameters, self._recording_failed)

    def _log_recordings(self, before: list[WritingObserver], now: list[WritingObserver]) -> None:
        for recorder in before:
            if recorder not in now:
                self.endpoints.say(f"the recording to {recorder.place} ends")
        for recorder in now:
            if recorder not in before:
                self.endpoints.say(f"a recording to {recorder.place} begins")

    def _switch_recording(self, recorders: list[WritingObserver]) -> list[WritingObserver]:
        """Switch recorders, on the physics thread; new ones receive the scene and the body. Returns the finished ones;
        the caller closes them outside the physics thread.
        """
        before, self._recorders = self._recorders, recorders
        self._log_recordings(before, recorders)
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
        """Why the last recording has failed, or that the present one is stalled; empty if neither."""
        return self._recording_error or next(filter(None, (recorder.stalled for recorder in self._recorders)), "")

    def _recording_failed(self, message: str) -> None:
        self.endpoints.warn(message)
        self.endpoints.parameters_changed()

    def give_up_failed_recording(self) -> None:
        """Close recordings that have failed, and remove them from ``record``."""
        recorders = self._recorders
        if not any(recorder.error for recorder in recorders):
            return

        def give_up() -> list[WritingObserver]:
            if self._recorders is not recorders:  # replaced meanwhile
                return []
            going_on = [recorder for recorder in recorders if not recorder.error]
            finished = self._switch_recording(going_on)
            left = ",".join(recorder.place for recorder in going_on)
            self.loop.setup_of(Change({"record": left}))  # no event, since the motion is unchanged
            return finished

        _close(self.call(give_up))


def _fulfil(future: Future[Any], function: Callable[[], Any]) -> None:
    try:
        future.set_result(function())
    except BaseException as error:  # handled by the caller
        future.set_exception(error)


def _close(recorders: list[WritingObserver]) -> None:
    for recorder in recorders:
        recorder.close()
