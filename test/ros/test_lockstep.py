# SPDX-License-Identifier: MIT
"""A controller in another process, in lockstep with the simulation: the same session to the bit, run after run."""

from __future__ import annotations

import itertools
import subprocess
import sys

import pytest
from command_rig import RosClient
from ros_process import READY_S, SOURCE, from_source, running_node

from rigid_proto_ros.base.bundled import scene_path

EXAMPLE = SOURCE / "msg_examples" / "05_lockstep_controller.py"


def detumble(environment: dict) -> float:
    """Run the example; the angular rate that it ends at [rad/s]."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLE)],
        env=from_source(environment),
        capture_output=True,
        text=True,
        timeout=READY_S,
        check=True,
    )
    return float(done.stdout.split(" rad/s")[0].rpartition(" ")[2])


@pytest.mark.parametrize("runs", [2, pytest.param(20, marks=pytest.mark.stress)])
def test_a_detumbling_controller_in_lockstep_makes_the_same_session_every_time(ros_environment, tmp_path, runs):
    arguments = ("--ros-args", "--params-file", scene_path("t_handle"))
    with (
        running_node(*arguments, environment=ros_environment, log=tmp_path / "node"),
        RosClient(ros_environment) as client,
    ):
        client.listen("events", "pose")
        heard = itertools.cycle((True, False))
        client.until(lambda: client.pause(next(heard)) and client.events(), "the node to know that somebody listens")
        sessions = set()
        for _ in range(runs):
            client.forget("events")
            rate = detumble(ros_environment)
            assert rate < 0.2  # measured 0.1; 12 at the start, and every flip after it without thrusters
            client.until(lambda: sum(e["kind"] == "step" for e in client.events()) == 200, "200 steps")
            events = client.events()
            reset = next(k for k, event in enumerate(events) if event["kind"] == "reset")
            commands = [event for event in events[reset:] if event["kind"] == "thrusters"]
            # Each acts at the very state that it answers to.
            assert [event["time_ns"] for event in commands] == [k * 10_000_000 for k in range(200)]
            sessions.add(events[-1]["sha256"])
        assert len(sessions) == 1
