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


@pytest.fixture
def services():
    """The services of a flight on a real physics thread, as they are offered, without ROS; and the flight."""
    from rigid_proto_ros.live.live_simulation import LiveSimulation, warm_up
    from rigid_proto_ros.ros.simulation_interfaces import SERVICES, SimulationInterfaces
    from rigid_proto_ros.scene.scenario import make_scenario

    values = {"initial.angular_velocity": [0.1, 3.0, 0.1], "start_paused": True, "world_frame": "map"}
    live = LiveSimulation(make_scenario(values), "tool")
    # As the node does: a kernel that compiles would hold the first request up for longer than it waits.
    warm_up(live.scenario.setup)
    live.start()
    offered = {}
    node = SimpleNamespace(create_service=lambda _, name, answer: offered.update({name.removeprefix("~/"): answer}))
    SimulationInterfaces(live, MESSAGES).offer(node, SimpleNamespace(**{name: name for name, _ in SERVICES}))
    yield SimpleNamespace(**offered), live
    live.stop()


def response():
    return SimpleNamespace(
        result=SimpleNamespace(result=None, error_message=""),
        state=SimpleNamespace(state=None),
        features=SimpleNamespace(),
        ALREADY_IN_TARGET_STATE=ALREADY,
        INVALID_POSE=INVALID_POSE,
    )


def entity_state(position=(0.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0, 1.0), linear=(0.0,) * 3, angular=(0.0,) * 3):
    from geometry_msgs.msg import Accel, Point, Pose, Quaternion, Twist, Vector3
    from std_msgs.msg import Header

    def three(kind, values):
        return kind(**dict(zip("xyz", values, strict=True)))

    pose = Pose(position=three(Point, position), orientation=Quaternion(**dict(zip("xyzw", orientation, strict=True))))
    twist = Twist(linear=three(Vector3, linear), angular=three(Vector3, angular))
    return SimpleNamespace(header=Header(), pose=pose, twist=twist, acceleration=Accel())


def asked(entity="tool", **fields):
    return SimpleNamespace(entity=entity, set_pose=False, set_twist=False, set_acceleration=False, **fields)


def state(value):
    return SimpleNamespace(state=SimpleNamespace(state=value))


def test_what_is_listed_is_served_and_nothing_else_is(services):
    answer, node = services
    listed = answer.get_simulator_features(None, response()).features
    assert listed.spawn_formats == []

    def reset(scope):
        return answer.reset_simulation(SimpleNamespace(scope=scope, **SCOPES), response())

    def set_state(value):
        return answer.set_simulation_state(state(value), response())

    def step(steps):
        return answer.step_simulation(SimpleNamespace(steps=steps), response())

    # What a client that finds the feature listed may call, by the package's definition of the feature.
    calls = {
        10: lambda: answer.get_entity_state(asked(), SimpleNamespace(**vars(response()) | {"state": entity_state()})),
        11: lambda: answer.set_entity_state(asked(state=entity_state()), response()),
        20: lambda: reset(SCOPES["SCOPE_ALL"]),
        21: lambda: reset(SCOPES["SCOPE_TIME"]),
        22: lambda: reset(SCOPES["SCOPE_STATE"]),
        23: lambda: reset(SCOPES["SCOPE_SPAWNED"]),
        24: lambda: answer.get_simulation_state(None, response()),
        25: lambda: set_state(1),
        26: lambda: set_state(2),
        31: lambda: step(1),
        32: lambda: step(3),
    }
    assert [feature for feature, call in calls.items() if call().result.result == OK] == listed.features


def test_steps_are_publications_and_need_a_pause(services):
    answer, node = services
    assert answer.step_simulation(SimpleNamespace(steps=5), response()).result.result == OK
    assert node.loop.simulation.time_ns == 50_000_000
    assert answer.step_simulation(SimpleNamespace(steps=0), response()).result.result == FAILED
    answer.set_simulation_state(state(1), response())
    assert answer.step_simulation(SimpleNamespace(steps=1), response()).result.result == FAILED


def test_it_plays_and_pauses(services):
    answer, _ = services
    assert answer.get_simulation_state(None, response()).state.state == 2
    assert answer.set_simulation_state(state(2), response()).result.result == ALREADY
    assert answer.set_simulation_state(state(1), response()).result.result == OK
    assert answer.get_simulation_state(None, response()).state.state == 1
    for other in (0, 3):
        refused = answer.set_simulation_state(state(other), response())
        assert refused.result.result == UNSUPPORTED
        assert "signal" in refused.result.error_message


