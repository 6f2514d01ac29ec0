# SPDX-License-Identifier: MIT
"""However much a publication costs, the physics thread comes back soon: the motion is advanced in slices, to the same bits."""

from __future__ import annotations

import itertools
import time

import pytest
from flights import SECOND, wrench

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.live.pacing import WorkBudget
from rigid_proto_ros.live.simulation_loop import Endpoints, SimulationLoop
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.simulation.commands import Change

ENDLESS = {
    "integrator": "rk4",
    "step": 1e-9,
    "publish_rate": 1e-6,
    "real_time_factor": 0.0,
    "initial.angular_velocity": [0.1, 0.2, 12.0],
}
"""10¹⁵ steps to the next publication: years."""


class Rig:
    """A flight whose publications and commands are at hand."""

    def __init__(self, values: dict) -> None:
        self.published: list[int] = []
        self.commands: list = []
        self.has_listeners = True
        self.lively = False
        endpoints = Endpoints()
        endpoints.publish = lambda run: self.published.append(run.simulation.time_ns)
        endpoints.has_subscribers = lambda: self.has_listeners
        endpoints.take_commands = self.take_commands
        self.loop = SimulationLoop(make_scenario(values), endpoints=endpoints)
        self.loop.start()

    def take_commands(self, _, wall_ns: int, at_once: bool) -> bool:
        if self.commands:
            self.loop.catch_up()
        while self.commands:
            self.loop.simulation.submit(self.commands.pop())
        return self.lively


def test_a_tick_ends_long_before_a_publication_that_is_years_away():
    rig = Rig(ENDLESS)
    for _ in range(5):
        rig.loop.tick()
    assert rig.published == [0]
    assert 0 < rig.loop.simulation.time_ns < SECOND
    assert rig.loop.next_wake_ns() == 0


def test_commands_and_requests_get_in_meanwhile():
    rig = Rig(ENDLESS)
    rig.commands.append(wrench("world", (1e-3, 0.0, 0.0)))
    for _ in range(3):
        rig.loop.tick()
    assert rig.loop.simulation.events.count == 1
    rig.loop.prepare_request()
    rig.loop.pause(True)
    reached_ns = rig.loop.simulation.time_ns
    rig.loop.tick()
    assert rig.loop.simulation.time_ns == reached_ns


def test_a_step_that_takes_years_goes_on_tick_by_tick_and_is_given_up_by_resuming() -> None:
    rig = Rig({**ENDLESS, "start_paused": True})
    rig.loop.tick()
    assert not rig.loop.step()
    begun_ns = rig.loop.simulation.time_ns
    rig.loop.tick()
    assert rig.loop.stepping and rig.loop.simulation.time_ns > begun_ns
    assert set(rig.published) <= {0}, "a state of the middle of a step"
    rig.loop.pause(False)
    assert not rig.loop.stepping


@pytest.mark.parametrize("end", [lambda loop: loop.pause(False), lambda loop: loop.reset()], ids=["resumed", "reset"])
def test_who_waits_for_a_step_that_is_given_up_is_told_and_who_has_got_one_is_not(end) -> None:
    rig = Rig({**ENDLESS, "start_paused": True})
    rig.loop.tick()
    steps = rig.loop.steps()
    next(steps)
    rig.loop.tick()
    end(rig.loop)
    with pytest.raises(InputError, match="given up"):
        next(steps)
    rig.loop.pause(True)
    rig.loop.setup_of(Change({"publish_rate": 1000.0, "step": 0.001}))
    rig.loop.reset()
    rig.loop.tick()
    assert next(rig.loop.steps(), "made") == "made"


def test_a_step_asked_for_while_another_is_made_follows_it(monkeypatch) -> None:
    rig = Rig({"start_paused": True, "publish_rate": 1000.0})
    rig.loop.tick()
    reached_ns = rig.loop.simulation.time_ns
    advance, calls = WorkBudget.advance, itertools.count()
    # As where a tick's time is over before the step is made.
    monkeypatch.setattr(WorkBudget, "advance", lambda *given: next(calls) % 3 != 0 and advance(*given))
    waiting = [rig.loop.steps(5), rig.loop.steps(7)]
    while waiting:
        waiting = [steps for steps in waiting if next(steps, True) is None]
        rig.loop.tick()
    assert rig.loop.simulation.time_ns == reached_ns + 12 * SECOND // 1000


@pytest.mark.parametrize("listeners", [True, False])
def test_a_flight_pauses_at_the_last_time_that_a_stamp_can_say(monkeypatch, listeners):
    monkeypatch.setattr("rigid_proto_ros.live.simulation_loop.LAST_STAMP_NS", 3 * SECOND)
    rig = Rig({"real_time_factor": 0.0 if listeners else 1e6, "publish_rate": 1.0})
    rig.has_listeners = listeners
    while not rig.loop.paused:
        rig.loop.tick()
    assert "the largest that a stamp can hold" in rig.loop.simulation.failure
    assert rig.loop.simulation.time_ns <= 3 * SECOND
    assert max(rig.published, default=0) <= 3 * SECOND
    rig.loop.reset()
    assert not rig.loop.simulation.failure


def test_without_listeners_a_motion_that_is_too_dear_gives_time_up_and_says_so(monkeypatch):
    rig = Rig({**ENDLESS, "publish_rate": 1000.0, "real_time_factor": 1.0})
    monkeypatch.setattr("rigid_proto_ros.live.pacing.MAX_LAG_NS", 10_000_000)
    rig.has_listeners = False
    rig.loop.tick()
    lost_s = rig.loop.pace.real_time_lost_s
    while rig.loop.pace.real_time_lost_s == lost_s:
        rig.loop.tick()
    assert rig.loop.simulation.time_ns > 0


def test_simulated_time_goes_on_between_publications_that_are_far_apart(monkeypatch):
    now = [10**12]
    monkeypatch.setattr("rigid_proto_ros.live.pacing.time.monotonic_ns", lambda: now[0])
    rig = Rig({"publish_rate": 0.01})
    rig.loop.tick()
    rig.loop.simulation.submit(wrench("world", (1e-3, 0.0, 0.0)), SECOND)
    now[0] += 2 * SECOND
    rig.loop.tick()
    assert rig.loop.simulation.time_ns == 2 * SECOND
    assert rig.loop.simulation.events.count == 1
    assert rig.published == [0]


@pytest.mark.parametrize("factor", [1e-305, 5e-324])
def test_a_factor_that_asks_for_a_time_beyond_all_numbers_stops_the_motion_and_not_the_thread(factor):
    rig = Rig({"publish_rate": 1e-6, "real_time_factor": factor})
    rig.lively = True
    for _ in range(3):
        rig.loop.tick()
        assert rig.loop.next_wake_ns() < time.monotonic_ns() + SECOND
    assert rig.loop.simulation.time_ns == 0


def test_while_commands_come_they_are_taken_once_more_shortly_before_each_publication(monkeypatch):
    now = [10**12]
    monkeypatch.setattr("rigid_proto_ros.live.pacing.time.monotonic_ns", lambda: now[0])
    rig = Rig({"publish_rate": 1000.0})
    rig.lively = True
    wakes = []
    for _ in range(6):
        rig.loop.tick()
        now[0] = max(now[0], rig.loop.next_wake_ns())
        wakes.append(now[0] - 10**12)
    assert [round(w / 1e5) for w in wakes] == [8, 10, 18, 20, 28, 30]
    rig.lively = False
    for _ in range(2):
        rig.loop.tick()
        now[0] = max(now[0], rig.loop.next_wake_ns())
    assert round((now[0] - 10**12) / 1e6) == 5
