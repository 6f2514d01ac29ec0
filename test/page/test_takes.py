# SPDX-License-Identifier: MIT
"""Random takes by hands in the page, saved as files, end in the very state that the page shows: to the last bit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from page_tools import TESTS, kernels, run_node

from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun, run_with_progress, summary
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.simulation.commands import nanoseconds


def takes(page_file: Path, count: int, seed: int, fault: str = "") -> list[dict[str, Any]]:
    """Takes that page/test/takes.ts makes."""
    made: list[dict[str, Any]] = json.loads(run_node(TESTS / "takes.ts", kernels(), page_file, count, seed, fault))
    assert len(made) == count
    return made


def saved(take: dict[str, Any], folder: Path) -> tuple[Path, Path]:
    """The take's files."""
    scene, script = folder / "take.yaml", folder / "take_script.yaml"
    scene.write_text(take["scene"])
    script.write_text(take["script"])
    return scene, script


def hash_by_python(take: dict[str, Any], folder: Path) -> str:
    """The state hash that Python comes to, or what it refuses: no command of a take may be."""
    scene, script = saved(take, folder)
    run = OfflineRun(read_scene(str(scene)), read_script(script))
    run_with_progress(run, nanoseconds(take["durationS"]))
    return str(run.simulation.refusals or summary(run, 0.0)["state_hash"])


def check_equal(made: list[dict[str, Any]], folder: Path) -> None:
    found = [hash_by_python(take, folder) for take in made]
    assert found == [take["hash"] for take in made]
    # Opened from its link, and gone back in and forth, it is the same.
    assert all(take["opened"] == take["again"] == take["hash"] for take in made)
    # Hands do something, and are refused little.
    done, refused = sum(take["done"] for take in made), sum(take["refused"] for take in made)
    assert done > 40 * len(made) and refused < 0.05 * done


@pytest.mark.slow
def test_twenty_random_takes_end_in_python_as_on_the_page(page_file: Path, tmp_path: Path) -> None:
    check_equal(takes(page_file, 20, 1), tmp_path)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(2, 6))
def test_two_hundred_random_takes_end_in_python_as_on_the_page(page_file: Path, tmp_path: Path, seed: int) -> None:
    check_equal(takes(page_file, 50, seed), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["knot", "late"])
def test_a_knot_off_the_surface_and_a_target_a_nanosecond_late_are_noticed(
    page_file: Path, tmp_path: Path, fault: str
) -> None:
    made = takes(page_file, 10, 1, fault)
    different = [take for take in made if hash_by_python(take, tmp_path) != take["hash"]]
    assert len(different) >= 8  # measured: 20 of 20 with either


@pytest.mark.slow
def test_the_command_line_prints_the_hash_that_the_page_shows(page_file: Path, tmp_path: Path) -> None:
    (take,) = takes(page_file, 1, 7)
    saved(take, tmp_path)
    words = take["command"].split()
    assert words[:2] == ["rigid_proto", "simulate"]
    command = [sys.executable, "-m", "rigid_proto_ros.cli.executables", *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["state_hash"] == take["hash"]
