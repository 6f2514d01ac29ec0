# SPDX-License-Identifier: MIT
"""Thrusters push along the body's own axes with what they are told, within limit, least on-time and timeout."""

import json

import pytest
from flights import SECOND, Heard

from rigid_proto_ros.base.errors import CommandRefused, InputError
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.session.recorded_session import Resimulation
from rigid_proto_ros.simulation.observer import EventLog, LoadBegan, LoadEnded, Logged

BODY = {
    "mesh": "",
    "inertia_model": "explicit",
    "explicit_inertia.mass": 2.0,
    "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
    "wrench_timeout": 0.0,
}


class Told(Heard):
    @property
    def lines(self) -> list[str]:
        return [event.line for event in self.of(Logged)]

    @property
    def acting(self) -> set[int]:
        return {event.load_id for event in self.of(LoadBegan)} - {event.load_id for event in self.of(LoadEnded)}


def flown(script: str, until_s: float, **scene) -> tuple[OfflineRun, Told]:
    told = Told(Logged, LoadBegan, LoadEnded)
    run = OfflineRun(make_scenario({**BODY, **scene}), parse_script(script), told)
    run.advance(round(until_s * 1e9))
    assert not run.simulation.refused
    return run, told


def test_thrusters_push_together_in_the_order_of_their_names() -> None:
    # b is written first; a pushes along x through the COM, b along z at 1 m on x: -1 N m about y per newton.
    thrusters = {"thrusters.b": [1.0, 0.0, 0.0, 0.0, 0.0, 5.0], "thrusters.a": [0.0, 0.0, 0.0, 0.5, 0.0, 0.0]}
    run, told = flown("[{t: 0, thrusters: [4, 0.002]}]", 0.01, **thrusters)
    assert run.simulation.state.linear_velocity == pytest.approx([0.02, 0.0, 1e-5], rel=1e-4)  # it turns a little
    assert run.simulation.state.angular_velocity == pytest.approx([0.0, -2e-5, 0.0], rel=1e-4)
    assert {event.load.kind for event in told.of(LoadBegan)} == {"thruster"} and len(told.acting) == 2


BOTH = {"thrusters.a": [0, 0, 0, 1, 0, 0, 3.0], "thrusters.b": [0, 0, 0, 0, 1, 0, 0.0]}


@pytest.mark.parametrize(
    ("bidirectional", "forces", "velocity"), [(False, (-5, -5), [1.5, 50.0, 0.0]), (True, (-100, -5), [0.0, 47.5, 0.0])]
)
def test_a_thruster_pushes_one_way_unless_it_is_to_push_both_up_to_its_limit_and_0_is_none(
    bidirectional: bool, forces: tuple, velocity: list[float]
) -> None:
    script = f"[{{t: 0, thrusters: [100, 100]}}, {{t: 1, thrusters: {list(forces)}}}]"
    run, _ = flown(script, 2.0, **BOTH, **{"thruster.bidirectional": bidirectional})
    assert run.simulation.state.linear_velocity == pytest.approx(velocity, rel=1e-12, abs=1e-12)


