# SPDX-License-Identifier: MIT
"""The node: topics, services and parameters around one physics thread.

Callbacks run on the executor's thread; they convert and hand over. Commands don't come through callbacks at all: the
physics thread takes them itself (command_intake).
"""

from __future__ import annotations

from collections.abc import Callable

from geometry_msgs.msg import InertiaStamped, PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from .. import cdr
from ..core.commands import Change, ClearWrench
from ..core.errors import CommandRefused, InputError
from ..core.observer import BodySnapshot, Observer, Observers
from ..core.rotation import rotate
from ..core.state import State
from ..offline import tell_start
from ..parameters import parameter_named
from ..scenario import Scenario, make_scenario
from . import qos
from .command_intake import CommandIntake
from .diagnostics import REFUSAL_REASONS, Diagnostics
from .node_name import NODE_NAME
from .parameter_server import converted, declare_parameters, ros_parameter
from .physics_thread import PhysicsThread


class RigidBodyNode(Node):
    """make_observer(scenario, node name) gives the viewer and recorder, or a null Observer.

    Raises InputError when a parameter given at start is refused.
    """

    def __init__(self, make_observer: Callable[[Scenario, str], Observer] | None = None, **node_options) -> None:
        super().__init__(NODE_NAME, **node_options)
        scenario = make_scenario(declare_parameters(self))
        for warning in scenario.warnings:
            self.get_logger().warning(warning)
        self.world_frame = scenario.values["world_frame"]
        self.body_frame = scenario.values["body_frame"] or self.get_name()
        self._inertia = self.create_publisher(
            InertiaStamped, "~/inertia", qos.LATCHED, qos_overriding_options=qos.OVERRIDABLE
        )
        viewer = make_observer(scenario, self.get_name()) if make_observer else Observer()
        self.observer = Observers(_InertiaPublisher(self), viewer)
        self.states = _StatePublisher(self, self.world_frame, self.body_frame)
        self.physics = PhysicsThread(
            scenario, self.observer, self.states.publish, self._take_commands, self._motion_failed
        )
        self.intake = CommandIntake(
            self, (self.world_frame, self.body_frame), self._apply_scheduled, self._command_refused
        )
        self._scheduled_changes: list[dict] = []
        self._scheduled_guard = self.create_guard_condition(self._store_scheduled_changes)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(Trigger, "~/step", self._on_step)
        self.create_service(Trigger, "~/clear_wrench", self._on_clear_wrench)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self._diagnostics = Diagnostics(self, self._diagnostic_values)
        tell_start(self.observer, scenario)
        self.physics.simulation.announce()

    def start(self) -> None:
        """Begin simulated time."""
        self.physics.start()

    def stop(self) -> None:
        """End simulated time; whatever the observers hold goes out."""
        self.physics.stop()
        self.observer.close()

    # Commands, on the physics thread

    def _take_commands(self) -> None:
        self.intake.take(self.physics.simulation, self.physics.scenario)

    def _command_refused(self, refusal: CommandRefused) -> None:
        self.get_logger().warning(f"refused: {refusal}", throttle_duration_sec=1.0)

    def _motion_failed(self, message: str) -> None:
        self.get_logger().error(f"paused in the last good state: {message}")

    def _apply_scheduled(self, changes: dict):
        """A scheduled ``set`` takes effect: the parameters follow on the executor's thread."""
        scenario = self.physics.scenario.with_changes(changes)
        self.physics.change(scenario)
        self._scheduled_changes.append({name: scenario.values[name] for name in changes})
        self._scheduled_guard.trigger()
        return scenario.setup

    # Parameters, on the executor's thread

    def set_parameters_atomically(self, parameter_list) -> SetParametersResult:
        """Convert, check together, and hand over to the physics thread; a refusal leaves all as it was."""
        try:
            parameter_list = converted(parameter_list)
            for parameter in parameter_list:
                if parameter.name.startswith("ballast.") and not self.has_parameter(parameter.name):
                    raise InputError(parameter.name, parameter.value, "a ballast that was there at the start")
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        read_only = [p.name for p in parameter_list if self.has_parameter(p.name) and self._is_read_only(p.name)]
        if read_only:
            return SetParametersResult(successful=False, reason=f"{', '.join(read_only)}: can be set at start only")
        changes = {p.name: p.value for p in parameter_list if p.name in self.physics.scenario.values}
        if "density" in changes and "mass" not in changes:
            changes["mass"] = 0.0
            parameter_list = [*parameter_list, *self._as_ros({"mass": 0.0})]
        try:
            if changes:
                self._change(changes)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return super().set_parameters_atomically(parameter_list)

    def _is_read_only(self, name: str) -> bool:
        return self.describe_parameter(name).read_only

    def _change(self, changes: dict) -> None:
        # Loading a mesh takes time that the physics thread hasn't got: this fills the caches before it.
        self.physics.scenario.with_changes(changes)

        def change() -> None:
            scenario = self.physics.scenario.with_changes(changes)
            self.physics.change(scenario)
            self.physics.simulation.submit(Change(changes, lambda: scenario.setup))

        self.physics.call(change)

    def _store_scheduled_changes(self) -> None:
        while self._scheduled_changes:
            super().set_parameters_atomically(self._as_ros(self._scheduled_changes.pop(0)))

    def _as_ros(self, values: dict) -> list:
        return [ros_parameter(parameter_named(name), value) for name, value in values.items()]

    # Services, on the executor's thread

    def _on_reset(self, request, response):
        physics = self.physics
        physics.call(physics.reset)
        return _answer(response, "simulated time is 0")

    def _on_step(self, request, response):
        physics = self.physics
        if not physics.timekeeping.paused:
            return _answer(response, "step: the simulation is running; pause it first", success=False)
        reached_ns = physics.call(physics.step)
        return _answer(response, f"simulated time is {reached_ns / 1e9:.9g} s")

    def _on_pause(self, request, response):
        physics = self.physics
        physics.call(lambda: physics.pause(request.data))
        return _answer(response, "paused" if request.data else "running")

    def _on_clear_wrench(self, request, response):
        self.physics.call(lambda: self.physics.simulation.submit(ClearWrench()))
        return _answer(response, "no wrench acts; scheduled ones stay")

    # Reports

    def _diagnostic_values(self) -> dict:
        physics, intake = self.physics, self.intake
        simulation, timekeeping = physics.simulation, physics.timekeeping
        momentum = simulation.angular_momentum
        refused = dict(simulation.refused)
        return {
            "sim_time_ns": simulation.time_ns,
            "publish_rate": physics.scenario.values["publish_rate"],
            "overruns": timekeeping.overruns,
            "real_time_lost_s": timekeeping.real_time_lost_s,
            **{f"{topic}_received": intake.received[topic] for topic in ("wrench", "poke", "schedule")},
            "commands_received": intake.commands_received,
            "refused_total": sum(refused.values()),
            **{f"refused_{reason}": refused.get(reason, 0) for reason in REFUSAL_REASONS},
            "late": intake.late,
            "wall_stamp": intake.wall_stamp,
            "kinetic_energy": simulation.kinetic_energy,
            "potential_energy": simulation.potential_energy,
            "angular_momentum_norm": float((momentum * momentum).sum()) ** 0.5,
            "angular_momentum_drift": simulation.angular_momentum_drift,
            "integrator": simulation.setup.integrator.name,
            "state": "paused" if timekeeping.paused else "sleeping" if simulation.at_rest else "flying",
            "recording": physics.scenario.values["record"],
            "failure": simulation.failure,
        }

    def publish_inertia(self, time_ns: int, body: BodySnapshot) -> None:
        """The latched inertia: COM in scaled mesh coordinates, tensor about it in mesh axes."""
        message = InertiaStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        message.header.frame_id = f"{self.body_frame}/mesh"
        inertia, I = message.inertia, body.inertia
        inertia.m = body.mass
        inertia.com.x, inertia.com.y, inertia.com.z = body.center_of_mass.tolist()
        inertia.ixx, inertia.ixy, inertia.ixz = float(I[0, 0]), float(I[0, 1]), float(I[0, 2])
        inertia.iyy, inertia.iyz, inertia.izz = float(I[1, 1]), float(I[1, 2]), float(I[2, 2])
        self._inertia.publish(message)


