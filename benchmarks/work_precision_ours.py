# SPDX-License-Identifier: MIT
"""Our integrators as contestants: the whole ``Simulation`` as a user runs it, and the bare compiled kernel.

``simulation`` times Simulation.advance: segments, commands and the look at the end included. ``kernel`` times what a peer's
step function is timed by: the compiled loop over steps, called once from Python.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test")]

from flights import StringSettings, flight_setup

from peers import Contestant, Run
from problems import Problem, Wrench
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.base.yaml_text import plain
from rigid_proto_ros.motion.body import make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.effects import BEGIN
from rigid_proto_ros.simulation.flight import steps_of_segment
from rigid_proto_ros.simulation.setup import Setup
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.sweep.flights import Flight, Scene, read_command

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
    return flight_setup(
        make_body(problem.mass, np.zeros(3), np.array(problem.inertia)),
        integrator=integrator,
        step_s=step,
        initial=problem.row,
        accuracy=accuracy,
        gravity=problem.gravity,
        linear_damping=problem.linear_damping,
        angular_damping=problem.angular_damping,
        string=_string(problem),
    )


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
    return Run(restart, advance, row, lambda: simulation.steps)


def scene_of(problem: Problem, accuracy: float) -> Scene:
    """The problem as a scene for ``Flight``."""
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = np.array(problem.inertia).tolist()
    row = problem.row
    values = {
        "mesh": "",
        "inertia_model": "explicit",
        "explicit_inertia.mass": problem.mass,
        "explicit_inertia.tensor": [ixx, ixy, ixz, iyy, iyz, izz],
        "initial.position": row[:3],
        "initial.orientation_xyzw": row[3:7],
        "initial.linear_velocity": row[7:10],
        "initial.angular_velocity": rotate(*row[3:7], *row[10:13]),
        "gravity": problem.gravity,
        "linear_damping": problem.linear_damping,
        "angular_damping": problem.angular_damping,
        "accuracy": accuracy,
        "wrench_timeout": 0.0,
        "string.timeout": 0.0,
    }
    if problem.spring is not None:
        string = _string(problem)
        names = ("attached", "attach", "target", "stiffness", "damping_ratio", "rest_length", "bilateral")
        values |= {f"string.{name}": getattr(string, name) for name in names}
    return make_scenario(plain(values))


def prepare_flight(problem: Problem, accuracy: float) -> Run:
    """A ``Flight`` that begins again, as a user of Python flies it many times: commands are read once."""
    flight, commands = Flight(scene_of(problem, accuracy)), []
    for w in problem.wrenches:
        at, begin = {"at": {"point": list(map(float, w.point))}, "axes": w.axes}, float(w.begin)
        force, torque = list(map(float, w.force)), list(map(float, w.torque))
        if w.impulse:
            commands.append(read_command({"t": begin, **at, "impulse": force, "angular_impulse": torque}))
        elif w.end is None:
            commands.append(read_command({"t": begin, "wrench": {**at, "force": force, "torque": torque}}))
        else:
            duration = (round(w.end * 1e9) - round(w.begin * 1e9)) / 1e9
            commands.append(read_command({"t": begin, **at, "force": force, "torque": torque, "duration": duration}))

    # Setting back, commanding and simulating are one call.
    return Run(lambda: None, lambda until: flight.fly(commands, until), lambda: flight.sample().row, lambda: 0)


@dataclass
class Segment:
    """The first segment of a problem's flight, by the compiled loop alone. fly(until_ns): one call; returns whether it came
    there. row (13,): the state then.
    """

    simulation: Simulation
    restart: Callable[[], None]
    fly: Callable[[int], bool]
    row: np.ndarray


def first_segment(problem: Problem, integrator: str, step: float, accuracy: float = 1e-9) -> Segment | None:
    """A problem of one segment; None where there are more, or where the integrator can't carry it."""
    if not all(w.end is None and w.begin == 0.0 and not w.impulse for w in problem.wrenches):
        return None
    simulation = simulation_of(problem, integrator, step, accuracy)
    if simulation is None or simulation.refused:
        return None
    # A command at time 0 acts with the first advance beyond it.
    simulation.advance(1)
    arrays = simulation._arrays
    begun = np.array(arrays.integers)

    def restart():
        arrays.integers[:] = begun.data
        arrays.call(BEGIN, 0)

    return Segment(simulation, restart, arrays.fly, arrays.row)


def prepare_kernel(problem: Problem, step: float, integrator: str) -> Run | None:
    """The compiled loop alone, on problems of one segment whose end is a whole number of steps away."""
    steps = round(problem.duration / step)
    if integrator in ADAPTIVE or abs(steps * step - problem.duration) > 1e-9:
        return None
    segment = first_segment(problem, integrator, step)
    if segment is None:
        return None
    now = {}

    def advance(until: float):
        now["good"] = segment.fly(round(until * 1e9))

    def row():
        return segment.row.copy() if now["good"] else np.full(13, np.nan)

    return Run(segment.restart, advance, row, lambda: int(steps_of_segment(segment.simulation.flight)))
