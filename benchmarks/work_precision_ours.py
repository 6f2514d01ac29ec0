# SPDX-License-Identifier: MIT
"""Our integrators as contestants: the whole ``Simulation`` as a user runs it, and the bare compiled kernel.

``simulation`` times Simulation.advance: segments, commands and the look at the end included. ``kernel`` times what a peer's
step function is timed by: the integrator's own loop over steps, called once from Python.
"""

from __future__ import annotations

import sys
import time
from dataclasses import fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from peers import Contestant, Run
from problems import Problem, Wrench
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.problem import to_row
from rigid_proto_ros.motion.string import StringSettings
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.setup import Setup
from rigid_proto_ros.simulation.simulation import Simulation

ADAPTIVE = ("auto",)
"""Integrators that take an accuracy instead of a step."""


def our_version() -> str:
    """Version of the package, also when it runs from a checkout."""
    try:
        return version("rigid_proto_ros")
    except PackageNotFoundError:
        return "checkout"


def contestants() -> list[Contestant]:
    """Every integrator of the package, by the two ways of timing it."""
    found = []
    for name in INTEGRATORS:
        found.append(
            Contestant(
                "ours", our_version(), name, _bind(prepare_simulation, name), tolerance=name in ADAPTIVE, cost=0.4
            )
        )
        if name not in ADAPTIVE:
            found.append(Contestant("ours (kernel)", our_version(), name, _bind(prepare_kernel, name), cost=0.4))
    return found


def _bind(prepare, name):
    return lambda problem, step: prepare(problem, step, name)


def setup_of(problem: Problem, integrator: str, step: float, accuracy: float = 1e-9) -> Setup:
    """The problem as a Setup; ``step`` [s]."""
    values = {
        "body": make_body(problem.mass, np.zeros(3), np.array(problem.inertia)),
        "inertia_model": "explicit",
        "surface": None,
        "geometry": ("",),
        "contacts": {},
        "gravity": np.array(problem.gravity),
        "linear_damping": problem.linear_damping,
        "angular_damping": problem.angular_damping,
        "gyroscopic": True,
        "integrator": INTEGRATORS[integrator],
        "step_ns": round(step * 1e9),
        "accuracy": accuracy,
        "wrench_timeout_ns": 0,
        "poke_duration_ns": 50_000_000,
        "string": _string(problem),
        "initial": np.array(problem.row),
    }
    return Setup(**{f.name: values[f.name] for f in fields(Setup) if f.name in values})


def _string(problem: Problem) -> StringSettings:
    s = problem.spring
    if s is None:
        return StringSettings()
    return StringSettings(
        attached=True,
        attach=s.point,
        target=s.target,
        stiffness=s.stiffness,
        damping_ratio=s.damping_ratio,
        rest_length=s.rest_length,
        bilateral=s.bilateral,
    )


def commands_of(wrenches: tuple[Wrench, ...]) -> list[tuple[WrenchCommand, int]]:
    """The problem's wrenches as commands and their exact times [ns]; one without an end is held."""
    commands = []
    for w in wrenches:
        frame = f"{w.axes}@point/{','.join(repr(float(c)) for c in w.point)}"
        if w.impulse:
            frame += ";impulse"
        elif w.end is not None:
            frame += f";duration={(round(w.end * 1e9) - round(w.begin * 1e9)) / 1e9!r}"
        held = w.end is None and not w.impulse
        command = WrenchCommand(held, parse_frame(frame), w.force, w.torque, frame)
        commands.append((command, round(w.begin * 1e9)))
    return commands


def simulation_of(problem: Problem, integrator: str, step: float, accuracy: float = 1e-9) -> Simulation | None:
    """A Simulation at time 0 with the problem's commands submitted, or None when the integrator can't carry it."""
    try:
        simulation = Simulation(setup_of(problem, integrator, step, accuracy))
        for command in commands_of(problem.wrenches):
            simulation.submit(*command)
        simulation.advance(0)
    except InputError:
        return None
    return simulation


def prepare_simulation(problem: Problem, step: float, integrator: str) -> Run | None:
    """The whole simulation; ``step`` is the accuracy for an adaptive integrator."""
    adaptive = integrator in ADAPTIVE
    arguments = (1e-3, step) if adaptive else (step, 1e-9)
    simulation = simulation_of(problem, integrator, *arguments)
    if simulation is None:
        return None
    begin = time.perf_counter()
    simulation.advance(round(min(problem.duration, 10 * arguments[0]) * 1e9))
    compile_s = time.perf_counter() - begin
    commands = commands_of(problem.wrenches)

    def restart():
        # The same object from its start, as a peer's integrator is set back.
        simulation.reset()
        for command in commands:
            simulation.submit(*command)

    def advance(until: float):
        simulation.advance(round(until * 1e9))

    def row():
        if simulation.failure or simulation.refused:
            return np.full(13, np.nan)
        return simulation.state.row.copy()

    restart()
    if simulation.refused:
        return None
    return Run(restart, advance, row, lambda: simulation.steps, compile_s)


def prepare_kernel(problem: Problem, step: float, integrator: str) -> Run | None:
    """The compiled loop alone, on problems of one segment whose end is a whole number of steps away."""
    steps = round(problem.duration / step)
    one_segment = all(w.end is None and w.begin == 0.0 and not w.impulse for w in problem.wrenches)
    if not one_segment or abs(steps * step - problem.duration) > 1e-9:
        return None
    simulation = simulation_of(problem, integrator, step)
    if simulation is None or simulation.refused:
        return None
    # A command at time 0 acts with the first advance beyond it.
    simulation.advance(1)
    flight = simulation.flight
    p, kernel = flight.problem, INTEGRATORS[integrator].kernel
    if kernel is None:
        return None
    begin = time.perf_counter()
    start = flight.variables.copy()
    kernel(start.copy(), p, 1e-9, 1)
    compile_s = time.perf_counter() - begin
    now = {}

    def restart():
        now.update(y=start.copy(), done=0)

    def advance(until: float):
        wanted = round(until / step) - now["done"]
        now["good"] = kernel(now["y"], p, step, wanted) == wanted
        now["done"] += wanted

    def row():
        out = np.full(13, np.nan)
        if now["good"]:
            to_row(now["y"], p, now["done"] * step, out)
        return out

    restart()
    return Run(restart, advance, row, lambda: now["done"], compile_s)
