# SPDX-License-Identifier: MIT
"""What was done by hand becomes a scene and a script that give the same motion again, bit for bit."""

from __future__ import annotations

import pytest
from hand_session import random_hand_session

from rigid_proto_ros.offline import OfflineRun
from rigid_proto_ros.poke_script import parse_script
from rigid_proto_ros.scenario import make_scenario
from rigid_proto_ros.scene_file import read_scene_text
from rigid_proto_ros.workbench.save_as_script import SavedScript, save_as_script

SECOND = 10**9


def flown(saved: SavedScript, until_ns: int) -> str:
    """The state hash of ``simulate SCENE --script SCRIPT``."""
    run = OfflineRun(make_scenario(read_scene_text(saved.scene).values), parse_script(saved.script))
    assert run.advance(until_ns)
    assert not run.simulation.refused
    return run.simulation.state.sha256()


@pytest.mark.parametrize("seed", range(8))
def test_a_hand_session_saved_as_a_script_flies_again_to_the_bit(seed: int) -> None:
    hand = random_hand_session(seed, seconds=6.0)
    saved = save_as_script(hand.session())
    assert saved.notes == []
    assert saved.commands > 10
    assert flown(saved, hand.now_ns) == hand.simulation.state.sha256()
