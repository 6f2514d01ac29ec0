# SPDX-License-Identifier: MIT
"""Several robots in one call, as the pre-commit hook and the GitHub action give them; both name what exists."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

import rigid_proto_ros
from rigid_proto_ros.cli.main import main

ROOT = Path(rigid_proto_ros.__file__).resolve().parent.parent
pytestmark = pytest.mark.skipif(not (ROOT / "action.yml").is_file(), reason="not run from a source tree")
ROBOT = '<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="{}"/></inertial></link></robot>'


@pytest.fixture
def robots(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep" / "er").mkdir(parents=True)
    (tmp_path / "good.urdf").write_text(ROBOT.format(1))
    (tmp_path / "deep" / "er" / "bad.urdf").write_text(ROBOT.format(5))
    (tmp_path / "broken.urdf").write_text("<robot")
    return tmp_path


def test_the_worst_of_several_robots_counts(robots, capsys):
    assert main(["inspect", "--compare", "good.urdf", "good.urdf"]) == 0
    assert main(["inspect", "--compare", "good.urdf", "deep/er/bad.urdf"]) == 1
    assert "deep/er/bad.urdf:" in capsys.readouterr().out
    assert main(["inspect", "--compare", "broken.urdf", "deep/er/bad.urdf", "--json"]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and "broken.urdf" in said.err
    broken, bad = json.loads(said.out)["robots"]
    assert broken["links"] is None and bad["links"][0]["status"] == "impossible"
    assert main(["inspect", "--compare", "good.urdf", "good.urdf", "--fix", "out.urdf"]) == 2


def test_the_hook_is_a_command_that_takes_files(robots):
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())
    program, *words = hook["entry"].split()
    assert program == "rigid_proto"
    assert main([*words, *hook["args"], "good.urdf", "deep/er/bad.urdf"]) == 1


@pytest.mark.parametrize(("files", "status"), [("good.urdf", 0), ("deep/**/*.urdf", 1), ("*.sdf", 2)])
def test_the_actions_step_judges_the_files_that_match(robots, files, status):
    action = yaml.safe_load((ROOT / "action.yml").read_text())
    step = action["runs"]["steps"][-1]
    if shutil.which("rigid_proto", path=(scripts := os.path.dirname(__import__("sys").executable))) is None:
        pytest.skip("rigid_proto is not installed beside this Python: make setup")
    environment = {**os.environ, "PATH": f"{scripts}:{os.environ['PATH']}", "FILES": files, "ARGUMENTS": ""}
    done = subprocess.run(
        ["bash", "-e", "-c", step["run"]], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stderr
