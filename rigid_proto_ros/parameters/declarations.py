# SPDX-License-Identifier: MIT
"""Every parameter, declared once. Its type, the ROS descriptors, the command line's help and the table in the docs are
derived from these declarations.
"""

from __future__ import annotations

import dataclasses
import math
import re
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np

from ..base.errors import CommandRefused, InputError, did_you_mean
from ..mass import INERTIA_MODELS, INFILL, MODEL_COMS, WALL_THICKNESS
from ..motion import INTEGRATOR_NAMES
from ..motion.frames import check_contact_name

LIVE, AT_RESET, READ_ONLY = "live", "at the next reset", "read-only"

HUGE = 1e100
"""Bound of positions, speeds and forces: squares stay finite."""

Value = bool | int | float | str | list[float]
"""A parameter's value as files and ROS have it."""

Vector = tuple[float, float, float]
Four = tuple[float, float, float, float]
Tensor = tuple[float, float, float, float, float, float]

ZERO = (0.0, 0.0, 0.0)

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z")

# Declaration of a parameter


@dataclass(frozen=True)
class Parameter:
    """type: ``double``, ``doubles``, ``integer``, ``bool`` or ``string``, one of the ``choices``. lower
    and upper are inclusive unless ``above``: then values must lie above lower. lengths: accepted
    lengths of ``doubles``. changes: LIVE, AT_RESET or READ_ONLY. default: None where the name is the user's choice.
    """

    name: str
    type: str
    default: Value | None
    description: str
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    above: bool = False
    lengths: tuple[int, ...] = ()
    choices: tuple[str, ...] = ()
    changes: str = LIVE

    @property
    def accepted(self) -> str:
        """What the parameter accepts, in words."""
        if self.choices:
            return ", ".join(repr(c) if c == "" else c for c in self.choices)
        if self.type == "bool":
            return "true or false"
        if self.type == "string":
            return "text"
        words = {"double": "a finite number", "integer": "a whole number"}.get(self.type)
        if words is None:
            words = f"{' or '.join(str(n) for n in self.lengths)} finite numbers"
        if self.lower > -math.inf:
            words += f" {'>' if self.above else '>='} {self.lower:g}"
        if self.upper < math.inf:
            words += f"{' and' if self.lower > -math.inf else ''} <= {self.upper:g}"
        return f"{words} [{self.unit}]" if self.unit else words

    def convert(self, value: object) -> Value:
        """The value in the parameter's own type, checked; raises InputError.

        Numbers are numbers: whole numbers and text that reads as a number, or as a list of numbers, are converted.
        """
        # What most are; strictly between two numbers means finite, too.
        lower, upper = self.lower, self.upper
        if type(value) is float and self.type == "double" and lower < value < upper:
            return value
        if type(value) is list and self.type == "doubles" and len(value) in self.lengths:
            for number in value:
                if type(number) is not float or not lower < number < upper:
                    break
            else:
                return [*value]
        converted = self._typed(value)
        if converted is None or not self._within_bounds(converted):
            hint = did_you_mean(str(value), filter(None, self.choices))
            received = value.tolist() if isinstance(value, array) else value
            text = repr(received)
            received = received if len(text) <= 80 else text[:77] + "..."
            raise InputError(self.name, received, "; ".join(filter(None, [self.accepted, hint])))
        return converted

    def _typed(self, value: object) -> Value | None:
        if self.type in ("bool", "string"):
            return value if isinstance(value, bool if self.type == "bool" else str) else None
        if self.type == "doubles":
            return _to_doubles(value)
        if self.type == "integer" and type(value) is int:
            return value  # a double would round it from 2^53 on
        number = _to_double(value)
        if self.type == "double" or number is None:
            return number
        return int(number) if math.isfinite(number) and number == int(number) else None

    def _within_bounds(self, value: Value) -> bool:
        if isinstance(value, bool):
            return True
        if isinstance(value, str):
            return not self.choices or value in self.choices
        numbers = value if isinstance(value, list) else [value]
        if self.lengths and len(numbers) not in self.lengths:
            return False
        above = all(n > self.lower if self.above else n >= self.lower for n in numbers)
        return above and all(n <= self.upper and math.isfinite(n) for n in numbers)


