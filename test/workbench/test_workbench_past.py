# SPDX-License-Identifier: MIT
"""Looking back on the page at what the body did, and jumps of time while somebody has a hand in it."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("viser")
from flown_page import FlownPage

from rigid_proto_ros.workbench.readouts import ENERGY, MOMENTUM


def readings(flown: FlownPage) -> list[str]:
    return [flown.page.readings.values[name] for name in (ENERGY, MOMENTUM)]


def test_the_past_is_shown_with_the_body_that_moved_then(flown: FlownPage) -> None:
    flown.fly(1.0)
    numbers, picture, first = readings(flown), flown.page.picture, flown.scenario.setup
    flown.change({"mass": 10.0 * first.body.mass, "scale": [2.0, 2.0, 2.0]})
    flown.fly(0.5)
    flown.change({"mesh": "hammer"})
    flown.fly(0.5)
    last = flown.scenario.setup
    assert readings(flown) != numbers and picture.setup is last
    flown.look_back(1.5)
    assert readings(flown) == numbers and picture.setup is first
    assert len(picture._vertices) == len(first.surface.vertices)
    assert picture.shape.size * flown.page.backend.unit > 0.0 and flown.page._unit == flown.page.backend.unit
    flown.look_back(0.0)
    assert picture.setup is last and len(picture._vertices) == len(last.surface.vertices)


def test_what_is_done_while_the_past_is_shown_is_refused_with_what_to_do(flown: FlownPage) -> None:
    flown.fly(1.0)
    flown.look_back(0.5)
    before, mass = len(flown.events), flown.scenario.setup.body.mass
    for act in (
        lambda: flown.click((0.0, 0.045, 0.0), (1.0, 0.0, 0.0)),
        lambda: flown.grab((0.0, 0.045, 0.0)),
        lambda: flown.change({"mass": 1.0}),
    ):
        act()
        flown.wait_until_asked()
        refusal = "The past is shown: press Play to go on from here, or return to the present first."
        assert flown.said.pop() == refusal and not flown.said
        assert len(flown.events) == before and flown.scenario.setup.body.mass == mass
        assert not flown.page.pointer.dragging
    # How one looks at the motion can be changed.
    flown.change({"real_time_factor": 2.0})
    assert flown.scenario.parameters.real_time_factor == 2.0 and not flown.said
    flown.look_back(0.0)
    flown.fly(0.1)


def test_going_on_from_the_past_moves_neither_the_camera_nor_the_reference_of_size_and_mass(
    flown: FlownPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown.pick("thrown_hammer")
    flown.set("Mass ×", (0.3,))
    flown.fly(0.6)
    looks: list[object] = []
    monkeypatch.setattr(flown.page.room, "look", looks.append)
    flown.look_back(0.3)
    seen = flown.page.backend.origin.copy()
    flown.do(flown.page.flight.go_on_from_here)
    flown.fly(0.0)
    flown.until(lambda: flown.page._drawn_moment_ns is None, "present")
    assert flown.widget("Mass ×").value == (0.3,) and not looks
    assert np.array_equal(flown.page.backend.origin, seen)
    # It is 1.5 m below the place where it goes on, and 0.45 m beside it.
    assert np.linalg.norm(flown.page.state.position - seen) > 1.0
    flown.reset()
    assert not looks and np.array_equal(flown.page.backend.origin, seen)


def test_an_answer_to_a_lessons_question_returns_from_the_past_to_the_motion(flown: FlownPage) -> None:
    flown.ask("book")
    flown.fly(0.0)
    flown.look_back(1.0)
    flown.do(lambda: flown.page.lessons.answer(0))
    flown.fly(0.5)
    assert not flown.live.paused and flown.page.flight.moment_ns is None
    flown.until(lambda: flown.page.state.time_ns == 500_000_000, "motion")


@pytest.mark.parametrize("paused", [False, True])
def test_a_step_returns_from_the_past_to_the_present_and_time_stands_there(flown: FlownPage, paused: bool) -> None:
    flown.do(lambda: flown.page.flight.pause(paused))
    flown.fly(1.0)
    before_ns = flown.live.state.time_ns
    flown.look_back(0.5)
    flown.press("Step", of="Simulation")
    flown.wait_until_asked()
    flown.until(lambda: flown.page._drawn_moment_ns is None, "present")
    assert flown.live.paused and not flown.said
    assert flown.live.loop.simulation.time_ns - before_ns == (10_000_000 if paused else 0)


@pytest.mark.parametrize("by_the_page", [True, False])
def test_a_reset_ends_a_drag(flown: FlownPage, by_the_page: bool) -> None:
    place = flown.grab((0.0, 0.045, 0.0))
    flown.fly(0.2)
    assert flown.live.loop.simulation.string is not None
    if by_the_page:
        flown.reset()
    else:
        flown.do(lambda: flown.page.flight._worker.submit(flown.live.reset))
        flown.fly(0.0)
    assert not flown.page.pointer.dragging
    flown.pull(place + [0.0, 0.0, 0.1])
    flown.fly(0.1)
    assert flown.live.loop.simulation.string is None


def test_plots_of_the_past_end_at_it_and_those_of_the_present_are_whole_again(flown: FlownPage) -> None:
    flown.fly(10.0)
    whole = flown.page.readings.samples
    for seconds in (8.0, 2.0):
        flown.look_back(seconds)
        flown.until(lambda s=seconds: abs(flown.page.state.time_ns - (10.0 - s) * 1e9) < 1e8, "moment")
        assert np.array_equal(flown.page.readings.samples, whole[whole[:, 0] <= 10.0 - seconds])
    flown.look_back(0.0)
    assert np.array_equal(flown.page.readings.samples, whole)


def test_after_a_reset_while_time_stands_the_plots_of_the_run_before_are_gone(flown: FlownPage) -> None:
    flown.fly(3.0)
    flown.press("Pause", of="Simulation")
    plot = flown.page.readout_tab._free
    flown.until(lambda: len(plot._handle.data[0]) > 10, "plot")
    flown.press("Reset", of="Simulation")
    flown.until(lambda: len(plot._handle.data[0]) == 1, "plot of the start alone")


def test_what_another_client_does_while_the_past_is_shown_is_shown(flown: FlownPage) -> None:
    flown.fly(1.0)
    flown.look_back(0.5)
    flown.live.set_parameters({"density": 1234.5})
    flown.until(lambda: flown.widget("Density [kg/m³]").value == "1234.5", "density set elsewhere")
    flown.live.reset()
    flown.until(lambda: flown.page._drawn_moment_ns is None and not flown.page._undrawn, "run that has begun")
    flown.wait_until_asked()
    assert not flown.live.paused and flown.page.state.time_ns == 0 and flown.page.flight.moment_ns is None
    assert len(flown.page.readings.samples) == 1
