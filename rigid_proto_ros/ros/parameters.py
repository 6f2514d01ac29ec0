# SPDX-License-Identifier: MIT
"""The declared parameters as ROS parameters: descriptors, and values converted before rclpy sees them.

Changes in flight are checked together and passed to the physics thread. The ROS parameters are updated after commands
change the simulation's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from ..parameters.declarations import (
    LIVE,
    PARAMETERS,
    READ_ONLY,
    Parameter,
    is_ros_parameter,
    parameter_named,
    with_mass_of_density,
)
from .publishers import StatePublisher

_TYPES = {
    "double": ParameterType.PARAMETER_DOUBLE,
    "doubles": ParameterType.PARAMETER_DOUBLE_ARRAY,
    "integer": ParameterType.PARAMETER_INTEGER,
    "bool": ParameterType.PARAMETER_BOOL,
    "string": ParameterType.PARAMETER_STRING,
}
_ROS_TYPES = {name: RosParameter.Type(value) for name, value in _TYPES.items()}


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """The ROS descriptor of a declared parameter."""
    known = {READ_ONLY: "Set at start only.", LIVE: "Can be changed while the simulation runs."}
    when = known.get(parameter.changes, f"Changes take effect {parameter.changes}.")
    result = ParameterDescriptor(
        name=parameter.name,
        type=_TYPES[parameter.type],
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
    """Declare all parameters on the node, with the values ``given`` at start or their defaults; returns them converted.

    Values that rcl has read from the same files and arguments are ignored, because rclpy would refuse an integer where
    a double is declared. Raises InputError.
    """
    values = {}
    for name in dict.fromkeys([*PARAMETERS, *given]):
        parameter = parameter_named(name)
        values[name] = parameter.convert(given[name]) if name in given else parameter.default
        node.declare_parameter(name, values[name], descriptor(parameter), ignore_override=True)
    return values


def ros_parameter(name: str, value: object) -> RosParameter:
    """A converted value as a parameter of rclpy."""
    return RosParameter(name, _ROS_TYPES[parameter_named(name).type], value)


def converted(changes: list[RosParameter]) -> list[RosParameter]:
    """A client's parameters converted to their declared types; raises InputError."""
    result = []
    for change in changes:
        if is_ros_parameter(change.name):
            if change.name == "use_sim_time" and not isinstance(change.value, bool):
                raise InputError(change.name, change.value, "true or false")
            result.append(change)
            continue
        if change.type_ == RosParameter.Type.NOT_SET:
            raise InputError(change.name, "can't be deleted; a ballast that there is can be")
        result.append(ros_parameter(change.name, parameter_named(change.name).convert(change.value)))
    return result


def is_read_only(name: str) -> bool:
    """Whether a parameter can be set at start only; true for the parameters that every rclpy node has."""
    return is_ros_parameter(name) or parameter_named(name).changes == READ_ONLY


Store = Callable[[list[RosParameter]], SetParametersResult]
"""rclpy's function that sets parameters atomically."""


class LiveParameters:
    """Changes of a node's parameters in flight, on the executor's thread.

    The node's ``set_parameters_atomically`` calls ``set_together``. rclpy's callbacks don't serve: its pre-set callback
    can't refuse, and before its on-set callback rclpy refuses a read-only parameter or another type even if the value
    is unchanged.
    """

    def __init__(self, node: Node, store: Store, live: LiveSimulation, states: StatePublisher) -> None:
        self._node = node
        self._store_in_ros = store
        self._live = live
        self._states = states

    def set_together(self, parameters: list[RosParameter]) -> SetParametersResult:
        """Convert and check all, then pass them to the physics thread; after a refusal nothing is changed. Deleting a
        ballast sets its mass to 0.
        """
        gone = [p.name for p in parameters if p.type_ == RosParameter.Type.NOT_SET and self._is_ballast(p.name)]
        given = [p for p in parameters if p.name not in gone]
        result = self._set([*given, *(ros_parameter(name, self._without_mass(name)) for name in gone)])
        if result.successful:
            for name in gone:
                self._node.undeclare_parameter(name)
        return result

    def _is_ballast(self, name: str) -> bool:
        return name.startswith("ballast.") and self._node.has_parameter(name)

    def _without_mass(self, name: str) -> list[float]:
        return [0.0, *self._node.get_parameter(name).value[1:]]

    def _set(self, parameters: list[RosParameter]) -> SetParametersResult:
        try:
            parameters = converted(parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        named = {p.name: p for p in parameters}
        for name in with_mass_of_density(named).keys() - named.keys():
            named[name] = ros_parameter(name, 0.0)
        # Values already in force are not changes, so a parameter dump can be reloaded.
        try:
            now = self._live.parameters_now
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        changed = [p for p in named.values() if not self._is_set(p, now)]
        fixed = [p.name for p in changed if is_read_only(p.name)]
        if fixed:
            return SetParametersResult(successful=False, reason=f"{', '.join(fixed)}: can be set at start only")
        if not changed:
            return SetParametersResult(successful=True)
        try:
            self._live.set_parameters({p.name: p.value for p in changed})
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._states.configure(self._live.scenario.parameters)
        return self._store(changed)

    def follow(self) -> None:
        """Update the ROS parameters after scheduled commands and inertia messages, or after a failed recording."""
        self._live.give_up_failed_recording()
        now = self._live.scenario.parameters
        named = [ros_parameter(name, value) for name, value in now.named().items() if not is_read_only(name)]
        behind = [p for p in named if not self._is_set(p)]
        if behind:
            self._store(behind)
            self._states.configure(now)

    def _store(self, parameters: list[RosParameter]) -> SetParametersResult:
        """Store parameters in rclpy, which publishes them on /parameter_events; declare ballasts added in flight."""
        for p in parameters:
            if not self._node.has_parameter(p.name):
                self._node.declare_parameter(p.name, p.value, descriptor(parameter_named(p.name)), ignore_override=True)
        return self._store_in_ros(parameters)

    def _is_set(self, parameter: RosParameter, values: Mapping[str, Any] = MappingProxyType({})) -> bool:
        """Whether the parameter has this value already, in ``values`` or else in rclpy."""
        name = parameter.name
        if name not in values and not self._node.has_parameter(name):
            # A deleted ballast.
            return bool(name.startswith("ballast.") and parameter.value[0] == 0.0)
        value = values[name] if name in values else self._node.get_parameter(name).value
        return bool(_plain(value) == _plain(parameter.value))


def _plain(value: Any) -> Any:
    """A value as plain Python; rclpy stores arrays of doubles as array.array."""
    return value if isinstance(value, (str, bool, int, float)) else list(value)
