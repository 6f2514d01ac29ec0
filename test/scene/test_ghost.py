# SPDX-License-Identifier: MIT
"""The ghost gets all the commands that the body gets, or isn't there yet."""

from __future__ import annotations

import numpy as np
import pytest
from flights import SECOND, Heard

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.motion.frames import parse_frame
from rigid_proto_ros.scene.scenario import make_scenario
from rigid_proto_ros.scene.scenario_run import ScenarioRun
from rigid_proto_ros.simulation.commands import WrenchCommand
from rigid_proto_ros.simulation.observer import GhostChanged, GhostPublished, Published, Refused

MOVING = {
    "initial.linear_velocity": [1.0, 0.0, 0.0],
    "initial.angular_velocity": [0.1, 5.0, 0.2],
    "real_time_factor": 0.0,
}


def test_a_ghost_that_cannot_carry_the_scene_is_refused_by_its_own_name():
    with pytest.raises(InputError, match=r"ghost\.integrator"):
        make_scenario({"string.attached": True, "ghost.integrator": "free_body"})
    scenario = make_scenario({"string.attached": True})
    with pytest.raises(InputError, match=r"ghost\.integrator"):
        scenario.with_changes({"ghost.integrator": "free_body"})


def test_a_command_that_the_ghost_cannot_carry_is_said_once_until_the_next_reset():
    heard = Heard(Refused)
    scenario = make_scenario({"ghost.integrator": "free_body"})
    run = ScenarioRun(scenario, heard)
    run.begin_ghost()
    simulation = run.simulation
    push = WrenchCommand(False, parse_frame("world@com"), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), "")

    def fly() -> None:
        run.take(push)
        run.take(push, simulation.time_ns + 1_000_000)
        end_ns = simulation.time_ns + SECOND // 10
        simulation.advance(end_ns)
        run.ghost.advance(end_ns)

    fly()
    fly()
    (refused,) = heard.events
    assert refused.reason == "ghost"
    assert "the ghost continues without" in refused.message and "free_body" in refused.message
    assert not simulation.refused  # the body itself carries it
    simulation.reset()
    run.begin_ghost()
    fly()
    assert len(heard.events) == 2


def test_a_ghost_begins_at_a_reset_and_is_gone_at_once_when_it_is_switched_off():
    from rigid_proto_ros.live.simulation_loop import SimulationLoop

    heard = Heard(GhostChanged, Published, GhostPublished)
    loop = SimulationLoop(make_scenario(MOVING), heard)

    def fly_to(time_ns: int) -> None:
        while loop.simulation.time_ns < time_ns:
            loop.tick()

    def switch(model: str) -> None:
        loop.replace(loop.scenario.with_changes({"ghost.inertia_model": model}))

    loop.start()
    fly_to(SECOND)
    switch("bounding_box")
    fly_to(2 * SECOND)
    assert not heard.of(GhostChanged) and not heard.of(GhostPublished)
    heard.events.clear()
    loop.reset()
    fly_to(SECOND)
    (began,), body, ghost = heard.of(GhostChanged), heard.of(Published), heard.of(GhostPublished)
    assert began.time_ns == 0 and began.setup is not None
    assert [state.time_ns for state in ghost] == [state.time_ns for state in body]
    # No force acts, so the COMs stay together; the tensors part the attitudes.
    assert np.array_equal(ghost[-1].row[:3], body[-1].row[:3])
    assert not np.array_equal(ghost[-1].row[3:7], body[-1].row[3:7])
    heard.events.clear()
    switch("")
    off_ns = loop.simulation.time_ns
    fly_to(2 * SECOND)
    assert heard.events[0] == GhostChanged(off_ns, None)
    loop.reset()
    fly_to(SECOND)
    switch("bounding_box")
    fly_to(2 * SECOND)
    assert len(heard.of(GhostChanged)) == 1
    assert all(state.time_ns == off_ns for state in heard.of(GhostPublished))
    loop.reset()
    fly_to(SECOND)
    assert len(heard.of(GhostChanged)) == 2 and max(state.time_ns for state in heard.of(GhostPublished)) >= SECOND
