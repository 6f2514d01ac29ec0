# SPDX-License-Identifier: MIT
"""The ghost that a scene asks for: the body under another tensor or integrator, given the same commands, beside the first.

It is computed here, from what the page hears: the state that it begins with, and every event since.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..core.commands import Change, ClearWrench, Command, ReleaseString, WrenchCommand
from ..core.errors import InputError
from ..core.frames import parse_frame
from ..core.setup import Setup
from ..core.simulation import Simulation
from ..core.state import State
from ..poke_script import string_attach, string_target
from ..scenario import Scenario

LONGEST_NS = 1_000_000_000
"""[ns] That it is carried over at once; a page that slept for longer begins anew."""


class Shadow:
    """Follows one flight. ``begin`` with each reset, or where the page comes in."""

    def __init__(self) -> None:
        self._simulation: Simulation | None = None
        self._setup: Setup | None = None
        self._offset_ns = 0

    @property
    def center_of_mass(self) -> np.ndarray | None:
        """Of its own tensor (3,) [m, scaled mesh coordinates]; None while there is none."""
        return None if self._simulation is None else self._simulation.setup.body.center_of_mass

    def begin(self, scenario: Scenario, state: State) -> None:
        """Beside the body, at ``state``; nowhere, where the scene asks for no ghost."""
        self._setup = scenario.ghost
        self._offset_ns = state.time_ns
        self._simulation = None
        if scenario.ghost is not None:
            at_start = state.time_ns == 0
            initial = scenario.ghost.initial if at_start else _beside(scenario, state)
            self._simulation = Simulation(replace(scenario.ghost, initial=initial))

    def changed(self, scenario: Scenario, state: State) -> None:
        """Parameters changed at ``state``."""
        if self._simulation is None or scenario.ghost is None:
            if scenario.ghost is not self._setup:
                self.begin(scenario, state)
            return
        setup = self._setup = scenario.ghost
        self._submit(Change({}, lambda: setup), state.time_ns)

    def event(self, line: dict, scenario: Scenario) -> None:
        """A line of the event log."""
        if self._simulation is not None:
            try:
                command = _command(line["kind"], line["content"], scenario)
            except InputError:
                return
            if command is not None:
                self._submit(command, line["time_ns"])

    def _submit(self, command: Command, time_ns: int) -> None:
        try:
            self._simulation.submit(command, max(time_ns - self._offset_ns, self._simulation.time_ns))
        except InputError:
            pass  # what its integrator can't carry passes it by

    def row(self, time_ns: int) -> np.ndarray | None:
        """Its state (13,) at the node's ``time_ns``, or None."""
        simulation = self._simulation
        until_ns = time_ns - self._offset_ns
        if simulation is None or simulation.failure or until_ns < simulation.time_ns:
            return None
        if until_ns > simulation.time_ns + LONGEST_NS:
            self._simulation = None
            return None
        return simulation.advance(until_ns).row


def _beside(scenario: Scenario, state: State) -> np.ndarray:
    """The state of a body whose mesh lies where the first one's does, and moves alike: its COM may be another point of it."""
    apart = state.rotation @ (scenario.ghost.body.center_of_mass - scenario.setup.body.center_of_mass)
    row = state.row.copy()
    row[0:3] += apart
    row[7:10] += np.cross(state.angular_velocity, apart)
    return row


def _command(kind: str, content: dict, scenario: Scenario) -> Command | None:
    if kind == "string_attach":
        return string_attach(0, content["axes"], content["point"])
    if kind == "string_target":
        return string_target(0, "world", content["point"])
    if kind == "string_release":
        return ReleaseString()
    if kind == "clear_wrench":
        return ClearWrench()
    if kind in ("wrench", "poke"):
        values = scenario.values
        names = (values["world_frame"], values["body_frame"] or "body")
        frame = parse_frame(content["frame_id"], frozenset(scenario.setup.contacts), *names)
        force, torque = tuple(content["force"]), tuple(content["torque"])
        return WrenchCommand(kind == "wrench", frame, force, torque, 0, content["frame_id"], b"")
    return None
