# SPDX-License-Identifier: MIT
"""What `replay` says of a session."""

from __future__ import annotations

import pytest
from conftest import needs_rerun

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import notify_start
from rigid_proto_ros.session.mcap_observer import McapObserver


def test_a_recording_without_states_has_nothing_to_verify(tmp_path, capsys):
    pytest.importorskip("mcap")
    scenario = make_scenario({})
    recorder = McapObserver(tmp_path / "empty.mcap")
    notify_start(recorder, scenario)
    recorder.close()
    assert main(["replay", str(tmp_path / "empty.mcap"), "--verify"]) == 2
    out, err = capsys.readouterr()
    assert "nothing to verify" in err and err.count("\n") == 1 and "verified" not in out


@needs_rerun
def test_a_node_that_a_recording_does_not_hold_is_refused(tmp_path, capsys):
    session = str(tmp_path / "s.rrd")
    assert main(["simulate", "book", "--duration", "0.2", "--record", session]) == 0
    assert main(["replay", session, "--node", "/rigid_body"]) == 0
    capsys.readouterr()
    assert main(["replay", session, "--node", "other"]) == 2
    assert "accepted: rigid_body" in capsys.readouterr().err