def _answer(response, message: str, success: bool = True):
    response.success, response.message = success, message
    return response


class _InertiaPublisher(Observer):
    def __init__(self, node: RigidBodyNode) -> None:
        self._node = node

    def body_changed(self, time_ns: int, body: BodySnapshot) -> None:
        self._node.publish_inertia(time_ns, body)


class _StatePublisher:
    """Pose, twist and odometry as packed bytes; nothing is packed for a topic that nobody listens to."""

    def __init__(self, node: Node, world_frame: str, body_frame: str) -> None:
        def publisher(message_type, topic):
            return node.create_publisher(message_type, f"~/{topic}", qos.STATE, qos_overriding_options=qos.OVERRIDABLE)

        self._pose = publisher(PoseStamped, "pose"), cdr.StampedTemplate(world_frame, 7)
        self._twist = publisher(TwistStamped, "twist"), cdr.StampedTemplate(world_frame, 6)
        self._odom = (
            publisher(Odometry, "odom"),
            cdr.StampedTemplate(world_frame, cdr.ODOMETRY_DOUBLES, child_frame_id=body_frame),
        )

    def publish(self, state: State) -> None:
        """Publish one state on every topic that has a subscriber."""
        time_ns, row = state.time_ns, state.row.tolist()
        q, v, w = row[3:7], row[7:10], row[10:13]
        publisher, template = self._pose
        if publisher.get_subscription_count():
            publisher.publish(bytes(template.pack(time_ns, row[:7])))
        publisher, template = self._twist
        if publisher.get_subscription_count():
            publisher.publish(bytes(template.pack(time_ns, [*v, *rotate(*q, *w)])))
        publisher, template = self._odom
        if publisher.get_subscription_count():
            # An Odometry's twist is in the child frame: body axes.
            template.pack(time_ns, row[:7])
            v_body = rotate(-q[0], -q[1], -q[2], q[3], *v)
            publisher.publish(bytes(template.pack(time_ns, [*v_body, *w], at=cdr.ODOMETRY_TWIST_AT)))
