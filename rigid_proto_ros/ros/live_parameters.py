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

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from ..scene.parameters import parameter_named, with_mass_of_density
from .parameter_server import converted, descriptor, is_read_only, ros_parameter
from .state_publisher import StatePublisher

Store = Callable[[list[Parameter]], SetParametersResult]
"""rclpy's own way to set parameters atomically."""


class LiveParameters:
    """The parameters of a node. All but ``changed`` runs on the executor's thread."""

    def __init__(self, node: Node, store: Store, live: LiveSimulation, states: StatePublisher) -> None:
        self._node = node
        self._store_in_ros = store
        self._live = live
        self._states = states
        self._behind = node.create_guard_condition(self._follow)

    def changed(self) -> None:
        """From any thread: a command has changed what parameters say."""
        self._behind.trigger()

    def set_together(self, parameters: list[Parameter]) -> SetParametersResult:
        """Convert, check together, and hand over to the physics thread; a refusal leaves all as it was."""
        try:
            parameters = converted(parameters)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        named = {p.name: p for p in parameters}
        for name in with_mass_of_density(named).keys() - named.keys():
            named |= {p.name: p for p in _as_ros({name: 0.0})}
        # What is so already is no change: a dump of this very node can be loaded.
        changed = [p for p in named.values() if not self._is_in_force(p)]
        fixed = [p.name for p in changed if is_read_only(p.name)]
        if fixed:
            return SetParametersResult(successful=False, reason=f"{', '.join(fixed)}: can be set at start only")
        if not changed:
            return SetParametersResult(successful=True)
        changes = {p.name: p.value for p in changed}
        try:
            self._live.set_parameters(changes)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._states.configure(self._live.scenario.parameters)
        return self._store(changed, changes)

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


def _as_ros(values: dict) -> list[Parameter]:
    return [ros_parameter(parameter_named(name), value) for name, value in values.items()]


def _plain(value: Any) -> Any:
    """rclpy keeps arrays of doubles as array.array."""
    return value if isinstance(value, (str, bool, int, float)) else list(value)
