# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters around one body that the physics thread advances.

Callbacks run on the executor's thread; they convert and hand over. Commands don't come through callbacks at all: the
physics thread takes them itself (command_intake.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..scene.command_codec import frame_names
from ..scene.offline import notify_start
from ..scene.scenario import BodyMesh, Scenario, make_scenario
from ..simulation.observer import Observer
from ..simulation.setup import Setup
from .arguments import NODE_NAME
from .command_intake import CommandIntake
from .command_queue import Unserved
from .diagnostics import Diagnostics
from .event_publisher import EventPublisher
from .live_parameters import LiveParameters
from .pacing import Stamps
from .parameter_server import declare_parameters
from .physics_thread import PhysicsThread
from .services import Services
from .simulation_interfaces import offer_simulation_interfaces
from .simulation_loop import SimulationLoop
from .state_publisher import StatePublisher
from .static_frames import StaticFrames
from .step_service import StepService
from .watchers import Watchers


class RigidBodyNode(Node):
    """values: parameters by name as scene files give them, the others at their defaults. physics: the thread that
    advances ``loop`` once it is started with it. make_viewer(scenario, node name) gives an observer that shows the
    body, or None.

    Raises InputError when a parameter given at start is refused.
    """

    def __init__(
        self,
        physics: PhysicsThread,
        values: Mapping[str, object],
        make_viewer: Callable[[Scenario, str], Observer | None] = lambda *_: None,
        node_name: str = NODE_NAME,
    ) -> None:
        super().__init__(node_name, start_parameter_services=False)
        scenario = make_scenario(declare_parameters(self, values))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        frames = frame_names(scenario.parameters, self.get_name())
        stamps = Stamps(self._followed_clock(scenario))
        static_frames = StaticFrames(self, frames, scenario.setup.contacts, stamps)
        events = EventPublisher(self, frames[1], self._mesh_path, static_frames, stamps)
        self._watchers = Watchers(
            self.get_name(), events, make_viewer(scenario, self.get_name()), self._recording_failed
        )
        self.states = StatePublisher(self, *frames, self._specific_force, stamps)
        self.states.configure(scenario.parameters)
        self.loop = SimulationLoop(
            scenario,
            self._watchers.observer,
            self.states.publish,
            self._take_commands,
            self._motion_failed,
            stamps,
            self.states.find_subscribers,
            lambda: self._watchers.are_there,
        )
        self.call = partial(physics.call, self.loop)
        self.intake = CommandIntake(self, self.loop, frames, static_frames, self._apply_scheduled, self._apply_inertia)
        self._live_parameters = LiveParameters(
            self, super().set_parameters_atomically, self.loop, self.call, self._watchers, self.states
        )
        self._watchers.record_to(self._watchers.open_recorder(scenario))
        self.loop.watch(self._watchers.observer)
        Services(self.loop, self.call, self.intake).offer(self)
        self.loop.serve_steps = StepService(self, self.loop, self.intake, Unserved()).serve
        offer_simulation_interfaces(self, self.loop, self.call)
        self.diagnostics = Diagnostics(self, self.loop, self.intake, self._watchers)
        notify_start(self._watchers.observer, scenario)
        self.loop.simulation.announce()
        self.loop.notify_scene()

    def close(self) -> None:
        """After the physics thread has ended: whatever the observers hold goes out."""
        self._watchers.close()

    def _recording_failed(self, message: str) -> None:
        self.get_logger().error(message)
        self._live_parameters.changed()

    def _followed_clock(self, scenario: Scenario) -> Callable[[], int] | None:
        """/clock, when use_sim_time asks for it and it isn't our own."""
        if not self.get_parameter("use_sim_time").value or scenario.parameters.publish_clock:
            return None
        clock = self.get_clock()
        return lambda: clock.now().nanoseconds

    # On the physics thread

    def _take_commands(self, wall_ns: int, all_topics: bool) -> bool:
        return self.intake.take(wall_ns, all_topics)

    def _motion_failed(self, message: str) -> None:
        self.get_logger().error(f"paused in the last good state: {message}")

    def _specific_force(self) -> np.ndarray:
        """At the contact that ~/imu is mounted at, or the COM."""
        contact, simulation = self.loop.scenario.parameters.imu_contact, self.loop.simulation
        body = simulation.setup.body
        point = body.point(simulation.setup.contacts[contact]).tolist() if contact else (0.0, 0.0, 0.0)
        return simulation.specific_force(point)

    def _mesh_path(self) -> str:
        mesh = self.loop.scenario.body_mesh
        return mesh.mesh.path if mesh else ""

    def _apply_scheduled(self, changes: Mapping, at_hand: BodyMesh | None) -> Setup:
        """A scheduled ``set`` takes effect: the ROS parameters follow on the executor's thread."""
        setup = self.loop.change(changes, at_hand=at_hand)
        self._live_parameters.changed()
        return setup

    def _apply_inertia(self, content: Mapping) -> Setup:
        """An inertia message takes effect."""
        setup = self.loop.change_inertia(content)
        self._live_parameters.changed()
        return setup

    # On the executor's thread

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """All changes of parameters come here: checked, and handed to the physics thread."""
        return self._live_parameters.set_together(parameter_list)
