# SPDX-License-Identifier: MIT
"""Several held wrenches: each slot is replaced and timed out by itself, offline and recorded."""

import json

import pytest
from flights import SECOND, EventLines

from rigid_proto_ros.base.errors import CommandRefused
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.recorded_session import Resimulation
from rigid_proto_ros.simulation.commands import slot_name, slot_number
from rigid_proto_ros.simulation.simulation import TIMEOUTS

SCENE = {"mesh": "t_handle", "mass": 1.0, "publish_rate": 10.0}
SCRIPT = """
- {t: 0.0, wrench: {force: [1, 0, 0], slot: left}}
- {t: 0.0, wrench: {force: [0, 2, 0], slot: right}}
- {t: 0.0, wrench: {force: [0, 0, 4]}}
- {t: 1.0, wrench: {force: [3, 0, 0], slot: left}}
- {t: 1.0, wrench: {force: [0, 0, 0]}}
"""
PULSE = "- {t: 1.0, force: [0, 0, 8], duration: 5}\n- {t: 2.0, impulse: [0, 0, 1]}\n"


def flown(script: str = SCRIPT, until_s: float = 4.0, **scene) -> tuple[OfflineRun, EventLines]:
    lines = EventLines()
    run = OfflineRun(make_scenario({**SCENE, **scene}), parse_script(script), lines)
    run.advance(round(until_s * 1e9))
    return run, lines


@pytest.mark.parametrize(
    ("script", "velocity", "timeouts"),
    [
        # left: 1 N for 1 s, then 3 N for the timeout of 1.5 s; right: 2 N for 1.5 s; the unnamed one 4 N for 1 s.
        (SCRIPT, [1.0 + 4.5, 3.0, 4.0], 2),
        # clear_wrench ends a running pulse too, and leaves what is scheduled.
        (SCRIPT + PULSE + "- {t: 1.25, service: clear_wrench}", [1.0 + 0.75, 2.5, 4.0 + 2.0 + 1.0], 0),
        (SCRIPT + "- {t: 0.5, force: [0, 8, 0], duration: 0.25, slot: right}", [1.0 + 4.5, 1.0 + 2.0, 4.0], 1),
        # What has a duration ends by it, and nothing else: no other slot, no timeout, no change of the timeout.
        ("[{t: 0, wrench: {force: [1, 0, 0], duration: 2, slot: a}}, {t: 0, wrench: {force: [0, 1, 0]}}]", [2, 1.5, 0], 1),
        ("[{t: 0, wrench: {force: [1, 0, 0], duration: 2, slot: a}}, {t: 1, force: [0, 1, 0], duration: 2, slot: a}]", [1, 2, 0], 0),
        ("[{t: 0, wrench: {force: [1, 0, 0], duration: 2}}, {t: 1, set: {wrench_timeout: 0.25}}]", [2, 0, 0], 0),
        # What replaces it ends it for good.
        ("[{t: 0, wrench: {force: [1, 0, 0], duration: 3}}, {t: 0.5, wrench: {force: [0, 1, 0], duration: 2}}]", [0.5, 2, 0], 0),
    ],
    ids=["replaced and timed out", "cleared", "poked", "its own end", "replaced by a poke", "timeout changed", "replaced"],
)  # fmt: skip
def test_each_slot_is_replaced_and_ends_by_itself(script: str, velocity: list[float], timeouts: int) -> None:
    run, told = flown(script)
    assert run.simulation.state.linear_velocity == pytest.approx(velocity, rel=1e-12)
    assert sum('"timeout"' in line for line in told.lines) == timeouts


def test_a_held_wrench_that_times_out_is_an_event_and_one_that_is_replaced_is_none() -> None:
    _, told = flown()
    timeouts = [(e["time_ns"], e["content"]) for e in map(json.loads, told.lines) if e["kind"] == "timeout"]
    assert timeouts == [(1_500_000_000, {"slot": "right"}), (2_500_000_000, {"slot": "left"})]


@pytest.mark.parametrize("timeouts_recorded", [True, False])
def test_slots_replay_to_the_bit_also_from_recordings_without_timeouts(timeouts_recorded: bool) -> None:
    run, told = flown()
    recorded = [line for line in told.lines if timeouts_recorded or '"timeout"' not in line]
    again_told = EventLines()
    logged = TIMEOUTS if timeouts_recorded else ()
    again = Resimulation(make_scenario(SCENE), recorded, again_told, logged_timeouts=logged)
    row = again.advance(4 * SECOND)
    assert row.tobytes() == run.simulation.state.row.tobytes()
    assert len(again_told.lines) == len(recorded)
    assert not timeouts_recorded or again_told.lines == told.lines


def test_slots_have_a_number_each() -> None:
    names = ["a", "z", "a_b", "a0", "left", "z" * 12, "a" * 12, "z___________"]
    assert [slot_name(slot_number(name)) for name in names] == names
    assert slot_name(slot_number("")) == ""
    assert max(map(slot_number, names)) < 2**63


@pytest.mark.parametrize(
    "frame", ["body;slot=", "body;slot=Left", "body;slot=a;slot=b", "body;impulse;slot=a", f"body;slot={'a' * 13}"]
)
def test_what_is_no_slot_is_refused(frame: str) -> None:
    with pytest.raises(CommandRefused, match="slot"):
        parse_frame(frame)


@pytest.mark.parametrize(
    ("timeout", "velocity"), [(0.0, 2.0), (1e-300, 1e-9), (4e-10, 1e-9), (1.4e-9, 1e-9), (0.5, 0.5)]
)
def test_a_timeout_below_a_nanosecond_is_one_and_only_zero_means_for_ever(timeout: float, velocity: float) -> None:
    one = {"mesh": "", "inertia_model": "explicit", "explicit_inertia.mass": 1.0, "wrench_timeout": timeout}
    run, _ = flown("[{t: 0, wrench: {force: [1, 0, 0]}}]", 2.0, mass=0.0, **one)
    assert run.simulation.state.linear_velocity[0] == pytest.approx(velocity, rel=1e-9)
