# SPDX-License-Identifier: MIT
"""The workbench's memory of a flight: scrubbing, rewinding, ghosts, and what it holds at most."""

from __future__ import annotations

import numpy as np
import pytest
from hand_session import SCENE, HandSession, random_hand_session

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.scene.offline import OfflineRun
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scene_file import read_scene_text
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.workbench import history as history_module
from rigid_proto_ros.workbench.history import MAX_STATES, History
from rigid_proto_ros.workbench.rewind import Rewind, changes_to
from rigid_proto_ros.workbench.state_log import StateLog

SECOND = 10**9
STIFF = {"string.damping_ratio": 0.0}


def hearing(history: History):
    """What a client hears, told to the history."""
    return lambda what, *content: getattr(history, what)(*content)


def applied(hand: HandSession, history: History, rewind: Rewind) -> HandSession:
    """The same node after it was told what a rewind says."""
    hand.pause()
    scenario = hand.scenario.with_changes(rewind.changes)
    hand.scenario = scenario
    history.scene(scenario.text)
    history.rewinding(rewind)
    hand.reset()
    return hand


@pytest.mark.parametrize("seed", range(3))
def test_any_moment_of_a_hand_session_is_computed_anew_to_the_bit(seed: int) -> None:
    history = History()
    random_hand_session(seed, 4.0, hearing(history))
    first_ns, live_ns = history.span
    assert (first_ns, live_ns) == (10_000_000, history.span[1])
    for moment_ns in np.linspace(first_ns, live_ns, 5).astype(int).tolist():
        rewind = history.rewind(moment_ns)
        assert rewind.exact
        assert moment_ns - 10_000_000 < rewind.moment_ns <= moment_ns
        values = read_scene_text(rewind.scene).values
        assert [*values["initial.position"], *values["initial.orientation_xyzw"]] == history.row(moment_ns)[:7].tolist()


