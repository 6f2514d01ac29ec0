# SPDX-License-Identifier: MIT
"""A what-if from any moment of a session: a scene that begins with the state there, and a script of what still acts.

A branch is a session of its own: its time begins at 0, and its steps with it, so that it follows the session it left
within ``accuracy``, and not to the very bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..scene.scenario import Scenario, make_scenario
from ..scene.yaml_text import flow
from ..simulation.commands import HELD_WRENCH, UNNAMED_SLOT, slot_name
from ..simulation.flight import NEVER
from ..simulation.simulation import Simulation
from .messages import PROJECTIONS
from .recorded_session import RecordedSession
from .replay import Resimulation, resimulation

Entry = dict[str, object]


@dataclass(frozen=True)
class Branch:
    """scene: parameter-file text; entries: of a poke script."""

    scene: str
    entries: list[Entry]

    @property
    def script(self) -> str:
        """The entries as a poke script's text, an empty list where nothing acts."""
        return "".join(f"- {flow(entry)}\n" for entry in self.entries) or "[]\n"


def branch_at(session: RecordedSession, time_ns: int) -> Branch:
    """The scene that begins with the session's state at ``time_ns``, to its last bit, and what still acts there, for
    the time that is left.

    Commands that act at that very time or later are left out. Raises InputError where the session doesn't reach it.
    """
    last_ns = max([session.end_ns, *(event_ns for event_ns, _ in session.events)])
    if not 0 <= time_ns <= last_ns:
        raise InputError("--at", time_ns / 1e9, f"a time of the session, 0 to {last_ns / 1e9:.9g} s")
    again = resimulation(session)
    row = again.advance(time_ns)
    simulation = again.simulation
    if simulation.failure:
        raise InputError("--at", time_ns / 1e9, f"a time before the motion failed: {simulation.failure}")
    entries = [*_load_entries(simulation), *_thruster_entries(simulation), *_string_entries(simulation)]
    return Branch(_scene(again, row).text, entries)


def _scene(again: Resimulation, row: np.ndarray) -> Scenario:
    """The scene that begins with this state, and with the string as it is."""
    numbers, scenario, tied = row.tolist(), again.scenario, again.simulation.string
    velocities = PROJECTIONS["twist"](numbers)
    values = {
        **scenario.parameters.named(),
        "initial.position": numbers[0:3],
        "initial.orientation_xyzw": numbers[3:7],
        "initial.linear_velocity": velocities[:3],
        "initial.angular_velocity": velocities[3:],
        "record": "",
        "string.attached": tied is not None,
        "string.attach": list(again.simulation.attach if tied is None else tied.attach),
    }
    if tied is not None:
        values["string.target"] = tied.free_end(again.simulation.time_ns).tolist()
        values["initial.string_mass"] = tied.effective_mass
    return make_scenario(values, scenario.body_mesh.mesh if scenario.body_mesh else None)


def _string_entries(simulation: Simulation) -> Iterator[Entry]:
    tied, now_ns = simulation.string, simulation.time_ns
    if tied is None:
        return
    if tied.end_ns > now_ns:
        # A target is reached over the time since the one before it, here since time 0: so when it would have been.
        yield {"t": (tied.end_ns - now_ns) // 2 / 1e9, "string": {"target": tied.target.tolist()}}
    if tied.release_ns is not None:
        yield {"t": (tied.release_ns - now_ns) / 1e9, "string": "release"}


def _load_entries(simulation: Simulation) -> Iterator[Entry]:
    timeout_ns, now_ns = simulation.setup.wrench_timeout_ns, simulation.time_ns
    for acting in simulation.acting:
        endless = acting.kind == HELD_WRENCH and not timeout_ns
        if acting.thruster >= 0 or not (endless or acting.end_ns > now_ns):
            continue
        load = acting.load
        entry: Entry = {"at": "com" if load.mesh_point is None else {"point": list(load.mesh_point)}}
        if load.axes == "normal":
            entry["push"] = load.force[0]
        else:
            entry |= {"force": list(load.force), "torque": list(load.torque), "axes": load.axes}
        if acting.slot > UNNAMED_SLOT:
            entry["slot"] = slot_name(acting.slot)
        if not endless:
            entry["duration"] = (acting.end_ns - now_ns) / 1e9
        held = acting.kind == HELD_WRENCH or acting.slot == UNNAMED_SLOT
        yield {"t": 0.0, "wrench": entry} if held else {"t": 0.0, **entry}


def _thruster_entries(simulation: Simulation) -> Iterator[Entry]:
    """What the thrusters push with, and again without those that stop by their least on-time or the timeout."""
    control, now_ns = simulation.thrusters, simulation.time_ns
    pushes = control.pushes
    if not any(push.force for push in pushes):
        return
    ends = [push.off_ns for push in pushes]
    if control.times_out:
        ends = [min(end_ns, control.last_ns + simulation.setup.wrench_timeout_ns) for end_ns in ends]
    for time_ns in (now_ns, *sorted({end_ns for end_ns in ends if end_ns != NEVER})):
        forces = [push.force if end_ns > time_ns else 0.0 for push, end_ns in zip(pushes, ends, strict=True)]
        yield {"t": (time_ns - now_ns) / 1e9, "thrusters": forces}