def test_what_the_simulation_refuses_is_a_failed_operation_with_its_reason(services, monkeypatch):
    answer, live = services
    live.schedule("{t: 0, state: {linear_velocity: [9.9e99, 0, 0], position: [9.9e99, 0, 0]}}")
    for refused in (
        answer.step_simulation(SimpleNamespace(steps=100), response()),
        answer.set_simulation_state(state(1), response()),
    ):
        assert refused.result.result == FAILED and "until a reset" in refused.result.error_message
    monkeypatch.setattr("rigid_proto_ros.live.live_simulation.BUSY_S", 0.0)
    held = threading.Event()
    live._requests.append((held.wait, Future()))
    live._wake.set()
    refused = answer.get_entity_state(asked(), SimpleNamespace(**vars(response()) | {"state": entity_state()}))
    held.set()
    assert refused.result.result == FAILED and "too busy" in refused.result.error_message


def test_time_and_state_are_reset_together_or_not_at_all(services):
    answer, node = services
    for scope, result in ((0, OK), (255, OK), (3, OK), (1, UNSUPPORTED), (2, UNSUPPORTED), (4, UNSUPPORTED)):
        answer.step_simulation(SimpleNamespace(steps=3), response())
        reached = node.loop.simulation.time_ns
        request = SimpleNamespace(scope=scope, **SCOPES)
        assert answer.reset_simulation(request, response()).result.result == result
        assert node.loop.simulation.time_ns == (0 if result == OK else reached)


def test_without_the_package_nothing_is_offered(monkeypatch):
    from rigid_proto_ros.ros.simulation_interfaces import offer_simulation_interfaces

    monkeypatch.setitem(sys.modules, "simulation_interfaces", None)
    assert offer_simulation_interfaces(None, None) is False


def test_a_state_that_is_set_acts_as_a_command_that_replays_to_the_bit(services):
    from rigid_proto_ros.session.recorded_session import Resimulation

    answer, node = services
    entity, told = answer, EventLines()
    node.call(lambda: node.loop.watch(told))
    wanted = entity_state((1.0, 2.0, 3.0), (0.0, 0.0, 3.0, 4.0), (0.5, 0.0, 0.0), (0.0, 0.0, 2.0))
    pose = SimpleNamespace(**vars(asked(state=wanted)) | {"set_pose": True})
    assert entity.set_entity_state(pose, response()).result.result == OK
    answer.step_simulation(SimpleNamespace(steps=10), response())
    reached = node.loop.simulation.state
    assert reached.position == pytest.approx([1.0, 2.0, 3.0])
    assert reached.angular_velocity[1] == pytest.approx(3.0, abs=0.2)  # the twist was left alone
    twist = SimpleNamespace(**vars(asked(state=wanted)) | {"set_twist": True})
    assert entity.set_entity_state(twist, response()).result.result == OK
    answer.step_simulation(SimpleNamespace(steps=10), response())
    heard = entity.get_entity_state(asked(), SimpleNamespace(**vars(response()) | {"state": entity_state()})).state
    assert heard.header.frame_id == "map" and heard.header.stamp.nanosec == 200_000_000
    assert heard.pose.position.x == pytest.approx(1.05) and heard.twist.linear.x == 0.5
    again = Resimulation(node.loop.scenario, told.lines)
    assert again.advance(200_000_000).tobytes() == node.loop.simulation.state.row.tobytes()
    broken = SimpleNamespace(**vars(asked(state=entity_state(orientation=(0.0,) * 4))) | {"set_pose": True})
    assert entity.set_entity_state(broken, response()).result.result == INVALID_POSE
    assert entity.set_entity_state(asked("chair", state=wanted), response()).result.result == NOT_FOUND


def test_a_request_of_a_release_without_switches_sets_pose_and_twist(services):
    answer, node = services
    wanted = entity_state((1.0, 2.0, 3.0), linear=(0.5, 0.0, 0.0))
    said = answer.set_entity_state(SimpleNamespace(entity="tool", state=wanted), response())
    assert said.result.result == OK
    answer.step_simulation(SimpleNamespace(steps=10), response())
    assert node.loop.simulation.state.position == pytest.approx([1.05, 2.0, 3.0])
    # Those for Jazzy up to 1.2 have no word for a broken pose either.
    broken = SimpleNamespace(entity="tool", state=entity_state(orientation=(0.0,) * 4))
    plain = SimpleNamespace(result=response().result)
    assert answer.set_entity_state(broken, plain).result.result == FAILED
