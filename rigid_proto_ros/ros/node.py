# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters around one physics thread.

Callbacks run on the executor's thread; they convert and hand over. Commands don't come through callbacks at all: the
physics thread takes them itself (command_intake).
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..scene.offline import tell_start
from ..scene.scenario import BodyMesh, Scenario, check_inertia, make_scenario
from ..simulation.commands import ClearWrench, ReleaseString
from ..simulation.observer import Observer, Observers
from .command_intake import TOPICS, CommandIntake
from .diagnostics import REFUSAL_REASONS, Diagnostics
from .event_publisher import EventPublisher
from .flight import Flight
from .live_parameters import LiveParameters
from .node_name import NODE_NAME
from .parameter_server import declare_parameters
from .physics_thread import PhysicsThread, step_over
from .simulation_interfaces import offer_simulation_interfaces
from .state_publisher import StatePublisher


class RigidBodyNode(Node):
    """make_viewer(scenario, node name) gives an observer that shows the flight, or None. thread: the physics thread that
    carries ``flight``, to be set before anything is asked of the running node.

    Raises InputError when a parameter given at start is refused.
    """

    def __init__(
        self,
        make_viewer: Callable[[Scenario, str], Observer | None] = lambda *_: None,
        node_name: str = NODE_NAME,
        **node_options,
    ) -> None:
        super().__init__(node_name, start_parameter_services=False, **node_options)
        self.thread: PhysicsThread | None = None
        self.follows_clock = False
        self._others = 0
        scenario = make_scenario(declare_parameters(self))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        self.world_frame = scenario.parameters.world_frame
        self.body_frame = scenario.parameters.body_frame or self.get_name()
        self._event_publisher = EventPublisher(self, self.body_frame, self._mesh_path)
        self._viewer = make_viewer(scenario, self.get_name())
        self._recorder = self.open_recorder(scenario)
        self.observer = self._observers()
        self.states = StatePublisher(self, self.world_frame, self.body_frame, self._specific_force)
        self.states.configure(scenario.parameters)
        self.flight = Flight(
            scenario,
            self.observer,
            self.states.publish,
            self._take_commands,
            self._motion_failed,
            self._followed_clock(scenario),
            self._anybody_listens,
            self._is_viewed,
        )
        self.intake = CommandIntake(
            self,
            (self.world_frame, self.body_frame),
            self._apply_scheduled,
            self._apply_inertia,
        )
        self._live_parameters = LiveParameters(self)
        self.create_service(Trigger, "~/reset", _answering(self._on_reset))
        self.create_service(Trigger, "~/step", _answering(self._on_step))
        self.create_service(Trigger, "~/clear_wrench", _answering(self._on_clear_wrench))
        self.create_service(SetBool, "~/pause", _answering(self._on_pause))
        self.create_service(Trigger, "~/string/release", _answering(self._on_string_release))
        offer_simulation_interfaces(self)
        self._diagnostics = Diagnostics(self, self._diagnostic_values)
        tell_start(self.observer, scenario)
        self.flight.simulation.announce()
        self.tell_scene(scenario)

    def call(self, function: Callable):
        """Run a function on the physics thread; returns what it returns. Raises InputError when that is too busy."""
        if self.thread is None:
            return function()
        return self.thread.call(self.flight, function)

    def close(self) -> None:
        """After the physics thread has ended: whatever the observers hold goes out."""
        self.observer.close()

    def _observers(self) -> Observers:
        """All who watch the flight now."""
        return Observers(*filter(None, (self._event_publisher, self._viewer, self._recorder)))

    def _is_viewed(self) -> bool:
        return self._viewer is not None or self._recorder is not None

    def open_recorder(self, scenario: Scenario) -> Observer | None:
        """The recorder that ``record`` asks for; raises InputError when its file can't be written."""
        path = scenario.parameters.record
        if not path:
            return None
        from ..rerun_view.recorder import make_recorder

        return make_recorder(path, self.get_name(), scenario.parameters, self._recording_failed)

    def _recording_failed(self, message: str) -> None:
        print(f"{self.get_name()}: {message}", file=sys.stderr)

    def switch_recording(self, recorder: Observer | None) -> Observer | None:
        """On the physics thread: the new recording is told what flies. Returns the old one, to be closed by whom nobody waits for."""
        finished, self._recorder = self._recorder, recorder
        self.observer = self._observers()
        self.flight.watch(self.observer)
        if recorder is not None:
            tell_start(recorder, self.flight.scenario)
            recorder.scene_changed(self.flight.simulation.time_ns, self.flight.scenario.text)
            self.flight.simulation.introduce(recorder)
        return finished

    def _followed_clock(self, scenario: Scenario) -> Callable[[], int] | None:
        """/clock, when use_sim_time asks for it and it isn't our own."""
        if not self.get_parameter("use_sim_time").value or scenario.parameters.publish_clock:
            return None
        self.follows_clock = True
        clock = self.get_clock()
        return lambda: clock.now().nanoseconds

    # Commands, on the physics thread

    def _anybody_listens(self) -> bool:
        return self.states.look_for_subscribers()

    def _take_commands(self, wall_ns: int, whole: bool) -> bool:
        flight = self.flight
        return self.intake.take(flight.simulation, flight.scenario, wall_ns, flight.catch_up, whole)

    def _motion_failed(self, message: str) -> None:
        self.get_logger().error(f"paused in the last good state: {message}")

    def _specific_force(self):
        """At the contact that ~/imu is mounted at, or the COM."""
        contact, simulation = self.flight.scenario.parameters.imu_contact, self.flight.simulation
        body = simulation.setup.body
        point = body.point(simulation.setup.contacts[contact]) if contact else np.zeros(3)
        return simulation.specific_force(point)

    def _apply_scheduled(self, changes: dict, at_hand: BodyMesh | None):
        """A scheduled ``set`` takes effect: the ROS parameters follow on the executor's thread."""
        return self._take_on(self.flight.scenario.with_changes(changes, at_hand=at_hand))

    def _apply_inertia(self, content: dict):
        """An inertia message takes effect."""
        return self._take_on(check_inertia(self.flight.scenario, content))

    def _mesh_path(self) -> str:
        mesh = self.flight.scenario.body_mesh
        return mesh.mesh.path if mesh else ""

    def tell_scene(self, scenario: Scenario) -> None:
        self.observer.scene_changed(self.flight.simulation.time_ns, scenario.text)

    def check_change(self, scenario: Scenario) -> None:
        """On the physics thread: raises InputError where this scenario can't follow the present one."""
        if self.follows_clock and scenario.parameters.publish_clock:
            raise InputError(
                "publish_clock", True, "false, while simulated time follows the /clock of another (use_sim_time)"
            )
        self.flight.simulation.check_change(scenario.setup)

    def _take_on(self, scenario: Scenario):
        self.check_change(scenario)
        self.flight.change(scenario)
        self.tell_scene(scenario)
        self._live_parameters.changed()
        return scenario.setup

    # Parameters, on the executor's thread

    def set_parameters_atomically(self, parameter_list) -> SetParametersResult:
        """rclpy's way for all changes: checked, and handed to the physics thread."""
        return self._live_parameters.set_together(parameter_list)

    # Services, on the executor's thread

    def _on_reset(self, request, response):
        flight = self.flight
        self.call(flight.reset)
        return _answer(response, "simulated time is 0")

    def _on_step(self, request, response):
        flight = self.flight
        if not flight.timekeeping.paused:
            return _answer(response, "step: the simulation is running; pause it first", success=False)
        return _answer(response, f"simulated time is {step_over(self.call, flight) / 1e9:.9g} s")

    def _on_pause(self, request, response):
        flight = self.flight
        self.call(lambda: flight.pause(request.data))
        return _answer(response, "paused" if request.data else "running")

    def _on_string_release(self, request, response):
        self.call(lambda: self.flight.simulation.submit(ReleaseString()))
        return _answer(response, "the string is loose")

    def _on_clear_wrench(self, request, response):
        self.call(lambda: self.flight.simulation.submit(ClearWrench()))
        return _answer(response, "no wrench acts; scheduled ones stay")

    # Reports

    def _diagnostic_values(self) -> dict:
        flight, intake = self.flight, self.intake
        simulation, timekeeping = flight.simulation, flight.timekeeping
        # First: whatever happened up to then is counted in what follows.
        time_ns = simulation.time_ns
        momentum = simulation.angular_momentum
        # Counted last by the physics thread, so read first: who finds a message received finds its refusal too.
        received = dict(intake.received)
        refused = dict(simulation.refused)
        return {
            "sim_time_ns": time_ns,
            "publish_rate": flight.scenario.parameters.publish_rate,
            "overruns": timekeeping.overruns,
            "real_time_lost_s": timekeeping.real_time_lost_s,
            **{f"{topic}_received": received.get(topic, 0) for topic in TOPICS},
            "commands_received": sum(received.values()),
            "refused_total": sum(refused.values()),
            **{f"refused_{reason}": refused.get(reason, 0) for reason in REFUSAL_REASONS},
            "late": intake.late,
            "wall_stamp": intake.wall_stamp,
            "sequence_gaps": intake.sequence_gaps,
            "queue_full": intake.queue_full,
            "kinetic_energy": simulation.kinetic_energy,
            "potential_energy": simulation.potential_energy,
            "angular_momentum_norm": float((momentum * momentum).sum()) ** 0.5,
            "angular_momentum_drift": simulation.angular_momentum_drift,
            "integrator": simulation.setup.integrator.name,
            "integrator_choice": simulation.choice,
            "accuracy_floor": simulation.accuracy_floor,
            "steps": simulation.steps,
            "force_evaluations": simulation.force_evaluations,
            "state": "paused" if timekeeping.paused else "sleeping" if simulation.at_rest else "flying",
            "recording": "" if getattr(self._recorder, "error", "not recording") else flight.scenario.parameters.record,
            "warning": simulation.failure or self._namesake() or simulation.too_coarse or simulation.too_slow,
        }

    def _namesake(self) -> str:
        """What to say when somebody else publishes the same states; logged when it begins."""
        before, self._others = self._others, self.count_publishers("~/pose") - 1
        if self._others <= 0:
            return ""
        warning = f"another node publishes {self.get_fully_qualified_name()}/pose: nodes of the same name receive each other's commands"
        if before <= 0:
            self.get_logger().warning(warning)
        return warning


def _answering(callback: Callable) -> Callable:
    """A service callback that answers with what was wrong instead of raising it."""

    def answer(request, response):
        try:
            return callback(request, response)
        except InputError as error:
            return _answer(response, str(error), success=False)

    return answer


def _answer(response, message: str, success: bool = True):
    response.success, response.message = success, message
    return response
