# SPDX-License-Identifier: MIT
"""The standard services about entities (simulation_interfaces): there is the node's body, named after the node."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ..base.errors import CommandRefused
from ..base.rotation import transposed_times
from ..live.live_simulation import LiveSimulation
from ..simulation.commands import SetState

SERVICES = (
    ("GetEntities", "get_entities"),
    ("GetEntitiesStates", "get_entities_states"),
    ("GetEntityInfo", "get_entity_info"),
    ("GetEntityState", "get_entity_state"),
    ("SetEntityState", "set_entity_state"),
    ("GetEntityBounds", "get_entity_bounds"),
)


class EntityServices:
    """Answers for one body. messages: the modules simulation_interfaces.msg."""

    def __init__(self, live: LiveSimulation, messages: Any) -> None:
        self._loop = live.loop
        self._call = live.call
        self._messages = messages
        self._name = live.name
        self._world_frame = live.frames[0]

    def features(self) -> list[int]:
        """What is supported of it."""
        known = self._messages.SimulatorFeatures
        return [
            known.ENTITY_BOUNDS,
            known.ENTITY_CATEGORIES,
            known.ENTITY_STATE_GETTING,
            known.ENTITY_STATE_SETTING,
            known.ENTITY_INFO_GETTING,
        ]

    def get_entities(self, request: Any, response: Any) -> Any:
        """The body's name, where the filters let it through."""
        response.entities = self._filtered(request.filters, response)
        return response

    def get_entities_states(self, request: Any, response: Any) -> Any:
        """Name and state, where the filters let it through."""
        response.entities = self._filtered(request.filters, response)
        response.states = [self._state(self._messages.EntityState()) for _ in response.entities]
        return response

    def get_entity_info(self, request: Any, response: Any) -> Any:
        """A moving object, and its mesh."""
        if self._is_known(request.entity, response):
            response.info.category.category = self._messages.EntityCategory.CATEGORY_DYNAMIC_OBJECT
            parameters = self._loop.scenario.parameters
            response.info.description = (
                f"rigid body, mesh {parameters.mesh!r}, inertia model {parameters.inertia_model}"
            )
        return response

    def get_entity_state(self, request: Any, response: Any) -> Any:
        """True pose, twist and acceleration, in world axes."""
        if self._is_known(request.entity, response):
            self._state(response.state)
        return response

    def set_entity_state(self, request: Any, response: Any) -> Any:
        """Put the body elsewhere, as a command that is logged and replayed; accelerations follow from the loads."""
        if not self._is_known(request.entity, response):
            return response
        frame, results = request.state.header.frame_id, self._messages.Result
        # The releases for Jazzy and Kilted have no switches: pose and twist are meant, the acceleration may be ignored.
        accelerates = getattr(request, "set_acceleration", False)
        if accelerates or frame not in ("", "world", self._world_frame):
            what = "set_acceleration" if accelerates else f"frame {frame!r}"
            return _ended(
                response, results.RESULT_FEATURE_UNSUPPORTED, f"{what}: pose and twist in {self._world_frame}"
            )
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
            return _ended(response, getattr(response, "INVALID_POSE", results.RESULT_OPERATION_FAILED), str(refusal))
        if values:
            self._call(lambda: self._loop.simulation.submit(command))
        return _ended(response, results.RESULT_OK)

    def get_entity_bounds(self, request: Any, response: Any) -> Any:
        """The mesh's box in body axes, about the COM; unbounded without a mesh."""
        if not self._is_known(request.entity, response):
            return response
        box, kinds = self._box(), self._messages.Bounds
        response.bounds.type = kinds.TYPE_EMPTY if box is None else kinds.TYPE_BOX
        response.bounds.points = [] if box is None else [self._vector(box[1]), self._vector(box[0])]
        return response

    def _box(self) -> np.ndarray | None:
        """Lower and upper corner (2, 3) [m, body axes from the COM]."""
        setup = self._loop.scenario.setup
        if setup.surface is None:
            return None
        ends = np.array([setup.surface.vertices.min(axis=0), setup.surface.vertices.max(axis=0)]) * setup.body.scale
        return np.sort(ends, axis=0) - setup.body.center_of_mass

    def _vector(self, values: np.ndarray) -> Any:
        from geometry_msgs.msg import Vector3

        x, y, z = values.tolist()
        return Vector3(x=x, y=y, z=z)

    def _is_known(self, entity: str, response: Any) -> bool:
        results = self._messages.Result
        if entity != self._name:
            _ended(response, results.RESULT_NOT_FOUND, f"there is no {entity!r}; the only entity is {self._name!r}")
            return False
        _ended(response, results.RESULT_OK)
        return True

    def _filtered(self, filters: Any, response: Any) -> list[str]:
        """The names that pass, and the result of the call."""
        results, kinds = self._messages.Result, self._messages.Bounds
        if filters.tags.tags:
            _ended(response, results.RESULT_FEATURE_UNSUPPORTED, "tags: entities have none")
            return []
        if filters.bounds.type not in (kinds.TYPE_EMPTY, kinds.TYPE_SPHERE):
            _ended(response, results.RESULT_FEATURE_UNSUPPORTED, "bounds: empty, or a sphere")
            return []
        try:
            named = re.search(filters.filter, self._name) is not None
        except re.error as error:
            _ended(response, results.RESULT_OPERATION_FAILED, f"filter {filters.filter!r}: {error}")
            return []
        category = self._messages.EntityCategory.CATEGORY_DYNAMIC_OBJECT
        fits = not filters.categories or any(own.category == category for own in filters.categories)
        _ended(response, results.RESULT_OK)
        within = filters.bounds.type == kinds.TYPE_EMPTY or self._meets_sphere(filters.bounds.points)
        return [self._name] if named and fits and within else []

    def _meets_sphere(self, points: Any) -> bool:
        """Whether the body's box, as it lies, overlaps a sphere of centre and radius."""
        center, box, state = points[0], self._box(), self._call(lambda: self._loop.simulation.state)
        corners = np.zeros((2, 3)) if box is None else box
        own = transposed_times(state.rotation, np.array([center.x, center.y, center.z]) - state.position)
        return float(np.linalg.norm(own - np.clip(own, corners[0], corners[1]))) <= points[1].x

    def _state(self, message: Any) -> Any:
        simulation = self._loop.simulation
        state, (linear, angular) = self._call(lambda: (simulation.state, simulation.accelerations()))
        message.header.frame_id = self._world_frame
        message.header.stamp.sec, message.header.stamp.nanosec = self._loop.stamps.of(state.time_ns)
        _fill(message.pose.position, state.position)
        q = message.pose.orientation
        q.x, q.y, q.z, q.w = state.orientation_xyzw.tolist()
        _fill(message.twist.linear, state.linear_velocity)
        _fill(message.twist.angular, state.angular_velocity)
        _fill(message.acceleration.linear, linear)
        _fill(message.acceleration.angular, angular)
        return message

    @property
    def answers(self) -> dict[str, Callable[[Any, Any], Any]]:
        """Callbacks by the names of SERVICES."""
        return {name: getattr(self, name) for _, name in SERVICES}


def _fill(vector: Any, values: np.ndarray) -> None:
    vector.x, vector.y, vector.z = values.tolist()


def _ended(response: Any, result: int, message: str = "") -> Any:
    response.result.result, response.result.error_message = result, message
    return response
