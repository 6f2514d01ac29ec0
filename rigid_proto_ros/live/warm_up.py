# SPDX-License-Identifier: MIT
"""Kernels compiled, or loaded from the cache, before a command waits for them."""

from __future__ import annotations

from dataclasses import replace

from ..base.errors import CommandRefused
from ..motion.frames import parse_frame
from ..motion.state import State, shift_com
from ..simulation.commands import Command, MoveString, WrenchCommand
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation


def warm_up(setup: Setup) -> State:
    """Fly this setup for a moment under a command of each kind that its integrator supports; returns the last state."""
    spinning = setup.initial.copy()
    spinning[10:13] += (0.1, 0.2, 0.3)
    force = (1e-9 * setup.body.mass, 0.0, 0.0)
    commands: list[Command] = [MoveString(tuple(setup.initial[:3].tolist()))]
    for frame in ("world@origin;duration=0.01", "body@origin;duration=0.01", "world@origin;impulse"):
        commands.append(WrenchCommand(False, parse_frame(frame), force, (0.0, 0.0, 0.0), frame))
    for command in commands:
        trial = Simulation(replace(setup, initial=spinning))
        try:
            trial.submit(command)
        except CommandRefused:
            continue  # an integrator that doesn't support it will refuse it in flight too
        for until_ns in (1_000_000, 2_000_001):
            trial.advance(until_ns)
    # Used by changes in flight that move the COM, by ~/imu and by /diagnostics.
    shift_com(trial.state.row, 0.0, 0.0, 0.0)
    trial.specific_force((0.0, 0.0, 0.0))
    _ = trial.kinetic_energy, trial.angular_momentum
    return trial.state
