# SPDX-License-Identifier: MIT
"""Every parameter, declared once: its type, ROS descriptors, the command line's help and the table in the
docs come from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

from ..base.errors import CommandRefused, InputError, did_you_mean
from ..mass import INERTIA_MODELS, MODEL_COMS
from ..motion import INTEGRATOR_FILES
from ..motion.frames import check_contact_name
from .declaration import (
    AT_RESET,
    HUGE,
    READ_ONLY,
    Parameter,
    Value,
    declared,
    number,
    numbers,
    port,
    switch,
    text,
    whole,
)

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
PointMass = tuple[float, float, float, float]
ThrusterNumbers = tuple[float, ...]
Noise = tuple[float, float, float, float]
Tensor = tuple[float, float, float, float, float, float]

ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class ExplicitInertia:
    """The body by numbers, for ``inertia_model`` explicit."""

    mass: float = number(1.0, "Mass of the explicit model.", "kg", lower=0.0, upper=HUGE, above=True)
    center_of_mass: Vector = numbers(ZERO, "Centre of mass of the explicit model, in mesh coordinates.", "mesh units")
    tensor: Tensor = numbers(
        (1.0, 0.0, 0.0, 1.0, 0.0, 1.0),
        "Tensor of the explicit model about its centre of mass: ixx ixy ixz iyy iyz izz.",
        "kg m²",
    )


@dataclass(frozen=True, slots=True)
class ThrusterRules:
    """What holds for all thrusters."""

    bidirectional: bool = switch(
        False,
        "Thrusters push both ways, up to their limit of either sign; else from 0 to their limit.",
        changes=READ_ONLY,
    )
    minimum_on_time: float = number(
        0.0, "Once on, a thruster pushes at least so long.", "s", lower=0.0, upper=1e9, changes=READ_ONLY
    )


@dataclass(frozen=True, slots=True)
class InitialState:
    """What the body does at time 0."""

    position: Vector = numbers(ZERO, "Position of the centre of mass at time 0, world axes.", "m", changes=AT_RESET)
    orientation_xyzw: Quaternion = numbers(
        (0.0, 0.0, 0.0, 1.0), "Attitude at time 0, body to world; normalized.", changes=AT_RESET
    )
    linear_velocity: Vector = numbers(
        ZERO, "Velocity of the centre of mass at time 0, world axes.", "m/s", changes=AT_RESET
    )
    angular_velocity: Vector = numbers(ZERO, "Angular velocity at time 0, world axes.", "rad/s", changes=AT_RESET)
    string_mass: float = number(
        0.0,
        "Effective mass that stiffness and damping of a string tied at time 0 are taken from; 0 is that of the body as "
        "it lies then.",
        "kg",
        lower=0.0,
        upper=HUGE,
        changes=AT_RESET,
    )


@dataclass(frozen=True, slots=True)
class StringParameters:
    """The string."""

    attached: bool = switch(False, "The string is tied from the start, without a timeout.")
    attach: Vector = numbers(ZERO, "Where it is tied, in mesh coordinates.", "mesh units")
    target: Vector = numbers(ZERO, "Where its free end is while it is tied from the start, world axes.", "m")
    stiffness: float = number(50.0, "Stiffness of the string.", "N/m", lower=0.0, upper=1e30)
    frequency: float = number(
        0.0,
        "Above 0 it takes precedence over stiffness: angular frequency of the effective mass on the string, so that "
        "light and heavy bodies respond alike.",
        "rad/s",
        lower=0.0,
        upper=1e15,
    )
    damping_ratio: float = number(0.1, "Damping of the string relative to critical.", lower=0.0, upper=1e6)
    rest_length: float = number(0.0, "Length up to which the string doesn't pull.", "m", lower=0.0, upper=1e30)
    bilateral: bool = switch(False, "The string pushes too, as a spring does.")
    timeout: float = number(
        1.0, "The string is released this long after the last target message; 0 never.", "s", lower=0.0, upper=1e9
    )


@dataclass(frozen=True, slots=True)
class NoiseParameters:
    """What published messages err; the motion stays exact."""

    imu: Noise = numbers(
        (0.0, 0.0, 0.0, 0.0),
        "Errors in ~/imu: densities of white noise of angular velocity and specific force [per √Hz], then the standard "
        "deviations of their biases.",
        "rad/s, m/s²",
        lower=0.0,
    )
    state: Noise = numbers(
        (0.0, 0.0, 0.0, 0.0),
        "Densities of white noise [per √Hz] of position, attitude, velocity and angular velocity in ~/pose, ~/twist, "
        "~/odom; the attitude's in ~/imu too.",
        "m, rad, m/s, rad/s",
        lower=0.0,
    )
    seed: int = whole(
        0, "Seed of the noise: the same seed gives the same errors at the same stamps.", lower=0, upper=2**62
    )


@dataclass(frozen=True, slots=True)
class GhostParameters:
    """What differs of the ghost; it is shown where one is given."""

    inertia_model: str = text(
        "",
        "Show a ghost beside the body, from time 0 or the next reset on, that gets the same commands under this "
        "inertia model.",
        choices=("", *INERTIA_MODELS),
    )
    integrator: str = text(
        "",
        "Show a ghost, from time 0 or the next reset on, that gets the same commands under this integrator.",
        choices=("", *INTEGRATOR_FILES),
    )


@dataclass(frozen=True, slots=True)
class Parameters:
    """A value for every parameter. ``string.stiffness`` of files, ROS and command line is
    ``parameters.string.stiffness`` here.

    ``replaced`` makes one from values by name, with all checks; ``named`` gives those back. contacts: named points of
    the body. ballast: point masses by name. thrusters: point, direction and limit by name. All in mesh
    coordinates.
    """

    mesh: str = text(
        "t_handle",
        "Mesh of the body: a path, a package:// URI or a bundled name; empty only with the explicit inertia model.",
    )
    mesh_repair: bool = switch(False, "Orient, weld and cap a mesh that isn't closed, as with inspect --repair.")
    mesh_fallback: str = text(
        "",
        "Fallback shape for a mesh that encloses no volume, as with inspect --fallback.",
        choices=("", "hull", "box"),
    )
    scale: tuple[float, ...] = numbers(
        (1.0, 1.0, 1.0),
        "Mesh coordinates times scale are metres; one number or one per axis, a negative one mirrors.",
        "m per mesh unit",
        lower=-1e9,
        upper=1e9,
        lengths=(1, 3),
    )
    mass: float = number(
        0.0,
        "Mass; above 0 it takes precedence over density and doesn't change with scale.",
        "kg",
        lower=0.0,
        upper=HUGE,
    )
    density: float = number(
        1000.0, "Density of the solid; setting it sets mass to 0.", "kg/m³", lower=0.0, upper=HUGE, above=True
    )
    inertia_model: str = text(
        "solid",
        "Model of the mass distribution, from which the inertia tensor follows.",
        choices=INERTIA_MODELS,
    )
    inertia_model_com: str = text(
        "model",
        "Where the model's centre of mass lies: where the model has it, or where the true solid has it, so that what "
        "the tensor does is seen alone; explicit numbers keep theirs.",
        choices=MODEL_COMS,
    )
    explicit_inertia: ExplicitInertia = ExplicitInertia()
    gyroscopic: bool = switch(True, "Keep the term ω × Iω; without it the motion isn't that of a rigid body.")
    gravity: Vector = numbers(ZERO, "Acceleration of gravity, world axes.", "m/s²")
    linear_damping: float = number(
        0.0, "Damping force at the centre of mass per velocity.", "N s/m", lower=0.0, upper=HUGE
    )
    angular_damping: float = number(0.0, "Damping torque per angular velocity.", "N m s", lower=0.0, upper=HUGE)
    initial: InitialState = InitialState()
    integrator: str = text(
        "auto",
        "Integrator of the motion; auto picks the cheapest that meets accuracy.",
        choices=tuple(INTEGRATOR_FILES),
    )
    step: float = number(
        0.001, "Step of fixed-step integrators, rounded to the nearest nanosecond.", "s", lower=1e-9, upper=1e5
    )
    accuracy: float = number(
        1e-9,
        "Local error a second that auto allows: angle, displacement per half diagonal, relative velocities.",
        "1/s",
        lower=1e-16,
        upper=1.0,
        above=True,
    )
    publish_rate: float = number(100.0, "States published per simulated second.", "1/s", lower=1e-6, upper=1e4)
    real_time_factor: float = number(
        1.0, "Simulated seconds per second of the wall clock; 0 runs as fast as possible.", lower=0.0, upper=1e6
    )
    lockstep: bool = switch(
        False,
        "While paused, each message taken from ~/wrench or ~/thrusters steps the simulation, as ~/step does; "
        "without its round trip.",
    )
    start_paused: bool = switch(False, "Start paused.", changes=READ_ONLY)
    wrench_timeout: float = number(
        1.5,
        "A held wrench ends this long after its last message; 0 holds it until it is replaced.",
        "s",
        lower=0.0,
        upper=1e9,
    )
    poke_duration: float = number(0.05, "Duration of a poke that states none.", "s", lower=1e-9, upper=1e9)
    schedule_horizon: float = number(
        3600.0, "How far ahead of simulated time a command's stamp may lie.", "s", lower=0.0, upper=1e9
    )
    string: StringParameters = StringParameters()
    publish_clock: bool = switch(False, "Publish simulated time on /clock.")
    publish_tf: bool = switch(False, "Publish the body's frame on /tf (where tf2_msgs is installed).")
    imu_contact: str = text("", "Contact at which ~/imu measures; empty means the centre of mass.")
    noise: NoiseParameters = NoiseParameters()
    ghost: GhostParameters = GhostParameters()
    world_frame: str = text("world", "Name of the world frame in published messages.", changes=READ_ONLY)
    body_frame: str = text(
        "", "Name of the body's frame in published messages; empty means the node's name.", changes=READ_ONLY
    )
    record: str = text("", "Record the session to this .rrd (Rerun) or .mcap (bag) file; empty records nothing.")
    viewer: str = text(
        "none",
        "Show the motion live: web in Rerun in the browser, native in Rerun's own window, workbench on the "
        "interactive page.",
        choices=("none", "web", "native", "workbench"),
        changes=READ_ONLY,
    )
    rerun_port: int = port(9876, "Port on which the live view is served, on this machine only.")
    web_port: int = port(9090, "Port of the browser's viewer page, on this machine only.")
    workbench_port: int = port(8080, "Port of the interactive page, on this machine only.")
    thruster: ThrusterRules = ThrusterRules()
    contacts: Mapping[str, Vector] = field(default_factory=dict)
    ballast: Mapping[str, PointMass] = field(default_factory=dict)
    thrusters: Mapping[str, ThrusterNumbers] = field(default_factory=dict)

    def replaced(self, changes: Mapping[str, object]) -> Parameters:
        """With these changed, by name, each converted and checked by its declaration; raises InputError.

        A density that is set without a mass sets the mass, which would win, to 0.
        """
        groups: dict[str, dict[str, Any]] = {}
        for name, value in convert_all(with_mass_of_density(changes)).items():
            group, _, own = name.rpartition(".")
            groups.setdefault(group, {})[own] = tuple(value) if isinstance(value, list) else value
        top = groups.pop("", {})
        for group, values in groups.items():
            present = getattr(self, group)
            named_by_user = f"{group}." in PATTERNS
            top[group] = {**present, **values} if named_by_user else replace(present, **values)
        return replace(self, **top)

    def named(self) -> dict[str, Value]:
        """Every value by its dotted name, as files and ROS have it."""
        values: dict[str, Any] = {name: value_of(self) for name, value_of in _VALUE_OF.items()}
        for prefix in PATTERNS:
            group = prefix.removesuffix(".")
            values |= {f"{prefix}{own}": value for own, value in getattr(self, group).items()}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @property
    def point_masses(self) -> list[PointMass]:
        """The ballast in the order in which it is added to the body: sums depend on it."""
        return [mass for _, mass in sorted(self.ballast.items())]


PARAMETERS: dict[str, Parameter] = declared(Parameters())
_VALUE_OF = {name: attrgetter(name) for name in PARAMETERS}

PATTERNS: dict[str, Parameter] = {
    "contacts.": Parameter(
        "contacts.<name>",
        "doubles",
        None,
        "A named point of the body, in mesh coordinates.",
        "mesh units",
        -HUGE,
        HUGE,
        lengths=(3,),
        changes=READ_ONLY,
    ),
    "ballast.": Parameter(
        "ballast.<name>",
        "doubles",
        None,
        "A point mass added to the body: kg, then x, y, z in mesh coordinates.",
        "kg, mesh units",
        -HUGE,
        HUGE,
        lengths=(4,),
    ),
    "thrusters.": Parameter(
        "thrusters.<name>",
        "doubles",
        None,
        "A thruster on the body, commanded by ~/thrusters: x, y, z and the direction of its force in mesh coordinates; "
        "behind them, where wanted, the largest force (0 for any).",
        "mesh units, N",
        -HUGE,
        HUGE,
        lengths=(6, 7),
        changes=READ_ONLY,
    ),
}
"""Parameters with a name of the user's choice."""


