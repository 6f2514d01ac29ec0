# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters around one body that the physics thread advances.

Callbacks run on the executor's thread; they convert and hand over. Commands don't come through callbacks at all: the
physics thread takes them itself (command_subscriber.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..live.endpoints import Endpoints
from ..live.live_simulation import LiveSimulation
from ..motion.state import State
from ..scene.command_codec import frame_names
from ..scene.scenario import Scenario, make_scenario
from ..simulation.observer import Observer
from .arguments import NODE_NAME
from .command_queue import ManualCallbackGroup
from .command_subscriber import CommandSubscriber
from .diagnostics import Diagnostics
from .event_publisher import EventPublisher
from .parameters import LiveParameters, declare_parameters
from .services import StepService, offer_services
from .simulation_interfaces import offer_simulation_interfaces
from .state_publisher import StatePublisher


class RigidBodyNode(Node):
    """values: parameters by name as scene files give them, the others at their defaults. make_viewer(scenario, node
    name) gives an observer that shows the body, or None. ``live`` flies once it is started.

    Raises InputError when a parameter given at start is refused.
    """

    def __init__(
        self,
        values: Mapping[str, object],
        make_viewer: Callable[[Scenario, str], Observer | None] = lambda *_: None,
        node_name: str = NODE_NAME,
    ) -> None:
        super().__init__(node_name)
        scenario = make_scenario(declare_parameters(self, values))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        frames = frame_names(scenario.parameters, self.get_name())
        events = EventPublisher(self, frames[1], scenario.setup.contacts)
        viewer = make_viewer(scenario, self.get_name())
        self._endpoints = RosEndpoints(self)
        clock = self._followed_clock(scenario)
        self.live = LiveSimulation(scenario, self.get_name(), [events, *filter(None, [viewer])], self._endpoints, clock)
        self.loop, self.call = self.live.loop, self.live.call
        events.stamps = self.live.stamps
        self._endpoints.states = self.states = StatePublisher(self, *frames, self._specific_force, self.live.stamps)
        self.states.configure(scenario.parameters)
        has_thrusters = bool(scenario.parameters.thrusters)
        self._endpoints.subscriber = CommandSubscriber(self, self.live.commands, frames, has_thrusters)
        self._live_parameters = LiveParameters(self, super().set_parameters_atomically, self.live, self.states)
        offer_services(self, self.live)
        self._endpoints.steps = StepService(self, self.live, ManualCallbackGroup())
        offer_simulation_interfaces(self, self.live)
        self.diagnostics = Diagnostics(self, self.live)
        self.live.announce()

    def parameters_changed(self) -> None:
        """From any thread: the ROS parameters follow on the executor's thread."""
        self._live_parameters.changed()

    def _followed_clock(self, scenario: Scenario) -> Callable[[], int] | None:
        """/clock, when use_sim_time asks for it and it isn't our own."""
        if not self.get_parameter("use_sim_time").value or scenario.parameters.publish_clock:
            return None
        clock = self.get_clock()
        return lambda: clock.now().nanoseconds

    # On the physics thread

    def _specific_force(self) -> np.ndarray:
        """At the contact that ~/imu is mounted at, or the COM."""
        contact, simulation = self.loop.scenario.parameters.imu_contact, self.loop.simulation
        body = simulation.setup.body
        point = body.point(simulation.setup.contacts[contact]).tolist() if contact else (0.0, 0.0, 0.0)
        return simulation.specific_force(point)

    # On the executor's thread

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """All changes of parameters come here: checked, and handed to the physics thread."""
        return self._live_parameters.set_together(parameter_list)


class RosEndpoints(Endpoints):
    """What the loop of one node publishes to and takes commands from."""

    states: StatePublisher
    subscriber: CommandSubscriber
    steps: StepService

    def __init__(self, node: RigidBodyNode) -> None:
        self._node = node

    def publish(self, state: State) -> None:
        """On the topics of states."""
        self.states.publish(state)

    def has_subscribers(self) -> bool:
        """Whether one of them has any."""
        return self.states.find_subscribers()

    def take_commands(self, wall_ns: int, all_topics: bool) -> bool:
        """From the command topics."""
        return self.subscriber.take(wall_ns, all_topics)

    def serve_steps(self, wall_ns: int) -> bool:
        """``~/step``."""
        return self.steps.serve(wall_ns)

    @property
    def queue_full(self) -> int:  # type: ignore[override]  # counted by the queues
        """How often a queue was found full."""
        return self.subscriber.queue_full

    @property
    def messages_lost(self) -> int:  # type: ignore[override]  # counted by the queues
        """How many messages the middleware has said to be lost."""
        return self.subscriber.messages_lost

    def parameters_changed(self) -> None:
        """The ROS parameters follow."""
        self._node.parameters_changed()

    def warn(self, message: str) -> None:
        """In the node's log."""
        self._node.get_logger().warning(message)

    def failed(self, message: str) -> None:
        """In the node's log."""
        self._node.get_logger().error(message)
