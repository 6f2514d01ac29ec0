# SPDX-License-Identifier: MIT
"""The declared parameters on a ROS node: descriptors, and values converted before rclpy sees them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ..base.errors import InputError
from ..scene.declaration import LIVE, READ_ONLY, Parameter
from ..scene.parameters import PARAMETERS, is_ros_parameter, parameter_named

_TYPES = {
    "double": ParameterType.PARAMETER_DOUBLE,
    "doubles": ParameterType.PARAMETER_DOUBLE_ARRAY,
    "integer": ParameterType.PARAMETER_INTEGER,
    "bool": ParameterType.PARAMETER_BOOL,
    "string": ParameterType.PARAMETER_STRING,
}
_ROS_TYPES = {name: RosParameter.Type(value) for name, value in _TYPES.items()}
_SEVERAL_TYPES = "bool or string"


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """The ROS descriptor of a declared parameter."""
    when = {READ_ONLY: "Set at start only."}.get(parameter.changes, f"Changes take effect {parameter.changes}.")
    if parameter.changes == LIVE:
        when = "Can be changed while the simulation runs."
    result = ParameterDescriptor(
        name=parameter.name,
        type=_TYPES.get(parameter.type, ParameterType.PARAMETER_NOT_SET),
        dynamic_typing=parameter.type == _SEVERAL_TYPES,
        description=f"{parameter.description} {when}",
        additional_constraints=parameter.accepted,
        read_only=parameter.changes == READ_ONLY,
    )
    bounded = abs(parameter.lower) < float("inf") and abs(parameter.upper) < float("inf")
    if parameter.type == "double" and bounded:
        result.floating_point_range = [FloatingPointRange(from_value=parameter.lower, to_value=parameter.upper)]
    if parameter.type == "integer" and bounded:
        result.integer_range = [IntegerRange(from_value=int(parameter.lower), to_value=int(parameter.upper), step=1)]
    return result


def declare_parameters(node: Node, given: Mapping[str, object]) -> dict[str, Any]:
    """Declare all parameters on the node, those ``given`` at start with their values, and return them all, converted.

    What rcl has read from the same files and arguments is ignored: rclpy would refuse an integer where a double is
    declared. Raises InputError.
    """
    values = {}
    for name in dict.fromkeys([*PARAMETERS, *given]):
        parameter = parameter_named(name)
        values[name] = parameter.convert(given[name]) if name in given else parameter.default
        node.declare_parameter(name, values[name], descriptor(parameter), ignore_override=True)
    return values


def ros_parameter(parameter: Parameter, value: object) -> RosParameter:
    """A converted value as rclpy's parameter."""
    own = "bool" if isinstance(value, bool) else "string"
    return RosParameter(parameter.name, _ROS_TYPES[own if parameter.type == _SEVERAL_TYPES else parameter.type], value)


def converted(changes: list[RosParameter]) -> list[RosParameter]:
    """Parameters as a client sent them, each in its declared type; raises InputError."""
    result = []
    for change in changes:
        if is_ros_parameter(change.name):
            if change.name == "use_sim_time" and not isinstance(change.value, bool):
                raise InputError(change.name, change.value, "true or false")
            result.append(change)
            continue
        parameter = parameter_named(change.name)
        result.append(ros_parameter(parameter, parameter.convert(change.value)))
    return result


def is_read_only(name: str) -> bool:
    """Whether a parameter counts at start only, ours or one that every rclpy node has."""
    return is_ros_parameter(name) or parameter_named(name).changes == READ_ONLY
