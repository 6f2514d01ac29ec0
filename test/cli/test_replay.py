# SPDX-License-Identifier: MIT
"""What `replay` says of a session."""

from __future__ import annotations

import pytest
from conftest import needs_rerun

from rigid_proto_ros.cli import replay
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.offline import notify_start
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.session.mcap_observer import McapObserver
from rigid_proto_ros.session.recorded_session import RecordedSession


@pytest.mark.parametrize("ending", [".mcap", ".rrd"])
def test_after_a_repair_it_says_how_to_see_the_new_file(ending, tmp_path, capsys):
    pytest.importorskip("mcap" if ending == ".mcap" else "rerun")
    old, new = tmp_path / f"old{ending}", tmp_path / f"new{ending}"
    record = "--bag" if ending == ".mcap" else "--record"
    assert main(["simulate", "t_handle", "--duration", "0.2", record, str(old)]) == 0
    capsys.readouterr()
    assert main(["replay", str(old), "--repair", str(new)]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert "show it" in last and str(new) in last and str(old) not in last


def test_what_was_written_is_named(tmp_path, capsys):
    pytest.importorskip("mcap")
    old, new = tmp_path / "old.mcap", tmp_path / "new.mcap"
    assert main(["simulate", "t_handle", "--duration", "0.2", "--bag", str(old)]) == 0
    capsys.readouterr()
    assert main(["replay", str(old), "--record", str(new)]) == 0
    assert f"recorded: {new}" in capsys.readouterr().out.splitlines()[-1]


def test_however_many_commands_were_refused_few_are_listed(capsys):
    refusals = [(k * 1_000_000, f"command {k}") for k in range(5000)]
    replay._print_session("s.rrd", RecordedSession(refusals=refusals))
    lines = capsys.readouterr().out.splitlines()
    assert sum("refused at" in line for line in lines) == replay.REFUSALS_SHOWN
    assert f"{5000 - replay.REFUSALS_SHOWN} more were refused, the last at 4.999 s" in lines[-1]


def test_a_recording_without_states_has_nothing_to_verify(tmp_path, capsys):
    pytest.importorskip("mcap")
    scenario = make_scenario({})
    recorder = McapObserver(tmp_path / "empty.mcap")
    notify_start(recorder, scenario)
    recorder.close()
    assert main(["replay", str(tmp_path / "empty.mcap"), "--verify"]) == 2
    out, err = capsys.readouterr()
    assert "nothing to verify" in err and err.count("\n") == 1 and "verified" not in out


def test_what_a_recording_has_itself_is_not_taken_from_elsewhere(tmp_path, capsys):
    pytest.importorskip("mcap")
    session = str(tmp_path / "s.mcap")
    assert main(["simulate", "book", "--duration", "0.2", "--bag", session]) == 0
    capsys.readouterr()
    for words in (["replay", session, "--verify"], ["snapshot", session, "--at", "0.1", "-o", str(tmp_path / "x.png")]):
        if words[0] == "snapshot":
            pytest.importorskip("rerun")
        assert main([*words, "--scene", "config/hammer.yaml"]) == 2
        assert "the session has its own" in capsys.readouterr().err


@needs_rerun
def test_a_node_that_a_recording_does_not_hold_is_refused(tmp_path, capsys):
    session = str(tmp_path / "s.rrd")
    assert main(["simulate", "book", "--duration", "0.2", "--record", session]) == 0
    assert main(["replay", session, "--node", "/rigid_body"]) == 0
    capsys.readouterr()
    assert main(["replay", session, "--node", "other"]) == 2
    assert "accepted: rigid_body" in capsys.readouterr().err
    assert main(["snapshot", session, "--at", "0.1", "-o", str(tmp_path / "x.png"), "--node", "other"]) == 2
    assert "an .rrd recording has its own scene" in capsys.readouterr().err


def test_a_folder_of_several_recordings_is_no_bag(tmp_path, capsys):
    pytest.importorskip("mcap")
    for name in ("one", "two_2"):
        assert main(["simulate", "book", "--duration", "0.2", "--bag", str(tmp_path / f"{name}.mcap")]) == 0
    capsys.readouterr()
    assert main(["replay", str(tmp_path)]) == 2
    assert "one.mcap, two_2.mcap; name one of them" in capsys.readouterr().err
