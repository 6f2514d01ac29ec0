# SPDX-License-Identifier: MIT
"""Kernels compiled, or loaded from the cache, before a command waits for them."""

from __future__ import annotations

from dataclasses import replace

from ..base.errors import CommandRefused
from ..motion.frames import parse_frame
from ..motion.state import State
from ..scene.scenario import Scenario
from ..simulation.commands import Command, MoveString, WrenchCommand
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation


def warm_up(setup: Setup) -> State:
    """Fly this setup for a moment under a command of each kind that its integrator supports; returns the last state."""
    force, none = (1e-9 * setup.body.mass, 0.0, 0.0), (0.0, 0.0, 0.0)
    spinning = setup.initial.copy()
    spinning[10:13] += (0.1, 0.2, 0.3)

    def wrench(frame: str) -> WrenchCommand:
        return WrenchCommand(False, parse_frame(frame), force, none, 0, frame, b"")

    commands: list[Command] = [
        wrench(f) for f in ("world@origin;duration=0.01", "body@origin;duration=0.01", "world@origin;impulse")
    ]
    commands.append(MoveString(tuple(setup.initial[:3].tolist())))
    for command in commands:
        trial = Simulation(replace(setup, initial=spinning))
        try:
            trial.submit(command)
        except CommandRefused:
            continue  # an integrator that doesn't support it will refuse it in flight too
        for until_ns in (1_000_000, 2_000_001):
            trial.advance(until_ns)
    return trial.state


def warm_up_change(before: Scenario, after: Scenario) -> None:
    """What flies this setup and its ghost after a change of integrator."""
    for old, new in ((before.setup, after.setup), (before.ghost, after.ghost)):
        if new is not None and (old is None or new.integrator is not old.integrator):
            try:
                warm_up(new)
            except CommandRefused:
                pass  # what acts when the change is made decides whether it is refused, and that is counted
