# SPDX-License-Identifier: MIT
"""A node with its page: what comes by topic is seen on the page, and both end together."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from command_rig import wrench_message
from ros_client import RosClient
from ros_process import running_node
from workbench_page import bare_page, said

SPEED = r"speed of the COM</td><td>([\d.e+-]+) m/s"


def test_a_wrench_by_topic_is_read_off_the_page_of_the_node_which_ends_by_sigint(ros_environment, tmp_path) -> None:
    values = {"viewer": "workbench", "mesh": "book"}
    with running_node(ros_environment, tmp_path / "node", values) as node:
        node.wait_for("the workbench is at")
        port = int(re.search(r"the workbench is at http://127\.0\.0\.1:(\d+)", node.errors)[1])
        with bare_page(port) as page, RosClient(ros_environment) as client:
            while not (found := re.findall(SPEED, said(page))):
                pass
            assert found[-1] == "0"
            client.advertise("wrench")
            client.publish("wrench", wrench_message(0, "world@com;duration=0.5", (1.0, 0.0, 0.0)))
            while not (found := [x for x in re.findall(SPEED, said(page)) if float(x) > 0.0]):
                pass
    assert "Traceback" not in node.errors
