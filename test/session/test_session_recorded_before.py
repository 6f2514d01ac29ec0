# SPDX-License-Identifier: MIT
"""Sessions of earlier versions, a string and changes of parameters in them, are simulated again to the bit."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mcap")

from rigid_proto_ros.base.provenance import versions
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.session.check import Difference, other_versions, verify
from rigid_proto_ros.session.runs import decode_event

RECORDED = Path(__file__).parents[1] / "recorded"


@pytest.mark.parametrize("integrator", ["discrete_gradient", "auto"])
def test_a_session_recorded_before_is_verified_to_the_bit(integrator: str) -> None:
    (session,) = read_runs(RECORDED / f"string_and_changes_{integrator}.mcap")
    kinds = [decode_event(line, number)[1] for number, line in enumerate(session.lines, 1)]
    assert {"poke", "set", "string_attach", "string_target", "wrench"} <= set(kinds)
    assert len(session.times) == 21
    assert verify(session) is None


@pytest.mark.parametrize("ending", [".mcap", ".rrd"])
def test_where_other_versions_give_other_bits_the_ones_that_recorded_are_named(ending, tmp_path, monkeypatch, capsys):
    if ending == ".rrd":
        pytest.importorskip("rerun")
    path = tmp_path / f"flown{ending}"
    record = "--bag" if ending == ".mcap" else "--record"
    with monkeypatch.context() as earlier:
        earlier.setitem(versions(), "rigid_proto_ros", "0.0.9")
        earlier.setitem(versions("mcap" if ending == ".mcap" else "rerun-sdk"), "rigid_proto_ros", "0.0.9")
        assert main(["simulate", "t_handle", "--duration", "0.1", record, str(path)]) == 0
    (session,) = read_runs(path)
    assert session.made_with["rigid_proto_ros"] == "0.0.9" and session.made_with["numba"] == versions()["numba"]
    assert other_versions(session) == f"rigid_proto_ros 0.0.9 (here {versions()['rigid_proto_ros']})"
    monkeypatch.setattr("rigid_proto_ros.session.check.verify", lambda *_: Difference(0, "state differs"))
    assert main(["replay", str(path), "--verify"]) == 1
    assert "it was made with: rigid_proto_ros 0.0.9" in capsys.readouterr().err
