# SPDX-License-Identifier: MIT
"""A session sent again over ROS: its states with their stamps, its commands to a node that then flies the same motion."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import ENDINGS, MISSING

pytest.importorskip("rclpy")
pytest.importorskip("mcap")

from bag_recorder import BagRecorder
from command_rig import RosClient, wrench_message
from flights import SECOND
from ros_process import run, running_node
from scripts import EVERY_KIND

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.session.messages import read_state


def flown_session(folder, *settings: str):
    (folder / "script.yaml").write_text(EVERY_KIND)
    bag = folder / "s.mcap"
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "2"]
    recorded = [] if "rerun" in MISSING else ["--record", str(folder / "s.rrd")]
    assert main([*arguments, "--bag", str(bag), *recorded, *settings]) == 0
    return bag


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    return flown_session(tmp_path_factory.mktemp("flown"))


def states_of(messages, name: str) -> tuple[list[int], list[list[float]]]:
    read = [read_state(name, m.data, m.topic) for m in messages if m.topic.endswith(f"/{name}")]
    return [stamp for stamp, _ in read], [row for _, row in read]


def last_reset(messages) -> int:
    """Where the last run begins."""
    return max(k for k, m in enumerate(messages) if m.topic.endswith("events") and b'"reset"' in m.data)


def events_since_reset(messages) -> list[bytes]:
    """Without the reset's own and those of pauses."""
    run = messages[last_reset(messages) :]
    return [m.data for m in run if m.topic.endswith("events") and b'"pause"' not in m.data][1:]


def flown_to(messages) -> int:
    """The stamp that both pose and twist have reached since the reset [ns]; 0 before it has been heard."""
    messages = list(messages)
    if not any(m.topic.endswith("events") and b'"reset"' in m.data for m in messages):
        return 0
    run = messages[last_reset(messages) :]
    return min(max(states_of(run, name)[0], default=0) for name in ("pose", "twist"))


def heard_states(client, session, *arguments: str):
    """What is heard of the states of a session, and of /clock while ``client`` listens to it; again where who was found
    late on a busy machine has missed the beginning.
    """

    def published():
        client.forget("/clock")
        recorder = BagRecorder(client.environment)
        done = run("rigid_proto", "replay", session, "--publish", "states", *arguments, environment=client.environment)
        messages = recorder.close()
        assert done.returncode == 0, done.stderr
        clock = [tick["clock"] for tick in client.heard("/clock")]
        heard = min(len(clock), *(len(states_of(messages, name)[0]) for name in ("pose", "twist")))
        return heard > 20 and (messages, clock)

    return client.until(published, "states and clock that were heard")


@pytest.fixture(scope="module")
def clock_client(ros_environment):
    with RosClient(ros_environment) as client:
        client.environment = ros_environment
        client.do("listen", topic="/clock", type="Clock", wait=False, best_effort=True)
        yield client


def test_states_go_out_with_their_stamps_to_the_bit(session, clock_client):
    messages, clock = heard_states(clock_client, session, "--speed", "4")
    (recorded,) = read_runs(session)
    assert {t["sec"] * SECOND + t["nanosec"] for t in clock} <= set(recorded.times.tolist())
    for name in ("pose", "twist"):
        stamps, rows = states_of(messages, name)
        # Reliable topics: once a subscriber is matched, nothing is missing.
        first = recorded.times.tolist().index(stamps[0])
        assert stamps == recorded.times.tolist()[first:]
        assert np.array(rows).tobytes() == recorded.published[name].rows[first:].tobytes()


