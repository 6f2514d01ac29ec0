# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters around one body that the physics thread advances.

Callbacks run on the executor's thread; they convert and hand over. Commands don't come through callbacks at all: the
physics thread takes them itself (commands.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from ..live.simulation_loop import Endpoints
from ..scene.command_codec import frame_names
from ..scene.scenario import Scenario, make_scenario
from ..simulation.commands import ClearWrench, ReleaseString
from ..simulation.observer import Observer
from .arguments import NODE_NAME
from .commands import CommandSubscriber, StepService
from .diagnostics import Diagnostics
from .parameters import LiveParameters, declare_parameters
from .publishers import EventPublisher, StatePublisher
from .simulation_interfaces import offer_simulation_interfaces


def offer_services(node: Node, live: LiveSimulation) -> None:
    """Create reset, pause and the ends of wrench and string, private to the node; ``~/step`` is in commands.py."""

    def offer(service_type: Any, name: str, function: Callable[[Any], None], done: Callable[[Any], str]) -> None:
        """A service that calls function(request) and answers with done(request), or with what was wrong."""

        def answer(request: Any, response: Any) -> Any:
            try:
                function(request)
                response.success, response.message = True, done(request)
            except InputError as error:
                response.success, response.message = False, str(error)
            return response

        node.create_service(service_type, f"~/{name}", answer)

    offer(Trigger, "reset", lambda _: live.reset(), lambda _: "simulated time is 0")
    offer(
        Trigger, "clear_wrench", lambda _: live.submit(ClearWrench()), lambda _: "no wrench acts; scheduled ones stay"
    )
    offer(Trigger, "string/release", lambda _: live.submit(ReleaseString()), lambda _: "the string is released")
    offer(SetBool, "pause", lambda request: live.pause(request.data), lambda r: "paused" if r.data else "running")


class RigidBodyNode(Node):
    """values: parameters by name as scene files give them, the others at their defaults. make_viewer(scenario, node
    name) gives an observer that shows the body, or None. ``live`` flies once it is announced and started.

    Raises InputError when a parameter given at start is refused.
    """

    def __init__(
        self,
        values: Mapping[str, object],
        make_viewer: Callable[[Scenario, str], Observer | None] = lambda *_: None,
    ) -> None:
        super().__init__(NODE_NAME)
        scenario = make_scenario(declare_parameters(self, values))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        frames = frame_names(scenario.parameters, self.get_name())
        events = EventPublisher(self, frames[1])
        viewer = make_viewer(scenario, self.get_name())
        endpoints = Endpoints(warn=self.get_logger().warning)
        clock = self._followed_clock(scenario)
        # With its namespace: a recording has the node's own topics.
        name = self.get_fully_qualified_name().strip("/")
        self.live = LiveSimulation(scenario, name, [events, *filter(None, [viewer])], endpoints, clock)
        events.stamps = self.live.stamps
        self.states = StatePublisher(self, frames, self.live.loop, self.live.stamps)
        self.states.configure(scenario.parameters)
        subscriber = CommandSubscriber(self, self.live.loop.commands, frames, bool(scenario.parameters.thrusters))
        self._parameters_in_flight = LiveParameters(self, super().set_parameters_atomically, self.live, self.states)
        endpoints.publish = self.states.publish
        endpoints.has_subscribers = self.states.find_subscribers
        endpoints.take_commands = subscriber.take
        endpoints.serve_steps = StepService(self, self.live).serve
        endpoints.parameters_changed = self._parameters_in_flight.changed
        offer_services(self, self.live)
        offer_simulation_interfaces(self, self.live)
        Diagnostics(self, self.live, subscriber)

    def _followed_clock(self, scenario: Scenario) -> Callable[[], int] | None:
        """/clock, when use_sim_time asks for it and it isn't our own."""
        if not self.get_parameter("use_sim_time").value or scenario.parameters.publish_clock:
            return None
        clock = self.get_clock()
        return lambda: clock.now().nanoseconds

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """All changes of parameters come here, on the executor's thread: checked, and handed to the physics thread."""
        return self._parameters_in_flight.set_together(parameter_list)
