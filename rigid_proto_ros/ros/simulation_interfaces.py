# SPDX-License-Identifier: MIT
"""The standard simulator services (simulation_interfaces), where that package is installed.

Only what this simulator does is offered and listed: reset, pause and play, single and multiple steps, also as an
action (step_action.py), and what there is to know of the body and to set of its state (entity_services.py). There is
one body and no world, so nothing is spawned, loaded or deleted.
"""

from __future__ import annotations

from typing import Any

from rclpy.node import Node

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from . import entity_services
from .entity_services import EntityServices
from .step_action import StepAction

SERVICES = (
    ("GetSimulatorFeatures", "get_simulator_features"),
    ("ResetSimulation", "reset_simulation"),
    ("GetSimulationState", "get_simulation_state"),
    ("SetSimulationState", "set_simulation_state"),
    ("StepSimulation", "step_simulation"),
)
MAX_STEPS = 1_000_000
"""Publications that one call may step over."""


class SimulationInterfaces:
    """Answers the standard services for one node; call ``offer`` once."""

    def __init__(self, live: LiveSimulation, messages: Any, entity: EntityServices) -> None:
        self._live = live
        self._loop = live.loop
        self._messages = messages
        self._entity = entity
        self._stopped = False

    def offer(self, node: Node, services: Any) -> None:
        """Create the services, private to the node."""
        for service_type, name in SERVICES:
            node.create_service(getattr(services, service_type), f"~/{name}", getattr(self, name))
        for service_type, name in entity_services.SERVICES:
            node.create_service(getattr(services, service_type), f"~/{name}", self._entity.answers[name])

    def get_simulator_features(self, _: Any, response: Any) -> Any:
        """What is really supported, and nothing else: a feature of a single scope would mean that a reset
        takes it alone.
        """
        features = self._messages.SimulatorFeatures
        response.features.features = [
            *self._entity.features(),
            features.SIMULATION_RESET,
            features.SIMULATION_STATE_GETTING,
            features.SIMULATION_STATE_SETTING,
            features.SIMULATION_STATE_PAUSE,
            features.STEP_SIMULATION_SINGLE,
            features.STEP_SIMULATION_MULTIPLE,
            features.STEP_SIMULATION_ACTION,
        ]
        response.features.spawn_formats = []
        response.features.custom_info = (
            "One rigid body, set by parameters, which a reset keeps. A step is one publication period. "
            "Time and state are reset together: SCOPE_ALL."
        )
        return response

    def reset_simulation(self, request: Any, response: Any) -> Any:
        """Time and state together: SCOPE_ALL, or both scopes; nothing was spawned."""
        both = request.SCOPE_TIME | request.SCOPE_STATE
        if request.scope not in (request.SCOPE_DEFAULT, request.SCOPE_ALL) and request.scope & both != both:
            return self._unsupported(response, f"scope {request.scope}: time and state are reset together")
        self._live.reset()
        return self._done(response)

    def _state(self) -> int:
        """Stopped is paused at time 0 after a request to stop: nothing else tells the two apart."""
        states, loop = self._messages.SimulationState, self._loop
        if not loop.timekeeping.paused:
            return states.STATE_PLAYING
        stopped = self._stopped and loop.simulation.time_ns == 0
        return states.STATE_STOPPED if stopped else states.STATE_PAUSED

    def get_simulation_state(self, _: Any, response: Any) -> Any:
        """Playing, paused or stopped."""
        response.state.state = self._state()
        return self._done(response)

    def set_simulation_state(self, request: Any, response: Any) -> Any:
        """Play, pause, or stop, which is to pause and reset."""
        states = self._messages.SimulationState
        wanted = request.state.state
        if wanted not in (states.STATE_STOPPED, states.STATE_PLAYING, states.STATE_PAUSED):
            accepted = "0 stopped, 1 playing or 2 paused; end the node by a signal"
            return self._unsupported(response, f"state {wanted}: {accepted}")
        if wanted == self._state():
            response.result.result = response.ALREADY_IN_TARGET_STATE
            return response
        self._stopped = wanted == states.STATE_STOPPED
        if self._stopped:
            self._live.call(self._stop)
        else:
            self._live.pause(wanted == states.STATE_PAUSED)
        return self._done(response)

    def _stop(self) -> None:
        self._loop.pause(True)
        self._loop.reset()

    def step_simulation(self, request: Any, response: Any) -> Any:
        """Step over publications, while paused."""
        loop, results = self._loop, self._messages.Result
        if not loop.timekeeping.paused:
            response.result.result = results.RESULT_OPERATION_FAILED
            response.result.error_message = "the simulation is running; pause it first"
        elif not 1 <= request.steps <= MAX_STEPS:
            response.result.result = results.RESULT_OPERATION_FAILED
            response.result.error_message = f"{request.steps} steps: 1 to {MAX_STEPS}"
        else:
            try:
                self._live.step(request.steps)
            except InputError as error:
                response.result.result = results.RESULT_OPERATION_FAILED
                response.result.error_message = str(error)
                return response
            return self._done(response)
        return response

    def _done(self, response: Any) -> Any:
        response.result.result = self._messages.Result.RESULT_OK
        return response

    def _unsupported(self, response: Any, message: str) -> Any:
        response.result.result = self._messages.Result.RESULT_FEATURE_UNSUPPORTED
        response.result.error_message = message
        return response


def offer_simulation_interfaces(node: Node, live: LiveSimulation) -> bool:
    """Offer the standard services on the node; False where simulation_interfaces isn't installed."""
    try:
        from simulation_interfaces import action, msg, srv
    except ImportError:
        return False
    entity = EntityServices(live, msg)
    SimulationInterfaces(live, msg, entity).offer(node, srv)
    StepAction(live, msg, action.SimulateSteps).offer(node)
    return True
