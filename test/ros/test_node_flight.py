# SPDX-License-Identifier: MIT
"""What the node publishes is, bit for bit, what the offline run computes from the same commands at the same times."""

import signal

import pytest
from command_rig import RosClient, published
from conftest import needs_rerun
from ros_process import RosProcess, run, running_node

from rigid_proto_ros.base.bundled import example_path, scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.rrd_file import read_session
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

SECOND = 10**9


def check_states(found: dict, offline: OfflineRun, at_least: int) -> None:
    """Every received pose and twist equals the offline state of its stamp."""
    times = sorted(set(found["pose"]) | set(found["twist"]))
    assert min(len(found["pose"]), len(found["twist"])) >= at_least
    for time_ns in times:
        assert offline.advance(time_ns)
        pose, twist = published(offline.simulation.state.row)
        assert found["pose"].get(time_ns, pose) == pose, time_ns
        assert found["twist"].get(time_ns, twist) == twist, time_ns


OFTEN, SELDOM = ("heavier_in_flight",), ("flip_and_poke", "same_force_three_ways", "heavier_in_flight")


@needs_rerun
@pytest.mark.parametrize("names", [OFTEN, pytest.param(SELDOM, marks=pytest.mark.stress)], ids=["one", "three"])
def test_poke_client_and_simulate_give_one_motion_and_the_recording_verifies(ros_environment, tmp_path, names):
    scene, session = scene_path("t_handle"), tmp_path / "session.rrd"
    arguments = ["--ros-args", "--params-file", scene, "-p", f"record:={session}", "-p", "publish_rate:=25"]
    arguments += ["-p", "real_time_factor:=8"]
    with (
        RosClient(ros_environment) as client,
        running_node(*arguments, environment=ros_environment, log=tmp_path / "node"),
    ):
        client.meet()
        for script in map(example_path, names):
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
            check_states(client.rows(), offline, 100)
    recorded = read_session(session)
    assert recorded.complete and len(recorded.times) > 200
    assert main(["replay", str(session), "--verify"]) == 0


@needs_rerun
@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGINT, marks=pytest.mark.stress)])
def test_the_recording_of_a_node_ended_by_a_signal_is_complete(ros_environment, tmp_path, number):
    session = tmp_path / "session.rrd"
    node = RosProcess(
        *("rigid_body_node", "--ros-args", "--params-file", scene_path("hammer"), "-p", f"record:={session}"),
        environment=ros_environment,
        log=tmp_path / "node",
    )
    node.wait_for("is simulating")
    assert node.end(number) == 0, node.errors
    recorded = read_session(session)
    assert recorded.complete
    assert recorded.mesh_chunks == 1
