# SPDX-License-Identifier: MIT
"""The standard simulator services: honest about what is supported. The message package isn't on PyPI, so its types are
stood in for; the node, its thread and its clock are real."""

from __future__ import annotations

import sys
import threading
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
from flights import EventLines

pytest.importorskip("rclpy")

MESSAGES = SimpleNamespace(
    SimulatorFeatures=SimpleNamespace(
        ENTITY_STATE_GETTING=10,
        ENTITY_STATE_SETTING=11,
        SIMULATION_RESET=20,
        SIMULATION_STATE_GETTING=24,
        SIMULATION_STATE_SETTING=25,
        SIMULATION_STATE_PAUSE=26,
        STEP_SIMULATION_SINGLE=31,
        STEP_SIMULATION_MULTIPLE=32,
    ),
    SimulationState=SimpleNamespace(STATE_STOPPED=0, STATE_PLAYING=1, STATE_PAUSED=2, STATE_QUITTING=3),
    Result=SimpleNamespace(RESULT_FEATURE_UNSUPPORTED=0, RESULT_OK=1, RESULT_NOT_FOUND=2, RESULT_OPERATION_FAILED=4),
)
OK, UNSUPPORTED, NOT_FOUND, FAILED, ALREADY, INVALID_POSE = 1, 0, 2, 4, 101, 101
SCOPES = {"SCOPE_DEFAULT": 0, "SCOPE_TIME": 1, "SCOPE_STATE": 2, "SCOPE_SPAWNED": 4, "SCOPE_ALL": 255}


class Client:
    """Calls the services by their names, with the fields of the request."""

    def __init__(self, offered: dict) -> None:
        self._offered = offered

    def call(self, service: str, **fields) -> SimpleNamespace:
        """The response."""
        request = {"entity": "tool", "set_pose": False, "set_twist": False, "set_acceleration": False, **SCOPES}
        response = SimpleNamespace(
            result=SimpleNamespace(result=None, error_message=""),
            state=entity_state() if service == "get_entity_state" else SimpleNamespace(state=None),
            features=SimpleNamespace(),
            ALREADY_IN_TARGET_STATE=ALREADY,
            INVALID_POSE=INVALID_POSE,
        )
        return self._offered[service](SimpleNamespace(**{**request, **fields}), response)

    def result(self, service: str, **fields) -> int:
        return self.call(service, **fields).result.result

    def step(self, steps: int) -> int:
        return self.result("step_simulation", steps=steps)

    def set_state(self, value: int) -> SimpleNamespace:
        return self.call("set_simulation_state", state=SimpleNamespace(state=value)).result


@pytest.fixture
def services():
    """A client of the services of a flight on a real physics thread, as they are offered, without ROS; and the flight."""
    from rigid_proto_ros.live.live_simulation import LiveSimulation
    from rigid_proto_ros.ros.simulation_interfaces import SERVICES, SimulationInterfaces
    from rigid_proto_ros.scene.scenario import make_scenario

    values = {"initial.angular_velocity": [0.1, 3.0, 0.1], "start_paused": True, "world_frame": "map"}
    live = LiveSimulation(make_scenario(values), "tool")
    live.start()
    offered = {}
    node = SimpleNamespace(create_service=lambda _, name, answer: offered.update({name.removeprefix("~/"): answer}))
    SimulationInterfaces(live, MESSAGES).offer(node, SimpleNamespace(**{name: name for name, _ in SERVICES}))
    yield Client(offered), live
    live.stop()


def entity_state(position=(0.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0, 1.0), linear=(0.0,) * 3, angular=(0.0,) * 3):
    from geometry_msgs.msg import Accel, Point, Pose, Quaternion, Twist, Vector3
    from std_msgs.msg import Header

    def three(kind, values):
        return kind(**dict(zip("xyz", values, strict=True)))

    pose = Pose(position=three(Point, position), orientation=Quaternion(**dict(zip("xyzw", orientation, strict=True))))
    twist = Twist(linear=three(Vector3, linear), angular=three(Vector3, angular))
    return SimpleNamespace(header=Header(), pose=pose, twist=twist, acceleration=Accel())


def test_what_is_listed_is_served_and_nothing_else_is(services):
    client, _ = services
    listed = client.call("get_simulator_features").features
    assert listed.spawn_formats == []
    # What a client that finds the feature listed may call, by the package's definition of the feature.
    results = {
        10: client.result("get_entity_state"),
        11: client.result("set_entity_state", state=entity_state()),
        20: client.result("reset_simulation", scope=SCOPES["SCOPE_ALL"]),
        21: client.result("reset_simulation", scope=SCOPES["SCOPE_TIME"]),
        22: client.result("reset_simulation", scope=SCOPES["SCOPE_STATE"]),
        23: client.result("reset_simulation", scope=SCOPES["SCOPE_SPAWNED"]),
        24: client.result("get_simulation_state"),
        25: client.set_state(1).result,
        26: client.set_state(2).result,
        31: client.step(1),
        32: client.step(3),
    }
    assert [feature for feature, result in results.items() if result == OK] == listed.features


