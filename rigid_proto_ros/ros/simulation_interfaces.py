# SPDX-License-Identifier: MIT
"""The standard simulator services (package simulation_interfaces), if it is installed: typed requests, each answered
with a result code.

Offered are reset, pause and play, steps, and reading and setting the state of the one body. There is no world, so
nothing can be spawned, loaded or deleted.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node

from ..base.errors import CommandRefused, InputError
from ..live.live_simulation import LiveSimulation
from ..simulation.commands import SetState

SERVICES = (
    ("GetSimulatorFeatures", "get_simulator_features"),
    ("ResetSimulation", "reset_simulation"),
    ("GetSimulationState", "get_simulation_state"),
    ("SetSimulationState", "set_simulation_state"),
    ("StepSimulation", "step_simulation"),
    ("GetEntityState", "get_entity_state"),
    ("SetEntityState", "set_entity_state"),
)
MAX_STEPS = 1_000_000
"""Largest number of publications in one request to step."""


class SimulationInterfaces:
    """Answers the standard services for one node; call ``offer`` once. messages: simulation_interfaces.msg."""

    def __init__(self, live: LiveSimulation, messages: Any) -> None:
        self._live = live
        self._loop = live.loop
        self._messages, self._results = messages, messages.Result
        self._entity = live.name.rpartition("/")[2]

    def offer(self, node: Node, services: Any) -> None:
        """Create the services, private to the node."""
        for service_type, name in SERVICES:
            node.create_service(getattr(services, service_type), f"~/{name}", partial(self.answer, getattr(self, name)))

    def answer(self, serve: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
        """The response of serve(request, response), or one with the error."""
        try:
            return serve(request, response)
        except InputError as error:
            return _ended(response, self._results.RESULT_OPERATION_FAILED, str(error))

    # The simulation

    def get_simulator_features(self, _: Any, response: Any) -> Any:
        """List the supported features. Features of a single reset scope are left out, since time and state are reset
        together.
        """
        features = self._messages.SimulatorFeatures
        response.features.features = [
            features.ENTITY_STATE_GETTING,
            features.ENTITY_STATE_SETTING,
            features.SIMULATION_RESET,
            features.SIMULATION_STATE_GETTING,
            features.SIMULATION_STATE_SETTING,
            features.SIMULATION_STATE_PAUSE,
            features.STEP_SIMULATION_SINGLE,
            features.STEP_SIMULATION_MULTIPLE,
        ]
        response.features.spawn_formats = []
        response.features.custom_info = (
            "One rigid body, defined by parameters, which a reset keeps. A step is one publication period. "
            "Time and state are reset together: SCOPE_ALL."
        )
        return response

    def reset_simulation(self, request: Any, response: Any) -> Any:
        """Reset time and state together: SCOPE_ALL, or both scopes. Spawned entities don't exist."""
        both = request.SCOPE_TIME | request.SCOPE_STATE
        if request.scope not in (request.SCOPE_DEFAULT, request.SCOPE_ALL) and request.scope & both != both:
            unsupported = self._results.RESULT_FEATURE_UNSUPPORTED
            return _ended(response, unsupported, f"scope {request.scope}: time and state are reset together")
        self._live.reset()
        return _ended(response, self._results.RESULT_OK)

    def _simulation_state(self) -> int:
        states = self._messages.SimulationState
        return int(states.STATE_PAUSED if self._live.paused else states.STATE_PLAYING)

    def get_simulation_state(self, _: Any, response: Any) -> Any:
        """Return playing or paused."""
        response.state.state = self._simulation_state()
        return _ended(response, self._results.RESULT_OK)

    def set_simulation_state(self, request: Any, response: Any) -> Any:
        """Play or pause."""
        states = self._messages.SimulationState
        wanted = request.state.state
        if wanted not in (states.STATE_PLAYING, states.STATE_PAUSED):
            accepted = "1 playing or 2 paused; reset_simulation for time 0, and a signal ends the node"
            return _ended(response, self._results.RESULT_FEATURE_UNSUPPORTED, f"state {wanted}: {accepted}")
        if wanted == self._simulation_state():
            return _ended(response, response.ALREADY_IN_TARGET_STATE)
        self._live.pause(wanted == states.STATE_PAUSED)
        return _ended(response, self._results.RESULT_OK)

    def step_simulation(self, request: Any, response: Any) -> Any:
        """Advance over ``steps`` publications, while paused."""
        if not 1 <= request.steps <= MAX_STEPS:
            raise InputError("steps", request.steps, f"1 to {MAX_STEPS}")
        self._live.step(request.steps)
        return _ended(response, self._results.RESULT_OK)

    # The body

    def get_entity_state(self, request: Any, response: Any) -> Any:
        """Return exact pose, twist and acceleration, in world axes."""
        if not self._is_known(request.entity, response):
            return response
        simulation, message = self._loop.simulation, response.state
        state, (linear, angular) = self._live.call(lambda: (simulation.state, simulation.accelerations()))
        message.header.frame_id = self._live.frames[0]
        message.header.stamp.sec, message.header.stamp.nanosec = self._loop.stamps.of(state.time_ns)
        q = message.pose.orientation
        q.x, q.y, q.z, q.w = state.orientation_xyzw.tolist()
        for vector, values in (
            (message.pose.position, state.position),
            (message.twist.linear, state.linear_velocity),
            (message.twist.angular, state.angular_velocity),
            (message.acceleration.linear, linear),
            (message.acceleration.angular, angular),
        ):
            vector.x, vector.y, vector.z = values.tolist()
        return response

    def set_entity_state(self, request: Any, response: Any) -> Any:
        """Set the body's state by a command, which is logged and replayed; accelerations follow from the loads."""
        if not self._is_known(request.entity, response):
            return response
        frame, world = request.state.header.frame_id, self._live.frames[0]
        # The requests of Jazzy and Kilted have no set_... flags: pose and twist are set, the acceleration is ignored.
        accelerates = getattr(request, "set_acceleration", False)
        if accelerates or frame not in ("", "world", world):
            what = "set_acceleration" if accelerates else f"frame {frame!r}"
            return _ended(response, self._results.RESULT_FEATURE_UNSUPPORTED, f"{what}: pose and twist in {world}")
        values: dict[str, tuple[float, ...]] = {}
        if getattr(request, "set_pose", True):
            p, q = request.state.pose.position, request.state.pose.orientation
            values |= {"position": (p.x, p.y, p.z), "orientation_xyzw": (q.x, q.y, q.z, q.w)}
        if getattr(request, "set_twist", True):
            v, w = request.state.twist.linear, request.state.twist.angular
            values |= {"linear_velocity": (v.x, v.y, v.z), "angular_velocity": (w.x, w.y, w.z)}
        try:
            command = SetState(values)
        except CommandRefused as refusal:
            invalid = getattr(response, "INVALID_POSE", self._results.RESULT_OPERATION_FAILED)
            return _ended(response, invalid, str(refusal))
        if values:
            self._live.submit(command)
        return _ended(response, self._results.RESULT_OK)

    def _is_known(self, entity: str, response: Any) -> bool:
        if entity == self._entity:
            _ended(response, self._results.RESULT_OK)
            return True
        message = f"there is no {entity!r}; the only entity is {self._entity!r}"
        _ended(response, self._results.RESULT_NOT_FOUND, message)
        return False


def _ended(response: Any, result: int, message: str = "") -> Any:
    response.result.result, response.result.error_message = result, message
    return response


def offer_simulation_interfaces(node: Node, live: LiveSimulation) -> bool:
    """Offer the standard services on the node; False where simulation_interfaces isn't installed."""
    try:
        from simulation_interfaces import msg, srv
    except ImportError:
        return False
    SimulationInterfaces(live, msg).offer(node, srv)
    return True
