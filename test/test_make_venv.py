# SPDX-License-Identifier: MIT
"""What `make setup` installs where: all of it pinned, and beside a ROS installation nothing that would stand in its way."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import pytest

import rigid_proto_ros

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
SCRIPT = SOURCE / "requirements" / "make_venv.py"
pytestmark = pytest.mark.skipif(not SCRIPT.is_file(), reason="not run from a source tree")


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> ModuleType:
    """The script, with an environment in a folder of its own."""
    spec = importlib.util.spec_from_file_location("make_venv", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "VENV", tmp_path)
    return module


def installed_beside(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, system: str, stage: str
) -> tuple[list[str], list[str], list[str]]:
    """What pip is asked for on a ROS machine whose packages are given: requirements, their limits, and the entries that it
    installs when it says that trimesh and PyYAML are missing."""
    asked: list[str] = []

    def install(_: str, *arguments: object) -> None:
        words = list(map(str, arguments))
        if "--dry-run" in words:
            asked[:] = words
            found = [{"metadata": {"name": name}} for name in ("trimesh", "PyYAML")]
            Path(words[words.index("--report") + 1]).write_text(json.dumps({"install": found}))
        else:
            assert {"--no-deps", "--require-hashes"} <= set(words)

    monkeypatch.setattr(script, "called", lambda *_: (0, system))
    monkeypatch.setattr(script, "install", install)
    script.install_beside_ros("python", stage)
    limits, entries = (
        (script.VENV / name).read_text("utf-8").splitlines() for name in ("constraints.txt", "missing.txt")
    )
    return asked, limits, entries


@pytest.mark.parametrize("stage", ["run", "all"])
def test_every_package_of_every_list_is_pinned(script: ModuleType, stage: str) -> None:
    pins = script.pins(*script.LISTS[stage])
    for requirement in script.wanted(SOURCE / "requirements" / f"{stage}.in"):
        assert script.normalized(script.re.split("[<>=;]", requirement)[0]) in pins, requirement


@pytest.mark.parametrize("stage", ["run", "all"])
def test_beside_ros_rclpy_and_numpy_stay_and_what_the_system_has_is_not_pinned(script, monkeypatch, stage) -> None:
    system = "numpy=2.3.5 PyYAML=6.0.2 rclpy=10.0.1 coverage=7.6.0"
    asked, limits, entries = installed_beside(script, monkeypatch, system, stage)
    assert "numpy==2.3.5" in limits and not [line for line in limits if line.lower().startswith("pyyaml")]
    assert {"numba", "numpy"} <= set(asked) and not [word for word in asked if word.startswith(("rclpy", "ros-"))]
    # numba doesn't start beside Debian's coverage, so that one gets a newer one before it.
    assert "coverage" in asked and any(line.startswith("coverage==") for line in limits)
    # The system's PyYAML is too old, says pip: the pinned one comes.
    assert [entry.partition("==")[0] for entry in entries] == ["trimesh", "pyyaml"]
    assert all(" --hash=sha256:" in entry for entry in entries)


def test_beside_numpy_1_rerun_comes_without_the_numpy_that_it_asks_for(script, monkeypatch) -> None:
    asked, limits, entries = installed_beside(script, monkeypatch, "numpy=1.26.4 PyYAML=6.0.1", "run")
    assert "numpy==1.26.4" in limits and "pyarrow==21.0.0" in limits
    assert not [word for word in asked if word.startswith("rerun-sdk")] and "pyarrow" in asked
    assert [entry.partition("==")[0] for entry in entries] == ["trimesh", "pyyaml", "rerun-sdk"]


def test_what_is_missing_beside_ros_and_not_pinned_is_refused(script, monkeypatch) -> None:
    monkeypatch.setattr(script, "missing", lambda *_: ["unheard-of"])
    monkeypatch.setattr(script, "called", lambda *_: (0, "numpy=2.3.5"))
    with pytest.raises(SystemExit, match="unheard-of: needed beside what this machine has"):
        script.install_beside_ros("python", "run")


def test_a_ros_installation_is_found_by_its_distribution_or_where_it_is_the_only_one(script, monkeypatch, tmp_path):
    monkeypatch.setattr(script, "OPT_ROS", tmp_path)
    for name in ("AMENT_PREFIX_PATH", "ROS_DISTRO"):
        monkeypatch.delenv(name, raising=False)
    assert script.ros_setup() is None
    for distro in ("jazzy", "lyrical"):
        (tmp_path / distro / "lib" / "python3.12" / "site-packages").mkdir(parents=True)
        (tmp_path / distro / "setup.bash").write_text("")
        if distro == "jazzy":
            assert script.ros_setup() == tmp_path / "jazzy" / "setup.bash"
    with pytest.raises(SystemExit, match="ROS_DISTRO: got nothing; accepted: one of jazzy, lyrical"):
        script.ros_setup()
    monkeypatch.setenv("ROS_DISTRO", "lyrical")
    assert script.ros_setup() == tmp_path / "lyrical" / "setup.bash"


def test_an_environment_that_is_not_whole_or_not_of_this_place_is_made_anew_and_the_reason_said(
    script, tmp_path
) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path], check=True)
    inner, version = tmp_path / "bin" / "python", sys.version_info[:2]
    here = (str(tmp_path), "{}.{}".format(*version), "with rclpy from PyPI")
    script.MADE = tmp_path / ".made"
    assert "interrupted" in script.defect(inner, version, here)
    script.MADE.write_text("\n".join(here), "utf-8")
    assert script.defect(inner, version, here) == ""
    elsewhere = ("/elsewhere", *here[1:])
    assert script.defect(inner, version, elsewhere) == f"it was made in {tmp_path}"
    assert script.defect(inner, (3, 1), (here[0], "3.1", here[2])) == f"it was made with Python {here[1]}"
    assert script.defect(inner, version, (*here[:2], "beside ROS")) == "it was made with rclpy from PyPI"
    inner.unlink()
    assert script.defect(inner, version, here) == "its Python doesn't run any more"


def test_tests_and_headers_in_packages_go_and_nothing_else_does(script, monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(script, "called", lambda *_: (0, ""))
    site = tmp_path / "lib" / "python3.13" / "site-packages"
    gone = [site / name for name in ("numpy/_core/tests", "numba/tests", "pyarrow/include")]
    kept = [site / name for name in ("numpy/testing", "pyarrow/lib", "numpy/_core/include")]
    for folder in (*gone, *kept):
        folder.mkdir(parents=True)
    script.remove_what_no_flight_needs("python")
    assert not [folder for folder in gone if folder.exists()]
    assert not [folder for folder in kept if not folder.exists()]


def test_ctrl_c_ends_the_set_up_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "requirements").mkdir()
    shutil.copy(SCRIPT, tmp_path / "requirements")
    slow = tmp_path / "python"
    slow.write_text(f"#!/bin/sh\ntouch {tmp_path}/started\nexec sleep 60\n", "utf-8")
    slow.chmod(0o755)
    command = [sys.executable, tmp_path / "requirements" / "make_venv.py", "run"]
    environment = {**os.environ, "PYTHON": str(slow), "AMENT_PREFIX_PATH": "/nowhere"}
    with subprocess.Popen(
        command,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A shell that starts the suite in the background has its processes ignore SIGINT.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as made:
        while not (tmp_path / "started").exists() and made.poll() is None:
            time.sleep(0.01)
        os.killpg(made.pid, signal.SIGINT)
        told = made.communicate(timeout=180)[1]
    assert made.returncode == 130
    assert told.strip().splitlines() == ["make setup: interrupted; the next make begins anew"]


@pytest.mark.parametrize(
    ("target", "status", "made"), [("up", 130, 0), ("workbench", 130, 0), ("up", 1, 2), ("run", 130, 2)]
)
def test_make_calls_no_error_how_up_and_workbench_end_after_ctrl_c(tmp_path, target, status, made) -> None:
    shutil.copy(SOURCE / "Makefile", tmp_path)
    program = tmp_path / ".venv" / "bin" / "rigid_proto"
    program.parent.mkdir(parents=True)
    program.write_text(f"#!/bin/sh\nexit {status}\n", "utf-8")
    program.chmod(0o755)
    command = ["make", "-C", tmp_path, "--no-print-directory", target, "FOR_RUN="]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == made
    assert ("Error" in done.stderr) == bool(made), done.stderr
