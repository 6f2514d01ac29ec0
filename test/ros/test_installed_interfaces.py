# SPDX-License-Identifier: MIT
"""The real packages simulation_interfaces and tf2_msgs, where they are installed: from a ROS installation."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from ros_process import READY_S, from_source, running_node

from rigid_proto_ros.base.bundled import scene_path

pytest.importorskip("rclpy")
pytest.importorskip("simulation_interfaces")
pytest.importorskip("tf2_msgs")

CLIENT = """
import json, rclpy
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from simulation_interfaces import action, msg, srv
from tf2_msgs.msg import TFMessage

rclpy.init()
node = rclpy.create_node("client")

def call(service_type, name, **fields):
    client = node.create_client(service_type, "/rigid_body/" + name)
    assert client.wait_for_service(100.0), name
    future = client.call_async(service_type.Request(**fields))
    rclpy.spin_until_future_complete(node, future, timeout_sec=100.0)
    return future.result()

static = []
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
node.create_subscription(TFMessage, "/tf_static", lambda m: static.extend(m.transforms), latched)
said = {}
features = call(srv.GetSimulatorFeatures, "get_simulator_features").features
said["features"] = list(features.features)
paused = msg.SimulationState(state=msg.SimulationState.STATE_PAUSED)
said["pause"] = call(srv.SetSimulationState, "set_simulation_state", state=paused).result.result
said["reset"] = call(srv.ResetSimulation, "reset_simulation").result.result
said["entities"] = list(call(srv.GetEntities, "get_entities").entities)
states = call(srv.GetEntitiesStates, "get_entities_states")
said["states"] = [list(states.entities), [s.twist.angular.z for s in states.states]]
said["category"] = call(srv.GetEntityInfo, "get_entity_info", entity="rigid_body").info.category.category
bounds = call(srv.GetEntityBounds, "get_entity_bounds", entity="rigid_body").bounds
said["bounds"] = [bounds.type, len(bounds.points)]
wanted = msg.EntityState()
wanted.pose.position.x, wanted.pose.orientation.w = 2.0, 1.0
# The releases for Jazzy and Kilted have no such switch.
what = {"set_pose": True} if hasattr(srv.SetEntityState.Request, "set_pose") else {}
set_ = call(srv.SetEntityState, "set_entity_state", entity="rigid_body", state=wanted, **what)
said["set"] = [set_.result.result, set_.result.error_message]
said["step"] = call(srv.StepSimulation, "step_simulation", steps=2).result.result
state = call(srv.GetEntityState, "get_entity_state", entity="rigid_body").state
said["state"] = [state.header.stamp.nanosec, state.pose.position.x]

client = ActionClient(node, action.SimulateSteps, "/rigid_body/simulate_steps")
assert client.wait_for_server(100.0)

def steps(count, cancel_at=None):
    told = []
    sent = client.send_goal_async(action.SimulateSteps.Goal(steps=count), lambda f: told.append(f.feedback))
    rclpy.spin_until_future_complete(node, sent, timeout_sec=100.0)
    goal = sent.result()
    if cancel_at is not None:
        while not told or told[-1].completed_steps < cancel_at:
            rclpy.spin_once(node, timeout_sec=0.1)
        rclpy.spin_until_future_complete(node, goal.cancel_goal_async(), timeout_sec=100.0)
    ended = goal.get_result_async()
    rclpy.spin_until_future_complete(node, ended, timeout_sec=100.0)
    return ended.result(), told

# Until the node knows that somebody listens to its feedback.
heard = []
while not heard:
    _, heard = steps(1)
    rclpy.spin_once(node, timeout_sec=0.5)
ended, told = steps(5)
while len(told) < 5:
    rclpy.spin_once(node, timeout_sec=0.1)
said["action"] = [ended.status, ended.result.result.result, [[f.completed_steps, f.remaining_steps] for f in told]]
ended, told = steps(1_000_000, cancel_at=3)
said["cancelled"] = ended.status
while not static:
    rclpy.spin_once(node, timeout_sec=0.1)
said["static"] = sorted(t.child_frame_id for t in static)
print(json.dumps(said))
node.destroy_node()
rclpy.shutdown()
"""
PACKAGE_FEATURES = [5, 8, 10, 11, 12, 20, 24, 25, 26, 31, 32, 33]
SUCCEEDED, CANCELED = 4, 5


def test_every_service_and_the_action_answer_a_client_of_the_real_package(ros_environment, tmp_path):
    scene = ("--ros-args", "--params-file", scene_path("t_handle"), "-p", "contacts.tip:=[0.0, 0.0, 0.07]")
    environment = {**ros_environment, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with running_node(*scene, environment=environment, log=tmp_path / "node"):
        done = subprocess.run(
            [sys.executable, "-c", CLIENT],
            env=from_source(environment),
            capture_output=True,
            text=True,
            timeout=READY_S,
        )
        assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout.splitlines()[-1])
    assert said["features"] == PACKAGE_FEATURES
    assert (said["pause"], said["reset"], said["step"], said["set"]) == (1, 1, 1, [1, ""])
    assert said["entities"] == said["states"][0] == ["rigid_body"]
    assert said["states"][1] == [12.0]
    assert said["category"] == 4 and said["bounds"] == [1, 2]
    assert said["state"] == [20_000_000, pytest.approx(2.0, abs=0.1)]
    assert said["action"] == [SUCCEEDED, 1, [[k, 5 - k] for k in range(1, 6)]]
    assert said["cancelled"] == CANCELED
    assert {"rigid_body/mesh", "rigid_body/tip"} <= set(said["static"])
