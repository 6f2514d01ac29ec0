# SPDX-License-Identifier: MIT
"""A session sent again over ROS: its states with their stamps, its commands to a node that then flies the same motion."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")
pytest.importorskip("mcap")

from command_rig import wrench_message
from flights import SECOND
from ros_client import RosClient, stamp_ns
from ros_process import running_node
from scripts import EVERY_KIND

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.ros import replay_publisher
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.recorded_session import decode_event


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flown")
    (folder / "script.yaml").write_text(EVERY_KIND)
    arguments = ["simulate", "t_handle", "--script", str(folder / "script.yaml"), "--duration", "2"]
    assert main([*arguments, "--bag", str(folder / "s.mcap")]) == 0
    return folder / "s.mcap"


@pytest.fixture(scope="module")
def flyer(ros_environment, tmp_path_factory):
    """A client of a node /lab/flyer that flies the T-handle, and records from its start to ``flyer.path``."""
    folder = tmp_path_factory.mktemp("flyer")
    path = folder / "flight.mcap"
    names = ("--params-file", scene_path("t_handle"), "-r", "__node:=flyer", "-r", "__ns:=/lab")
    with (
        RosClient(ros_environment, "/lab/flyer") as client,
        running_node(ros_environment, folder / "node", {"record": str(path)}, *names),
    ):
        client.path = path
        client.meet()
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


def test_all_that_a_node_records_is_verified(flyer):
    path = flyer.path
    fly_and_reset(flyer)
    runs = read_runs(path)
    assert len(runs) == 2
    assert all(session.complete for session in runs)
    assert "gravity: [0.0, 0.0, -1.0]" in runs[-1].scene
    assert main(["replay", str(path), "--verify"]) == 0
    assert [session.node_name for session in runs] == ["lab/flyer", "lab/flyer"]
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


@pytest.fixture
def domain(ros_environment, monkeypatch):
    """Commands run in this process talk to the nodes of this session."""
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])


def test_states_go_out_with_their_stamps_to_the_bit(session, ros_environment, domain):
    """Heard again where who was found late on a busy machine has missed the beginning."""
    (recorded,) = read_runs(session)
    with RosClient(ros_environment) as client:
        client.listen("pose", "twist", wait=False)
        client.listen("/clock", wait=False, best_effort=True)

        def published() -> bool:
            client.forget("pose", "twist", "/clock")
            assert main(["replay", str(session), "--publish", "states", "--speed", "8"]) == 0
            return min(map(client.heard_count, ("pose", "twist", "/clock"))) > 20

        client.until(published, "states and clock that were heard")
        clock = [tick["clock"] for tick in client.heard("/clock")]
        assert {t["sec"] * SECOND + t["nanosec"] for t in clock} <= set(recorded.times.tolist())
        for name in ("pose", "twist"):
            # Reliable topics: once a subscriber is matched, nothing is missing.
            client.until(lambda name=name: client.newest_ns(name) == recorded.end_ns, "the last state")
            heard = client.heard(name)
            assert list(map(stamp_ns, heard)) == recorded.times.tolist()[-len(heard) :]
            rows = [[x for part in message[name].values() for x in part.values()] for message in heard]
            assert np.array(rows).tobytes() == recorded.published[name].rows[-len(heard) :].tobytes()


def test_commands_give_a_node_the_same_motion_to_the_bit(session, flyer, tmp_path, domain):
    (recorded,), path = read_runs(session), tmp_path / "flown.mcap"
    flyer.set(record=str(path), real_time_factor=4.0)
    assert main(["replay", str(session), "--publish", "commands", "--node", "/lab/flyer"]) == 0
    # States heard may be those from before the reset.
    flyer.until(lambda: int(flyer.diagnostics()["sim_time_ns"]) >= recorded.end_ns, "end of the session")
    flyer.set(record="")
    flown = read_runs(path)[-1]
    acted = [decode_event(line, number) for number, line in enumerate(flown.lines, 1)]
    commands = [event for event in acted if event[1] not in ("reset", "pause") and event[2] != {"record": ""}]
    assert commands == [decode_event(line, number) for number, line in enumerate(recorded.lines, 1)]
    for name, rows in recorded.published.items():
        states = flown.published[name]
        begin = states.times.tolist().index(rows.times[1])
        assert states.rows[begin:][: len(rows) - 1].tobytes() == rows.rows[1:].tobytes()


@pytest.mark.parametrize("speed", [0.5, 20.0])
def test_states_go_out_at_the_pace_that_is_asked_for(session, monkeypatch, speed):
    """On a clock that moves by what is slept, and by nothing else."""
    clock, sent = SimpleNamespace(now_s=5.0), []

    def sleep(seconds: float) -> None:
        clock.now_s += seconds

    def publisher(message_type, topic: str, _profile):
        publish = lambda data: sent.append((topic, clock.now_s - 5.0, data))  # noqa: E731
        return SimpleNamespace(publish=publish, wait_for_all_acked=lambda _: True)

    monkeypatch.setattr(replay_publisher, "time", SimpleNamespace(monotonic=lambda: clock.now_s, sleep=sleep))
    monkeypatch.setattr(replay_publisher, "_wait_for_subscribers", lambda *_: None)
    (recorded,) = read_runs(session)
    replay_publisher._send_states(SimpleNamespace(create_publisher=publisher), recorded, speed)
    for topic in ("/clock", "/rigid_body/pose", "/rigid_body/twist"):
        at = [time_s for name, time_s, _ in sent if name == topic]
        assert at == pytest.approx([1e-9 * stamp / speed for stamp in recorded.times.tolist()], abs=1e-9)


def test_publishing_to_nobody_ends_in_one_line(session, domain, monkeypatch, capsys):
    monkeypatch.setattr(replay_publisher, "WAIT_FOR_NODE_S", 0.1)
    assert main(["replay", str(session), "--publish", "commands", "--node", "/nobody"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and "/nobody" in err


def test_speed_without_states_to_publish_is_refused(session, capsys):
    assert main(["replay", str(session), "--speed", "2"]) == 2
    assert main(["replay", str(session), "--publish", "commands", "--speed", "2"]) == 2
    assert "real_time_factor" in capsys.readouterr().err
