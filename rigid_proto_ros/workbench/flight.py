# SPDX-License-Identifier: MIT
"""The body that flies in this process, as the page uses it: what it is told and asked, and the present run in memory.

The page's thread calls; the physics thread tells. What takes longer than a moment (a mesh, kernels, a run computed
anew) is done on one worker thread, in the order in which it was asked for.
"""

from __future__ import annotations

import asyncio
import functools
import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, IntArray, StateRow
from ..live.live_simulation import LiveSimulation
from ..parameters.declarations import parameter_named
from ..scene.scenario import Scenario, make_scenario, mesh_sha256_of
from ..scene.scene_file import read_scene_text
from ..session.as_script import branch_at
from ..session.recorded_session import RecordedSession, StateRows
from ..simulation.observer import BodyChanged, Event, Logged, Observer, Published, Reset, SceneChanged
from ..simulation.setup import Setup

KEPT_S = 300.0
"""[s, simulated] How far back one can go."""

SPACING_NS = 10_000_000
"""States closer than this aren't kept: a body at 1 kHz would fill the memory ten times as fast."""

MAX_EVENTS = 50_000
"""Of one run: 40 minutes of pulling at 20 targets a second, 20 MB."""

LOOKS = frozenset(
    {"record", "real_time_factor", "publish_rate", "publish_clock", "publish_tf", "imu_contact", "schedule_horizon"}
)
"""Parameters that a lesson leaves as they are: how one looks at the motion, not the motion."""

SOON_S = 0.3
"""[s] What takes no longer isn't said to be waited for."""

SCENE, FUTURE = "another scene", "another future of this one"
"""What begins at a jump of time."""

Entry = dict[str, Any]
"""One entry of a poke script."""

Result = TypeVar("Result")

_logger = logging.getLogger(__name__)


class RunMemory(Observer):
    """The run since the last reset, kept as a session. Told on the physics thread, read from any."""

    takes = frozenset({BodyChanged, Published, Logged, SceneChanged, Reset})

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._text = ""
        self._bodies: list[BodyChanged] = []
        self._begin()

    def _begin(self) -> None:
        self._bodies = [body._replace(time_ns=0) for body in self._bodies[-1:]]
        self._scene = self._text
        self._scenes = [self._text]
        self._events: list[tuple[int, str]] = []
        self._states: deque[tuple[int, StateRow]] = deque(maxlen=round(KEPT_S * 1e9 / SPACING_NS))
        self._whole = True

    def on(self, event: Event) -> None:
        """Keep what a session has."""
        with self._lock:
            match event:
                case Published(time_ns, row):
                    if not self._states or time_ns >= self._states[-1][0] + SPACING_NS:
                        self._states.append((time_ns, row.copy()))
                case Logged(time_ns, line):
                    self._whole &= len(self._events) < MAX_EVENTS
                    if self._whole:
                        self._events.append((time_ns, line))
                case SceneChanged(time_ns, scene):
                    self._scene_changed(time_ns, scene)
                case BodyChanged() if self._whole:
                    self._bodies.append(event)
                case Reset():
                    self._begin()

    def _scene_changed(self, time_ns: int, scene: str) -> None:
        self._text = scene
        if not self._scene or (time_ns == 0 and not self._events):
            self._begin()
        elif mesh_sha256_of(scene) != mesh_sha256_of(self._scenes[-1]):
            self._scenes.append(scene)

    def setup_at(self, time_ns: int) -> Setup:
        """The setup in force at a time of the run."""
        with self._lock:
            return next(body.setup for body in reversed(self._bodies) if body.time_ns <= time_ns)

    def session(self) -> RecordedSession:
        """The run so far. Raises InputError when more has happened in it than is kept."""
        with self._lock:
            if not self._whole:
                accepted = f"at most {MAX_EVENTS} commands since the last reset; reset, then continue"
                raise InputError("session", "more commands than are kept", accepted)
            states = list(self._states)
            return RecordedSession(
                scene=self._scene,
                events=list(self._events),
                states=StateRows(
                    np.array([time_ns for time_ns, _ in states], np.int64),
                    np.array([row for _, row in states]).reshape(-1, 13),
                ),
                node_name=self._name,
                scenes=list(self._scenes),
            )


