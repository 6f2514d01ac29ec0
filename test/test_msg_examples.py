# SPDX-License-Identifier: MIT
"""The numbered examples are short, run as they stand, and do what their first lines say."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable

import pytest
import yaml
from ros_process import SOURCE, from_source, running_node

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.ros.poke_client import main as poke_client
from rigid_proto_ros.scene.scene_file import read_scene_file

EXAMPLES = sorted((SOURCE / "msg_examples").glob("[0-9]*"))


@pytest.fixture
def run(ros_environment, tmp_path, monkeypatch, capfd):
    """Runs an example in a folder of its own; its output.

    The programs on its path are functions of this process, which has imported already what each would have to import:
    an example's words come through a pipe, and the exit status goes back through another one.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    asked, answered, folder = tmp_path / "asked", tmp_path / "answered", tmp_path / "bin"
    os.mkfifo(asked)
    os.mkfifo(answered)
    folder.mkdir()
    environment = from_source({**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"})

    def run_example(number: int, **programs: Callable[[list[str]], int]) -> str:
        programs = {"rigid_proto": rigid_proto, "poke_client": poke_client, **programs}
        for name in programs:
            text = f'#!/bin/sh\nprintf "%s\\0" {name} "$@" > {asked}\nread status < {answered}\nexit "$status"\n'
            (folder / name).write_text(text)
            (folder / name).chmod(0o755)
        path = EXAMPLES[number - 1]
        assert path.name.startswith(f"{number:02}_")
        interpreter = "sh" if path.suffix == ".sh" else sys.executable
        whole = f'{interpreter} "$0"; printf "exit\\0%s" $? > {asked}'
        with subprocess.Popen(["sh", "-c", whole, str(path)], env=environment, start_new_session=True) as shell:
            try:
                while (words := asked.read_text().removesuffix("\0").split("\0"))[0] != "exit":
                    answered.write_text(f"{programs[words[0]](words[1:])}\n")
            except BaseException:
                os.killpg(shell.pid, signal.SIGKILL)
                raise
        said = capfd.readouterr()
        assert words == ["exit", "0"], (path.name, said)
        return said.out

    return run_example


def test_there_are_ten_of_5_to_40_lines() -> None:
    assert [path.name[:2] for path in EXAMPLES] == [f"{k:02}" for k in range(1, 11)]
    for path in EXAMPLES:
        assert 5 <= len(path.read_text("utf-8").splitlines()) <= 40, path.name


def test_many_simulations_from_python_find_the_gains(run) -> None:
    assert "best of 25: 0.01 N m, 0.0032 N m s" in run(6)


def test_a_sweep_writes_its_table_and_says_one_row(run) -> None:
    pytest.importorskip("pyarrow")
    said = run(7)
    assert "3000 rows in out/box_error.parquet" in said and re.search(r"difference.attitude +0\.\d+", said)


def test_the_doctor_names_the_cause_and_corrects_it(run) -> None:
    said = run(8)
    assert "cause: axes x and y exchanged" in said
    assert "explained -> uniform" in said


def test_a_recording_verifies_and_is_converted_and_continued(run, tmp_path) -> None:
    pytest.importorskip("mcap")
    assert "every command and state is reproduced bit for bit" in run(9)
    assert len((tmp_path / "out" / "flight.csv").read_text("utf-8").splitlines()) == 1002


# With a node, which is there from here to the end


@pytest.fixture(scope="module")
def client(ros_environment, tmp_path_factory):
    """A client of the node that the examples talk to."""
    pytest.importorskip("rclpy")
    from ros_client import RosClient

    log, scene = tmp_path_factory.mktemp("flown") / "node", ("--params-file", scene_path("t_handle"))
    with (
        running_node(ros_environment, log, {"real_time_factor": 10.0}, *scene),
        RosClient(ros_environment) as client,
    ):
        client.listen("events", "/diagnostics")
        client.advertise("poke", "wrench", "string/attach", "string/target")
        heard = itertools.cycle((True, False))
        client.until(lambda: client.pause(next(heard)) and client.events(), "the node to know that somebody listens")
        yield client


@pytest.mark.parametrize("runs", [2, pytest.param(20, marks=pytest.mark.stress)])
def test_a_detumbling_controller_in_lockstep_makes_the_same_session_every_time(client, run, runs) -> None:
    sessions = set()
    for _ in range(runs):
        client.forget("events")
        rate = float(run(5).split(" rad/s")[0].rpartition(" ")[2])
        assert rate < 0.2  # measured 0.1; 12 at the start, and every flip after it without thrusters
        client.until(lambda: len(client.events("step")) == 200, "200 steps")
        events = client.events()
        reset = next(k for k, event in enumerate(events) if event["kind"] == "reset")
        commands = [event for event in events[reset:] if event["kind"] == "thrusters"]
        # Each acts at the very state that it answers to.
        assert [event["time_ns"] for event in commands] == [k * 10_000_000 for k in range(200)]
        sessions.add(events[-1]["sha256"])
    assert len(sessions) == 1


def ros2(client, words: list[str]) -> int:
    """What the examples need of ros2cli, which isn't among PyPI's wheels; its clock goes ten times as fast, as the node's."""
    match words:
        case ["service", "call", service, "std_srvs/srv/Trigger"]:
            assert client.trigger(service)["success"]
        case ["param", "set", client.node, name, value]:
            assert client.set_named({name: yaml.safe_load(value)}) == [[True, ""]]
        case ["topic", "pub", *options, topic, _, text]:
            given = dict(zip(options[0::2], options[1::2], strict=False))
            messages = [yaml.safe_load(text)] * int(given.get("--times", 1))
            client.publish(topic.removeprefix("/rigid_body/"), *messages, rate=10.0 * float(given.get("--rate", 1.0)))
        case _:
            raise AssertionError(f"{words} are not among what the examples use")
    return 0


def test_messages_a_script_a_string_and_a_change_of_mass_reach_the_node(client, run) -> None:
    client.pause(False)
    stand_in = {} if shutil.which("ros2") else {"ros2": lambda words: ros2(client, words)}

    def kinds() -> list[str]:
        found = [event["kind"] for event in client.events()]
        client.forget("events")
        return found

    client.forget("events")
    run(1, **stand_in)
    client.until(lambda: len(client.events("wrench")) == 6, "both held wrenches")
    heard = kinds()
    assert heard[heard.index("reset") :].count("poke") == 3
    assert "0 late, 0 refused" in run(2, **stand_in)
    assert set(kinds()) >= {"reset", "poke", "wrench"}
    run(3, **stand_in)
    client.until(lambda: len(client.events("string_target")) == 42, "all targets")
    kinds()
    run(4, **stand_in)
    assert client.get("density", "ballast.tip") == {"density": 15700.0, "ballast.tip": [0.03, 0.0, 0.0, 0.07]}
    assert int(client.diagnostics()["refused_total"]) == 0


def test_a_filter_is_compared_with_the_truth(client, run) -> None:
    assert 'config/plumb_line.yaml -p noise.imu:="[0.001, 0.0, 0.02, 0.0]"' in EXAMPLES[9].read_text("utf-8")
    values = {**read_scene_file(scene_path("plumb_line")).values, "noise.imu": [0.001, 0.0, 0.02, 0.0]}
    changes = {name: value for name, value in values.items() if not name.startswith("contacts.")}
    # So slow that the filter takes each message also on a busy machine.
    changes |= {
        "real_time_factor": 5.0,
        "density": 700.0,
        "ballast.tip": [0.0] * 4,
        "initial.angular_velocity": [0.0] * 3,
    }
    assert client.set_named(changes, atomically=True) == [[True, ""]]
    client.trigger("reset")
    client.pause(False)
    alone, filtered = re.findall(r"([\d.e-]+) rad", run(10))
    # Measured 0.73 and 0.007 rad.
    assert float(filtered) < 0.02 < 0.5 < float(alone)
