# SPDX-License-Identifier: MIT
"""Kernels compiled, or loaded from the cache, before a command waits for them.

``python -m rigid_proto_ros.live.warm_up`` compiles auto's integrators and ends.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np

from ..base.errors import CommandRefused
from ..base.interrupts import end_with_this_thread, with_this_package
from ..motion.frames import parse_frame
from ..motion.integrators import INTEGRATORS, auto
from ..motion.integrators.stepping import method_table, provide_kernel
from ..motion.state import State, shift_com
from ..motion.string import StringSettings
from ..scene.scenario import Scenario
from ..simulation.commands import Command, MoveString, WrenchCommand
from ..simulation.setup import Setup
from ..simulation.simulation import Simulation


def warm_up(setup: Setup) -> State:
    """Fly this setup for a moment under a command of each kind that its integrator supports; returns the last state."""
    spinning = setup.initial.copy()
    spinning[10:13] += (0.1, 0.2, 0.3)

    frames = ("world@origin;duration=0.01", "body@origin;duration=0.01", "world@origin;impulse")
    commands: list[Command] = [_small_wrench(setup, frame) for frame in frames]
    commands.append(MoveString(tuple(setup.initial[:3].tolist())))
    for command in commands:
        trial = Simulation(replace(setup, initial=spinning))
        try:
            trial.submit(command)
        except CommandRefused:
            continue  # an integrator that doesn't support it will refuse it in flight too
        for until_ns in (1_000_000, 2_000_001):
            trial.advance(until_ns)
    # Taken by changes in flight that move the COM.
    shift_com(trial.state.row, 0.0, 0.0, 0.0)
    return trial.state


def _small_wrench(setup: Setup, frame: str) -> WrenchCommand:
    return WrenchCommand(False, parse_frame(frame), (1e-9 * setup.body.mass, 0.0, 0.0), (0.0, 0.0, 0.0), frame)


def warm_up_change(before: Scenario, after: Scenario) -> None:
    """What flies this setup and its ghost after a change of integrator."""
    for old, new in ((before.setup, after.setup), (before.ghost, after.ghost)):
        if new is not None and (old is None or new.integrator is not old.integrator):
            try:
                warm_up(new)
            except CommandRefused:
                pass  # what acts when the change is made decides whether it is refused, and that is counted


def compile_flight(setup: Setup) -> None:
    """Compile what every flight needs under any integrator: a body of this setup rests, and no integrator is called."""
    at_rest = setup.initial.copy()
    at_rest[7:13] = 0.0
    resting = replace(
        setup,
        initial=at_rest,
        gravity=np.zeros(3),
        string=StringSettings(),
        thrusters={},
        gyroscopic=True,
        integrator=INTEGRATORS["auto"],
    )
    trial = Simulation(resting)
    # Checked when it is taken; it doesn't come to act.
    trial.submit(_small_wrench(setup, "world@origin"), 2_000_000)
    trial.advance(1_000_000)
    # What a node publishes of a state.
    trial.specific_force((0.0, 0.0, 0.0))
    _ = trial.kinetic_energy, trial.angular_momentum


def compile_integrators() -> None:
    """Compile auto's integrators."""
    table = method_table(auto.AUTO, 0)
    for kind in (auto.STEADY, auto.FREE, auto.TURNING_LOADS, auto.ANY_LOADS):
        provide_kernel(auto.AUTO, table, kind)


class IntegratorsCompiling:
    """``compile_integrators`` in a process of its own. It shares few kernels with ``compile_flight`` and takes about as
    long, so that a first start with both side by side takes little more than half as long.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def begin(self) -> None:
        """Start the process, where there is a second core for it."""
        if hasattr(os, "sched_getaffinity") and len(os.sched_getaffinity(0)) < 2:
            return
        self._process = subprocess.Popen(
            [sys.executable, "-m", "rigid_proto_ros.live.warm_up"],
            env=with_this_package(),
            preexec_fn=end_with_this_thread(),  # which waits for it below
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,  # what it doesn't compile, this process will, and says what is wrong
        )

    def wait(self, setup: Setup) -> None:
        """Compile what flies this setup meanwhile; returns when both are done, at once where nothing was begun."""
        if self._process is not None:
            compile_flight(setup)
            self._process.wait()


if __name__ == "__main__":
    compile_integrators()
