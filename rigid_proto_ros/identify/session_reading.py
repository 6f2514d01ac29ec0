# SPDX-License-Identifier: MIT
"""Sessions of this package as measured flights: the published states, and the loads of the event log."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.errors import CommandRefused, InputError
from ..base.vectors import FloatArray, vector
from ..motion.loads import Load, load_of_bytes
from ..scene.command_codec import frame_names, of_event
from ..scene.scenario import Scenario
from ..session.recorded_session import RecordedSession, decode_event, session_scenario
from ..simulation.commands import NO_SLOT, ClearWrench, WrenchCommand
from ..simulation.setup import Setup, check_command
from .measurements import ATTITUDE, POSITION, LoadHistory, MeasuredFlight, Series, load_history


def session_flight(
    session: RecordedSession, name: str, first_s: float, last_s: float
) -> tuple[MeasuredFlight, Scenario]:
    """The measurements between two simulated times. Raises InputError if a load acted that can't be taken into account.

    The tracked frame has the mesh's axes, and its origin is the scene's centre of mass.
    """
    scenario = session_scenario(session)
    setup = scenario.setup
    if setup.scene.string_attached:
        raise InputError(
            "session", f"{name} has a string tied to the body from its start; only wrenches and pokes are supported"
        )
    if setup.flight.has_rotor:
        raise InputError("session", f"{name} has a flywheel; only gravity and damping act beside wrenches and pokes")
    if not setup.scene.gyroscopic:
        raise InputError(
            "session", f"{name} was simulated with gyroscopic: false, which isn't the motion of a rigid body"
        )
    end_ns = round(min(last_s, 1e-9 * session.end_ns) * 1e9)
    frames = frame_names(scenario.parameters, session.node_name)
    loads = _load_history(session, setup, frames, name, end_ns)
    series = [one.within(round(min(first_s, 1e9) * 1e9), end_ns) for one in _series(session)]
    series = [one for one in series if len(one.times_ns)]
    if not series:
        raise InputError("--from", first_s, f"a time within {name}, which ends at {1e-9 * session.end_ns:g} s")
    x, y, z = (float(value) for value in setup.gravity)
    damping = float(setup.scene.linear_damping), float(setup.scene.angular_damping)
    return MeasuredFlight(name, tuple(series), loads, (x, y, z), *damping, gravity_from="from the scene"), scenario


def _series(session: RecordedSession) -> list[Series]:
    """The poses as series of one topic."""
    topic = next((topic for topic in ("pose", "odom", "") if topic in session.states.topics), None)
    if topic is None:
        return []
    poses = session.published[topic]
    return [
        Series(topic or "states", kind, poses.times, poses.rows[:, columns])
        for kind, columns in ((POSITION, slice(0, 3)), (ATTITUDE, slice(3, 7)))
    ]


@dataclass
class _Acting:
    """A load (LOAD,) and when it acts [ns]. slot: the next command in it ends this load."""

    begin_ns: int
    end_ns: int
    load: FloatArray
    slot: int


def _load_history(
    session: RecordedSession, setup: Setup, frames: tuple[str, str], name: str, end_ns: int
) -> LoadHistory:
    """Loads of the event log up to a time, as intervals; an impulse ends when it begins."""
    impulses: list[tuple[int, int, FloatArray]] = []
    acting: list[_Acting] = []
    for number, line in enumerate(session.lines, 1):
        time_ns, kind, content = decode_event(line, number)
        if time_ns > end_ns:
            break
        command = of_event(kind, content, frames)
        if command is None and kind != "jump":
            continue
        if isinstance(command, ClearWrench):
            for one in acting:
                one.end_ns = min(one.end_ns, time_ns)
            continue
        if not isinstance(command, WrenchCommand):
            reason = f"at {1e-9 * time_ns:g} s {name} has a {kind} event"
            raise InputError("session", f"{reason}: only wrenches and pokes are supported; end before it with --to")
        load = _load_row(command, setup, name, time_ns)
        if command.frame.impulse:
            impulses.append((time_ns, time_ns, load))
            continue
        for one in acting:
            if one.slot == command.slot != NO_SLOT:
                one.end_ns = min(one.end_ns, time_ns)
        flight = setup.flight
        usual = int(flight.timeout_ns or end_ns if command.held else flight.poke_ns)
        lasts = command.duration_ns if command.duration_ns >= 0 else usual
        acting.append(_Acting(time_ns, min(time_ns + lasts, end_ns), load, command.slot))
    pushes = [(one.begin_ns, one.end_ns, one.load) for one in acting if one.end_ns > one.begin_ns]
    return load_history(impulses + pushes)


def _load_row(command: WrenchCommand, setup: Setup, name: str, time_ns: int) -> FloatArray:
    """The load (LOAD,) with its point in the tracked frame."""
    if command.frame.point[0] == "ray":
        where = f"at {1e-9 * time_ns:g} s {name} has a poke along a ray"
        raise InputError("session", f"{where}: the point it hit isn't in the log; end before it with --to")
    try:
        load = load_of_bytes(check_command(command, setup))
    except CommandRefused as refusal:
        raise InputError("session", f"{name} has a command that the simulation refuses: {refusal}") from None
    point = None if load.mesh_point is None else vector(load.arm(setup.body))
    if load.axes == "normal":
        return Load("body", point, vector(load.own_force(setup.body)), load.torque).row
    return Load(load.axes, point, load.force, load.torque).row
