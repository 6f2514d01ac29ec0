# SPDX-License-Identifier: MIT
"""The standard simulator services: honest about what is supported. The message package isn't on PyPI, so its types are
stood in for; the node, its thread and its clock are real."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

MESSAGES = SimpleNamespace(
    SimulatorFeatures=SimpleNamespace(
        SIMULATION_RESET=20,
        SIMULATION_STATE_GETTING=24,
        SIMULATION_STATE_SETTING=25,
        SIMULATION_STATE_PAUSE=26,
        STEP_SIMULATION_SINGLE=31,
        STEP_SIMULATION_MULTIPLE=32,
    ),
    SimulationState=SimpleNamespace(STATE_STOPPED=0, STATE_PLAYING=1, STATE_PAUSED=2, STATE_QUITTING=3),
    Result=SimpleNamespace(RESULT_FEATURE_UNSUPPORTED=0, RESULT_OK=1, RESULT_OPERATION_FAILED=4),
)
OK, UNSUPPORTED, FAILED, ALREADY = 1, 0, 4, 101
SCOPES = {"SCOPE_DEFAULT": 0, "SCOPE_TIME": 1, "SCOPE_STATE": 2, "SCOPE_SPAWNED": 4, "SCOPE_ALL": 255}


class Node:
    """A flight on a real physics thread, without ROS."""

    def __init__(self) -> None:
        from rigid_proto_ros.ros.physics_thread import PhysicsThread
        from rigid_proto_ros.ros.simulation_loop import SimulationLoop
        from rigid_proto_ros.scene.scenario import make_scenario
        from rigid_proto_ros.simulation.observer import Observer

        scenario = make_scenario({"initial.angular_velocity": [0.1, 3.0, 0.1], "start_paused": True})
        self.loop = SimulationLoop(
            scenario, Observer(), lambda state: None, lambda wall_ns, whole: False, lambda message: None
        )
        self.thread = PhysicsThread()
        self.thread.start([self.loop])

    def call(self, function):
        return self.thread.call(self.loop, function)


@pytest.fixture
def services():
    from rigid_proto_ros.ros.simulation_interfaces import SimulationInterfaces

    node = Node()
    yield SimulationInterfaces(node.loop, node.call, MESSAGES), node
    node.thread.stop()


def response():
    return SimpleNamespace(
        result=SimpleNamespace(result=None, error_message=""),
        state=SimpleNamespace(state=None),
        features=SimpleNamespace(),
        ALREADY_IN_TARGET_STATE=ALREADY,
    )


def state(value):
    return SimpleNamespace(state=SimpleNamespace(state=value))


def test_what_is_listed_is_served_and_nothing_else_is(services):
    answer, _ = services
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


def test_states_play_pause_and_stop(services):
    answer, node = services
    assert answer.get_simulation_state(None, response()).state.state == 2
    assert answer.set_simulation_state(state(2), response()).result.result == ALREADY
    assert answer.set_simulation_state(state(1), response()).result.result == OK
    assert answer.get_simulation_state(None, response()).state.state == 1
    assert answer.set_simulation_state(state(0), response()).result.result == OK
    assert answer.get_simulation_state(None, response()).state.state == 0
    assert node.loop.simulation.time_ns == 0
    assert answer.set_simulation_state(state(0), response()).result.result == ALREADY
    # Stopped may be paused: that begins it without a step. Then it is no longer where a stop has put it.
    assert answer.set_simulation_state(state(2), response()).result.result == OK
    assert answer.get_simulation_state(None, response()).state.state == 2
    answer.set_simulation_state(state(0), response())
    answer.step_simulation(SimpleNamespace(steps=1), response())
    assert answer.get_simulation_state(None, response()).state.state == 2
    refused = answer.set_simulation_state(state(3), response())
    assert refused.result.result == UNSUPPORTED
    assert "signal" in refused.result.error_message


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
    assert offer_simulation_interfaces(None, None, None) is False