def test_commands_give_a_node_the_same_motion_to_the_bit(session, ros_environment, tmp_path):
    recorder = BagRecorder(ros_environment)
    arguments = ["--ros-args", "--params-file", scene_path("t_handle"), "-r", "__node:=other"]
    other = BagRecorder(ros_environment, name="other")
    with (
        RosClient(ros_environment, "/other") as client,
        running_node(*arguments, environment=ros_environment, log=tmp_path / "node"),
    ):
        client.until(
            lambda: any(m.topic.endswith("/pose") for m in list(other.messages)), "the recorder to hear the node"
        )
        done = run(
            *("rigid_proto", "replay", session, "--publish", "commands", "--node", "/other"),
            environment=ros_environment,
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stderr
        client.until(lambda: flown_to(other.messages) >= 2 * SECOND, "the flight after the reset")
        (recorded,) = read_runs(session)
        commands = [json.loads(line) for line in recorded.lines]
        client.until(lambda: len(events_since_reset(list(other.messages))) >= len(commands), "their events")
        assert client.get("record") == {"record": ""}
    assert not recorder.close()
    messages = other.close()
    last = last_reset(messages)
    assert len(events_since_reset(messages)) == len(commands)
    for name in ("pose", "twist"):
        stamps, rows = states_of(messages[last:], name)
        flown = {stamp: row for stamp, row in zip(stamps, rows, strict=True) if stamp <= 2 * SECOND}
        expected = dict(zip(recorded.times.tolist(), recorded.published[name].rows.tolist(), strict=True))
        assert sum(stamp > 0 for stamp in flown) >= 199
        assert all(flown[stamp] == expected[stamp] for stamp in flown if stamp > 0)


@pytest.mark.stress
def test_publishing_to_nobody_ends_in_one_line(session, ros_environment):
    arguments = ["replay", session, "--publish", "commands", "--node", "/nobody"]
    done = run("rigid_proto", *arguments, environment=ros_environment)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1 and "/nobody" in done.stderr


def test_speed_without_states_to_publish_is_refused(session, capsys):
    assert main(["replay", str(session), "--speed", "2"]) == 2
    assert main(["replay", str(session), "--publish", "commands", "--speed", "2"]) == 2
    assert "real_time_factor" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_node_records_by_the_ending_of_the_file_and_all_of_it_is_verified(ros_environment, tmp_path, ending):
    path = tmp_path / f"session{ending}"
    arguments = ["--params-file", scene_path("hammer"), "-p", f"record:={path}", "-r", "__node:=flyer"]
    with (
        RosClient(ros_environment, "/flyer") as client,
        running_node("--ros-args", *arguments, environment=ros_environment, log=tmp_path / "node"),
    ):
        client.meet()
        client.publish("poke", wrench_message(0, "flyer@com;impulse", (0.0, 0.3, 0.0)))
        client.until_received(1)
        client.set(gravity=[0.0, 0.0, -1.0])
        client.fly_until(SECOND)
        client.reset()
        client.fly_until(SECOND // 2)
    runs = read_runs(path)
    assert len(runs) == (2 if ending == ".mcap" else 1)
    assert all(session.complete for session in runs)
    assert "gravity: [0.0, 0.0, -1.0]" in runs[-1].scene
    assert main(["replay", str(path), "--verify"]) == 0
    if ending == ".rrd":
        # A reset begins another file; the run before holds the command with the node's own frame.
        runs = [*read_runs(tmp_path / "session.run1.rrd"), *runs]
        assert main(["replay", str(tmp_path / "session.run1.rrd"), "--verify"]) == 0
    assert [session.node_name for session in runs] == ["flyer", "flyer"]
    assert any("flyer@com" in line for line in runs[0].lines)


@pytest.fixture(scope="module")
def hammer(ros_environment, tmp_path_factory):
    """A client of a node that flies a hammer and records nothing."""
    arguments = ["--params-file", scene_path("hammer"), "-r", "__node:=hammer"]
    log = tmp_path_factory.mktemp("hammer") / "node"
    with (
        RosClient(ros_environment, "/hammer") as client,
        running_node("--ros-args", *arguments, environment=ros_environment, log=log),
    ):
        client.meet()
        yield client


def test_a_recording_switched_on_in_flight_is_shown_and_verified_from_the_next_reset_on(
    hammer, ros_environment, tmp_path
):
    path, client = tmp_path / "session.mcap", hammer
    client.publish("poke", wrench_message(0, "body@com;impulse", (0.0, 0.3, 0.0)))
    client.set(record=str(path))
    client.forget("pose")
    client.until(lambda: client.heard_count("pose") > 50, "half a second of states")
    assert client.diagnostics()["recording"] == str(path)
    client.set(record="")
    assert client.diagnostics()["recording"] == ""
    late = run("rigid_proto", "replay", path, "--verify", environment=ros_environment)
    assert late.returncode == 2 and "begins at" in late.stderr, late.stderr
    assert read_runs(path)[-1].complete and len(read_runs(path)[-1].times) > 10
    # A change that is refused leaves the file of that name as it is.
    before = path.read_bytes()
    client.set(wrench_timeout=0.0)
    taken = int(client.diagnostics()["wrench_received"])
    client.publish("wrench", wrench_message(0, "body@point/0.0,0.1,0.0", (0.0, 0.0, 1e-3)))
    client.until_received(taken + 1, "wrench")
    ((accepted, reason),) = client.set(record=str(path), integrator="free_body", atomically=True)
    assert not accepted and "free_body" in reason
    assert path.read_bytes() == before
    client.set(record=str(path))
    client.reset()
    client.fly_until(SECOND // 2)
    client.set(record="")
    assert main(["replay", str(path), "--verify"]) == 0
