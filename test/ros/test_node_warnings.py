# SPDX-License-Identifier: MIT
"""What goes wrong in flight is said where a ROS user hears it: in the node's log, in its diagnostics, in its parameters."""

from __future__ import annotations

import importlib.util
import itertools
import resource
import time

import pytest

pytest.importorskip("rclpy")

import often_reporting_node

from rigid_proto_ros.ros.diagnostics import WARNING_S


def test_a_publisher_with_incompatible_qos_on_a_command_topic_is_warned_of(rig):
    rig.advertise("string/target#2", wait=False, best_effort=True)
    said = "a publisher on /rigid_body/string/target offers incompatible QoS (last policy: RELIABILITY)"
    rig.until(lambda: said in rig.node_process.errors, "a warning")


def test_real_time_that_is_given_up_is_warned_of_and_not_every_second(rig):
    said = "of real time given up"
    before, start, began_ns = rig.node_process.errors.count(said), time.monotonic(), time.time_ns()
    # 10⁹ steps a second: some hundred times more than there is time for.
    rig.set(integrator="rk4", step=1e-9)
    lost_s = float(rig.diagnostics()["real_time_lost_s"])
    rig.until(lambda: float(rig.diagnostics()["real_time_lost_s"]) > lost_s + 1.0, "a second lost")
    # On a busy machine one of an earlier test may have come just before: then the next is WARNING_S later.
    rig.until(lambda: rig.node_process.errors.count(said) > before, "a warning")
    elapsed_s = time.monotonic() - start
    assert rig.node_process.errors.count(said) - before <= 2 + elapsed_s // WARNING_S
    # Each report that finds more lost, or more published late, is a warning, and says so.
    reports = rig.all_diagnostics(after=began_ns)
    for key, words in (("real_time_lost_s", "s behind real time"), ("overruns", "published late")):
        grown = [b for a, b in itertools.pairwise(reports) if float(b[key]) > float(a[key])]
        assert grown and all(report["level"] == 1 and words in report["message"] for report in grown)


@pytest.mark.skipif(importlib.util.find_spec("tf2_msgs") is not None, reason="tf2_msgs is installed")
def test_that_tf_lacks_its_messages_is_warned_of_once_and_not_at_every_change_of_a_parameter(rig):
    for gravity in (1.0, 2.0, 3.0):
        assert rig.set(publish_tf=True, gravity=[0.0, 0.0, -gravity]) == [[True, ""]] * 2
    assert rig.node_process.errors.count("tf2_msgs isn't installed") == 1


def test_a_fixed_step_too_long_for_the_motion_is_a_warning_as_long_as_it_is_in_force(rig):
    rig.set(integrator="rk4", step=0.5)
    report = rig.diagnostics()
    assert report["level"] == 1
    assert all("rk4: |w| step = 6" in report[words] for words in ("message", "warning"))
    rig.set(integrator="auto")
    assert not rig.diagnostics()["warning"]


@pytest.mark.parametrize("name", ["flight.mcap", "flight.rrd"])
def test_a_recording_that_stops_is_told_by_log_diagnostics_and_parameter_until_another_begins(rig, tmp_path, name):
    path, unlimited, began_ns = tmp_path / name, (resource.RLIM_INFINITY, resource.RLIM_INFINITY), time.time_ns()
    assert rig.set(record=str(path), publish_rate=200.0) == [[True, ""]] * 2
    assert rig.diagnostics()["recording"] == str(path)
    try:
        # As on a full disk: the file grows by some kilobytes more, and the log less.
        size = max(path.stat().st_size, len(rig.node_process.errors.encode()))
        resource.prlimit(rig.node_process.pid, resource.RLIMIT_FSIZE, (size + 50_000, unlimited[1]))
        rig.until(lambda: "recording" in rig.diagnostics()["message"], "a warning")
        # Half a second after the last write that went well comes one that doesn't; then 2 s of reports.
        failing_ns = path.stat().st_mtime_ns + 500_000_000
        since = [report for report in rig.all_diagnostics(after=failing_ns) if "recording" not in report["message"]]
        assert len(since) <= 2.0 / often_reporting_node.REPORT_S
        rig.until(lambda: "recording stopped" in rig.diagnostics()["message"], "the end of the recording")
        report = rig.diagnostics()
        assert (report["level"], report["recording"]) == (1, "")
        # The table of parameters follows what has happened.
        rig.until(lambda: rig.get("record") == {"record": ""}, "the parameter to follow")
        assert "[WARN]" in rig.node_process.errors and f"recording stopped: {path}" in rig.node_process.errors
    finally:
        resource.prlimit(rig.node_process.pid, resource.RLIMIT_FSIZE, unlimited)
    again = tmp_path / "again.mcap"
    assert rig.set(record=str(again)) == [[True, ""]]
    report = rig.diagnostics()
    assert "recording stopped" not in report["message"]
    assert report["recording"] == str(again)
    # One a period, and none beside it for what has changed; a late one doesn't delay those behind it.
    stamps = [report["stamp_ns"] for report in rig.all_diagnostics(after=began_ns)]
    assert len(stamps) - 2 <= (stamps[-1] - stamps[0]) * 1e-9 / often_reporting_node.REPORT_S
