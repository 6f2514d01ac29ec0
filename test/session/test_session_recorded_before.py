# SPDX-License-Identifier: MIT
"""Sessions of earlier versions, a string and changes of parameters in them, are simulated again."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mcap")

from rigid_proto_ros.base.provenance import versions
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.session.bag import read_runs
from rigid_proto_ros.session.check import Difference, made_with_table

RECORDED = Path(__file__).parents[1] / "recorded"


@pytest.mark.parametrize("name", ["pokes_and_changes", "string", "jitter"])
def test_a_session_is_verified_to_the_bit_for_as_long_as_the_motion_has_the_bits_it_was_recorded_with(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = RECORDED / f"same_bits_{name}.mcap"
    (session,) = read_runs(path)
    was, here = session.made_with["motion"], versions()["motion"]
    assert main(["replay", str(path), "--verify"]) == (0 if was == here else 1)
    assert was == here or f"motion differs: {was} recorded, {here} here" in capsys.readouterr().err


def test_where_other_versions_give_other_bits_the_ones_that_recorded_are_named(tmp_path, monkeypatch, capsys):
    path = tmp_path / "flown.mcap"
    with monkeypatch.context() as earlier:
        earlier.setitem(versions(), "rigid_proto_ros", "0.0.9")
        earlier.setitem(versions("mcap"), "rigid_proto_ros", "0.0.9")
        assert main(["simulate", "t_handle", "--duration", "0.1", "--record", str(path)]) == 0
    (session,) = read_runs(path)
    assert session.made_with["rigid_proto_ros"] == "0.0.9" and session.made_with["numpy"] == versions()["numpy"]
    table = {name: (was, here) for name, was, here in made_with_table(session)}
    assert table["rigid_proto_ros"] == ("0.0.9", versions()["rigid_proto_ros"])
    assert {"cpu", "machine", "c_library", "kernels", "numpy", "python"} <= set(table)
    assert [name for name, (was, here) in table.items() if was != here] == ["rigid_proto_ros"]
    monkeypatch.setattr("rigid_proto_ros.session.check.verify", lambda *_: Difference(0, "state differs"))
    assert main(["replay", str(path), "--verify"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[1:] == [f"  rigid_proto_ros differs: 0.0.9 recorded, {versions()['rigid_proto_ros']} here"]
