# SPDX-License-Identifier: MIT
"""The last minutes of a flight: scrub back, branch off, and see where the old future went.

The node's clock starts again at every reset, a rewind included. The history's own time, the *moment*, goes on over
plain resets, and goes back with a rewind to where the new future begins: moment = the run's offset + simulated time.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..base.errors import InputError
from ..scene.command_codec import MARKS
from ..session.recorded_session import RecordedSession, scene_sha256
from ..session.runs import decode_event
from .rewind import Rewind, core_row, make_rewind
from .save_as_script import SavedScript, save_as_script
from .state_log import StateLog

WINDOW_S = 300.0
"""How far back one can go."""

MAX_STATES = 60_000
"""Five minutes at 200 a second: 13 MB."""

MAX_RUNS = 200
"""Resets within the window; more come from a program, not from a hand."""

MAX_EVENTS = 50_000
"""Of one run: 40 minutes of pulling at 20 targets a second, 20 MB. A longer run can be looked at, and branched from
recorded states, but not computed anew.
"""

MIN_SPACING_NS = 5_000_000
"""States closer to each other than this are left out: eyes see no more, and a node at 1 kHz would fill
the log in 40 s.
"""

SCENE_GRACE_S = 0.1
"""Topics come one by one: a scene heard this soon after a reset [wall clock] is the one that the run began with."""

STALE_STATES = 20
"""States from before a reset that may still come after its event; when more come, they are of the new run after all."""


@dataclass(frozen=True)
class PreviousMotion:
    """The motion before a rewind: moments (n,) [ns] and rows (n, 13) as published, from the branch on."""

    moments: np.ndarray
    rows: np.ndarray

    def at(self, moment_ns: int) -> np.ndarray | None:
        """Its row (13,) at a moment, the last at or before it; None before it begins and after it ends."""
        if not len(self.moments) or not self.moments[0] <= moment_ns <= self.moments[-1]:
            return None
        return self.rows[int(np.searchsorted(self.moments, moment_ns, side="right")) - 1]


@dataclass
class _Run:
    """From a start or reset on. scene: as it began; scenes: those with another mesh since; events: (time_ns, line).
    whole: none was dropped for their number. is_new: a reset began it, and nothing has happened in it yet, not even
    time.
    """

    offset_ns: int
    scene: str
    scenes: list[str] = field(default_factory=list)
    events: list[tuple[int, str]] = field(default_factory=list)
    began_s: float = field(default_factory=time.monotonic)
    whole: bool = True
    is_new: bool = False

    @property
    def untouched(self) -> bool:
        """Nothing acted in it yet."""
        return all(decode_event(line, 1)[1] in MARKS for _, line in self.events)


class History:
    """What a client hears of a node, for the last WINDOW_S seconds of simulated time. For any threads.

    node_name as RecordedSession has it. attachments() gives (file name, bytes) of meshes that a scene may name by hash.
    """

    def __init__(
        self, node_name: str = "rigid_body", attachments: Callable[[], Sequence[tuple[str, bytes]]] = lambda: ()
    ) -> None:
        self._lock = threading.RLock()
        self._node_name = node_name
        self._attachments = attachments
        self.forget()

    def forget(self) -> None:
        """As if nothing had been heard."""
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        self._states = StateLog(MAX_STATES)
        self._scene = ""
        self._runs: deque[_Run] = deque([_Run(0, "")], maxlen=MAX_RUNS)
        self._last_stamp_ns = -1
        self._kept_stamp_ns = -MIN_SPACING_NS
        self._stale_from_ns = 0
        self._stale_left = 0
        self._restarted_by_state = False
        self._rewinding: Rewind | None = None
        self._ghost: PreviousMotion | None = None

    # What is heard

    def scene(self, text: str) -> None:
        """A text of ``~/scene``: all parameters as they are now."""
        with self._lock:
            self._scene = text
            run = self._runs[-1]
            if not run.scene or (run.is_new and time.monotonic() - run.began_s < SCENE_GRACE_S):
                run.scene = text
            if scene_sha256(text) != scene_sha256((run.scenes or [run.scene])[-1]):
                run.scenes.append(text)

    def event(self, line: str) -> None:
        """A line of ``~/events``. Raises InputError for one that is none."""
        time_ns, kind, _ = decode_event(line, 1)
        with self._lock:
            if kind == "reset":
                self._on_reset()
            run = self._runs[-1]
            run.is_new &= kind == "reset"
            if run.whole and len(run.events) < MAX_EVENTS:
                run.events.append((time_ns, line))
            else:
                run.whole = False
                run.events.clear()

    def state(self, time_ns: int, pose: np.ndarray, twist: np.ndarray) -> None:
        """A state as published at one stamp: pose x y z and xyzw, twist linear and angular, both in world axes."""
        with self._lock:
            if self._is_stale(time_ns):
                return
            if time_ns < self._last_stamp_ns:
                # The first state after a reset came before the reset's own event.
                self._begin_run()
                self._restarted_by_state = True
            self._last_stamp_ns = time_ns
            if self._kept_stamp_ns < time_ns < self._kept_stamp_ns + MIN_SPACING_NS:
                return
            self._kept_stamp_ns = time_ns
            self._runs[-1].is_new &= time_ns == 0
            live_ns = self._runs[-1].offset_ns + time_ns
            self._states.append(live_ns, np.concatenate([pose, twist]))
            oldest_ns = live_ns - round(WINDOW_S * 1e9)
            self._states.drop_before(oldest_ns)
            while len(self._runs) > 1 and self._runs[1].offset_ns <= oldest_ns:
                self._runs.popleft()

    # What may be asked

    @property
    def span(self) -> tuple[int, int]:
        """The first and the last moment [ns] that can be looked at; the last is the live one."""
        with self._lock:
            return (int(self._states.times[0]) if len(self._states) else self._live_ns), self._live_ns

    def row(self, moment_ns: int) -> np.ndarray | None:
        """The state (13,) as published, the last one at or before a moment; None before anything was heard."""
        with self._lock:
            return self._states.at(moment_ns)

    def simulated_ns(self, moment_ns: int) -> int:
        """What the node's clock showed at a moment."""
        with self._lock:
            return moment_ns - self._run_at(moment_ns).offset_ns

    @property
    def ghost(self) -> PreviousMotion | None:
        """The future that the last rewind left."""
        with self._lock:
            return self._ghost

    def forget_ghost(self) -> None:
        """No ghost any more."""
        with self._lock:
            self._ghost = None

    def rewind(self, moment_ns: int) -> Rewind:
        """What the node must be told to go on from the last state at or before a moment, with another future.

        Takes as long as computing the run anew up to there: call it where that may take a second. Raises InputError
        when nothing was received yet, or a mesh that flew then is gone.
        """
        with self._lock:
            row = self._states.at(moment_ns)
            if row is None or not self._scene:
                raise InputError("rewind", moment_ns / 1e9, "a moment since the first state was received")
            k = max(int(np.searchsorted(self._states.times, moment_ns, side="right")) - 1, 0)
            moment_ns = int(self._states.times[k])
            run = self._run_at(moment_ns)
            session = self._session(run, moment_ns - run.offset_ns, row)
            whole, present = run.whole, self._scene
        return make_rewind(session, moment_ns, row, whole, present)

    def rewinding(self, rewind: Rewind | None) -> None:
        """Say before ``~/reset`` is called that the next reset goes back to there; None takes it back."""
        with self._lock:
            self._rewinding = rewind

    def session(self) -> RecordedSession:
        """The live run as a recording of its events. Raises InputError when too much happened in it to be kept."""
        with self._lock:
            run = self._runs[-1]
            if not run.whole or not run.scene:
                accepted = f"at most {MAX_EVENTS} events since the last reset or rewind; reset or rewind, then continue"
                raise InputError("history", "more events than are kept" if run.scene else "no scene received", accepted)
            row = self._states.at(self._live_ns)
            return self._session(run, self._live_ns - run.offset_ns, row)

    def save_as_script(self) -> SavedScript:
        """What was done by hand since the last reset or rewind; raises InputError where that isn't known whole."""
        return save_as_script(self.session())

    # Runs

    @property
    def _live_ns(self) -> int:
        offset_ns = self._runs[-1].offset_ns
        return max(int(self._states.times[-1]), offset_ns) if len(self._states) else offset_ns

    def _run_at(self, moment_ns: int) -> _Run:
        return next((run for run in reversed(self._runs) if run.offset_ns <= moment_ns), self._runs[0])

    def _on_reset(self) -> None:
        if self._restarted_by_state:
            self._restarted_by_state = False
            # What came in between still belongs to the run before.
            self._runs[-1].events.clear()
            return
        last_ns = self._last_stamp_ns
        self._begin_run()
        self._stale_from_ns, self._stale_left = last_ns, STALE_STATES

    def _begin_run(self) -> None:
        offset_ns, rewinding = self._live_ns, self._rewinding
        if rewinding is not None:
            self._rewinding = None
            offset_ns = rewinding.moment_ns
            future = self._states.cut_after(offset_ns)
            if len(future[0]):
                self._ghost = PreviousMotion(*future)
        while len(self._runs) > 1 and (
            self._runs[-1].offset_ns > offset_ns or (self._runs[-1].offset_ns == offset_ns and self._runs[-1].untouched)
        ):
            self._runs.pop()
        self._runs.append(_Run(offset_ns, self._scene, is_new=True))
        self._last_stamp_ns, self._kept_stamp_ns = -1, -MIN_SPACING_NS

    def _is_stale(self, time_ns: int) -> bool:
        """A state from before the reset whose event was already heard."""
        if self._stale_left and 0 < self._stale_from_ns <= time_ns:
            self._stale_left -= 1
            return True
        self._stale_left = 0
        return False

    def _session(self, run: _Run, end_ns: int, row: np.ndarray | None) -> RecordedSession:
        events = [(time_ns, line) for time_ns, line in run.events if time_ns <= end_ns]
        rows = np.empty((0, 13)) if row is None else core_row(row)[None]
        return RecordedSession(
            scene=run.scene,
            events=events,
            times=np.full(len(rows), end_ns, np.int64),
            rows=rows,
            mesh_sha256=scene_sha256(run.scene),
            node_name=self._node_name,
            scenes=[run.scene, *run.scenes],
            attachments=list(self._attachments()),
        )
