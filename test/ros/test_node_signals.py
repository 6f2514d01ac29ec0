# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end every command quietly, with a complete recording and no orphan: with 128 + the signal's number,
and the node with 0. ``up`` is among the commands of the README that stay up, in test_readme.py.
"""

import re
import signal
import socket
import time

import pytest
from conftest import needs_rerun
from rerun_flight import verified
from ros_process import READY_S, RosProcess, alive, catches, descendants, start_node

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.session.bag import read_runs

BOTH = pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.stress)])
"""One handler serves both."""


@needs_rerun
@BOTH
def test_a_recording_node_a_waiting_client_and_an_offline_run_end(ros_environment, tmp_path, number):
    script = tmp_path / "late.yaml"
    script.write_text("- {t: 1000, at: com, force: [0, 0, 1]}\n")
    run, flown = tmp_path / "run", tmp_path / "flown"
    names = {place: f"{place}.mcap,{place}.rrd" for place in (run, flown)}
    scene = ("--params-file", scene_path("hammer"))
    node = start_node(ros_environment, tmp_path / "node", {"record": names[flown]}, *scene)
    node.wait_for("is simulating")
    # The command lies too far ahead to be sent: it waits, beside a long offline run.
    client = RosProcess("poke_client", script, environment=ros_environment, log=tmp_path / "client")
    offline = RosProcess(
        *("rigid_proto", "simulate", "t_handle", "--duration", 1e6, "--record", names[run]),
        environment=ros_environment,
        log=tmp_path / "offline",
    )
    view = run.with_suffix(".rrd")
    for ready in (lambda: view.exists() and view.stat().st_size > 10_000, lambda: catches(client.pid, number)):
        while not ready():
            assert offline.process.poll() is None and client.process.poll() is None, offline.errors + client.errors
            time.sleep(0.02)
    assert offline.end(number) == 128 + number, offline.errors
    assert client.end(number) == 128 + number, client.errors
    assert node.end(signal.SIGTERM if number == signal.SIGINT else signal.SIGINT) == 0, node.errors
    assert offline.errors == client.errors == ""
    for place in (run, flown):
        assert read_runs(f"{place}.mcap")[0].complete
        assert verified(place.with_suffix(".rrd"))


@pytest.mark.stress
@needs_rerun
@BOTH
def test_a_demo_ended_in_flight_leaves_its_recording_and_no_process(ros_environment, tmp_path, number):
    demo = RosProcess("rigid_proto", "demo", "--duration", 60, environment=ros_environment, log=tmp_path / "demo")
    session = tmp_path / "out" / "session.mcap"
    while not (session.exists() and session.stat().st_size > 10_000):
        assert demo.process.poll() is None, demo.errors
        time.sleep(0.02)
    children = descendants(demo.pid)
    assert len(children) >= 2
    assert demo.end(number) == 128 + number, demo.errors
    assert "Traceback" not in demo.errors
    assert not [pid for pid in children if alive(pid)]
    assert read_runs(session)[-1].complete and verified(session.with_suffix(".rrd"))


@needs_rerun
def test_a_node_that_is_refused_behind_its_viewer_leaves_none(ros_environment, tmp_path):
    node = start_node(ros_environment, tmp_path / "node", {"viewer": "web", "record": "/proc/flight.mcap"})
    assert node.process.wait(READY_S) == 2
    assert "rigid_body_node: record: got '/proc/flight.mcap'" in node.errors and "Traceback" not in node.errors
    port = int(re.search(r"viewer: http://127\.0\.0\.1:(\d+)", node.errors)[1])
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))


def wait_for_the_end_of(pids: set[int]) -> None:
    """They have been killed, which takes a moment."""
    deadline = time.monotonic() + READY_S
    while going_on := [pid for pid in pids if alive(pid)]:
        assert time.monotonic() < deadline, going_on
        time.sleep(0.02)


@needs_rerun
def test_a_node_that_is_killed_takes_its_viewer_with_it(ros_environment, tmp_path):
    node = start_node(ros_environment, tmp_path / "node", {"viewer": "web"})
    node.wait_for("is simulating")
    (viewer,) = descendants(node.pid)
    node.process.kill()
    wait_for_the_end_of({viewer})


@BOTH
def test_a_node_that_builds_its_kernels_ends_at_once(ros_environment, tmp_path, number):
    """That takes a minute, in a process of its own."""
    environment = {**ros_environment, "RIGID_PROTO_KERNELS_FOLDER": str(tmp_path / "kernels")}
    node = start_node(environment, tmp_path / "node")
    node.wait_for("building the kernels")
    while not (children := descendants(node.pid)):
        time.sleep(0.01)
    assert node.end(number, within_s=10.0) == 0, node.errors
    wait_for_the_end_of(children)
    assert "Traceback" not in node.errors
    assert "is simulating" not in node.output + node.errors
