# SPDX-License-Identifier: MIT
"""What the node publishes is, bit for bit, what the offline run computes from the same commands at the same times."""

import pytest
from conftest import needs_rerun
from ros_client import RosClient, stamp_ns
from ros_process import run, running_node

from rigid_proto_ros.base.bundled import example_path, scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.rrd_reading import read_session
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.messages import PROJECTIONS

SECOND = 10**9


@needs_rerun
@pytest.mark.stress
def test_poke_client_and_simulate_give_one_motion_and_the_recording_verifies(ros_environment, tmp_path):
    """One script after another; that every entry gives that motion, test_poke_client.py shows in every run."""
    scene, session = scene_path("t_handle"), tmp_path / "session.rrd"
    values = {"record": str(session), "publish_rate": 25.0, "real_time_factor": 8.0}
    with (
        RosClient(ros_environment) as client,
        running_node(ros_environment, tmp_path / "node", values, "--params-file", scene),
    ):
        client.meet()
        for script in map(example_path, ("flip_and_poke", "same_force_three_ways", "heavier_in_flight")):
            client.set(density=7850.0, gravity=[0.0, 0.0, 0.0])
            client.pause(True)
            # So that nothing from the run before carries a later stamp than this one's.
            client.reset()
            client.forget("pose", "twist")
            poker = run("poke_client", script, "--reset", "--timeout", 120, environment=ros_environment)
            assert poker.returncode == 0, poker.stdout + poker.stderr
            assert "0 late, 0 refused" in poker.stdout
            client.fly_until(9 * SECOND)
            offline = OfflineRun(read_scene(str(scene), {"publish_rate": 25.0}), read_script(script))
            twists = {stamp_ns(message): message["twist"] for message in client.heard("twist")}
            poses = {stamp_ns(message): message["pose"] for message in client.heard("pose")}
            assert len(poses.keys() & twists.keys()) > 100
            for time_ns in sorted(poses.keys() & twists.keys()):
                assert offline.advance(time_ns)
                row = offline.simulation.state.row.tolist()
                for name, message in (("pose", poses[time_ns]), ("twist", twists[time_ns])):
                    published = [x for part in message.values() for x in part.values()]
                    assert published == PROJECTIONS[name](row), time_ns
    recorded = read_session(session)
    assert recorded.complete and len(recorded.times) > 200
    assert main(["replay", str(session), "--verify"]) == 0
