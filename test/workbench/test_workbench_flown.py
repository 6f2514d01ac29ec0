# SPDX-License-Identifier: MIT
"""What the page shows of a body in flight is what the body does: string, energy, ghost, refusals. No browser, no ROS."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")
pytest.importorskip("rclpy", reason="rclpy is not installed: no link to ROS")

from flown_page import FlownLink, FlownPage

from rigid_proto_ros.session.replay import resimulation
from rigid_proto_ros.simulation.observer import GhostPublished, Observer
from rigid_proto_ros.workbench import controls
from rigid_proto_ros.workbench import page as page_module


@pytest.fixture
def flown(monkeypatch: pytest.MonkeyPatch) -> Iterator[FlownPage]:
    monkeypatch.setattr(page_module, "RosLink", FlownLink)
    monkeypatch.setattr(page_module, "GRACE_S", 0.0)
    monkeypatch.setattr(controls, "TYPING_S", 0.0)
    monkeypatch.setattr(controls, "TOUCHED_S", 0.0)
    flown = FlownPage()
    yield flown
    flown.end()


def test_a_drag_draws_the_string_from_the_grabbed_point_and_shows_the_energy_that_it_holds(flown: FlownPage) -> None:
    flown.pick("Three pushes, three answers")
    spout = [0.134, 0.0, 0.108]
    place = flown.grab(spout)
    flown.pull(place + [0.03, 0.0, 0.02])
    flown.fly(0.3)
    page, own = flown.page, flown.link.simulation
    knot, hand = flown.do(lambda: page.follower.acting.string_ends(page.scenes.scenario.setup, page.follower.state))
    tied = own.string
    assert tied is not None
    assert np.abs(hand - tied.free_end(own.time_ns)).max() < 1e-12
    true_knot = own.state.position + own.state.rotation @ own.setup.body.point(tied.attach)
    assert np.abs(knot - true_knot).max() < 1e-12
    stretched = flown.do(lambda: page.follower.acting.string_energy(page.scenes.scenario.setup, page.follower.state))
    assert stretched == pytest.approx(tied.potential_energy(own.setup.body, own.state), rel=1e-3)
    assert not flown.said
    apart = float(np.linalg.norm(hand - knot))

    def shown(length: float) -> np.ndarray:
        # Read at once: the page itself draws the string anew with the next state.
        page.view.show_string((knot, hand), length, np.array([0.0, 0.0, -9.81]))
        return np.asarray(page.view._string.points) * page.view.unit

    for length in (0.0, 3.0 * apart):
        pieces = flown.do(lambda length=length: shown(length))
        drawn = float(np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1).sum())
        assert drawn == pytest.approx(length or apart, rel=5e-3)
    flown.let_go()
    flown.fly(0.1)
    assert (
        own.string is None
        and flown.do(lambda: page.follower.acting.string_ends(page.scenes.scenario.setup, page.follower.state)) is None
    )


def test_frames_that_bear_the_nodes_name_are_shown_and_what_cannot_be_is_said(flown: FlownPage) -> None:
    flown.do(lambda: flown.link.wrench("poke", "rigid_body@point/0.0,0.0,0.07", (0.0, 1.0, 0.0)))
    flown.fly(0.05)
    page = flown.page
    assert len(flown.do(lambda: page.follower.acting.arrows(page.scenes.scenario.setup, page.follower.state, 0.1))) == 1
    assert not flown.said
    line = '{"time_ns": 60000000, "kind": "poke", "content": {"frame_id": "moon", "force": [1, 0, 0], "torque": [0, 0, 0]}}'
    flown.do(lambda: flown.link._heard.events.append(line))
    flown.fly(0.05)
    assert len(flown.said) == 1 and "doesn't show this poke" in flown.said[0] and "moon" in flown.said[0]


def test_the_ghost_of_a_lesson_is_there_from_its_start_and_gone_in_the_next_one(flown: FlownPage) -> None:
    page = flown.page
    flown.fly(3.0)
    flown.pick("The true tensor against the box's")
    flown.fly(0.05)
    alike, _ = flown.until(
        lambda: (ghost := page.follower.ghost_row(page.scenes.scenario, None))[0] is not None and ghost,
        "ghost at the start",
    )
    assert np.abs(alike[3:7] - page.follower.state.row[3:7]).max() < 0.02
    flown.fly(2.0)
    apart, _ = flown.until(
        lambda: (ghost := page.follower.ghost_row(page.scenes.scenario, None))[0] is not None and ghost,
        "ghost later on",
    )
    assert np.abs(apart[3:7] - page.follower.state.row[3:7]).max() > 0.3
    flown.pick("One book, three throws")
    flown.fly(0.5)
    assert flown.link.scenario.ghost is None and page.follower.ghost_row(page.scenes.scenario, None)[0] is None


class GhostWatcher(Observer):
    takes = frozenset({GhostPublished})

    def on(self, event) -> None:
        if isinstance(event, GhostPublished):
            self.row = event.row.copy()


def test_the_pages_ghost_is_to_the_bit_the_one_that_replay_computes(flown: FlownPage) -> None:
    page, link = flown.page, flown.link
    flown.pick("The true tensor against the box's")
    flown.fly(0.5)
    # Between two states that the page hears.
    flown.do(lambda: link.schedule("{t: 0.513, set: {mass: 3.0}}"))
    flown.do(
        lambda: link.schedule("{t: 0.527, at: {point: [0.1, 0.02, 0.003]}, force: [0.0, 0.5, 0.0], duration: 0.1}")
    )
    flown.fly(1.0)
    time_ns = page.follower.state.time_ns
    shown = flown.until(
        lambda: (row := page.follower.ghost_row(page.scenes.scenario, None)[0]) is not None and [row], "a ghost"
    )[0]
    watcher = GhostWatcher()
    again = resimulation(page.history.session(), watcher)
    again.begin_ghost()
    again.advance(time_ns)
    again.ghost.advance(time_ns)
    assert shown.tobytes() == watcher.row.tobytes()


def test_a_command_that_the_ghosts_integrator_cannot_carry_is_said(flown: FlownPage) -> None:
    flown.set("Its integrator", "free_body")
    flown.fly(1.0)  # a state of a time before this one is told from those before the reset
    flown.reset()
    flown.fly(0.1)
    place = flown.grab([0.0, 0.0, 0.07])
    flown.pull(place + [0.0, 0.1, 0.0])
    flown.fly(0.1)
    said = flown.said
    flown.until(lambda: any("ghost continues without" in text and "free_body" in text for text in said), "word of it")


def slider_below(flown: FlownPage, label: str):
    """The slider that is added right after an input."""
    widgets = list(flown._widgets())
    return widgets[next(k for k, w in enumerate(widgets) if getattr(w, "label", None) == label) + 1]


@pytest.mark.parametrize("label, of", [("Size ×", "scale"), ("Mass ×", "mass"), ("Force ×", "")])
def test_a_factors_box_holds_the_factor_itself_and_its_slider_the_logarithm(flown, label: str, of: str) -> None:
    page, box, slider = flown.page, flown.widget(label), slider_below(flown, label)
    body = page.scenes.scenario.setup.body

    def factor() -> float:
        if of == "":
            return page.tools.force / page.tools.usual_force
        now = page.scenes.scenario.setup.body
        return now.scale[0] / body.scale[0] if of == "scale" else now.mass / body.mass

    assert box.value == "1" and slider.value == (0.0,)
    flown.set(label, "2")
    assert factor() == pytest.approx(2.0, rel=1e-8)
    assert slider.value == pytest.approx((0.3,), abs=0.002)
    flown._update(slider, (-1.0,))
    assert factor() == pytest.approx(0.1, rel=1e-2) and float(box.value) == pytest.approx(0.1, rel=1e-2)
    before = factor()
    flown.set(label, "two")
    flown.until(lambda: flown.said, "word of what can't be read")
    assert "'two'" in flown.said[0] and "a number" in flown.said[0]
    assert factor() == before and float(box.value) == pytest.approx(before, rel=1e-3)


def test_a_size_is_set_to_the_digit_and_one_refused_is_told_as_it_was_typed(flown: FlownPage) -> None:
    for factor in ("1e-6", "0.3", "7", "1"):
        flown.set("Size ×", factor)
    assert list(flown.page.scenes.scenario.setup.body.scale) == [1.0, 1.0, 1.0]
    flown.set("Size ×", "0.3")
    flown.set("Size ×", "1e12")
    flown.until(lambda: flown.said, "a refusal")
    assert "got [1000000000000.0, " in flown.said[0] and "<= 1e+09" in flown.said[0]


def test_the_ballast_form_shows_the_prepared_weight_at_its_place(flown: FlownPage) -> None:
    flown.do(lambda: flown.link.set_parameters({"ballast.tip": [0.0, 0.0, 0.0, 0.07]}))
    flown.wait_until_still()
    assert [flown.widget(label).value for label in ("Weight", "Its mass [kg]", "At x y z")] == ["tip", "0", "0 0 0.07"]
    flown.set("Its mass [kg]", "heavy")
    flown.press("Put it there")
    assert len(flown.said) == 1 and "'heavy'" in flown.said[0]


def test_a_lesson_begins_when_the_page_is_there_to_show_it(flown: FlownPage, monkeypatch) -> None:
    class Aloft(FlownLink):
        def __init__(self, *arguments) -> None:
            super().__init__(*arguments)
            self.set_parameters({"ghost.inertia_model": "bounding_box"})
            super().call("reset")
            self.fly(5.0)

    monkeypatch.setattr(page_module, "RosLink", Aloft)
    late = FlownPage(anew=True)
    try:
        late.until(lambda: late.link.rows[0][0] == 0, "flight that begins")
        late.fly(0.1)
        ghost, _ = late.until(
            lambda: (ghost := late.page.follower.ghost_row(late.page.scenes.scenario, None))[0] is not None and ghost,
            "ghost",
        )
        assert np.abs(ghost[:3] - late.page.follower.state.row[:3]).max() < 1e-3
    finally:
        late.end()


def test_one_click_shows_body_and_ghost_released_alike_and_the_angle_that_grows_between_them(flown: FlownPage) -> None:
    shown = flown.page.side_by_side
    assert not shown.sentence
    flown.press("True tensor against its box's")
    angles = []
    for _ in range(4):
        flown.fly(0.25)
        angles.append(flown.until(lambda: shown.angle, "angle between the two"))
    assert np.all(np.diff(angles) > 0.0) and np.degrees(angles[-1]) > 10.0
    degrees = f"**{np.degrees(angles[-1]):.0f}° apart**"
    flown.until(lambda: degrees in shown.sentence, "the number")
    assert (
        "only the tensor differs" in shown.sentence
        and flown.page.scenes.scenario.parameters.inertia_model_com == "solid"
    )
    assert shown.sentence.startswith("Started alike") and "After 1.0 s" in shown.sentence
    flown.pick("One book, three throws")
    flown.until(lambda: not shown.sentence, "end of the comparison")
    # A ghost that comes in flight wasn't released with the body.
    flown.fly(2.0)
    flown.set("Its tensor", "bounding_box")
    flown.fly(0.5)
    flown.until(lambda: "0.5 s later" in shown.sentence, "the comparison since then")
    assert shown.sentence.startswith("Alike at 2.0 s")
