# SPDX-License-Identifier: MIT
"""A hand session on a running node, saved as a script: ``simulate`` and ``poke_client --reset`` fly it again to the bit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("mcap")

from command_rig import RosClient
from ros_process import from_source, run, running_node

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.messages.session_messages import PROJECTIONS
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.recorded_session import RecordedSession
from rigid_proto_ros.workbench.save_as_script import save_as_script

HAND = """
import random, time
import rclpy
from rigid_proto_ros.workbench.ros_link import RosLink

rclpy.init(args=[])
link = RosLink("/rigid_body", lambda f, *a: f(*a), lambda text: None, lambda values: None)
link.wait_for_node(100.0)
while not all(p.get_subscription_count() for p in link.node.publishers if p.topic_name.startswith(link.target)):
    time.sleep(0.02)
while not all(client.service_is_ready() for client in link.node.clients):
    time.sleep(0.02)
r = random.Random(5)
link.wrench("poke", "normal@tip", (0.02, 0.0, 0.0))
time.sleep(0.1)
link.schedule("{t: 0, set: {string.frequency: 6.0}}")
link.point("string/attach", "body/mesh", (0.0, 0.0, 0.07))
for _ in range(15):
    link.point("string/target", "world", [0.1 * r.gauss(0, 1) for _ in range(3)])
    time.sleep(0.05)
link.call("string/release")
time.sleep(0.2)
link.call("pause", True)
time.sleep(0.2)
for k in range(12):
    link.set_parameters({"ballast.tip": [0.001 * k, 0.0, 0.0, 0.07]})
    link.set_parameters({"mass": 0.15 + 0.001 * k})
    time.sleep(0.02)
link.wrench("poke", "world@ray/1.0,0.0,0.0/-1.0,0.0,0.0;duration=0.1", (-0.02, 0.0, 0.0))
time.sleep(0.2)
link.call("pause", False)
time.sleep(0.3)
link.set_parameters({"inertia_model": "shell"})
time.sleep(0.5)
link.close()
"""


def poses(session: RecordedSession) -> dict[int, bytes]:
    """The published poses, by their stamp."""
    published = session.published["pose"]
    return {int(t): row.tobytes() for t, row in zip(published.times, published.rows, strict=True)}


@pytest.mark.stress
def test_a_hand_session_on_a_node_flies_again_offline_and_on_a_node(
    ros_environment: dict[str, str], tmp_path: Path
) -> None:
    def node(scene: Path, bag: str):
        arguments = ("--ros-args", "--params-file", scene, "-p", f"record:={tmp_path / bag}")
        return running_node(*arguments, environment=ros_environment, log=tmp_path / f"{bag}.log")

    with node(scene_path("t_handle"), "hand.mcap"):
        hand = [sys.executable, "-c", HAND]
        subprocess.run(hand, env=from_source(ros_environment), cwd=tmp_path, timeout=120, check=True)
    (session,) = read_runs(tmp_path / "hand.mcap")
    saved = save_as_script(session)
    assert saved.notes == []
    assert saved.commands > 10
    scene, script = tmp_path / "scene.yaml", tmp_path / "script.yaml"
    scene.write_text(saved.scene)
    script.write_text(saved.script)

    by_hand = poses(session)
    offline = OfflineRun(read_scene(str(scene)), read_script(script))
    for time_ns, pose in by_hand.items():
        assert offline.advance(time_ns)
        assert np.array(PROJECTIONS["pose"](offline.simulation.state.row.tolist())).tobytes() == pose

    with RosClient(ros_environment) as client, node(scene, "again.mcap"):
        client.meet()
        sent = run("poke_client", script, "--reset", "--timeout", 60, environment=ros_environment)
        assert sent.returncode == 0, sent.stderr
        client.fly_until(saved.last_ns + 10**9)
    again = poses(read_runs(tmp_path / "again.mcap")[-1])
    common = sorted(by_hand.keys() & again.keys())
    assert common[-1] > saved.last_ns
    assert all(by_hand[t] == again[t] for t in common)
