# SPDX-License-Identifier: MIT
"""Every parameter, declared once: ROS descriptors, the command line's help and the table in the docs come from here."""

from __future__ import annotations

import math
import re
from array import array
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..base.errors import CommandRefused, InputError
from ..base.nearest_name import did_you_mean
from ..mass.properties import INERTIA_MODELS, MODEL_COMS
from ..motion.frames import check_contact_name
from ..motion.integrators import INTEGRATORS

LIVE, AT_RESET, READ_ONLY = "live", "at the next reset", "read-only"

_HUGE = 1e100
"""Bound of positions, speeds and forces: squares stay finite."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z")


@dataclass(frozen=True)
class Parameter:
    """type: ``double``, ``doubles``, ``integer``, ``bool`` or ``string``. lower and upper are inclusive unless ``above``:
    then values must lie above lower. lengths: accepted lengths of ``doubles``. changes: LIVE, AT_RESET or READ_ONLY.
    """

    name: str
    type: str
    default: object
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

    def convert(self, value: object) -> object:
        """The value in the parameter's own type, checked; raises InputError.

        Numbers are numbers: whole numbers and text that reads as a number, or as a list of numbers, are converted.
        """
        converted = _CONVERSIONS[self.type](value)
        if converted is None or not self._within_bounds(converted):
            raise InputError(self.name, _shown(value), self.accepted)
        return converted

    def _within_bounds(self, value) -> bool:
        if self.type == "bool":
            return True
        if self.type == "string":
            return not self.choices or value in self.choices
        numbers = value if self.type == "doubles" else [value]
        if self.lengths and len(numbers) not in self.lengths:
            return False
        above = all(n > self.lower if self.above else n >= self.lower for n in numbers)
        return above and all(math.isfinite(n) and n <= self.upper for n in numbers)


def _to_double(value):
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


def _to_doubles(value):
    if isinstance(value, str):
        text = value.strip()
        if text.startswith("[") and text.endswith("]"):
            value = [item.strip(" '\"") for item in text[1:-1].split(",")]
    if _to_double(value) is not None:
        value = [value]
    if not isinstance(value, (list, tuple, array, np.ndarray)):
        return None
    numbers = [_to_double(v) for v in value]
    return None if None in numbers else numbers


def _to_integer(value):
    number = _to_double(value)
    return int(number) if number is not None and math.isfinite(number) and number == int(number) else None


_CONVERSIONS = {
    "double": _to_double,
    "doubles": _to_doubles,
    "integer": _to_integer,
    "bool": lambda value: value if isinstance(value, bool) else None,
    "string": lambda value: value if isinstance(value, str) else None,
}


def _shown(value):
    if isinstance(value, array):
        value = value.tolist()
    text = repr(value)
    return value if len(text) <= 80 else text[:77] + "..."


def _vector(name, default, description, unit, **more) -> Parameter:
    return Parameter(name, "doubles", default, description, unit, -_HUGE, _HUGE, lengths=(3,), **more)


def _port(name, default, description) -> Parameter:
    return Parameter(name, "integer", default, description, "", 1, 65535, changes=READ_ONLY)


_DECLARED = (
    Parameter("mesh", "string", "t_handle", "Mesh of the body: a path, a package:// URI or a bundled name; empty only with the explicit inertia model."),
    Parameter("mesh_repair", "bool", False, "Orient, weld and cap a mesh that isn't closed, as with inspect --repair."),
    Parameter("mesh_fallback", "string", "", "Fallback shape for a mesh that encloses no volume, as with inspect --fallback.", choices=("", "hull", "box")),
    Parameter("scale", "doubles", [1.0, 1.0, 1.0], "Mesh coordinates times scale are metres; one number or one per axis, a negative one mirrors.", "m per mesh unit", lengths=(1, 3), lower=-1e9, upper=1e9),
    Parameter("mass", "double", 0.0, "Mass; above 0 it takes precedence over density and doesn't change with scale.", "kg", 0.0, 1e100),
    Parameter("density", "double", 1000.0, "Density of the solid; setting it sets mass to 0.", "kg/m3", 0.0, 1e100, above=True),
    Parameter("inertia_model", "string", "solid", "Model of the mass distribution, from which the inertia tensor follows.", choices=INERTIA_MODELS),
    Parameter("inertia_model_com", "string", "model", "Where the model's centre of mass lies: where the model has it, or where the true solid has it, so that what the tensor does is seen alone; explicit numbers keep theirs.", choices=MODEL_COMS),
    Parameter("explicit_inertia.mass", "double", 1.0, "Mass of the explicit model.", "kg", 0.0, 1e100, above=True),
    _vector("explicit_inertia.center_of_mass", [0.0, 0.0, 0.0], "Centre of mass of the explicit model, in mesh coordinates.", "mesh units"),
    Parameter("explicit_inertia.tensor", "doubles", [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], "Tensor of the explicit model about its centre of mass: ixx ixy ixz iyy iyz izz.", "kg m2", -_HUGE, _HUGE, lengths=(6,)),
    Parameter("gyroscopic", "bool", True, "Keep the term ω × Iω; without it the motion isn't that of a rigid body."),
    _vector("gravity", [0.0, 0.0, 0.0], "Acceleration of gravity, world axes.", "m/s2"),
    Parameter("linear_damping", "double", 0.0, "Damping force at the centre of mass per velocity.", "N s/m", 0.0, 1e100),
    Parameter("angular_damping", "double", 0.0, "Damping torque per angular velocity.", "N m s", 0.0, 1e100),
    _vector("initial.position", [0.0, 0.0, 0.0], "Position of the centre of mass at time 0, world axes.", "m", changes=AT_RESET),
    Parameter("initial.orientation_xyzw", "doubles", [0.0, 0.0, 0.0, 1.0], "Attitude at time 0, body to world; normalized.", "", -_HUGE, _HUGE, lengths=(4,), changes=AT_RESET),
    _vector("initial.linear_velocity", [0.0, 0.0, 0.0], "Velocity of the centre of mass at time 0, world axes.", "m/s", changes=AT_RESET),
    _vector("initial.angular_velocity", [0.0, 0.0, 0.0], "Angular velocity at time 0, world axes.", "rad/s", changes=AT_RESET),
    Parameter("initial.string_mass", "double", 0.0, "Effective mass that stiffness and damping of a string tied at time 0 are taken from; 0 is that of the body as it lies then.", "kg", 0.0, 1e100, changes=AT_RESET),
    Parameter("integrator", "string", "auto", "Integrator of the motion; auto picks the cheapest that meets accuracy.", choices=tuple(INTEGRATORS)),
    Parameter("step", "double", 0.001, "Step of fixed-step integrators, rounded to the nearest nanosecond.", "s", 1e-9, 1e5),
    Parameter("accuracy", "double", 1e-9, "Local error a second that auto allows: angle, displacement per half diagonal, relative velocities.", "1/s", 1e-16, 1.0, above=True),
    Parameter("publish_rate", "double", 100.0, "States published per simulated second.", "1/s", 1e-6, 1e4),
    Parameter("real_time_factor", "double", 1.0, "Simulated seconds per second of the wall clock; 0 runs as fast as possible.", "", 0.0, 1e6),
    Parameter("start_paused", "bool", False, "Start paused.", changes=READ_ONLY),
    Parameter("wrench_timeout", "double", 1.5, "A held wrench ends this long after its last message; 0 holds it until it is replaced.", "s", 0.0, 1e9),
    Parameter("poke_duration", "double", 0.05, "Duration of a poke that states none.", "s", 1e-9, 1e9),
    Parameter("schedule_horizon", "double", 3600.0, "How far ahead of simulated time a command's stamp may lie.", "s", 0.0, 1e9),
    Parameter("string.attached", "bool", False, "The string is tied from the start, without a timeout."),
    _vector("string.attach", [0.0, 0.0, 0.0], "Where it is tied, in mesh coordinates.", "mesh units"),
    _vector("string.target", [0.0, 0.0, 0.0], "Where its free end is while it is tied from the start, world axes.", "m"),
    Parameter("string.stiffness", "double", 50.0, "Stiffness of the string.", "N/m", 0.0, 1e30),
    Parameter("string.frequency", "double", 0.0, "Above 0 it takes precedence over stiffness: angular frequency of the effective mass on the string, so that light and heavy bodies respond alike.", "rad/s", 0.0, 1e15),
    Parameter("string.damping_ratio", "double", 0.1, "Damping of the string relative to critical.", "", 0.0, 1e6),
    Parameter("string.rest_length", "double", 0.0, "Length up to which the string doesn't pull.", "m", 0.0, 1e30),
    Parameter("string.bilateral", "bool", False, "The string pushes too, as a spring does."),
    Parameter("string.timeout", "double", 1.0, "The string is released this long after the last target message; 0 never.", "s", 0.0, 1e9),
    Parameter("publish_clock", "bool", False, "Publish simulated time on /clock."),
    Parameter("publish_tf", "bool", False, "Publish the body's frame on /tf (where tf2_msgs is installed)."),
    Parameter("imu_contact", "string", "", "Contact at which ~/imu measures; empty means the centre of mass."),
    Parameter("ghost.inertia_model", "string", "", "Show a ghost beside the body, from time 0 or the next reset on, that gets the same commands under this inertia model.", choices=("", *INERTIA_MODELS)),
    Parameter("ghost.integrator", "string", "", "Show a ghost, from time 0 or the next reset on, that gets the same commands under this integrator.", choices=("", *INTEGRATORS)),
    Parameter("world_frame", "string", "world", "Name of the world frame in published messages.", changes=READ_ONLY),
    Parameter("body_frame", "string", "", "Name of the body's frame in published messages; empty means the node's name.", changes=READ_ONLY),
    Parameter("record", "string", "", "Record the session to this .rrd (Rerun) or .mcap (bag) file; empty records nothing."),
    Parameter("viewer", "string", "none", "Show the motion live in Rerun: in the browser, or in the native viewer.", choices=("none", "web", "native"), changes=READ_ONLY),
    _port("rerun_port", 9876, "Port on which the live view is served, on this machine only."),
    _port("web_port", 9090, "Port of the browser's viewer page, on this machine only."),
    _port("workbench_port", 8080, "Port of the interactive page, on this machine only."),
)  # fmt: skip

PARAMETERS: dict[str, Parameter] = {parameter.name: parameter for parameter in _DECLARED}

PATTERNS: dict[str, Parameter] = {
    "contacts.": _vector("contacts.<name>", None, "A named point of the body, in mesh coordinates.", "mesh units", changes=READ_ONLY),
    "ballast.": Parameter("ballast.<name>", "doubles", None, "A point mass added to the body: kg, then x, y, z in mesh coordinates.", "kg, mesh units", -_HUGE, _HUGE, lengths=(4,)),
}  # fmt: skip
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
            return Parameter(**{**vars(pattern), "name": name})
    hint = did_you_mean(name, [*PARAMETERS, *PATTERNS])
    raise InputError("parameter", f"there is no parameter {name!r}{hint and '; ' + hint}")


ROS_PARAMETERS = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters that every rclpy node has, so a dump of one holds them; a name ending in a dot is a prefix."""


def is_ros_parameter(name: str) -> bool:
    """Whether the name is one that every rclpy node has."""
    return any(name == known or (known.endswith(".") and name.startswith(known)) for known in ROS_PARAMETERS)


def convert_all(values: Mapping[str, object]) -> dict[str, object]:
    """Convert and check each value by its declaration; raises InputError."""
    return {name: parameter_named(name).convert(value) for name, value in values.items()}


def defaults() -> dict[str, object]:
    """Every parameter at its default."""
    return {p.name: list(p.default) if isinstance(p.default, list) else p.default for p in _DECLARED}
