# SPDX-License-Identifier: MIT
"""What a scene doesn't need isn't done: counted, not timed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from ros_process import from_source

WORK = Path(__file__).parents[1] / "node_work.py"


@pytest.fixture(scope="module")
def counted(ros_environment) -> dict[str, dict]:
    """What each scenario did, in a process of their own."""
    done = subprocess.run(
        [sys.executable, str(WORK)], env=from_source(ros_environment), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_without_subscribers_nothing_is_published_and_the_body_still_flies(counted):
    work = counted["alone"]
    assert set(work["publications"].values()) == {0}
    assert work["simulated_ns"] > 0.4e9
    # A free body crosses the time between two looks in one exact step: none is taken per publication period of 2 ms.
    assert work["steps"] <= 1
    assert work["message_objects"] == {}


def test_neither_rerun_nor_trimesh_is_imported_for_a_bundled_mesh_without_a_viewer(counted):
    assert {scenario: work["imported"] for scenario, work in counted.items()} == dict.fromkeys(counted, [])


def test_a_body_at_rest_takes_no_step(counted):
    work = counted["at_rest"]
    assert work["steps"] == 0
    assert work["simulated_ns"] > 0.4e9
    assert set(work["publications"].values()) == {0}


def test_the_steady_state_makes_no_message_objects(counted):
    work = counted["listened_to"]
    published = work["publications"]
    # Odometry is subscribed too, the IMU is not.
    for topic in ("pose", "twist", "odom"):
        # One a period of 2 ms; the ends of the counted time cut one off.
        assert published[topic] == pytest.approx(work["simulated_ns"] / 2e6, abs=2), published
    assert published["imu"] == 0
    assert work["wrenches"] >= 30
    assert work["message_objects"] == {}
