# SPDX-License-Identifier: MIT
"""Short ways for tests to set up a flight without parameters or files."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigid_proto_ros.base.compilation import copy_of, new_record
from rigid_proto_ros.base.vectors import Vector
from rigid_proto_ros.mass.properties import MeshMoments
from rigid_proto_ros.mass.tensor import six_from_tensor
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.body import Body, make_body
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.problem import begin_body
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.parameters.declarations import Parameters
from rigid_proto_ros.scene.scenario import scene_record
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.observer import Logged, Observer
from rigid_proto_ros.simulation.record import EXPLICIT, MESH
from rigid_proto_ros.simulation.setup import Setup, make_setup
from rigid_proto_ros.simulation.simulation import Simulation
from rigid_proto_ros.simulation.string_control import tie

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


class StringSettings(NamedTuple):
    """What a scene's record has of the string: stiffness [N/m], or a frequency [rad/s] if > 0; a timeout of 0 means never."""

    attached: bool = False
    attach: Vector = (0.0, 0.0, 0.0)
    target: Vector = (0.0, 0.0, 0.0)
    stiffness: float = 50.0
    frequency: float = 0.0
    damping_ratio: float = 0.1
    rest_length: float = 0.0
    bilateral: bool = False
    timeout_ns: int = SECOND


def flight_setup(
    body: Body, *, integrator: str = "rk4", step_s: float = 1e-3, initial=AT_REST, size: float = 0.0, **changes
) -> Setup:
    """A Setup of this body, as a scene with an explicit inertia has it; initial (13,): x, q xyzw, v, ω body.

    size: its length ℓ [m], where that isn't 1. changes: of a record SCENE, and ``string``.
    """
    values = {"wrench_timeout": 0.0, "string": StringSettings(), **changes}
    scene, mesh = scene_record(Parameters()), new_record(MESH)
    if size > 0.0:
        mesh.has_surface, mesh.extent[0] = True, 2.0 * size
    _write(scene, {"body": body, "integrator": integrator, "step": step_s, **values})
    return _with_start(scene, initial, mesh=mesh)


def changed(setup: Setup, *, initial=None, **changes) -> Setup:
    """The setup of a scene with some values changed, named as in ``flight_setup``."""
    scene = copy_of(setup.scene)
    _write(scene, changes)
    own = {name: getattr(setup, name) for name in ("mesh", "surface", "mesh_sha256", "contacts", "thrusters")}
    return _with_start(scene, setup.initial if initial is None else initial, **own)


def _write(scene: np.record, values: dict) -> None:
    """Write values by name into the record of a scene: ``body``, ``string`` and the record's own fields."""
    for name, value in values.items():
        if name == "body":
            scene.inertia_model, scene.scale = EXPLICIT, value.scale
            scene.explicit_inertia_mass = value.mass
            scene.explicit_inertia_center_of_mass = value.center_of_mass / value.scale
            scene.explicit_inertia_tensor = six_from_tensor(value.inertia)
        elif name == "string":
            own = value._asdict()
            scene.string_timeout = own.pop("timeout_ns") * 1e-9
            for field, number in own.items():
                scene[f"string_{field}"] = number
        elif name == "integrator":
            scene.integrator = list(INTEGRATORS).index(value)
        else:
            scene[name] = value


def _with_start(scene: np.record, row, **others) -> Setup:
    """The setup of a scene that starts in the state ``row`` (13,), to the bit: a scene has ω in world axes."""
    state = State(0, np.array(row, dtype=float))
    scene.initial_position, scene.initial_orientation_xyzw = state.position, state.orientation_xyzw
    scene.initial_linear_velocity, scene.initial_angular_velocity = state.linear_velocity, state.angular_velocity
    setup = make_setup(scene, **others)
    flight = setup.flight
    flight.row[:] = flight.start[:] = state.row
    if flight.tied:
        tie(scene, flight, scene.string_target, 0, scene.initial_string_mass)
    return setup


def put_body(setup: Setup, body: Body) -> None:
    """Let another body of the same size fly, also one that no rigid body can be."""
    setup.flight.body[:] = body.row
    begin_body(setup.flight.common, setup.flight.body, setup.scene, float(setup.scene.gyroscopic))


def flight(body: Body, **values) -> Simulation:
    """A Simulation of ``flight_setup(body, **values)``, whose events are chained."""
    return Simulation(flight_setup(body, **values), Observer())


def spinning(angular_velocity_body, orientation_xyzw=(0.0, 0.0, 0.0, 1.0)) -> np.ndarray:
    """A state row (13,) at the origin that only spins."""
    return np.array([0.0, 0.0, 0.0, *orientation_xyzw, 0.0, 0.0, 0.0, *angular_velocity_body])


def wrench(frame: str, force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0), *, held: bool = True) -> WrenchCommand:
    """A wrench command as its message would give it."""
    return WrenchCommand(held, parse_frame(frame), tuple(force), tuple(torque), frame)
