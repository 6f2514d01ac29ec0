# SPDX-License-Identifier: MIT
"""A what-if from any moment of a session: the scene that begins there, and a poke script of what was acting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..messages.session_messages import PROJECTIONS
from ..motion.body import Body
from ..motion.frames import parse_frame
from ..motion.loads import Load
from ..scene.scenario import Scenario, make_scenario, nanoseconds
from ..scene.yaml_text import dump_yaml
from ..simulation.commands import WrenchCommand
from ..simulation.observer import Observer, ShownLoad
from .recorded_session import RecordedSession
from .replay import Resimulation, mesh_finder, session_scenario


@dataclass
class _RecordedLoad:
    began_ns: int
    frame_id: str
    kind: str
    force: list[float]
    torque: list[float]


class ActingLoads(Observer):
    """Which wrenches and pokes act, as they took effect."""

    def __init__(self) -> None:
        self.acting: dict[int, _RecordedLoad] = {}
        self._latest: _RecordedLoad | None = None

    def applied(self, time_ns: int, command: WrenchCommand, load: Load, body: Body, _attitude: np.ndarray) -> None:
        """Remember the command until it is said to act."""
        force = load.force if load.axes == "world" else load.own_force(body)
        frame_id = load.frame_id + command.frame.options
        self._latest = _RecordedLoad(time_ns, frame_id, command.kind, [float(f) for f in force], list(load.torque))

    def load_began(self, _time_ns: int, load_id: int, load: ShownLoad) -> None:
        """The command applied last begins to act; an impulse has acted, and thrusters go by themselves."""
        if self._latest is not None and load.kind in ("wrench", "poke"):
            self.acting[load_id] = self._latest

    def load_ended(self, _time_ns: int, load_id: int) -> None:
        """It acts no longer."""
        self.acting.pop(load_id, None)


@dataclass(frozen=True)
class Branch:
    """scene: parameter-file text; pokes: entries of a poke script, for what no scene can say; notes: what differs."""

    scene: str
    pokes: list[dict]
    notes: list[str]

    @property
    def pokes_text(self) -> str:
        """The entries as a script."""
        return dump_yaml(self.pokes)


def branch_at(session: RecordedSession, time_ns: int) -> Branch:
    """The scene whose initial state is the session's at ``time_ns`` and whose parameters are those in force then.

    Commands that act at that very time or later are left out. Raises InputError where the session doesn't reach it.
    """
    last_ns = max([session.end_ns, *(event_ns for event_ns, _ in session.events)])
    if not 0 <= time_ns <= last_ns:
        raise InputError("--at", time_ns / 1e9, f"a time of the session, 0 to {last_ns / 1e9:.9g} s")
    loads = ActingLoads()
    again = Resimulation(session_scenario(session), session.lines, loads, mesh_finder(session), session.node_name)
    row = again.advance(time_ns)
    if again.simulation.failure:
        raise InputError("--at", time_ns / 1e9, f"a time before the motion failed: {again.simulation.failure}")
    pokes = [
        entry for acting in loads.acting.values() if (entry := _load_entry(acting, again.scenario, time_ns)) is not None
    ]
    notes: list[str] = []
    string, changes = _string(again, time_ns, notes)
    thrusters = again.simulation.thrusters
    if any(thrusters.targets):
        pokes.append({"t": 0.0, "thrusters": thrusters.targets})
        notes.append("thrusters time out as if they had been commanded then")
    if thrusters.lags:
        notes.append("thrusters with a lag begin at no force")
    return Branch(_scene(again.scenario, row, changes).text, [*string, *pokes], notes)


def recorded_branch(session: RecordedSession, scenario: Scenario, time_ns: int) -> Branch:
    """The same from recorded states alone: the one at ``time_ns``, or the last before it, in a scene given with it."""
    before = np.flatnonzero(session.times <= time_ns)
    if not len(before):
        raise InputError("--at", time_ns / 1e9, f"a time from the first state, {_first(session)}, on")
    k = before[np.argmax(session.times[before])]
    notes = [f"the state is the one recorded at {session.times[k] / 1e9:.9g} s; what acted then isn't recorded"]
    return Branch(_scene(scenario, session.rows[k], {}).text, [], notes)


def _first(session: RecordedSession) -> str:
    return f"at {session.times.min() / 1e9:.9g} s" if len(session.times) else "of which there is none"


def _scene(scenario: Scenario, row: np.ndarray, changes: dict) -> Scenario:
    numbers = row.tolist()
    velocities = PROJECTIONS["twist"](numbers)
    values = {
        **scenario.parameters.named(),
        **changes,
        "initial.position": numbers[0:3],
        "initial.orientation_xyzw": numbers[3:7],
        "initial.linear_velocity": velocities[:3],
        "initial.angular_velocity": velocities[3:],
        "record": "",
    }
    return make_scenario(values, scenario.body_mesh.mesh if scenario.body_mesh else None)


def _load_entry(acting: _RecordedLoad, scenario: Scenario, now_ns: int) -> dict | None:
    """A load as a script's entry for what is left of it."""
    frame = parse_frame(acting.frame_id)
    end_ns: int | None
    if acting.kind == "wrench":
        timeout_ns = scenario.setup.wrench_timeout_ns
        end_ns = acting.began_ns + timeout_ns if timeout_ns else None
    else:
        duration = frame.duration_s
        end_ns = acting.began_ns + (scenario.setup.poke_duration_ns if duration is None else nanoseconds(duration))
    if end_ns is not None and end_ns <= now_ns:
        return None
    word, *numbers = frame.point
    entry: dict = {
        "at": word if word in ("com", "origin") else {"point": [float(x) for x in numbers[0]]},
        "force": acting.force,
        "torque": acting.torque,
        "axes": frame.axes,
    }
    if frame.slot:
        entry["slot"] = frame.slot
    if end_ns is not None:
        entry["duration"] = (end_ns - now_ns) / 1e9
    return {"t": 0.0, "wrench": entry} if acting.kind == "wrench" else {"t": 0.0, **entry}


def _string(again: Resimulation, now_ns: int, notes: list[str]) -> tuple[list[dict], dict]:
    """What ties the string again as it is: parameters, and entries of a script for what it still does by itself."""
    tied = again.simulation.string
    if tied is None:
        return [], {"string.attached": False, "initial.string_mass": 0.0}
    changes = {
        "string.attached": True,
        "string.attach": list(tied.attach),
        "string.target": [float(x) for x in tied.free_end(now_ns)],
        # Stiffness and damping were computed from it, and stay what they were.
        "initial.string_mass": tied.effective_mass,
    }
    entries = []
    if now_ns < tied.end_ns:
        notes.append("the string's free end was moving: it rests where it was, then goes on to its target")
        target = [float(x) for x in tied.target]
        entries.append({"t": (tied.end_ns - now_ns) / 1e9, "set": {"string.target": target}})
    if tied.release_ns is not None:
        entries.append({"t": (tied.release_ns - now_ns) / 1e9, "set": {"string.attached": False}})
    return entries, changes
