# SPDX-License-Identifier: MIT
"""A session sent again over ROS: its states with their stamps, its commands to a node that then flies the same motion."""

from __future__ import annotations

import json

import numpy as np
import pytest
from conftest import ENDINGS

pytest.importorskip("rclpy")
pytest.importorskip("mcap")

from bag_recorder import BagRecorder
from command_rig import wrench_message
from flights import SECOND
from ros_client import RosClient
from ros_process import run, running_node
from scripts import EVERY_KIND

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.session.messages import read_state


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(EVERY_KIND)
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "2"]
    assert main([*arguments, "--bag", str(folder / "s.mcap")]) == 0
    return folder / "s.mcap"


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


@pytest.fixture(scope="module")
def flyer(ros_environment, tmp_path_factory):
    """A client of a node /flyer that flies the T-handle, and records from its start to ``flyer.path``."""
    folder = tmp_path_factory.mktemp("flyer")
    path = folder / "flight.mcap"
    names = ("--params-file", scene_path("t_handle"), "-r", "__node:=flyer")
    with (
        RosClient(ros_environment, "/flyer") as client,
        running_node(ros_environment, folder / "node", {"record": str(path)}, *names),
    ):
        client.path = path
        client.meet()
        client.listen("/clock", wait=False, best_effort=True)
        yield client


def fly_and_reset(client) -> None:
    """A poke, a change, a reset, and half a second after it."""
    taken = int(client.diagnostics()["poke_received"])
    client.publish("poke", wrench_message(0, "flyer@com;impulse", (0.0, 0.003, 0.0)))
    client.until_received(taken + 1, "poke")
    client.set(gravity=[0.0, 0.0, -1.0])
    client.fly_until(SECOND // 2)
    client.reset()
    client.fly_until(SECOND // 2)
    client.set(record="", gravity=[0.0, 0.0, 0.0])


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_node_records_by_the_ending_of_the_file_and_all_of_it_is_verified(flyer, tmp_path, ending):
    path = flyer.path
    if ending == ".rrd":
        path = tmp_path / "session.rrd"
        flyer.set(record=str(path))
        flyer.reset()
    fly_and_reset(flyer)
    runs = read_runs(path)
    if ending == ".rrd":
        # A reset begins another file; the one before holds the command with the node's own frame.
        runs = [*read_runs(tmp_path / "session.run2.rrd"), *runs]
        assert main(["replay", str(tmp_path / "session.run2.rrd"), "--verify"]) == 0
    assert len(runs) == 2
    assert all(session.complete for session in runs)
    assert "gravity: [0.0, 0.0, -1.0]" in runs[-1].scene
    assert main(["replay", str(path), "--verify"]) == 0
    assert [session.node_name for session in runs] == ["flyer", "flyer"]
    assert any("flyer@com" in line for line in runs[0].lines)


def test_a_recording_switched_on_in_flight_is_shown_and_verified_from_the_next_reset_on(flyer, tmp_path, capsys):
    path = tmp_path / "session.mcap"
    flyer.publish("poke", wrench_message(0, "body@com;impulse", (0.0, 0.003, 0.0)))
    flyer.set(record=str(path))
    flyer.forget("pose")
    flyer.until(lambda: flyer.heard_count("pose") > 50, "half a second of states")
    assert flyer.diagnostics()["recording"] == str(path)
    flyer.set(record="")
    assert flyer.diagnostics()["recording"] == ""
    assert main(["replay", str(path), "--verify"]) == 2
    assert "begins at" in capsys.readouterr().err
    assert read_runs(path)[-1].complete and len(read_runs(path)[-1].times) > 10
    # A change that is refused leaves the file of that name as it is.
    before = path.read_bytes()
    flyer.set(wrench_timeout=0.0)
    taken = int(flyer.diagnostics()["wrench_received"])
    flyer.publish("wrench", wrench_message(0, "body@point/0.0,0.1,0.0", (0.0, 0.0, 1e-3)))
    flyer.until_received(taken + 1, "wrench")
    ((accepted, reason),) = flyer.set(record=str(path), integrator="free_body", atomically=True)
    assert not accepted and "free_body" in reason
    assert path.read_bytes() == before
    flyer.set(record=str(path))
    flyer.reset()
    flyer.fly_until(SECOND // 2)
    flyer.set(record="", wrench_timeout=1.5)
    assert main(["replay", str(path), "--verify"]) == 0


def test_states_go_out_with_their_stamps_to_the_bit(session, flyer):
    """Heard again where who was found late on a busy machine has missed the beginning."""

    def published():
        flyer.forget("/clock")
        recorder = BagRecorder(flyer.environment)
        words = ("replay", session, "--publish", "states", "--speed", "8")
        done = run("rigid_proto", *words, environment=flyer.environment)
        messages = recorder.finish()
        assert done.returncode == 0, done.stderr
        clock = [tick["clock"] for tick in flyer.heard("/clock")]
        heard = min(len(clock), *(len(states_of(messages, name)[0]) for name in ("pose", "twist")))
        return heard > 20 and (messages, clock)

    messages, clock = flyer.until(published, "states and clock that were heard")
    (recorded,) = read_runs(session)
    assert {t["sec"] * SECOND + t["nanosec"] for t in clock} <= set(recorded.times.tolist())
    for name in ("pose", "twist"):
        stamps, rows = states_of(messages, name)
        # Reliable topics: once a subscriber is matched, nothing is missing.
        first = recorded.times.tolist().index(stamps[0])
        assert stamps == recorded.times.tolist()[first:]
        assert np.array(rows).tobytes() == recorded.published[name].rows[first:].tobytes()


def test_commands_give_a_node_the_same_motion_to_the_bit(session, flyer, tmp_path):
    flyer.set(real_time_factor=4.0)
    other = BagRecorder(flyer.environment, name="flyer")
    other.until(lambda: any(m.topic.endswith("/pose") for m in list(other.messages)), "the node")
    done = run(
        *("rigid_proto", "replay", session, "--publish", "commands", "--node", "/flyer"),
        environment=flyer.environment,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    other.until(lambda: flown_to(other.messages) >= 2 * SECOND, "the flight after the reset")
    (recorded,) = read_runs(session)
    commands = [json.loads(line) for line in recorded.lines]
    other.until(lambda: len(events_since_reset(list(other.messages))) >= len(commands), "their events")
    assert flyer.get("record") == {"record": ""}
    other.close()
    messages = other.messages
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
