# SPDX-License-Identifier: MIT
"""What the node publishes is, bit for bit, what the offline run computes from the same commands at the same times."""

import json
import signal

import pytest
from command_rig import RosClient, published
from conftest import needs_rerun
from ros_process import READY_S, RosProcess, dds_client, run, running_node

from rigid_proto_ros.base.bundled import example_path, scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.rerun_view.rrd_file import read_session
from rigid_proto_ros.scene.command_codec import string_attach, string_target
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.simulation.commands import WrenchCommand

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


def test_an_outside_dds_client_sees_the_offline_motion_bit_for_bit(ros_environment, tmp_path):
    pytest.importorskip("cyclonedds")
    scene = scene_path("t_handle")
    commands = [
        ["wrench", 2 * SECOND + 123_456_789, "body", [0.0, 0.0, 0.0], [1e-4, 0.0, -2e-4]],
        ["poke", 2 * SECOND + 500_000_001, "world@tip;duration=0.7", [0.0, 0.01, 0.02], [0.0, 0.0, 0.0]],
        ["poke", 2 * SECOND + 500_000_001, "normal@vertex/3", [0.03, 0.0, 0.0], [0.0, 0.0, 0.0]],
        ["wrench", 3 * SECOND, "world@left", [0.01, 0.0, 0.0], [0.0, 1e-5, 0.0]],
        ["poke", 3 * SECOND + 7, "body@point/0.0,0.05,0.0;impulse", [0.0, 0.0, 1e-3], [0.0, 0.0, 0.0]],
        ["poke", SECOND + 5, "world@ray/5.0,0.0,0.0/-1.0,0.0,0.0", [-0.02, 0.0, 0.0], [0.0, 0.0, 0.0]],
        ["string/attach", 2 * SECOND, "rigid_body/mesh", [0.0, 0.0, 0.07]],
        ["string/target", 2 * SECOND + 1, "world", [0.02, 0.01, 0.1]],
        ["string/target", 2 * SECOND + 200_000_000, "world", [0.03, 0.0, 0.12]],
        # Both taken onto the surface from where they are off it.
        ["string/attach", 2 * SECOND + 500_000_000, "body", [0.0, 0.03, 0.05]],
        ["string/attach", 2 * SECOND + 800_000_000, "world", [0.1, -0.2, 0.05]],
    ]
    arguments = ["--ros-args", "--params-file", scene, "-p", "publish_rate:=50", "-p", "real_time_factor:=3"]
    # Paused until they are all there.
    arguments += ["-p", "start_paused:=true"]
    with (
        RosClient(ros_environment) as client,
        running_node(*arguments, environment=ros_environment, log=tmp_path / "node"),
    ):
        outside = dds_client(ros_environment, "rigid_body", commands, 6 * SECOND)
        client.watch_diagnostics()
        client.until_received(len(commands))
        client.pause(False)
        output, errors = outside.communicate(timeout=READY_S)
    assert outside.returncode == 0, errors
    found = json.loads(output.splitlines()[-1])
    found = {topic: {int(ns): row for ns, row in rows.items()} for topic, rows in found.items()}
    scenario = read_scene(str(scene), {"publish_rate": 50.0})
    offline = OfflineRun(scenario)
    for topic, ns, frame, *values in commands:
        if topic.startswith("string"):
            read_string = {"string/attach": string_attach, "string/target": string_target}[topic]
            offline.simulation.submit(read_string(frame, values[0], ("world", "rigid_body"), stamp_ns=ns), ns)
            continue
        force, torque = values
        read = parse_frame(frame)
        offline.simulation.submit(
            WrenchCommand(topic == "wrench", read, tuple(force), tuple(torque), frame, stamp_ns=ns), ns
        )
    check_states(found, offline, 100)
    assert not offline.simulation.refused
    assert abs(offline.simulation.state.linear_velocity).max() > 1e-3


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
