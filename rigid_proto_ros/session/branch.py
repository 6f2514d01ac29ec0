# SPDX-License-Identifier: MIT
"""A what-if from any moment of a session: the scene that begins there, with what was acting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..messages.session_messages import PROJECTIONS
from ..scene.in_flight_text import NAME as IN_FLIGHT
from ..scene.in_flight_text import in_flight_text
from ..scene.scenario import Scenario, make_scenario
from .recorded_session import RecordedSession
from .replay import Resimulation, mesh_finder, session_scenario


@dataclass(frozen=True)
class Branch:
    """scene: parameter-file text; notes: what differs."""

    scene: str
    notes: list[str]


def branch_at(session: RecordedSession, time_ns: int) -> Branch:
    """The scene that goes on from the session's state at ``time_ns`` as the session does, to the bit, under the same
    commands.

    Those that act at that very time or later are left out. Raises InputError where the session doesn't reach it.
    """
    last_ns = max([session.end_ns, *(event_ns for event_ns, _ in session.events)])
    if not 0 <= time_ns <= last_ns:
        raise InputError("--at", time_ns / 1e9, f"a time of the session, 0 to {last_ns / 1e9:.9g} s")
    again = Resimulation(session_scenario(session), session.lines, None, mesh_finder(session), session.node_name)
    row = again.advance(time_ns)
    if again.simulation.failure:
        raise InputError("--at", time_ns / 1e9, f"a time before the motion failed: {again.simulation.failure}")
    return Branch(_scene(again.scenario, row, in_flight_text(again.simulation.in_flight)).text, [])


def recorded_branch(session: RecordedSession, scenario: Scenario, time_ns: int) -> Branch:
    """The same from recorded states alone: the one at ``time_ns``, or the last before it, in a scene given with it."""
    before = np.flatnonzero(session.times <= time_ns)
    if not len(before):
        raise InputError("--at", time_ns / 1e9, f"a time from the first state, {_first(session)}, on")
    k = before[np.argmax(session.times[before])]
    notes = [f"the state is the one recorded at {session.times[k] / 1e9:.9g} s; what acted then isn't recorded"]
    return Branch(_scene(scenario, session.rows[k], "").text, notes)


def _first(session: RecordedSession) -> str:
    return f"at {session.times.min() / 1e9:.9g} s" if len(session.times) else "of which there is none"


def _scene(scenario: Scenario, row: np.ndarray, flight: str) -> Scenario:
    numbers = row.tolist()
    velocities = PROJECTIONS["twist"](numbers)
    values = {
        **scenario.parameters.named(),
        "initial.position": numbers[0:3],
        "initial.orientation_xyzw": numbers[3:7],
        "initial.linear_velocity": velocities[:3],
        "initial.angular_velocity": velocities[3:],
        IN_FLIGHT: flight,
        "record": "",
    }
    return make_scenario(values, scenario.body_mesh.mesh if scenario.body_mesh else None)
