# SPDX-License-Identifier: MIT
"""What was done by hand becomes a scene and a script that give the same motion again, bit for bit."""

from __future__ import annotations

import pytest
from hand_session import SCENE, HandSession, random_hand_session

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.state import State
from rigid_proto_ros.scene.command_codec import of_event
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import expand_schedule, parse_script, read_schedule, schedules
from rigid_proto_ros.session.as_script import SceneAndScript, script_of_session

SECOND = 10**9


def flown(saved: SceneAndScript, until_ns: int) -> State:
    """The last state of ``simulate SCENE --script SCRIPT``."""
    run = OfflineRun(make_scenario(read_scene_text(saved.scene).values), parse_script(saved.script))
    assert run.advance(until_ns)
    assert not run.simulation.refused
    return run.simulation.state


def assert_flies_again(hand: HandSession) -> SceneAndScript:
    saved = script_of_session(hand.session())
    assert flown(saved, hand.now_ns).sha256() == hand.simulation.state.sha256()
    return saved


@pytest.mark.parametrize("seed", range(3))
def test_a_hand_session_saved_as_a_script_flies_again_to_the_bit(seed: int) -> None:
    saved = assert_flies_again(random_hand_session(seed, seconds=4.0))
    assert len(saved.entries) > 10


@pytest.mark.stress
@pytest.mark.parametrize("first", range(100, 1100, 100))
def test_a_thousand_hand_sessions_fly_again_to_the_bit(first: int) -> None:
    other = []
    for seed in range(first, first + 100):
        hand = random_hand_session(seed, seconds=5.0)
        saved = script_of_session(hand.session())
        if flown(saved, hand.now_ns).sha256() != hand.simulation.state.sha256():
            other.append(seed)
    assert other == []


def test_what_was_done_in_one_paused_instant_is_one_message_to_a_node_in_the_order_in_which_it_acted() -> None:
    hand = HandSession(SCENE)
    hand.pause()
    for k in range(200):
        hand.set(ballast__tip=[0.0001 * k, 0.0, 0.0, 0.07])
    hand.load(False, "normal@tip;impulse", [1e-4, 0.0, 0.0])
    hand.wait(SECOND)
    script = parse_script(assert_flies_again(hand).script)
    ((_, count, text),) = schedules(script)
    assert count == len(script) and expand_schedule(read_schedule(text)) == script
    assert [c.content["ballast.tip"][0] for c in script[:200]] == [0.0001 * k for k in range(200)]


def test_a_log_with_a_line_missing_is_refused() -> None:
    hand = random_hand_session(1, seconds=2.0)
    session = hand.session()
    del session.events[3]
    with pytest.raises(InputError):
        script_of_session(session)


def test_nothing_of_the_running_program_is_saved() -> None:
    hand = HandSession({**SCENE, "record": "out.mcap", "viewer": "none", "start_paused": True})
    hand.set(record="elsewhere.mcap")
    hand.wait(SECOND)
    saved = assert_flies_again(hand)
    assert "mcap" not in saved.scene + saved.script
    # The change cut a step of the motion: what stands for it does so too.
    assert [command.kind for command in parse_script(saved.script)] == ["set"]


def test_entries_are_the_commands_of_the_hand() -> None:
    hand = HandSession(SCENE)
    hand.wait(SECOND // 3)
    hand.load(False, "normal@tip", [0.02, 0.0, 0.0])
    hand.load(True, "body@point/0.01,0.02,0.03", [0.1, 0.2, 0.3], [0.0, 0.0, 1e-7])
    hand.wait(SECOND // 3)
    third = 333_333_333
    assert parse_script(script_of_session(hand.session()).script) == [
        of_event(kind, {"stamp_ns": third, "frame_id": frame_id, "force": force, "torque": torque})
        for kind, frame_id, force, torque in (
            ("wrench", "body@point/0.01,0.02,0.03", (0.1, 0.2, 0.3), (0.0, 0.0, 1e-7)),
            ("poke", "normal@tip", (0.02, 0.0, 0.0), (0.0, 0.0, 0.0)),
        )
    ]