def _to_double(value: object) -> float | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        try:
            return float(value)
        except OverflowError:
            return None
    if isinstance(value, str) and _NUMBER.match(value.strip()):
        return float(value)
    return None


def _to_doubles(value: object) -> list[float] | None:
    if isinstance(value, str):
        text = value.strip()
        if text.startswith("[") and text.endswith("]"):
            value = [item.strip(" '\"") for item in text[1:-1].split(",")]
        elif len(items := text.replace(",", " ").split()) > 1:
            value = items
    alone = _to_double(value)
    if alone is not None:
        return [alone]
    if not isinstance(value, (list, tuple, array, np.ndarray)):
        return None
    numbers = [number for item in value if (number := _to_double(item)) is not None]
    return numbers if len(numbers) == len(value) else None


def declare(default: Any, description: str, unit: str = "", **rules: Any) -> Any:
    """A field of a dataclass that declares a parameter of the default's type. rules: as in Parameter; doubles are as
    many as the default has, and within HUGE, unless these say otherwise.
    """
    kinds = {bool: "bool", int: "integer", float: "double", str: "string", tuple: "doubles"}
    kind = kinds[type(default)]
    if kind == "doubles":
        rules = {"lower": -HUGE, "upper": HUGE, "lengths": (len(default),), **rules}
    own = list(default) if kind == "doubles" else default
    return field(default=default, metadata={"declaration": Parameter("", kind, own, description, unit, **rules)})


def _port(default: int, description: str) -> Any:
    """A port of this machine, set at start."""
    return declare(default, description, lower=1, upper=65535, changes=READ_ONLY)


# The parameters


@dataclass(frozen=True, slots=True)
class ExplicitInertia:
    """Mass properties given as numbers, for ``inertia_model`` explicit."""

    mass: float = declare(1.0, "Mass of the explicit model.", "kg", lower=0.0, upper=HUGE, above=True)
    center_of_mass: Vector = declare(ZERO, "Centre of mass of the explicit model, in mesh coordinates.", "mesh units")
    tensor: Tensor = declare(
        (1.0, 0.0, 0.0, 1.0, 0.0, 1.0),
        "Tensor of the explicit model about its centre of mass: ixx ixy ixz iyy iyz izz.",
        "kg m²",
    )


@dataclass(frozen=True, slots=True)
class ThrusterRules:
    """Parameters of all thrusters."""

    bidirectional: bool = declare(
        False,
        "Whether thrusters push in both directions, up to their limit; otherwise only forwards, from 0 to their limit.",
        changes=READ_ONLY,
    )
    minimum_on_time: float = declare(
        0.0, "Minimum time for which a thruster stays on.", "s", lower=0.0, upper=1e9, changes=READ_ONLY
    )


@dataclass(frozen=True, slots=True)
class InitialState:
    """State of the body at time 0."""

    position: Vector = declare(ZERO, "Position of the centre of mass at time 0, world axes.", "m", changes=AT_RESET)
    orientation_xyzw: Four = declare(
        (0.0, 0.0, 0.0, 1.0), "Attitude at time 0, body to world; normalized.", changes=AT_RESET
    )
    linear_velocity: Vector = declare(
        ZERO, "Velocity of the centre of mass at time 0, world axes.", "m/s", changes=AT_RESET
    )
    angular_velocity: Vector = declare(ZERO, "Angular velocity at time 0, world axes.", "rad/s", changes=AT_RESET)
    string_mass: float = declare(
        0.0,
        "Effective mass from which the stiffness and damping of a string tied at time 0 are computed; 0 means that of "
        "the body in its initial state.",
        "kg",
        lower=0.0,
        upper=HUGE,
        changes=AT_RESET,
    )


@dataclass(frozen=True, slots=True)
class RotorParameters:
    """A flywheel in the body."""

    momentum: Vector = declare(
        ZERO,
        "Angular momentum of a flywheel relative to the body, body axes, at time 0 and again when it is changed.",
        "N m s",
    )
    torque: Vector = declare(
        ZERO,
        "Torque that drives the flywheel, body axes: its momentum grows by it, and the body gets the opposite torque.",
        "N m",
    )


