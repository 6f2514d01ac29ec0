# SPDX-License-Identifier: MIT
"""The list of topics and services in the docs is what a running node has, no more and no less."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from collections.abc import Iterator

import pytest
from ros_process import running_node

from node_interface import INTERFACES, PUBLISHED, SERVED, SUBSCRIBED
from rigid_proto_ros.scene.parameters import PARAMETERS, PATTERNS

pytest.importorskip("rclpy")
NAME = "listed"

# Every rclpy node has these.
OF_RCLPY = {
    SUBSCRIBED: {"/clock"},  # with use_sim_time
    PUBLISHED: {"/rosout", "/parameter_events"},
    SERVED: {
        f"/{NAME}/{service}"
        for service in (
            "describe_parameters",
            "get_parameter_types",
            "get_parameters",
            "get_type_description",
            "list_parameters",
            "set_parameters",
            "set_parameters_atomically",
        )
    },
}


@pytest.fixture(scope="module")
def graph(ros_environment: dict[str, str], tmp_path_factory) -> Iterator[dict[str, dict[str, str]]]:
    """Names and types by direction of a running node with everything on request switched on."""
    switches = sorted({i.on_request for i in INTERFACES if i.on_request})
    values = {"thrusters": "thrusters.tail:=[0, 0, 0, 1, 0, 0]"}
    arguments = [word for name in switches for word in ("-p", values.get(name, f"{name}:=true"))]
    log = tmp_path_factory.mktemp("listed") / "node"
    # A first start compiles its kernels.
    with running_node("--ros-args", "-r", f"__node:={NAME}", *arguments, environment=ros_environment, log=log) as node:
        yield _graph_of(node.process, ros_environment)


def _graph_of(process: subprocess.Popen, environment: dict[str, str]) -> dict[str, dict[str, str]]:
    """What another process finds, once it has found all that is listed, and nothing more has come since the last look."""
    listed = [sorted(_listed(direction)) for direction in (SUBSCRIBED, PUBLISHED, SERVED)]
    code = f"""
import json, time, rclpy
rclpy.init()
node = rclpy.create_node("looker")
looks = ("get_subscriber_names_and_types_by_node", "get_publisher_names_and_types_by_node",
         "get_service_names_and_types_by_node")
seen, deadline = None, time.monotonic() + 150.0
while time.monotonic() < deadline:
    time.sleep(0.3)
    try:
        now = [dict(getattr(node, look)({NAME!r}, "/")) for look in looks]
    except rclpy.node.NodeNameNonExistentError:
        continue
    if now == seen and all(set(names) <= found.keys() for names, found in zip({listed}, now)):
        break
    seen = now
print(json.dumps(seen))
node.destroy_node()
rclpy.shutdown()
"""
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert process.poll() is None
    looked = json.loads(done.stdout)
    return {
        direction: {name: types[0] for name, types in found.items() if name not in OF_RCLPY[direction]}
        for direction, found in zip((SUBSCRIBED, PUBLISHED, SERVED), looked, strict=True)
    }


def _resolved(name: str) -> str:
    return name.replace("~", f"/{NAME}")


def _listed(direction: str) -> dict[str, str]:
    missing = {p for p in ("tf2_msgs",) if importlib.util.find_spec(p) is None}
    return {
        _resolved(i.name): i.type
        for i in INTERFACES
        if i.direction == direction and i.type.partition("/")[0] not in missing
    }


@pytest.mark.parametrize("direction", [SUBSCRIBED, PUBLISHED, SERVED])
def test_running_node_has_exactly_the_listed_topics_and_services(graph, direction: str) -> None:
    assert graph[direction] == _listed(direction)


def test_what_is_on_request_names_a_switch() -> None:
    for interface in INTERFACES:
        switch = interface.on_request
        assert not switch or f"{switch}." in PATTERNS or PARAMETERS[switch].type == "bool"
        assert interface.meaning and not interface.meaning.endswith(".")
