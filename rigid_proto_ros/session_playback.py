# SPDX-License-Identifier: MIT
"""A recorded session told to an observer once more: the states as recorded, with the loads computed anew."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .core.errors import InputError
from .core.observer import BodySnapshot, Observer
from .core.simulation import Simulation
from .ghost import ghost_of
from .offline import tell_start
from .recorded_session import RecordedSession
from .replay import resimulation
from .scenario import Scenario
from .session_messages import PROJECTIONS
from .session_recorder import make_recorder


def play(
    session: RecordedSession,
    observer: Observer,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda done, total: None,
) -> None:
    """Tell ``observer`` the session from its start to its last state; ``progress`` is called with (states told, all states).

    given: the scene of a session that lacks it; then states alone are told. Raises InputError for events that can't be
    decoded, and for a session without a scene.
    """
    if given is not None or session.missing:
        _play_states(session, observer, given)
        return
    again = resimulation(session, observer)
    tell_start(observer, again.scenario)
    again.simulation.announce()
    again.ghost = ghost_of(again.scenario, again.simulation, observer)
    for count, (time_ns, row) in enumerate(sorted_states(session)):
        progress(count, len(session.times))
        try:
            computed = again.advance(time_ns)
        except InputError:
            # A command that can't have been taken: from here on what was recorded is all there is.
            computed = row
        observer.state(time_ns, computed if _published_alike(session, computed, row) else row)
        again.simulation.tell_status()
        if again.ghost is not None:
            again.ghost.advance(time_ns)


def record(
    runs: list[RecordedSession],
    path: str | Path,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda done, total: None,
) -> None:
    """Play all runs of a session into a recording, .rrd or .mcap; given: the scene of a session that lacks it. ``progress`` is
    called with (states told, all states).

    Raises InputError for a session without a scene and a file that can't be written.
    """
    for session in runs:
        if not session.scene and given is None:
            raise InputError("session", ", ".join(session.missing) or "no scene", "--scene FILE, to draw it")
    recorder = make_recorder(str(path), runs[-1].node_name.rpartition("/")[2] or "rigid_body", simulated_log=True)
    total = sum(len(session.times) for session in runs)
    before = 0
    try:
        for number, session in enumerate(runs):
            if number:
                recorder.reset()
            play(session, recorder, given, lambda done, _, before=before: progress(before + done, total))
            before += len(session.times)
    finally:
        recorder.close()
    if error := getattr(recorder, "error", ""):
        raise InputError("--record", str(path), f"a file that can be written ({error})")


def sorted_states(session: RecordedSession):
    """(time_ns, row) of every state in the order of time."""
    for k in np.argsort(session.times, kind="stable").tolist():
        yield int(session.times[k]), session.rows[k]


def _published_alike(session: RecordedSession, computed: np.ndarray, row: np.ndarray) -> bool:
    """Whether a computed state is the recorded one, of which a bag holds what was published, and no more."""
    if not session.published:
        return False
    return all(
        np.allclose(PROJECTIONS[name](computed.tolist()), PROJECTIONS[name](row.tolist()), rtol=1e-12, atol=1e-12)
        for name in session.published
    )


def _play_states(session: RecordedSession, observer: Observer, given: Scenario | None) -> None:
    if given is None:
        raise InputError("session", ", ".join(session.missing), "--scene FILE, to draw it")
    tell_start(observer, given)
    observer.body_changed(0, _snapshot(given))
    for time_ns, row in sorted_states(session):
        observer.state(time_ns, row)


def _snapshot(scenario: Scenario) -> BodySnapshot:
    told: list[BodySnapshot] = []

    class _Asked(Observer):
        def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
            told.append(body)

    Simulation(scenario.setup, _Asked()).announce()
    return told[0]