@dataclass(frozen=True, slots=True)
class StringParameters:
    """The string."""

    attached: bool = declare(False, "Whether the string is tied from the start, without a timeout.")
    attach: Vector = declare(ZERO, "Point of the body where the string is tied, in mesh coordinates.", "mesh units")
    target: Vector = declare(ZERO, "Position of the free end of a string tied from the start, world axes.", "m")
    stiffness: float = declare(50.0, "Stiffness of the string.", "N/m", lower=0.0, upper=1e30)
    frequency: float = declare(
        0.0,
        "Angular frequency of the effective mass on the string, so that light and heavy bodies respond alike; above 0 "
        "it takes precedence over stiffness.",
        "rad/s",
        lower=0.0,
        upper=1e15,
    )
    damping_ratio: float = declare(0.1, "Damping of the string, relative to critical damping.", lower=0.0, upper=1e6)
    rest_length: float = declare(
        0.0, "Rest length of the string, up to which it doesn't pull.", "m", lower=0.0, upper=1e30
    )
    bilateral: bool = declare(False, "Whether the string also pushes, as a spring does.")
    timeout: float = declare(
        1.0, "Time from the last target message to the string's release; 0 means never.", "s", lower=0.0, upper=1e9
    )


@dataclass(frozen=True, slots=True)
class NoiseParameters:
    """Errors of ~/imu; the motion and all other topics stay exact."""

    imu: Four = declare(
        (0.0, 0.0, 0.0, 0.0),
        "Errors of ~/imu: white noise densities of angular velocity and specific force [per √Hz], then the standard "
        "deviations of their biases.",
        "rad/s, m/s²",
        lower=0.0,
    )
    seed: int = declare(
        0, "Seed of the noise; the same seed gives the same errors at the same stamps.", lower=0, upper=2**62
    )


@dataclass(frozen=True, slots=True)
class GhostParameters:
    """How the ghost differs from the body; a ghost is shown when one of these is given."""

    inertia_model: str = declare(
        "",
        "Inertia model of a ghost that is shown beside the body, from time 0 or the next reset on, and gets the same "
        "commands.",
        choices=("", *INERTIA_MODELS),
    )
    integrator: str = declare(
        "",
        "Integrator of a ghost that is shown, from time 0 or the next reset on, and gets the same commands.",
        choices=("", *INTEGRATOR_NAMES),
    )