class Flight:
    """say(text) tells the users of a refusal, and on_refused() is called after it. busy(text): what takes time from now
    on, "" when it is over.

    scenario: the one in force. moment_ns: the time of the past that is looked at, None while the present is.
    before_jump() is called before time jumps; it and on_refused() on the page's thread. jump: SCENE or FUTURE while one
    begins, empty else: what is told meanwhile wasn't done by hand.
    """

    def __init__(
        self,
        live: LiveSimulation,
        say: Callable[[str], None],
        on_refused: Callable[[], None] = lambda: None,
        before_jump: Callable[[], None] = lambda: None,
    ) -> None:
        self.live = live
        self.memory = RunMemory(live.name)
        self.say = say
        self._on_refused, self._before_jump = on_refused, before_jump
        self._doing = "", 0.0
        self._worker = ThreadPoolExecutor(1, "page")
        self.jump = ""
        self._past: RecordedSession | None = None
        self.moment_ns: int | None = None
        self._ran_before = False

    @property
    def scenario(self) -> Scenario:
        """The scenario in force."""
        return self.live.scenario

    @property
    def paused(self) -> bool:
        """Whether simulated time stands."""
        return self.live.paused

    def busy(self, doing: str) -> None:
        """The page is busy with this, or, where it is empty, no longer."""
        if doing != self._doing[0]:
            self._doing = doing, time.monotonic()

    @property
    def waited_for(self) -> str:
        """What takes time, and for how long it has; empty for nothing."""
        doing, began_s = self._doing
        since_s = time.monotonic() - began_s
        return f"{doing} … {since_s:.0f} s" if doing and since_s > SOON_S else ""

    def close(self) -> None:
        """No more requests."""
        self._worker.shutdown(wait=False, cancel_futures=True)

    # Asking

    async def _ask(self, doing: str, function: Callable[[], Result]) -> Result | None:
        """Run a function on the worker thread; a refusal, or a fault of the program, is said, and gives None."""
        try:
            return await asyncio.get_running_loop().run_in_executor(self._worker, self._work, doing, function)
        except InputError as error:
            self.say(f"Refused: {error}")
        except Exception as error:
            self._say_failed(error)
        self._on_refused()
        return None

    def _say_failed(self, error: Exception) -> None:
        self.say(f"Failed: {type(error).__name__}: {error}")
        _logger.error("a request of the page failed", exc_info=error)

    def _work(self, doing: str, function: Callable[[], Result]) -> Result:
        """On the worker thread: who has asked for something else meanwhile sees what is being waited for."""
        self.busy(doing)
        try:
            return function()
        finally:
            self.busy("")

    def ask(self, function: Callable[[], object], doing: str = "") -> None:
        """Have a function run on the worker thread."""
        asyncio.ensure_future(self._ask(doing, function))

    def do(self, *entries: Entry) -> None:
        """Do this by hand, in this order: entries of a poke script without their time, which is now."""
        if self.refuses_in_past():
            return
        text = json.dumps([{"t": 0, **entry} for entry in entries])
        self.ask(functools.partial(self.live.schedule, text))

    def set(self, changes: Mapping[str, object]) -> None:
        """Set parameters, all or none."""
        if not changes.keys() <= LOOKS and self.refuses_in_past():
            return
        self.ask(functools.partial(self.live.set_parameters, dict(changes)), "setting parameters")

    def refuses_in_past(self) -> bool:
        """Whether the past is shown, in which nothing can be done; if so, it says so."""
        if self.moment_ns is None:
            return False
        self.say("The past is shown: press Play to go on from here, or return to the present first.")
        self._on_refused()
        return True

    def pause(self, paused: bool) -> None:
        """Stop simulated time, or let it go on."""
        self.ask(functools.partial(self.live.pause, paused))

    def step(self) -> None:
        """Go on by one publication period."""
        self.ask(self.live.step)

    # Scenes

    async def fly(
        self,
        scene: str | Mapping[str, object],
        script: str = "",
        paused: bool | None = None,
        speed: float | None = None,
    ) -> bool:
        """Begin a scene (parameter-file text, or its parameters) and a poke script (YAML text) at time 0; paused: or as
        it was; speed: simulated seconds per second, or as they were. Returns whether it was taken.
        """
        self._before_jump()
        goes_on = self.leave_past()

        def begin() -> bool:
            values: dict[str, object] = {}
            values.update(read_scene_text(scene).values if isinstance(scene, str) else scene)
            values.update(self._kept)
            if speed is not None:
                values["real_time_factor"] = speed
            paused_then = (self.paused and not goes_on) if paused is None else paused
            self._begin(SCENE, make_scenario(values), script, paused_then)
            return True

        return await self._ask("preparing the scene", begin) or False

    @property
    def _kept(self) -> dict[str, object]:
        """Parameters that another scene leaves as they are."""
        in_force = self.scenario.parameters.named()
        return {name: value for name, value in in_force.items() if name in LOOKS or _is_of_the_node(name)}

    def _begin(self, jump: str, scenario: Scenario, script: str, paused: bool) -> None:
        was_paused = self.paused
        # Time stands first: a scene that begins paused begins at its time 0.
        self.live.pause(True)
        try:
            self.jump = jump
            self.live.begin(scenario)
            if script.strip():
                self.live.schedule(script)
        except InputError:
            self.live.pause(was_paused)
            raise
        finally:
            self.jump = ""
        self.live.pause(paused)

    def reset(self) -> None:
        """Time 0 of the scene, or of the branch."""
        self._before_jump()
        self.look_at_present()
        self.ask(self.live.reset)

    # The past

    @property
    def reach_s(self) -> tuple[float, float]:
        """The first and the last simulated time [s] that can be looked at."""
        past = self._past
        if past is None or not len(past.times):
            return 0.0, self.live.state.time_ns * 1e-9
        return float(past.times[0]) * 1e-9, float(past.times[-1]) * 1e-9

    def look_at(self, time_s: float) -> None:
        """Show the body as it was at a time of this run; simulated time stands meanwhile."""
        if self._past is None:
            try:
                past = self.memory.session()
            except InputError as error:
                self.say(str(error))
                return
            if not len(past.times):
                return
            self._before_jump()
            self._past, self._ran_before = past, not self.paused
            self.pause(True)
        k = int(np.searchsorted(self._past.times, round(time_s * 1e9), side="right")) - 1
        self.moment_ns = int(self._past.times[max(k, 0)])

    def look_at_present(self) -> None:
        """Show the present again, which goes on if it did."""
        if self.leave_past():
            self.pause(False)

    def leave_past(self) -> bool:
        """Show the present again, where time stands; returns whether it went on until the past was looked at."""
        goes_on = self._past is not None and self._ran_before
        self._past = self.moment_ns = None
        return goes_on

    def past_rows(self, lasting_ns: int) -> tuple[IntArray, FloatArray]:
        """Times (n,) and states (n, 13) up to the one that is looked at."""
        past, moment_ns = self._past, self.moment_ns
        assert past is not None
        assert moment_ns is not None
        first, last = np.searchsorted(past.times, [moment_ns - lasting_ns, moment_ns])
        return past.times[first : last + 1], past.rows[first : last + 1]

    async def go_on_from_here(self) -> None:
        """Let simulated time go on from the moment that is looked at, with another future."""
        past, moment_ns = self._past, self.moment_ns
        if past is None or moment_ns is None:
            return

        def prepare() -> tuple[Scenario, str]:
            values: dict[str, object] = {}
            branch = branch_at(past, moment_ns)
            values.update(read_scene_text(branch.scene).values)
            values.update(self._kept)
            return make_scenario(values), json.dumps(branch.entries) if branch.entries else ""

        found = await self._ask("going back", prepare)
        if found is not None:
            # Before it begins: what is told while the past is looked at isn't heard.
            self._past = self.moment_ns = None
            await self._ask("going back", functools.partial(self._begin, FUTURE, *found, False))


def _is_of_the_node(name: str) -> bool:
    """Whether a parameter belongs to the running program, and not to what flies in it."""
    return parameter_named(name).changes == "read-only" and not name.startswith(("contacts.", "thrusters."))
