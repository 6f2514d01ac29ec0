# SPDX-License-Identifier: MIT
"""What goes wrong in flight is said where a ROS user hears it: in the node's log, in its diagnostics, in its parameters."""

from __future__ import annotations

import resource
import time

import pytest
from command_rig import NodeProcess, RosClient

pytest.importorskip("rclpy")

from rigid_proto_ros.ros.diagnostics import REPORT_S, WARNING_S


def test_a_publisher_with_incompatible_qos_on_a_command_topic_is_warned_of(rig):
    rig.do("advertise", topic=rig.name("string/target"), type="PointStamped", wait=False, best_effort=True)
    try:
        said = "a publisher on /rigid_body/string/target offers incompatible QoS (last policy: RELIABILITY)"
        rig.until(lambda: said in rig.node_process.log.read_text(), "a warning")
    finally:
        rig.advertise("string/target")


def test_real_time_that_is_given_up_is_warned_of_and_not_every_second(rig):
    said = "of real time given up"
    before, start = rig.node_process.log.read_text().count(said), time.monotonic()
    # 10⁹ steps a second: some hundred times more than there is time for.
    rig.set(integrator="rk4", step=1e-9)
    lost_s = float(rig.diagnostics()["real_time_lost_s"])
    rig.until(lambda: float(rig.diagnostics()["real_time_lost_s"]) > lost_s + 2.0, "two seconds lost")
    # On a busy machine one of an earlier test may have come just before: then the next is WARNING_S later.
    rig.until(lambda: rig.node_process.log.read_text().count(said) > before, "a warning")
    elapsed_s = time.monotonic() - start
    assert rig.node_process.log.read_text().count(said) - before <= 2 + elapsed_s // WARNING_S


@pytest.mark.parametrize("name", ["flight.mcap", "flight.rrd"])
def test_a_recording_that_stops_is_told_by_log_diagnostics_and_parameter_until_another_begins(
    ros_environment, tmp_path, name
):
    path = tmp_path / name
    node = NodeProcess(ros_environment, tmp_path / "node", {"record": str(path), "publish_rate": 1000.0})
    unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    try:
        with RosClient(ros_environment) as client:
            client.watch_diagnostics()
            assert client.diagnostics()["recording"] == str(path)
            # As on a full disk: no file of this process grows beyond some kilobytes more.
            resource.prlimit(node.pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 50_000, unlimited[1]))
            client.until(lambda: "recording" in client.diagnostics()["message"], "a warning")
            # Half a second after the last write that went well comes one that doesn't; 2 s are two reports.
            failing_ns = path.stat().st_mtime_ns + 500_000_000
            since = [report for report in client.all_diagnostics() if report["stamp_ns"] > failing_ns]
            assert len([report for report in since if "recording" not in report["message"]]) <= 2
            client.until(lambda: "recording stopped" in client.diagnostics()["message"], "the end of the recording")
            report = client.diagnostics()
            assert (report["level"], report["recording"]) == (1, "")
            # The table of parameters follows what has happened.
            client.until(lambda: client.get("record") == {"record": ""}, "the parameter to follow")
            assert "[WARN]" in node.log.read_text() and "recording stopped" in node.log.read_text()
            resource.prlimit(node.pid, resource.RLIMIT_FSIZE, unlimited)
            again = tmp_path / "again.mcap"
            assert client.set(record=str(again)) == [[True, ""]]
            report = client.diagnostics()
            assert "recording stopped" not in report["message"]
            assert report["recording"] == str(again)
            # One a period, and none beside it for what has changed; a late one doesn't delay those behind it.
            stamps = [report["stamp_ns"] for report in client.all_diagnostics()]
            assert len(stamps) - 2 <= (stamps[-1] - stamps[0]) * 1e-9 / REPORT_S
    finally:
        assert node.stop() == 0, node.log.read_text()
