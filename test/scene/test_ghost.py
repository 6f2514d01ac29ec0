# SPDX-License-Identifier: MIT
"""The ghost gets all the commands that the body gets, or isn't there yet."""

from __future__ import annotations

import pytest
from flights import SECOND

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import ScenarioRun
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.observer import GhostChanged, GhostPublished, Observer, Published, Refused

MOVING = {
    "initial.linear_velocity": [1.0, 0.0, 0.0],
    "initial.angular_velocity": [0.1, 5.0, 0.2],
    "real_time_factor": 0.0,
}


class Watcher(Observer):
    """Notes when ghosts begin and end, and where body and ghost are."""

    def __init__(self) -> None:
        self.began: list[int] = []
        self.ended: list[int] = []
        self.body: dict[int, list[float]] = {}
        self.ghost: dict[int, list[float]] = {}
        self.refusals: list[tuple[str, str]] = []

    takes = frozenset({Refused, GhostChanged, Published, GhostPublished})

    def on(self, event) -> None:
        match event:
            case Refused(_, reason, message):
                self.refusals.append((reason, message))
            case GhostChanged(time_ns, None):
                self.ended.append(time_ns)
            case GhostChanged(time_ns, _):
                self.began.append(time_ns)
            case Published(time_ns, row):
                self.body[time_ns] = row.tolist()
            case GhostPublished(time_ns, row):
                self.ghost[time_ns] = row.tolist()


def test_a_ghost_that_cannot_carry_the_scene_is_refused_by_its_own_name():
    with pytest.raises(InputError, match=r"ghost\.integrator"):
        make_scenario({"string.attached": True, "ghost.integrator": "free_body"})
    scenario = make_scenario({"string.attached": True})
    with pytest.raises(InputError, match=r"ghost\.integrator"):
        scenario.with_changes({"ghost.integrator": "free_body"})


def test_a_command_that_the_ghost_cannot_carry_is_said_once_until_the_next_reset():
    watcher = Watcher()
    scenario = make_scenario({"ghost.integrator": "free_body"})
    run = ScenarioRun(scenario, watcher)
    run.begin_ghost()
    simulation = run.simulation
    push = WrenchCommand(False, parse_frame("world@com"), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "")

    def fly() -> None:
        simulation.submit(push)
        simulation.submit(push, simulation.time_ns + 1_000_000)
        end_ns = simulation.time_ns + SECOND // 10
        simulation.advance(end_ns)
        run.ghost.advance(end_ns)

    fly()
    fly()
    ((reason, text),) = watcher.refusals
    assert reason == "ghost" and "the ghost continues without" in text and "free_body" in text
    assert not simulation.refused  # the body itself carries it
    simulation.reset()
    run.begin_ghost()
    fly()
    assert len(watcher.refusals) == 2


def test_a_ghost_asked_for_in_flight_begins_at_the_next_reset():
    from rigid_proto_ros.live.simulation_loop import SimulationLoop

    watcher = Watcher()
    flight = SimulationLoop(make_scenario(MOVING), watcher)
    flight.start()
    while flight.simulation.time_ns < SECOND:
        flight.tick()
    flight.replace(flight.scenario.with_changes({"ghost.inertia_model": "bounding_box"}))
    while flight.simulation.time_ns < 2 * SECOND:
        flight.tick()
    assert not watcher.began and not watcher.ghost
    flight.reset()
    watcher.body.clear()
    while flight.simulation.time_ns < SECOND:
        flight.tick()
    assert watcher.began == [0]
    assert watcher.ghost.keys() == watcher.body.keys()
    # No force acts, so the COMs stay together; the tensors part the attitudes.
    last = max(watcher.body)
    assert watcher.ghost[last][:3] == watcher.body[last][:3] and watcher.ghost[last][3:7] != watcher.body[last][3:7]


def test_a_ghost_switched_off_is_gone_at_once_and_begins_again_at_a_reset():
    from rigid_proto_ros.live.simulation_loop import SimulationLoop

    watcher = Watcher()
    flight = SimulationLoop(make_scenario({**MOVING, "ghost.inertia_model": "bounding_box"}), watcher)

    def fly_to(time_ns: int) -> None:
        while flight.simulation.time_ns < time_ns:
            flight.tick()

    flight.start()
    fly_to(SECOND)
    flight.replace(flight.scenario.with_changes({"ghost.inertia_model": ""}))
    off_ns = flight.simulation.time_ns
    fly_to(2 * SECOND)
    assert watcher.began == [0] and watcher.ended == [off_ns] and max(watcher.ghost) <= off_ns
    flight.reset()
    watcher.ghost.clear()
    fly_to(SECOND)
    flight.replace(flight.scenario.with_changes({"ghost.inertia_model": "bounding_box"}))
    fly_to(2 * SECOND)
    assert watcher.began == [0] and not watcher.ghost
    flight.reset()
    fly_to(SECOND)
    assert watcher.began == [0, 0] and watcher.ghost
