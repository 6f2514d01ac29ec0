# SPDX-License-Identifier: MIT
"""The numbered examples are short, run as they stand, and do what their first lines say."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ros_process import READY_S, SOURCE, from_source, running_node

from rigid_proto_ros.base.bundled import scene_path

EXAMPLES = sorted((SOURCE / "msg_examples").glob("[0-9]*"))


@pytest.fixture(scope="module")
def environment(ros_environment: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """With our executables, and a stand-in for ``ros2`` where there is none, on the path."""
    installed = ("rigid_proto", "rigid_body_node", "poke_client")
    programs = {name: f"-m rigid_proto_ros.cli.executables {name}" for name in installed}
    if shutil.which("ros2") is None:
        programs["ros2"] = str(SOURCE / "test" / "ros2_stand_in.py")
    folder = tmp_path_factory.mktemp("bin")
    for name, started in programs.items():
        (folder / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {started} "$@"\n')
        (folder / name).chmod(0o755)
    return from_source({**ros_environment, "PATH": f"{folder}:{ros_environment['PATH']}"})


def run(number: int, environment: dict[str, str], folder: Path) -> str:
    """Run an example in a folder; its output."""
    path = EXAMPLES[number - 1]
    assert path.name.startswith(f"{number:02}_")
    interpreter = "sh" if path.suffix == ".sh" else sys.executable
    done = subprocess.run(
        [interpreter, str(path)],
        env=environment,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=READY_S,
        check=False,
    )
    assert done.returncode == 0, (path.name, done.stdout, done.stderr)
    return done.stdout


def test_there_are_ten_of_5_to_40_lines() -> None:
    assert [path.name[:2] for path in EXAMPLES] == [f"{k:02}" for k in range(1, 11)]
    for path in EXAMPLES:
        assert 5 <= len(path.read_text("utf-8").splitlines()) <= 40, path.name


@pytest.fixture(scope="class")
def client(environment, tmp_path_factory):
    """A client of the node that the examples talk to."""
    pytest.importorskip("rclpy")
    from ros_client import RosClient

    log, scene = tmp_path_factory.mktemp("flown") / "node", ("--params-file", scene_path("t_handle"))
    with (
        running_node(environment, log, {"real_time_factor": 10.0}, *scene),
        RosClient(environment) as client,
    ):
        client.listen("events", "/diagnostics")
        heard = itertools.cycle((True, False))
        client.until(lambda: client.pause(next(heard)) and client.events(), "the node to know that somebody listens")
        yield client


class TestWithANode:
    """The examples that talk to one, which flies for them alone."""

    @pytest.mark.parametrize("runs", [2, pytest.param(20, marks=pytest.mark.stress)])
    def test_a_detumbling_controller_in_lockstep_makes_the_same_session_every_time(
        self, client, environment, tmp_path, runs
    ):
        sessions = set()
        for _ in range(runs):
            client.forget("events")
            rate = float(run(5, environment, tmp_path).split(" rad/s")[0].rpartition(" ")[2])
            assert rate < 0.2  # measured 0.1; 12 at the start, and every flip after it without thrusters
            client.until(lambda: len(client.events("step")) == 200, "200 steps")
            events = client.events()
            reset = next(k for k, event in enumerate(events) if event["kind"] == "reset")
            commands = [event for event in events[reset:] if event["kind"] == "thrusters"]
            # Each acts at the very state that it answers to.
            assert [event["time_ns"] for event in commands] == [k * 10_000_000 for k in range(200)]
            sessions.add(events[-1]["sha256"])
        assert len(sessions) == 1

    def test_messages_a_script_a_string_and_a_change_of_mass_reach_the_node(
        self, client, environment, tmp_path
    ) -> None:
        client.pause(False)

        def kinds() -> list[str]:
            found = [event["kind"] for event in client.events()]
            client.forget("events")
            return found

        client.forget("events")
        run(1, environment, tmp_path)
        client.until(lambda: len(client.events("wrench")) == 6, "both held wrenches")
        heard = kinds()
        assert heard[heard.index("reset") :].count("poke") == 3
        assert "0 late, 0 refused" in run(2, environment, tmp_path)
        assert set(kinds()) >= {"reset", "poke", "wrench"}
        run(3, environment, tmp_path)
        client.until(lambda: len(client.events("string_target")) == 42, "all targets")
        kinds()
        run(4, environment, tmp_path)
        assert client.get("density", "ballast.tip") == {"density": 15700.0, "ballast.tip": [0.03, 0.0, 0.0, 0.07]}
        assert int(client.diagnostics()["refused_total"]) == 0


def test_many_simulations_from_python_find_the_gains(environment, tmp_path) -> None:
    assert "best of 25: 0.01 N m, 0.0032 N m s" in run(6, environment, tmp_path)


def test_a_sweep_writes_its_table_and_says_one_row(environment, tmp_path) -> None:
    pytest.importorskip("pyarrow")
    said = run(7, environment, tmp_path)
    assert "3000 rows in out/box_error.parquet" in said and re.search(r"difference.attitude +0\.\d+", said)


def test_the_doctor_names_the_cause_and_corrects_it(environment, tmp_path) -> None:
    said = run(8, environment, tmp_path)
    assert "cause: axes x and y exchanged" in said
    assert "explained -> uniform" in said


def test_a_recording_verifies_and_is_converted_and_continued(environment, tmp_path) -> None:
    pytest.importorskip("mcap")
    assert "every command and state is reproduced bit for bit" in run(9, environment, tmp_path)
    assert len((tmp_path / "out" / "flight.csv").read_text("utf-8").splitlines()) == 1002


def test_a_filter_is_compared_with_the_truth(environment, tmp_path) -> None:
    pytest.importorskip("rclpy")
    bias = {"noise.imu": [0.001, 0.0, 0.02, 0.0], "real_time_factor": 10.0}
    assert 'noise.imu:="[0.001, 0.0, 0.02, 0.0]"' in EXAMPLES[9].read_text("utf-8")
    with running_node(environment, tmp_path / "node", bias, "--params-file", scene_path("plumb_line")):
        alone, filtered = re.findall(r"([\d.e-]+) rad", run(10, environment, tmp_path))
    # Measured 0.77 and 0.0026 rad.
    assert float(filtered) < 0.02 < 0.5 < float(alone)
