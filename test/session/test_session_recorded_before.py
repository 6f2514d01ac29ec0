# SPDX-License-Identifier: MIT
"""Sessions of earlier versions, a string and changes of parameters in them, are simulated again to the bit."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("mcap")

from rigid_proto_ros.rerun_view.session_files import read_runs
from rigid_proto_ros.session.check import verify
from rigid_proto_ros.session.runs import decode_event

RECORDED = Path(__file__).parents[1] / "recorded"


@pytest.mark.parametrize("integrator", ["discrete_gradient", "auto"])
def test_a_session_recorded_before_is_verified_to_the_bit(integrator: str) -> None:
    (session,) = read_runs(RECORDED / f"string_and_changes_{integrator}.mcap")
    kinds = [decode_event(line, number)[1] for number, line in enumerate(session.lines, 1)]
    assert {"poke", "set", "string_attach", "string_target", "wrench"} <= set(kinds)
    assert len(session.times) == 21
    assert verify(session) is None