@dataclass(frozen=True)
class Parameters:
    """A value for every parameter. What files, ROS and command line call ``string.stiffness`` is
    ``parameters.string.stiffness`` here.

    ``replaced`` returns a copy with values changed by name, with all checks; ``named`` returns all values by name.
    contacts: named points of the body. ballast: point masses by name. thrusters: point, direction and limit by name.
    All in mesh coordinates.
    """

    mesh: str = declare(
        "t_handle",
        "Mesh of the body, or a YAML file of parts: a path, a package:// URI or a bundled name; empty only with the "
        "explicit inertia model.",
    )
    mesh_repair: bool = declare(False, "Orient, weld and cap a mesh that isn't closed, as inspect --repair does.")
    mesh_fallback: str = declare(
        "",
        "Substitute shape for a mesh that encloses no volume, as with inspect --fallback.",
        choices=("", "hull", "box"),
    )
    scale: tuple[float, ...] = declare(
        (1.0, 1.0, 1.0),
        "Factor from mesh coordinates to metres; one number or one per axis, a negative number mirrors.",
        "m per mesh unit",
        lower=-1e9,
        upper=1e9,
        lengths=(1, 3),
    )
    mass: float = declare(
        0.0,
        "Mass; above 0 it takes precedence over density and doesn't change with scale.",
        "kg",
        lower=0.0,
        upper=HUGE,
    )
    density: float = declare(
        1000.0,
        "Density of the solid; setting it sets mass to 0. Of a body of parts 1000 leaves theirs as they are.",
        "kg/m³",
        lower=0.0,
        upper=HUGE,
        above=True,
    )
    inertia_model: str = declare(
        "solid",
        "Model of the mass distribution, from which the inertia tensor follows.",
        choices=INERTIA_MODELS,
    )
    inertia_model_com: str = declare(
        "model",
        "Which centre of mass is used, that of the inertia model or that of the solid; with the latter, only the "
        "tensors differ; the explicit model always keeps its own.",
        choices=MODEL_COMS,
    )
    wall_thickness: float = declare(
        WALL_THICKNESS,
        "Thickness of the walled model's walls, which have the full density.",
        "m",
        lower=0.0,
        upper=1e9,
        above=True,
    )
    infill: float = declare(
        INFILL, "Density within the walled model's walls, as a part of the full one.", lower=0.0, upper=1.0
    )
    explicit_inertia: ExplicitInertia = ExplicitInertia()
    gyroscopic: bool = declare(True, "Include the term ω × Iω; without it the motion isn't that of a rigid body.")
    gravity: Vector = declare(ZERO, "Acceleration of gravity, world axes.", "m/s²")
    linear_damping: float = declare(
        0.0, "Damping force at the centre of mass, per velocity.", "N s/m", lower=0.0, upper=HUGE
    )
    angular_damping: float = declare(0.0, "Damping torque, per angular velocity.", "N m s", lower=0.0, upper=HUGE)
    rotor: RotorParameters = RotorParameters()
    initial: InitialState = InitialState()
    integrator: str = declare(
        "auto",
        "Integrator of the motion; auto selects the cheapest one that meets accuracy.",
        choices=INTEGRATOR_NAMES,
    )
    step: float = declare(
        0.001, "Step of fixed-step integrators, rounded to the nearest nanosecond.", "s", lower=1e-9, upper=1e5
    )
    accuracy: float = declare(
        1e-9,
        "Local error per second that auto allows: angle, displacement per half diagonal, relative velocities.",
        "1/s",
        lower=1e-16,
        upper=1.0,
        above=True,
    )
    publish_rate: float = declare(100.0, "States published per simulated second.", "1/s", lower=1e-6, upper=1e4)
    real_time_factor: float = declare(
        1.0, "Simulated seconds per second of the wall clock; 0 runs as fast as possible.", lower=0.0, upper=1e6
    )
    lockstep: bool = declare(
        False,
        "While paused, each message received on ~/wrench or ~/thrusters steps the simulation as ~/step does, but "
        "without the round trip of a service call.",
    )
    start_paused: bool = declare(False, "Start paused.", changes=READ_ONLY)
    wrench_timeout: float = declare(
        1.5,
        "Time from the last message of a held wrench to its end; 0 holds it until it is replaced.",
        "s",
        lower=0.0,
        upper=1e9,
    )
    poke_duration: float = declare(0.05, "Duration of a poke that doesn't give one.", "s", lower=1e-9, upper=1e9)
    schedule_horizon: float = declare(
        3600.0, "Maximum time by which a command's stamp may lie ahead.", "s", lower=0.0, upper=1e9
    )
    string: StringParameters = StringParameters()
    publish_clock: bool = declare(False, "Publish simulated time on /clock.")
    publish_tf: bool = declare(False, "Publish the body's frame on /tf (where tf2_msgs is installed).")
    imu_contact: str = declare("", "Contact where the IMU of ~/imu is; empty means the centre of mass.")
    noise: NoiseParameters = NoiseParameters()
    ghost: GhostParameters = GhostParameters()
    world_frame: str = declare("world", "Name of the world frame in published messages.", changes=READ_ONLY)
    body_frame: str = declare(
        "",
        "Name of the body's frame in published messages; empty means the node's name with its namespace.",
        changes=READ_ONLY,
    )
    record: str = declare(
        "",
        "Record to this .mcap file (the recording, a bag of the topics) or .rrd file (a view for Rerun), or both with "
        "a comma; empty means no recording.",
    )
    viewer: str = declare(
        "none",
        "Live view of the motion: web for Rerun in the browser, native for Rerun's own window, workbench for the "
        "interactive page, which may stand beside one of them.",
        choices=("none", "web", "native", "workbench", "web,workbench", "native,workbench"),
        changes=READ_ONLY,
    )
    rerun_port: int = _port(9876, "Port on which the live view is served, on this machine only.")
    web_port: int = _port(9090, "Port of the browser's viewer page, on this machine only.")
    workbench_port: int = _port(8080, "Port of the interactive page.")
    workbench_host: str = declare(
        "127.0.0.1",
        "Address on which the interactive page is served: this machine only, or 0.0.0.0 for the network, too; others "
        "then watch, and one at a time drives.",
        changes=READ_ONLY,
    )
    thruster: ThrusterRules = ThrusterRules()
    contacts: Mapping[str, Vector] = field(default_factory=dict)
    ballast: Mapping[str, Four] = field(default_factory=dict)
    thrusters: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def replaced(self, changes: Mapping[str, object]) -> Parameters:
        """A copy with these values changed, by name, each converted and checked by its declaration; raises InputError.

        A density that is set without a mass sets the mass to 0, since the mass takes precedence.
        """
        return self.with_values(convert_all(with_mass_of_density(changes)))

    def with_values(self, changes: Mapping[str, Value]) -> Parameters:
        """A copy with these values changed, by name, which ``convert_all`` has returned."""
        groups: dict[str, dict[str, Any]] = {}
        for name, value in changes.items():
            group, _, own = name.rpartition(".")
            groups.setdefault(group, {})[own] = tuple(value) if isinstance(value, list) else value
        top = groups.pop("", {})
        for group, values in groups.items():
            present = getattr(self, group)
            named_by_user = f"{group}." in PATTERNS
            top[group] = {**present, **values} if named_by_user else replace(present, **values)
        # dataclasses.replace takes twenty times as long for so many fields.
        changed = object.__new__(Parameters)
        vars(changed).update({**vars(self), **top})
        return changed

    def named(self) -> dict[str, Value]:
        """Every value by its dotted name, as files and ROS have it."""
        values: dict[str, Any] = {name: value_of(self) for name, value_of in _VALUE_OF.items()}
        for prefix in PATTERNS:
            group = prefix.removesuffix(".")
            values |= {f"{prefix}{own}": value for own, value in getattr(self, group).items()}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @property
    def point_masses(self) -> list[Four]:
        """The ballast in the order in which it is added to the body: sums depend on it."""
        return [mass for _, mass in sorted(self.ballast.items())]


