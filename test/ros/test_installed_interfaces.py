# SPDX-License-Identifier: MIT
"""The real package simulation_interfaces, where it is installed: from a ROS installation."""

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

CLIENT = """
import json, rclpy
from simulation_interfaces import msg, srv

rclpy.init()
node = rclpy.create_node("client")

def call(service_type, name, **fields):
    client = node.create_client(service_type, "/rigid_body/" + name)
    assert client.wait_for_service(100.0), name
    future = client.call_async(service_type.Request(**fields))
    rclpy.spin_until_future_complete(node, future, timeout_sec=100.0)
    return future.result()

said = {}
features = call(srv.GetSimulatorFeatures, "get_simulator_features").features
said["features"] = list(features.features)
paused = msg.SimulationState(state=msg.SimulationState.STATE_PAUSED)
said["pause"] = call(srv.SetSimulationState, "set_simulation_state", state=paused).result.result
said["reset"] = call(srv.ResetSimulation, "reset_simulation").result.result
wanted = msg.EntityState()
wanted.pose.position.x, wanted.pose.orientation.w = 2.0, 1.0
# The releases for Jazzy and Kilted have no such switch.
what = {"set_pose": True} if hasattr(srv.SetEntityState.Request, "set_pose") else {}
set_ = call(srv.SetEntityState, "set_entity_state", entity="rigid_body", state=wanted, **what)
said["set"] = [set_.result.result, set_.result.error_message]
said["step"] = call(srv.StepSimulation, "step_simulation", steps=2).result.result
state = call(srv.GetEntityState, "get_entity_state", entity="rigid_body").state
said["state"] = [state.header.stamp.nanosec, state.pose.position.x]
print(json.dumps(said))
node.destroy_node()
rclpy.shutdown()
"""
PACKAGE_FEATURES = [10, 11, 20, 24, 25, 26, 31, 32]


def test_every_service_answers_a_client_of_the_real_package(ros_environment, tmp_path):
    scene = ("--ros-args", "--params-file", scene_path("t_handle"))
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
    assert said["state"] == [20_000_000, pytest.approx(2.0, abs=0.1)]