def parameter_named(name: str) -> Parameter:
    """The declaration behind a name; raises InputError with the nearest known name."""
    if name in PARAMETERS:
        return PARAMETERS[name]
    for prefix, pattern in PATTERNS.items():
        own = name.removeprefix(prefix)
        if own != name and "." not in own:
            try:
                check_contact_name(own)
            except CommandRefused as error:
                raise InputError(name, own, error.accepted) from None
            return replace(pattern, name=name)
    hint = did_you_mean(name, [*PARAMETERS, *PATTERNS])
    raise InputError("parameter", f"there is no parameter {name!r}{hint and '; ' + hint}")


ROS_PARAMETERS = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters that every rclpy node has, so a dump of one holds them; a name ending in a dot is a prefix."""


def is_ros_parameter(name: str) -> bool:
    """Whether the name is one that every rclpy node has."""
    return any(name == known or (known.endswith(".") and name.startswith(known)) for known in ROS_PARAMETERS)


def convert_all(values: Mapping[str, object]) -> dict[str, Value]:
    """Convert and check each value by its declaration; raises InputError."""
    return {name: parameter_named(name).convert(value) for name, value in values.items()}


def with_mass_of_density(changes: Mapping[str, object]) -> Mapping[str, object]:
    """The changes, with mass 0 where they set a density and no mass: the mass there was would win."""
    return {**changes, "mass": 0.0} if "density" in changes and "mass" not in changes else changes
