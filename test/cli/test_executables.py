# SPDX-License-Identifier: MIT
"""An executable that lacks what it needs ends in one line that says what to install."""

from __future__ import annotations

import importlib.util
import os
import resource
import signal
import subprocess
import sys

import pytest
from conftest import ENDINGS
from ros_process import command, from_source

from rigid_proto_ros.base import interrupts
from rigid_proto_ros.cli import executables
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import verify


@pytest.fixture(autouse=True)
def signals_as_before():
    """The handlers of signals, which executables set for their process."""
    before = {number: signal.getsignal(number) for number in interrupts.NUMBERS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


START = {name: getattr(executables, name) for name in ("rigid_proto", "rigid_body_node", "poke_client")}


def without(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Hide packages from those who look whether they are installed."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name in packages else find(name))


@pytest.mark.parametrize(
    ("program", "package", "remedies"),
    [
        *((program, "numpy", ("numpy not found by ", "make setup", "pip install numpy")) for program in START),
        ("rigid_body_node", "rclpy", ("/opt/ros/", "rigid_proto_ros[ros]")),
        ("poke_client", "rclpy", ("/opt/ros/", "rigid_proto_ros[ros]")),
    ],
)
def test_without_a_package_an_executable_says_what_to_source_or_install(
    program, package, remedies, monkeypatch, capsys
) -> None:
    without(monkeypatch, package)
    assert START[program]() == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{program}: ") and all(remedy in line for remedy in remedies)


def test_a_stream_that_the_shell_has_closed_is_open_to_nothing_also_for_processes_that_are_started(monkeypatch) -> None:
    without(monkeypatch, "numpy")
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)
    assert START["rigid_proto"]() == 2
    assert sys.stdin.read() == "" and not sys.stderr.isatty()
    assert all(os.get_inheritable(stream.fileno()) for stream in (sys.stdin, sys.stdout, sys.stderr))


def test_an_executable_that_is_started_here_imports_nothing_from_the_current_folder(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(executables, "check_rclpy", lambda _: None)
    (tmp_path / "json.py").write_text("raise SystemExit('the user's own json')")
    started = [*executables.own_executable("rigid_proto"), "--version"]
    assert subprocess.run(started, cwd=tmp_path, env=interrupts.with_this_package(), check=False).returncode == 0


def test_a_command_to_type_is_a_name_where_the_path_has_it_and_else_a_path(monkeypatch, tmp_path) -> None:
    for folder in (".venv/bin", "onpath"):
        (tmp_path / folder).mkdir(parents=True)
        for name in ("python", "poke_client"):
            (tmp_path / folder / name).touch(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(executables.sys, "executable", str(tmp_path / ".venv" / "bin" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert executables.as_typed("poke_client") == ".venv/bin/poke_client"
    assert executables.as_typed("rerun") == "rerun"
    monkeypatch.chdir(tmp_path / "onpath")
    assert executables.as_typed("poke_client") == str(tmp_path / ".venv" / "bin" / "poke_client")
    monkeypatch.setenv("PATH", str(tmp_path / "onpath"))
    assert executables.as_typed("poke_client") == "poke_client"


@pytest.mark.parametrize(
    ("command", "package", "named"),
    [
        (["up"], "rclpy", "rigid_proto_ros[ros]"),
        (["demo"], "rclpy", "rigid_proto_ros[ros]"),
        (["snapshot", "session.mcap", "--at", "1", "-o", "x.png"], "PIL", "rigid_proto_ros[rerun]"),
        (["snapshot", "session.mcap", "--at", "1", "-o", "x.png"], "rerun", "rigid_proto_ros[rerun]"),
        (["workbench"], "websockets", "rigid_proto_ros[workbench]"),
        (["simulate", "t_handle", "--record", "x.mcap,x.rrd"], "rerun", "rigid_proto_ros[rerun]"),
    ],
)
def test_a_command_without_its_package_names_it_in_one_line_and_does_nothing(
    command, package, named, monkeypatch, capsys
) -> None:
    without(monkeypatch, package)
    assert main(command) == 2
    told = capsys.readouterr()
    assert told.out == "" and len(told.err.splitlines()) == 1 and named in told.err


def buffered() -> dict[str, str]:
    """The environment of who pipes into another program: Python writes at the end."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}


def test_an_output_that_nobody_reads_or_that_takes_nothing_is_told_in_a_line_at_most():
    inspect = command("rigid_proto", "inspect", "book")
    with open("/dev/full", "w") as full:
        done = subprocess.run(inspect, stdout=full, stderr=subprocess.PIPE, text=True, env=buffered(), check=False)
    assert done.returncode == 2
    assert done.stderr == "rigid_proto inspect: [Errno 28] No space left on device\n"
    with open("/dev/full", "w") as full:
        plan = command("poke_client", "poke", "--at", "tip", "--push", "0.05", "--dry-run")
        done = subprocess.run(plan, stdout=full, stderr=subprocess.PIPE, text=True, env=buffered(), check=False)
    if importlib.util.find_spec("rclpy"):
        assert (done.returncode, done.stderr) == (2, "poke_client: [Errno 28] No space left on device\n")
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(inspect, stdout=write, stderr=subprocess.PIPE, text=True, env=buffered(), check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


def test_an_output_in_an_encoding_without_the_units_is_written_nevertheless():
    inspect, ascii_alone = command("rigid_proto", "inspect", "book"), {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(inspect, capture_output=True, text=True, env=ascii_alone, check=False)
    assert (done.returncode, done.stderr) == (0, "") and "m\\xb3" in done.stdout


REFUSED = """
import sys
from rigid_proto_ros.ros.main import main
for argument in sys.argv[2:]:
    assert main(["rigid_body_node", "--ros-args", "-p", f"record:={sys.argv[1]}", "-p", argument]) == 2
"""


def test_a_wrong_value_of_a_parameter_is_told_in_one_line_also_of_one_that_every_ros_node_has(
    ros_environment, tmp_path
):
    pytest.importorskip("rclpy")
    wrong = (
        *("use_sim_time:=1", "start_type_description_service:=3"),
        "qos_overrides./rigid_body/pose.publisher.reliability:=bestfort",
        "qos_overrides./rigid_body/wrench.subscription.depth:=-3",
        "qos_overrides./rigid_body/pose.publisher.depth:=100000000000",
    )
    earlier = tmp_path / "flight.mcap"
    earlier.write_bytes(b"\x89MCAP of an earlier flight")
    words = [sys.executable, "-c", REFUSED, earlier, *wrong, "mass:=-1.0"]
    done = subprocess.run(words, env=from_source(ros_environment), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    *lines, mass = done.stderr.splitlines()
    assert mass.startswith("rigid_body_node: mass: got -1.0")
    assert len(lines) == len(wrong) and all(x.startswith("rigid_body_node: ROS arguments: ") for x in lines), lines
    assert earlier.read_bytes() == b"\x89MCAP of an earlier flight"


FULL_BYTES = 1_000_000
"""Far less than what would be recorded."""


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_recording_that_stopped_on_a_full_disk_is_exit_2_and_the_simulation_goes_on_and_the_rest_is_verified(
    ending, tmp_path
):
    pytest.importorskip("mcap")
    path = tmp_path / f"session{ending}"
    words = ("simulate", "book", "--set", "publish_rate=10000", "--duration", "1.5", "--record", path)
    done = subprocess.run(
        command("rigid_proto", *words),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (FULL_BYTES, FULL_BYTES)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert f"recording stopped: {path}: " in done.stderr and "Traceback" not in done.stderr
    assert "state hash" in done.stdout and str(path) not in done.stdout
    assert 0.5 * FULL_BYTES < path.stat().st_size <= FULL_BYTES
    if ending == ".mcap":
        (session,) = read_runs(path)
        assert not session.complete and session.end_ns > 0
        assert verify(session) is None