def test_it_plays_and_pauses_and_steps_are_publications_and_need_a_pause(services):
    client, live = services
    assert client.step(5) == OK
    assert live.loop.simulation.time_ns == 50_000_000
    assert client.step(0) == FAILED
    assert client.call("get_simulation_state").state.state == 2
    assert client.set_state(2).result == ALREADY
    assert client.set_state(1).result == OK
    assert client.call("get_simulation_state").state.state == 1
    assert client.step(1) == FAILED
    for other in (0, 3):
        refused = client.set_state(other)
        assert refused.result == UNSUPPORTED and "signal" in refused.error_message


def test_what_the_simulation_refuses_is_a_failed_operation_with_its_reason(services, monkeypatch):
    client, live = services
    live.schedule("{t: 0, state: {linear_velocity: [9.9e99, 0, 0], position: [9.9e99, 0, 0]}}")
    for refused in (client.call("step_simulation", steps=100).result, client.set_state(1)):
        assert refused.result == FAILED and "until a reset" in refused.error_message
    monkeypatch.setattr("rigid_proto_ros.live.live_simulation.BUSY_S", 0.0)
    held = threading.Event()
    live._requests.append((held.wait, Future()))
    live.endpoints.wake()
    refused = client.call("get_entity_state").result
    held.set()
    assert refused.result == FAILED and "too busy" in refused.error_message


def test_time_and_state_are_reset_together_or_not_at_all(services):
    client, live = services
    for scope, result in ((0, OK), (255, OK), (3, OK), (1, UNSUPPORTED), (2, UNSUPPORTED), (4, UNSUPPORTED)):
        client.step(3)
        reached = live.loop.simulation.time_ns
        assert client.result("reset_simulation", scope=scope) == result
        assert live.loop.simulation.time_ns == (0 if result == OK else reached)


def test_without_the_package_nothing_is_offered(monkeypatch):
    from rigid_proto_ros.ros.simulation_interfaces import offer_simulation_interfaces

    monkeypatch.setitem(sys.modules, "simulation_interfaces", None)
    assert offer_simulation_interfaces(None, None) is False


def test_a_state_that_is_set_acts_as_a_command_that_replays_to_the_bit(services):
    from rigid_proto_ros.session.recorded_session import Resimulation

    client, live = services
    told = EventLines()
    live.call(lambda: live.loop.watch(told))
    wanted = entity_state((1.0, 2.0, 3.0), (0.0, 0.0, 3.0, 4.0), (0.5, 0.0, 0.0), (0.0, 0.0, 2.0))
    assert client.result("set_entity_state", state=wanted, set_pose=True) == OK
    client.step(10)
    reached = live.loop.simulation.state
    assert reached.position == pytest.approx([1.0, 2.0, 3.0])
    assert reached.angular_velocity[1] == pytest.approx(3.0, abs=0.2)  # the twist was left alone
    assert client.result("set_entity_state", state=wanted, set_twist=True) == OK
    client.step(10)
    heard = client.call("get_entity_state").state
    assert heard.header.frame_id == "map" and heard.header.stamp.nanosec == 200_000_000
    assert heard.pose.position.x == pytest.approx(1.05) and heard.twist.linear.x == 0.5
    again = Resimulation(live.loop.scenario, told.lines)
    assert again.advance(200_000_000).tobytes() == live.loop.simulation.state.row.tobytes()
    broken = entity_state(orientation=(0.0,) * 4)
    assert client.result("set_entity_state", state=broken, set_pose=True) == INVALID_POSE
    assert client.result("set_entity_state", state=wanted, entity="chair") == NOT_FOUND


def test_a_request_of_a_release_without_switches_sets_pose_and_twist(services):
    client, live = services
    set_state = client._offered["set_entity_state"]

    def result(state) -> int:
        # Those for Jazzy up to 1.2 have no word for a broken pose either.
        response = SimpleNamespace(result=SimpleNamespace(result=None, error_message=""))
        return set_state(SimpleNamespace(entity="tool", state=state), response).result.result

    assert result(entity_state((1.0, 2.0, 3.0), linear=(0.5, 0.0, 0.0))) == OK
    client.step(10)
    assert live.loop.simulation.state.position == pytest.approx([1.05, 2.0, 3.0])
    assert result(entity_state(orientation=(0.0,) * 4)) == FAILED