def _declared(group: Any, prefix: str = "") -> dict[str, Parameter]:
    """The parameters that a dataclass instance declares, by dotted name: those of an inner dataclass
    below its field's name.
    """
    found: dict[str, Parameter] = {}
    for own in dataclasses.fields(group):
        name = f"{prefix}{own.name}"
        value = getattr(group, own.name)
        if "declaration" in own.metadata:
            found[name] = replace(own.metadata["declaration"], name=name)
        elif dataclasses.is_dataclass(value):
            found |= _declared(value, f"{name}.")
    return found


PARAMETERS: dict[str, Parameter] = _declared(Parameters())
_VALUE_OF = {name: attrgetter(name) for name in PARAMETERS}


def _pattern(name: str, description: str, unit: str, lengths: tuple[int, ...], changes: str = LIVE) -> Parameter:
    return Parameter(name, "doubles", None, description, unit, -HUGE, HUGE, lengths=lengths, changes=changes)


PATTERNS: dict[str, Parameter] = {
    "contacts.": _pattern(
        "contacts.<name>", "A named point of the body, in mesh coordinates.", "mesh units", (3,), READ_ONLY
    ),
    "ballast.": _pattern(
        "ballast.<name>",
        "A point mass added to the body: kg, then x, y, z in mesh coordinates.",
        "kg, mesh units",
        (4,),
    ),
    "thrusters.": _pattern(
        "thrusters.<name>",
        "A thruster on the body, commanded by ~/thrusters: x, y, z and the direction of its force in mesh coordinates, "
        "optionally followed by its largest force (0 for no limit).",
        "mesh units, N",
        (6, 7),
        READ_ONLY,
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
"""Parameters that every rclpy node has, so that a parameter dump contains them; a name ending in a dot is a prefix."""


def is_ros_parameter(name: str) -> bool:
    """Whether the name is one that every rclpy node has."""
    return any(name == known or (known.endswith(".") and name.startswith(known)) for known in ROS_PARAMETERS)


def convert_all(values: Mapping[str, object]) -> dict[str, Value]:
    """Convert and check each value by its declaration; raises InputError."""
    return {name: parameter_named(name).convert(value) for name, value in values.items()}


def with_mass_of_density(changes: Mapping[str, Any]) -> Mapping[str, Any]:
    """The changes, with mass 0 where they set a density and no mass, since a mass above 0 takes precedence."""
    return {**changes, "mass": 0.0} if "density" in changes and "mass" not in changes else changes