def test_a_thruster_that_is_on_stays_so_for_its_least_time() -> None:
    rules = {"thrusters.a": [0, 0, 0, 1, 0, 0], "thruster.minimum_on_time": 0.1}
    # On at 0 for 0.02 s, which become 0.1 s; on at 0.5 s for 0.3 s, of which the last 0.1 with half the force.
    script = """[{t: 0, thrusters: [2]}, {t: 0.02, thrusters: [0]}, {t: 0.5, thrusters: [2]}, {t: 0.7, thrusters: [1]},
        {t: 0.8, thrusters: [0]}]"""
    run, told = flown(script, 0.05, **rules)
    assert len(told.acting) == 1
    run, told = flown(script, 1.0, **rules)
    assert run.simulation.state.linear_velocity[0] == pytest.approx(0.1 + 0.2 + 0.05, rel=1e-12)
    assert not told.acting
    # Asked for again before it is over, it goes on from there; the timeout too leaves it on for so long.
    script = "[{t: 0, thrusters: [2]}, {t: 0.02, thrusters: [0]}, {t: 0.06, thrusters: [2]}, {t: 0.3, thrusters: [0]}]"
    run, told = flown(script, 1.0, **rules)
    assert run.simulation.state.linear_velocity[0] == pytest.approx(0.3, rel=1e-12)
    run, told = flown("[{t: 0, thrusters: [2]}]", 1.0, **{**rules, "wrench_timeout": 0.04})
    assert run.simulation.state.linear_velocity[0] == pytest.approx(0.1, rel=1e-12)
    timeouts = [json.loads(line)["time_ns"] for line in told.lines if '"timeout"' in line]
    assert timeouts == [SECOND // 25]


def test_thrusters_time_out_as_an_event_and_clear_wrench_stops_them_at_once() -> None:
    scene = {"thrusters.a": [0, 0, 0, 1, 0, 0], "wrench_timeout": 0.5}
    run, told = flown("[{t: 0, thrusters: [2]}]", 2.0, **scene)
    assert run.simulation.state.linear_velocity[0] == pytest.approx(0.5, rel=1e-12)
    timeouts = [json.loads(line) for line in told.lines if '"timeout"' in line]
    assert [(e["time_ns"], e["content"]) for e in timeouts] == [(SECOND // 2, {"thrusters": True})]
    run, told = flown("[{t: 0, thrusters: [2]}, {t: 0.25, service: clear_wrench}]", 2.0, **scene)
    assert run.simulation.state.linear_velocity[0] == pytest.approx(0.25, rel=1e-12)
    assert not told.acting and not any('"timeout"' in line for line in told.lines)
    # Without a timeout nothing is due when the wrench is cleared; the least on-time counts from the next command.
    script = (
        "[{t: 0, thrusters: [2]}, {t: 1, service: clear_wrench}, {t: 1.1, thrusters: [2]}, {t: 1.2, thrusters: [0]}]"
    )
    run, told = flown(script, 3.0, **{**scene, "wrench_timeout": 0.0, "thruster.minimum_on_time": 0.5})
    assert run.simulation.state.linear_velocity[0] == pytest.approx(1.0 + 0.5, rel=1e-12)
    assert not told.acting


@pytest.mark.parametrize("minimum_on_time", [0.0, 0.13])
def test_thrusters_replay_to_the_bit_however_often_they_are_looked_at(minimum_on_time: float) -> None:
    scene = {**BODY, "thrusters.a": [0.1, 0.2, 0, 1, 0, 1, 5], "thrusters.b": [0, 0, 0.3, 0, 1, 0]}
    scene["thruster.minimum_on_time"] = minimum_on_time
    script = "[{t: 0, thrusters: [8, 1]}, {t: 0.4, force: [0, 1, 0]}, {t: 0.51, thrusters: [0, -2]}]"
    run, told = flown(script, 1.0, **{**scene, "wrench_timeout": 0.3})
    again = Resimulation(make_scenario({**scene, "wrench_timeout": 0.3}), told.lines)
    again.simulation.events = EventLog()  # chained, also without an observer
    rows = [again.advance(round(k * 1e7)) for k in range(101)]
    assert rows[-1].tobytes() == run.simulation.state.row.tobytes()
    assert again.simulation.events.sha256 == json.loads(told.lines[-1])["sha256"]


@pytest.mark.parametrize(
    ("numbers", "field"),
    [
        ([0, 0, 0, 0, 0, 0], "thrusters.a"),
        ([0, 0, 0, 1, 0, 0, -1], "thrusters.a"),
        # A lag is simulated no more.
        ([0, 0, 0, 1, 0, 0, 5, 0.02], "thrusters.a"),
    ],
)
def test_what_is_no_thruster_is_refused_by_name(numbers, field) -> None:
    with pytest.raises(InputError, match=field):
        make_scenario({**BODY, "thrusters.a": numbers})


def test_the_wrong_number_of_forces_is_refused_with_the_names() -> None:
    with pytest.raises((CommandRefused, InputError), match=r"1 numbers, one a thruster \(a\)"):
        flown("[{t: 0, thrusters: [1, 2]}]", 1.0, **{"thrusters.a": [0, 0, 0, 1, 0, 0]})
    with pytest.raises(InputError, match="none is declared"):
        flown("[{t: 0, thrusters: [1]}]", 1.0)
