# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters of one body, which the physics thread advances.

Callbacks run on the executor's thread: they convert a request and pass it to the physics thread. Commands use no
callbacks: the physics thread takes them from the middleware (commands.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.command_receiver import CommandReceiver
from ..live.live_simulation import LiveSimulation
from ..live.pacing import Stamps
from ..live.simulation_loop import Endpoints, SimulationLoop
from ..scene.command_codec import frame_names
from ..scene.scenario import Scenario, make_scenario
from ..scene.scenario_run import ScenarioRun
from ..simulation.commands import ClearWrench, ReleaseString
from ..simulation.observer import Observer
from .arguments import NODE_NAME
from .arrivals import Arrivals
from .commands import CommandSubscriber, StepService
from .diagnostics import Diagnostics
from .parameters import LiveParameters, declare_parameters
from .publishers import EventPublisher, StatePublisher
from .simulation_interfaces import offer_simulation_interfaces


def offer_services(node: Node, live: LiveSimulation) -> None:
    """Create the services reset, clear_wrench, string/release and pause in the node's private namespace; ``~/step`` is
    in commands.py.
    """

    def offer(service_type: Any, name: str, function: Callable[[Any], None], done: Callable[[Any], str]) -> None:
        """A service that calls function(request) and answers with done(request), or with the error."""

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


class NodeEndpoints(Endpoints):
    """Connects the loop to topics, commands and the log of one node."""

    def __init__(
        self, node: RigidBodyNode, states: StatePublisher, arrivals: Arrivals, subscriber: CommandSubscriber
    ) -> None:
        super().__init__()
        self._states = states
        self._arrivals = arrivals
        self._subscriber = subscriber
        self._steps = StepService(arrivals)
        self._logger = node.get_logger()
        self._parameters_behind = node.create_guard_condition(lambda: node.follow_parameters())

    def publish(self, run: ScenarioRun) -> None:
        """See Endpoints."""
        self._states.publish(run)

    def has_subscribers(self) -> bool:
        """See Endpoints."""
        return self._states.find_subscribers()

    def take_commands(self, commands: CommandReceiver, wall_ns: int, at_once: bool) -> bool:
        """See Endpoints."""
        return self._subscriber.take(commands, wall_ns, at_once)

    def serve_steps(self, loop: SimulationLoop) -> None:
        """See Endpoints."""
        self._steps.serve(loop)

    def parameters_changed(self) -> None:
        """See Endpoints; the node's ROS parameters are updated on the executor's thread."""
        self._parameters_behind.trigger()

    def wait(self, timeout_s: float) -> bool:
        """See Endpoints."""
        return self._arrivals.wait(timeout_s)

    def wake(self) -> None:
        """See Endpoints."""
        self._arrivals.wake()

    def say(self, message: str) -> None:
        """See Endpoints."""
        self._logger.info(message)

    def warn(self, message: str) -> None:
        """See Endpoints."""
        self._logger.warning(message)


class RigidBodyNode(Node):
    """The node of one body. values: parameters by name as in scene files; the others have their defaults.
    make_viewer(scenario, node): returns an observer that shows the body, or None. ``live``, the simulation, runs after
    its ``announce`` and ``start``.

    Raises InputError if a parameter given at start is refused.
    """

    def __init__(
        self,
        values: Mapping[str, object],
        make_viewer: Callable[[Scenario, Node], Observer | None] = lambda *_: None,
    ) -> None:
        super().__init__(NODE_NAME)
        scenario = make_scenario(declare_parameters(self, values))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        frames = frame_names(scenario.parameters, self.get_fully_qualified_name())
        stamps = Stamps(self._followed_clock(scenario))
        events = EventPublisher(self, frames[1], stamps)
        viewer = make_viewer(scenario, self)
        arrivals = Arrivals(self)
        self.states = StatePublisher(self, frames, stamps, arrivals.note)
        self.states.configure(scenario.parameters)
        subscriber = CommandSubscriber(self, arrivals, frames, bool(scenario.parameters.thrusters))
        endpoints = NodeEndpoints(self, self.states, arrivals, subscriber)
        # With the namespace, so that a recording has the node's topic names.
        name = self.get_fully_qualified_name().strip("/")
        self.live = LiveSimulation(scenario, name, [events, *filter(None, [viewer])], endpoints, stamps)
        self._parameters_in_flight = LiveParameters(self, super().set_parameters_atomically, self.live, self.states)
        offer_services(self, self.live)
        offer_simulation_interfaces(self, self.live)
        Diagnostics(self, self.live, subscriber)

    def _followed_clock(self, scenario: Scenario) -> Callable[[], int] | None:
        """The time of /clock [ns] if use_sim_time is set and this node doesn't publish /clock itself."""
        if not self.get_parameter("use_sim_time").value or scenario.parameters.publish_clock:
            return None
        clock = self.get_clock()
        return lambda: clock.now().nanoseconds

    def follow_parameters(self) -> None:
        """Set the ROS parameters to the simulation's present ones."""
        self._parameters_in_flight.follow()

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Check parameter changes and pass them to the physics thread; rclpy calls this for every change, on the
        executor's thread.
        """
        return self._parameters_in_flight.set_together(parameter_list)
