# SPDX-License-Identifier: MIT
"""The list of topics and services in the docs is what a running node has, no more and no less."""

from __future__ import annotations

import importlib.util

from node_interface import INTERFACES, PUBLISHED, SERVED, SUBSCRIBED
from rigid_proto_ros.scene.parameters import PARAMETERS, PATTERNS

NODE = "/rigid_body"

OF_RCLPY = {
    SUBSCRIBED: {"/clock"},  # with use_sim_time
    PUBLISHED: {"/rosout", "/parameter_events"},
    SERVED: {
        *(f"{NODE}/{verb}_parameters" for verb in ("describe", "get", "list", "set")),
        *(f"{NODE}/{name}" for name in ("get_parameter_types", "get_type_description", "set_parameters_atomically")),
    },
}
"""What every rclpy node has."""


def test_a_running_node_has_exactly_the_listed_topics_and_services(rig) -> None:
    """With everything on request switched on: the shared node has a thruster."""
    switches = {i.on_request: True for i in INTERFACES if i.on_request in PARAMETERS}
    assert rig.set_named(switches, atomically=True)[0][0]
    looks = {
        SUBSCRIBED: rig.own.get_subscriber_names_and_types_by_node,
        PUBLISHED: rig.own.get_publisher_names_and_types_by_node,
        SERVED: rig.own.get_service_names_and_types_by_node,
    }
    missing = {package for package in ("tf2_msgs",) if importlib.util.find_spec(package) is None}
    for direction, look in looks.items():
        listed = {
            i.name.replace("~", NODE): i.type
            for i in INTERFACES
            if i.direction == direction and i.type.partition("/")[0] not in missing
        }

        def found(look=look, own=OF_RCLPY[direction]) -> dict[str, str]:
            return {name: types[0] for name, types in look("rigid_body", "/") if name not in own}

        rig.until(lambda listed=listed, found=found: listed.keys() <= found().keys(), f"all that is {direction}")
        assert found() == listed


def test_what_is_on_request_names_a_switch() -> None:
    for interface in INTERFACES:
        switch = interface.on_request
        assert not switch or f"{switch}." in PATTERNS or PARAMETERS[switch].type == "bool"
        assert interface.meaning and not interface.meaning.endswith(".")
