# SPDX-License-Identifier: MIT
"""Parameters that change in flight: checked together, handed to the physics thread, updated to what
commands changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from ..scene.parameters import is_ros_parameter, parameter_named, with_mass_of_density
from .parameter_server import converted, descriptor, is_read_only, ros_parameter
from .state_publisher import StatePublisher

Store = Callable[[list[Parameter]], SetParametersResult]
"""rclpy's own way to set parameters atomically."""


class LiveParameters:
    """Serves the parameter services of a node. All but ``changed`` runs on the executor's thread."""

    def __init__(self, node: Node, store: Store, live: LiveSimulation, states: StatePublisher) -> None:
        self._node = node
        self._store_in_ros = store
        self._live = live
        self._states = states
        self._behind = node.create_guard_condition(self._follow)
        self._services = _ParameterServices(node, self.set_several)

    def changed(self) -> None:
        """From any thread: a command has changed what parameters say."""
        self._behind.trigger()

    def set_together(self, parameters: list[Parameter], counted: bool = True) -> SetParametersResult:
        """Convert, check together, and hand over to the physics thread; a refusal leaves all as it was.

        counted: a refusal goes to the counters.
        """
        try:
            parameters = converted(parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        # A dump of this very node is no change of what can't change.
        fixed = [p for p in parameters if is_read_only(p.name)]
        other = [p.name for p in fixed if not self._is_in_force(p)]
        if other:
            return SetParametersResult(successful=False, reason=f"{', '.join(other)}: can be set at start only")
        parameters = [p for p in parameters if p not in fixed]
        changes = {p.name: p.value for p in parameters if not is_ros_parameter(p.name)}
        if changes.keys() < with_mass_of_density(changes).keys():
            changes["mass"] = 0.0
            parameters = [*parameters, *_as_ros({"mass": 0.0})]
        try:
            if changes:
                self._live.set_parameters(changes, counted)
                self._states.configure(self._live.scenario.parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return self._store(parameters, changes)

    def set_several(self, parameters: list[Parameter]) -> list[SetParametersResult]:
        """What one ``set_parameters`` request brings, as ``ros2 param load`` sends a whole file: at once where all fit
        together. Otherwise one by one, and the refused ones again after the others, so that their order doesn't matter.
        """
        if len(parameters) > 1 and self.set_together(parameters, counted=False).successful:
            return [SetParametersResult(successful=True) for _ in parameters]
        refused, before = list(range(len(parameters))), len(parameters) + 1
        while 1 < len(refused) < before:
            before = len(refused)
            refused = [k for k in refused if not self.set_together([parameters[k]], counted=False).successful]
        results = [SetParametersResult(successful=True) for _ in parameters]
        for k in refused:
            results[k] = self.set_together([parameters[k]])
        return results

    def _follow(self) -> None:
        """Set the ROS parameters to what scheduled commands and inertia messages have changed, and to no recording
        where one has stopped.
        """
        self._live.give_up_failed_recording()
        now = self._live.scenario.parameters
        behind = {
            name: value
            for name, value in now.named().items()
            if not is_read_only(name) and not self._is_in_force(_as_ros({name: value})[0])
        }
        if behind:
            self._store(_as_ros(behind), behind)
            self._states.configure(now)

    def _store(self, parameters: list[Parameter], values: dict) -> SetParametersResult:
        """Into rclpy's table, which tells /parameter_events; a ballast that comes along in flight is declared."""
        for name, value in values.items():
            if not self._node.has_parameter(name):
                self._node.declare_parameter(name, value, descriptor(parameter_named(name)), ignore_override=True)
        return self._store_in_ros(parameters)

    def _is_in_force(self, parameter: Parameter) -> bool:
        """Whether the node has that parameter, with that value."""
        name = parameter.name
        return self._node.has_parameter(name) and _plain(self._node.get_parameter(name).value) == _plain(
            parameter.value
        )


class _ParameterServices(ParameterService):
    """rclpy's parameter services, but for ``set_parameters``, whose requests are taken as a whole.

    rclpy has no public way to replace one of them: the method overridden here is its own. Tried with rclpy 7.1.6
    (Jazzy); test/ros/test_command_queue.py says when a release breaks it.
    """

    def __init__(self, node: Node, set_several: Callable[[list[Parameter]], list[SetParametersResult]]) -> None:
        super().__init__(node)
        self._set_several = set_several

    def _set_parameters_callback(self, request: Any, response: Any) -> Any:
        response.results = self._set_several([Parameter.from_parameter_msg(message) for message in request.parameters])
        return response


def _as_ros(values: dict) -> list[Parameter]:
    return [ros_parameter(parameter_named(name), value) for name, value in values.items()]


def _plain(value: Any) -> Any:
    """rclpy keeps arrays of doubles as array.array."""
    return value if isinstance(value, (str, bool, int, float)) else list(value)
