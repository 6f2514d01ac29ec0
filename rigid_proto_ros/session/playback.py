# SPDX-License-Identifier: MIT
"""A recorded session told to an observer once more: the states as recorded, with the loads computed anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ..base.errors import InputError
from ..scene.offline import notify_start
from ..scene.scenario import Scenario
from ..simulation.notifier import snapshot
from ..simulation.observer import BodyChanged, GhostChanged, GhostPublished, Observer, Published
from .messages import PROJECTIONS
from .recorded_session import RecordedSession
from .replay import resimulation


def play(
    session: RecordedSession,
    observer: Observer,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda _done, _total: None,
) -> None:
    """Tell ``observer`` the session from its start to its last state; ``progress`` is called with (states told, all
    states).

    given: the scene of a session that lacks it; then states alone are told. Raises InputError for events that can't be
    decoded, and for a session without a scene.
    """
    if given is not None or session.missing:
        _play_states(session, observer, given)
        return
    again = resimulation(session, observer)
    notify_start(observer, again.scenario)
    again.simulation.announce()
    again.begin_ghost()
    for count, (time_ns, row) in enumerate(sorted_states(session)):
        progress(count, len(session.times))
        try:
            computed = again.advance(time_ns)
        except InputError:
            # A command that is refused here: from now on only the recorded states are shown.
            computed = row
        observer.on(Published(time_ns, computed if _published_alike(session, computed, row) else row))
        again.simulation.notify_status()
        if again.ghost is not None:
            again.ghost.advance(time_ns)


def play_beside(
    session: RecordedSession,
    observer: Observer,
    until_ns: int,
    progress: Callable[[float, float], None] = lambda _done, _total: None,
) -> None:
    """Tell ``observer`` the recorded states up to ``until_ns``, and as a ghost the motion that is computed anew."""
    again = resimulation(session, observer)
    notify_start(observer, again.scenario)
    again.simulation.announce()
    shown = None
    for count, (time_ns, row) in enumerate(sorted_states(session)):
        if time_ns > until_ns:
            break
        progress(count, len(session.times))
        try:
            computed = again.advance(time_ns)
        except InputError:
            break  # a command that is refused here
        if again.simulation.setup is not shown:
            shown = again.simulation.setup
            observer.on(GhostChanged(time_ns, again.simulation.snapshot()))
        observer.on(Published(time_ns, row))
        observer.on(GhostPublished(time_ns, computed))


def sorted_states(session: RecordedSession) -> Iterator[tuple[int, np.ndarray]]:
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
    notify_start(observer, given)
    observer.on(BodyChanged(0, snapshot(given.setup)))
    for time_ns, row in sorted_states(session):
        observer.on(Published(time_ns, row))