def test_a_rewind_takes_the_node_there_and_its_motion_goes_on_as_it_did() -> None:
    history = History()
    hand = HandSession({**SCENE, **STIFF}, hearing(history))
    hand.wait(SECOND // 2)
    hand.set(mass=0.2, gravity=[0.0, 0.0, -0.1])
    hand.load(True, "body@tip", [0.0, 0.01, 0.0])
    hand.load(False, "world@tip;duration=2.0", [0.01, 0.0, 0.0])
    hand.wait(SECOND)
    hand.set(density=5000.0)
    hand.wait(SECOND)
    was = history.row(int(1.8 * SECOND))
    rewind = history.rewind(int(1.2 * SECOND))
    assert rewind.exact
    assert rewind.changes["mass"] == 0.2
    # The future that it has again until the next change.
    future = [history.row(int(t * SECOND)) for t in (1.2, 1.3, 1.5)]
    again = OfflineRun(make_scenario(read_scene_text(rewind.scene).values))
    assert again.advance(int(0.3 * SECOND))
    assert np.array_equal(again.simulation.state.row[:7], future[-1][:7])

    applied(hand, history, rewind)
    assert hand.scenario.parameters.mass == 0.2
    assert history.span[1] == rewind.moment_ns
    hand.wait(int(0.3 * SECOND))
    assert history.span[1] == int(1.5 * SECOND)
    assert [history.row(int(t * SECOND)).tobytes() for t in (1.2, 1.3, 1.5)] == [row.tobytes() for row in future]
    # The old future, which had another density from 1.5 s on.
    ghost = history.ghost
    assert np.array_equal(ghost.at(int(1.8 * SECOND)), was)
    assert ghost.at(rewind.moment_ns) is None
    assert ghost.at(int(9.0 * SECOND)) is None
    hand.wait(int(0.5 * SECOND))
    assert not np.array_equal(history.row(int(1.8 * SECOND)), was)


@pytest.mark.parametrize("by_hand", [False, True])
def test_after_a_rewind_the_string_is_what_it_was_and_not_what_the_body_would_make_of_it_now(by_hand: bool) -> None:
    history = History()
    tied = {"string.attached": not by_hand, "string.attach": [0.0, 0.0, 0.07], "string.target": [0.1, 0.0, 0.3]}
    string = {**tied, "string.frequency": 9.0, "string.damping_ratio": 0.3, "string.timeout": 0.0}
    hand = HandSession({**SCENE, **string}, hearing(history))
    if by_hand:
        hand.pull(string["string.target"])
    hand.wait(2 * SECOND)
    was = hand.simulation.string
    rewind = history.rewind(SECOND)
    assert rewind.exact and rewind.notes == []
    future = history.row(int(1.5 * SECOND))[:7]
    applied(hand, history, rewind)
    hand.wait(int(0.5 * SECOND))
    now = hand.simulation.string
    assert (now.stiffness, now.damping) == (was.stiffness, was.damping)
    # Settled anew it would be another one, by far.
    anew = was.with_spring(hand.scenario.setup.string, hand.scenario.setup.body, hand.simulation.state)
    assert abs(anew.stiffness / was.stiffness - 1.0) > 0.01
    assert np.array_equal(hand.simulation.state.row[:7], future)


@pytest.mark.parametrize("seed", [*range(5), *(pytest.param(k, marks=pytest.mark.stress) for k in range(5, 200))])
def test_after_a_rewind_the_body_does_again_what_it_did_to_the_bit_until_a_hand_acts(seed: int) -> None:
    history = History()
    hand = random_hand_session(seed, 3.0, hearing(history))
    acted = [time_ns for time_ns, _ in hand.log.timed]
    # Among the longest times without a hand, a string's free end often moves at the beginning of one.
    lasting_ns, began_ns = sorted(zip(np.diff(acted).tolist(), acted, strict=False))[-1 - seed % 5]
    moment_ns = (began_ns // 10_000_000 + 1) * 10_000_000
    moments = range(moment_ns, began_ns + lasting_ns, 10_000_000)
    future = [history.row(moment).tobytes() for moment in moments]
    assert len(future) > 2
    rewind = history.rewind(moment_ns)
    assert rewind.exact and rewind.notes == []
    applied(hand, history, rewind).wait(lasting_ns)
    assert [history.row(moment).tobytes() for moment in moments] == future


def test_scrubbing_back_over_a_rewind_and_a_reset_shows_what_was() -> None:
    history = History()
    hand = HandSession(SCENE, hearing(history))
    hand.wait(2 * SECOND)
    before = history.row(SECOND)
    applied(hand, history, history.rewind(SECOND + SECOND // 2))
    hand.wait(SECOND)
    assert np.array_equal(history.row(SECOND), before)
    assert history.simulated_ns(2 * SECOND) == SECOND // 2
    hand.reset()
    hand.wait(SECOND)
    assert history.span[1] == int(3.5 * SECOND)
    assert np.array_equal(history.row(SECOND), before)
    # Before the rewind lies the first run, behind it the second, then the third.
    assert [history.rewind(int(t * SECOND)).time_ns / SECOND for t in (1.0, 2.0, 3.0)] == [1.0, 0.5, 0.5]
    assert all(history.rewind(int(t * SECOND)).exact for t in (1.0, 2.0, 3.0))


def test_a_hand_session_after_a_rewind_is_saved_from_there() -> None:
    history = History()
    hand = random_hand_session(2, 2.0, hearing(history))
    applied(hand, history, history.rewind(SECOND))
    hand.load(False, "world@tip", [0.03, 0.0, 0.0])
    hand.wait(SECOND)
    saved = history.save_as_script()
    run = OfflineRun(make_scenario(read_scene_text(saved.scene).values), parse_script(saved.script))
    run.advance(hand.now_ns)
    assert run.simulation.state.sha256() == hand.simulation.state.sha256()


def test_a_missed_event_is_noticed_and_the_recorded_state_taken() -> None:
    history = History()
    missed = iter([False, True])

    def heard(what, *content) -> None:
        if what != "event" or not next(missed, False):
            getattr(history, what)(*content)

    hand = HandSession(SCENE, heard)
    for _ in range(3):
        hand.wait(SECOND // 2)
        hand.load(False, "world@tip", [0.03, 0.0, 0.0])
        hand.set(gravity=[0.0, 0.0, -0.1])
    hand.wait(SECOND)
    rewind = history.rewind(2 * SECOND)
    assert not rewind.exact
    assert "recorded" in rewind.notes[0]
    assert np.array_equal(rewind.row, history.row(2 * SECOND))
    assert rewind.changes["initial.position"] == rewind.row[:3].tolist()
    with pytest.raises(InputError):
        history.save_as_script()
    hand.reset()
    hand.wait(SECOND)
    assert history.rewind(history.span[1]).exact
    assert history.save_as_script().commands == 0


def test_a_client_that_comes_in_flight_can_rewind_to_what_it_saw() -> None:
    history = History()
    hand = HandSession(SCENE)
    hand.load(False, "world@tip", [0.03, 0.0, 0.0])
    hand.wait(SECOND)
    history.scene(hand.scenario.text)
    hand.heard = hearing(history)
    hand.wait(SECOND)
    assert history.span == (SECOND + 10_000_000, 2 * SECOND)
    rewind = history.rewind(SECOND + SECOND // 2)
    assert not rewind.exact
    assert np.array_equal(rewind.row, history.row(SECOND + SECOND // 2))


@pytest.mark.parametrize("event_first", [True, False])
def test_states_and_events_of_a_reset_may_come_in_any_order(event_first: bool) -> None:
    history = History()
    hand = HandSession(SCENE, hearing(history))
    hand.wait(SECOND)
    old = history.row(SECOND)
    hand.heard = lambda what, *content: None
    hand.reset()
    reset = hand.log.lines[0]
    pose, twist = old[:7].tolist(), old[7:].tolist()
    if event_first:
        history.event(reset)
        history.state(SECOND, pose, twist)  # from before the reset
        history.state(0, pose, twist)
    else:
        history.state(0, pose, twist)
        history.event(reset)
    history.state(10_000_000, pose, twist)
    assert history.span[1] == SECOND + 10_000_000
    assert len(history._runs) == 2
    assert history.simulated_ns(history.span[1]) == 10_000_000


def test_what_is_kept_is_bounded_and_the_oldest_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history_module, "MAX_EVENTS", 50)
    history = History()
    history.scene(make_scenario(SCENE).text)
    pose, twist = [0.0] * 6 + [1.0], [0.0] * 6
    for k in range(70_000):
        history.state(k * 10_000_000, pose, twist)
    first_ns, live_ns = history.span
    assert live_ns - first_ns == 300 * SECOND
    line = '{"time_ns": 700000000000, "kind": "pause", "content": {}}'
    for _ in range(60):
        history.event(line)
    assert not history.rewind(live_ns).exact
    with pytest.raises(InputError):
        history.session()
    for _ in range(1000):
        history.event('{"time_ns": 0, "kind": "reset", "content": {}}')
        history.state(0, pose, twist)
    assert len(history._runs) <= 200


def test_a_log_of_states_keeps_the_newest() -> None:
    log = StateLog(100)
    for k in range(1000):
        log.append(k, np.full(13, float(k)))
    assert log.times.tolist() == list(range(900, 1000))
    assert log.at(950)[0] == 950.0
    assert log.at(5)[0] == 900.0
    times, rows = log.cut_after(989)
    assert times.tolist() == list(range(990, 1000))
    assert log.times[-1] == 989
    log.append(980, np.zeros(13))
    assert log.at(980)[0] == 980.0
    assert MAX_STATES * 2 * 14 * 8 < 20e6  # bytes


def test_nothing_heard_is_nothing_to_rewind_to() -> None:
    with pytest.raises(InputError):
        History().rewind(0)


def test_changes_set_mass_and_density_together_and_take_ballast_off() -> None:
    present = make_scenario({**SCENE, "mass": 0.2, "ballast.tip": [0.03, 0.0, 0.0, 0.07]}).parameters.named()
    wanted = make_scenario({**SCENE, "mass": 0.2, "density": 500.0, "record": ""}).parameters.named()
    changes = changes_to(wanted, present)
    assert changes["mass"] == 0.2
    assert changes["density"] == 500.0
    assert changes["ballast.tip"] == [0.0, 0.0, 0.0, 0.07]
    assert not changes.keys() & {"record", "contacts.tip", "viewer", "publish_rate"}
    assert make_scenario(present).with_changes(changes).setup.body.mass == 0.2
