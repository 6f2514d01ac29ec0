# SPDX-License-Identifier: MIT
"""Short ways for tests to set up a flight without parameters or files."""

from __future__ import annotations

import numpy as np

from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.body import Body, make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.integrators import integrator_named
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.observer import Logged, Observer
from rigid_proto_ros.simulation.setup import Setup, check_start
from rigid_proto_ros.simulation.simulation import Simulation

SECOND = 10**9
AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Heard(Observer):
    """Keeps the events of some kinds, in the order in which they came."""

    def __init__(self, *kinds: type) -> None:
        self.takes = frozenset(kinds)
        self.events: list = []

    def on(self, event) -> None:
        if type(event) in self.takes:
            self.events.append(event)

    def of(self, kind: type) -> list:
        return [event for event in self.events if type(event) is kind]


class EventLines(Heard):
    """Keeps the lines of the event log with their times [ns]."""

    def __init__(self) -> None:
        super().__init__(Logged)

    @property
    def timed(self) -> list[tuple[int, str]]:
        return [(event.time_ns, event.line) for event in self.events]

    @property
    def lines(self) -> list[str]:
        return [event.line for event in self.events]


def bundled_body(name: str) -> Body:
    """The bundled mesh as a solid of 1000 kg/m³."""
    mesh = load_mesh(name)
    properties = MeshMoments(mesh.vertices, mesh.triangles).mass_properties("solid")
    return make_body(properties.mass, properties.center_of_mass, properties.inertia)


def flight_setup(body: Body, *, integrator: str = "rk4", step_s: float = 1e-3, initial=AT_REST, **changes) -> Setup:
    """A Setup of this body; initial (13,): x, q xyzw, v, ω body."""
    values = {
        "body": body,
        "inertia_model": "explicit",
        "surface": None,
        "geometry": ("",),
        "contacts": {},
        "gravity": np.zeros(3),
        "linear_damping": 0.0,
        "angular_damping": 0.0,
        "gyroscopic": True,
        "integrator": integrator_named(integrator),
        "step_ns": round(step_s * SECOND),
        "wrench_timeout_ns": 0,
        "poke_duration_ns": 50_000_000,
        "initial": np.array(initial, dtype=float),
    }
    return Setup(**{**values, **changes})


def flight(body: Body, **values) -> Simulation:
    """A Simulation of ``flight_setup(body, **values)``, which is checked as that of a scene."""
    setup = flight_setup(body, **values)
    check_start(setup)
    return Simulation(setup)


def spinning(angular_velocity_body, orientation_xyzw=(0.0, 0.0, 0.0, 1.0)) -> np.ndarray:
    """A state row (13,) at the origin that only spins."""
    return np.array([0.0, 0.0, 0.0, *orientation_xyzw, 0.0, 0.0, 0.0, *angular_velocity_body])


def wrench(frame: str, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0), *, held: bool = True) -> WrenchCommand:
    """A wrench command as its message would give it."""
    return WrenchCommand(held, parse_frame(frame), tuple(force), tuple(torque), frame)
