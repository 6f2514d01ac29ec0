# SPDX-License-Identifier: MIT
"""SIGINT and SIGTERM end every command quietly, with a complete recording and no orphan: with 128 + the signal's number,
and the node with 0.
"""

import signal
import time

import pytest
from conftest import needs_rerun
from ros_process import RosProcess, alive, catches, descendants, running_node

from rigid_proto_ros.rerun_view.rrd_file import read_session

BOTH = pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.stress)])
"""One handler serves both; a node's end by SIGTERM is looked at in test_node_flight.py too."""


@BOTH
def test_up_without_a_viewer_ends(ros_environment, tmp_path, number):
    up = RosProcess("rigid_proto", "up", "--viewer", "none", environment=ros_environment, log=tmp_path / "up")
    up.wait_for("is simulating")
    children = descendants(up.pid)
    assert up.end(number) == 128 + number, up.errors
    assert not [pid for pid in children if alive(pid)]


@needs_rerun
@BOTH
def test_a_waiting_client_and_an_offline_run_end(ros_environment, tmp_path, number):
    script = tmp_path / "late.yaml"
    script.write_text("- {t: 1000, at: com, force: [0, 0, 1]}\n")
    session = tmp_path / "run.rrd"
    with running_node(environment=ros_environment, log=tmp_path / "node"):
        client = RosProcess("poke_client", script, environment=ros_environment, log=tmp_path / "client")
        # The command lies too far ahead to be sent: it waits, beside a long offline run.
        flight = RosProcess(
            *("rigid_proto", "simulate", "t_handle", "--duration", 1e6, "--record", session),
            environment=ros_environment,
            log=tmp_path / "flight",
        )
        while not (session.exists() and session.stat().st_size > 10_000):
            assert flight.process.poll() is None, flight.errors
            time.sleep(0.02)
        while not catches(client.pid, number):
            assert client.process.poll() is None, client.errors
            time.sleep(0.02)
        assert flight.end(number) == 128 + number, flight.errors
        assert client.end(number) == 128 + number, client.errors
    assert flight.errors == client.errors == ""
    assert read_session(session).complete


@BOTH
def test_a_node_that_compiles_its_kernels_ends_at_once(ros_environment, tmp_path, number):
    """From an empty cache they take a minute or two, and nothing interrupts a compiler."""
    environment = {**ros_environment, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    node = RosProcess("rigid_body_node", environment=environment, log=tmp_path / "node")
    node.wait_for("compiling kernels")
    assert node.end(number, within_s=10.0) == 0, node.errors  # 59 s before
    assert "Traceback" not in node.errors
    assert "is simulating" not in node.output + node.errors
