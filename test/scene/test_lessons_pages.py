# SPDX-License-Identifier: MIT
"""The lessons' pages: complete, at one with their scenes, true in what they say beyond these; and the notebook runs."""

from __future__ import annotations

import json
import math
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from lesson_flights import Z, degrees_between, fly

import rigid_proto_ros
from rigid_proto_ros.base.bundled import example_names, scene_names
from rigid_proto_ros.scene.lessons import lesson, lessons
from rigid_proto_ros.scene.scenario import nanoseconds, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.script import parse_script
from rigid_proto_ros.simulation.simulation import Simulation

PAGES = Path(rigid_proto_ros.__file__).resolve().parent.parent / "docs" / "lessons"
pytestmark = pytest.mark.skipif(not PAGES.is_dir(), reason="not run from a source tree")

SECTIONS = ("What to see", "Why", "What to change next")


@pytest.mark.parametrize("name", scene_names())
def test_every_scene_is_a_lesson_and_has_a_page_with_its_title_a_command_a_picture_and_a_reason(name: str) -> None:
    one = lesson(name)
    assert 8 < len(one.title) < 60 and not one.title.endswith(".")
    assert one.question.endswith("?") and len(set(one.choices)) == 3 and one.answer in range(3)
    assert all(20 < len(sentence) < 200 for sentence in one.sentences) and one.sentences[-1].endswith(".")
    assert len(one.reason) > 60
    answer = one.choices[one.answer].rstrip(".").lower()
    assert not any(answer in text.lower() for text in (one.title, one.question, *one.sentences)), (
        "the answer is given away"
    )
    assert f"rigid_proto simulate config/{name}.yaml" in one.commands
    assert not one.script or one.script in example_names()
    text = (PAGES / f"{name}.md").read_text("utf-8")
    assert text.startswith(f"# {one.title}\n")
    assert all(sentence in text for sentence in one.sentences)
    assert f"rigid_proto simulate config/{name}.yaml" in text
    assert [line[3:] for line in text.splitlines() if line.startswith("## ")] == list(SECTIONS)
    assert f"]({name}.png)" in text
    picture = PAGES / f"{name}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert 30_000 < picture.stat().st_size < 250_000


def test_there_is_no_page_without_a_scene_and_no_title_twice() -> None:
    assert len({one.title for one in lessons()}) == len(scene_names())
    assert sorted(page.stem for page in PAGES.glob("*.md") if page.stem != "README") == scene_names()


def test_the_notebook_runs_from_top_to_bottom(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(PAGES)
    notebook = json.loads((PAGES / "inertia.ipynb").read_text("utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 7
    names = {"__name__": "__main__"}
    for cell in cells:
        exec(cell, names)


def pushed(scene: str, at: str, impulse: list[float], seconds: float = 0.01, **changes) -> Simulation:
    """A scene pushed at time 0."""
    run = OfflineRun(read_scene(scene, changes), parse_script(f"- {{t: 0.0, at: {at}, impulse: {impulse}}}"))
    assert run.advance(nanoseconds(seconds))
    return run.simulation


AT_REST = {"initial.angular_velocity": [0.0, 0.0, 0.0]}


def test_hammer_pushed_at_head_and_grip_moves_alike_and_spins_otherwise() -> None:
    head, grip = (pushed("hammer", at, [0.1, 0.0, 0.0], **AT_REST).state for at in ("head", "grip"))
    assert np.array_equal(head.linear_velocity, grip.linear_velocity)
    assert head.angular_velocity[1] * grip.angular_velocity[1] < 0.0
    assert abs(grip.angular_velocity[1] / head.angular_velocity[1]) > 4.0


def test_hollow_box_spins_up_slower_than_the_full_one_of_its_mass() -> None:
    hollow, full = (
        pushed("hollow_box", "corner", [0.0, 0.05, 0.0], inertia_model=model, **AT_REST)
        for model in ("solid", "bounding_box")
    )
    assert np.allclose(hollow.state.linear_velocity, full.state.linear_velocity, rtol=1e-12)
    assert np.linalg.norm(hollow.state.angular_velocity) < 0.75 * np.linalg.norm(full.state.angular_velocity)
    more = hollow.setup.body.principal_moments / full.setup.body.principal_moments - 1.0
    assert [round(100.0 * float(x)) for x in more] == [58, 37, 36]


def test_teapot_leaves_at_one_speed_and_spins_otherwise_from_each_point_as_its_page_says() -> None:
    spins = {"spout": 5.0, "handle": 4.1, "knob": 3.9, "com": 0.0}
    states = [pushed("teapot", at, [0.0, 0.1, 0.0], 1.0).state for at in spins]
    assert np.ptp([state.linear_velocity for state in states[:3]], axis=0).max() == 0.0
    for state, spin in zip(states, spins.values(), strict=True):
        assert state.linear_velocity[1] == pytest.approx(0.094, abs=1e-3)
        assert np.linalg.norm(state.angular_velocity) == pytest.approx(spin, abs=0.05)
    for one, other in combinations(states[:3], 2):
        assert np.linalg.norm(one.angular_velocity - other.angular_velocity) > 1.0


@pytest.mark.parametrize("spin, lean", [(30.0, "3.7"), (60.0, "1.9")])
def test_spinning_top_leans_sideways_by_the_push_over_its_momentum(spin: float, lean: float) -> None:
    scenario = read_scene("spinning_top", {"initial.angular_velocity": [0.0, 0.0, spin]})
    run = OfflineRun(scenario, parse_script("- {t: 0.1, at: stem, impulse: [0.001, 0, 0]}"))
    body = run.simulation.setup.body
    across, _, along = body.principal_moments
    impulse, momentum = 0.001 * (0.075 - body.center_of_mass[2]), along * spin
    # Ten whole turns of the axis about L: the mean of its directions is that of L.
    period = 2.0 * math.pi * across / math.hypot(impulse, momentum)
    stems = []
    for k in range(1000):
        run.advance(nanoseconds(0.1 + 0.01 * k * period))
        stems.append(run.simulation.state.rotation[:, 2])
    forward, sideways, up = np.mean(stems, axis=0)
    angle = math.atan2(sideways, up)
    assert angle == pytest.approx(math.atan2(impulse, momentum), rel=1e-5)
    assert abs(forward) < 1e-5
    assert f"{math.degrees(angle):.1f}" == lean
    assert f"{lean}°" in (PAGES / "spinning_top.md").read_text("utf-8")


@pytest.mark.parametrize("scene, axis", [("book", 0), ("tennis_racket", 1), ("t_handle", 2)])
def test_bodies_turn_over_at_the_times_that_their_pages_say(scene: str, axis: int) -> None:
    said = re.search(r"at ([0-9.]+(?:,\s[0-9.]+)*)\sand\s([0-9.]+)\ss\b", (PAGES / f"{scene}.md").read_text("utf-8"))
    flips = fly(scene, 10.0, interval_s=0.001).flips(axis)
    assert [f"{time_s:.1f}" for time_s in flips] == [*said[1].replace(",", " ").split(), said[2]]


def test_top_at_rest_is_turned_over_by_the_same_push() -> None:
    run = OfflineRun(read_scene("spinning_top", AT_REST), parse_script("- {t: 0.1, at: stem, impulse: [0.001, 0, 0]}"))
    lowest = 1.0
    for k in range(100):
        run.advance(nanoseconds(0.1 + 0.01 * k))
        lowest = min(lowest, run.simulation.state.rotation[2, 2])
    assert lowest < -0.9


@pytest.mark.parametrize("scene, axis", [("book", 0), ("tennis_racket", 1), ("t_handle", 2)])
def test_bad_throws_look_calm_without_the_gyroscopic_term(scene: str, axis: int) -> None:
    flight = fly(scene, 10.0, gyroscopic=False)
    assert len(flight.flips(axis)) == 0
    assert degrees_between(flight.spin, flight.spin[0]).max() < 1e-6


def test_a_wider_book_has_no_middle_axis() -> None:
    flight = fly("book", 10.0, scale=[1.391, 1.0, 1.0])
    moments = flight.body.principal_moments
    assert moments[1] / moments[0] == pytest.approx(1.0, abs=0.03)
    assert len(flight.flips(0)) == 0


def test_t_handle_started_closer_to_its_axis_flips_later_by_the_logarithm() -> None:
    near = fly("t_handle", 10.0, initial__angular_velocity=[0.0005, 0.001, 12.0]).flips(2)[0]
    assert near - fly("t_handle", 3.0).flips(2)[0] == pytest.approx(math.log(100.0) / 4.93, abs=0.03)


@pytest.mark.parametrize(("step", "energy", "momentum"), [(0.016666667, 2.13, 1.46), (0.001, 1.04, 1.02)])
def test_t_handle_gains_energy_and_momentum_by_the_method_of_game_engines(
    step: float, energy: float, momentum: float
) -> None:
    flight = fly("t_handle", 10.0, integrator="semi_implicit_euler", step=step)
    size = np.linalg.norm(flight.momentum, axis=1)
    assert flight.energy[-1] / flight.energy[0] == pytest.approx(energy, abs=0.005)
    assert size[-1] / size[0] == pytest.approx(momentum, abs=0.005)


def test_l_bracket_has_its_momentum_15_degrees_off_z_and_no_principal_axis_along_its_drawing() -> None:
    flight = fly("l_bracket", 0.01)
    assert degrees_between(flight.momentum, Z)[0] == pytest.approx(15.0, abs=0.1)
    _, axes = np.linalg.eigh(flight.body.inertia)
    assert np.abs(axes).max() < math.cos(math.radians(1.0))


def test_hammers_box_has_the_moment_about_the_handle_91_per_cent_too_large() -> None:
    flight = fly("hammer", 0.01)
    true, box = flight.body, fly("hammer", 0.01, inertia_model="bounding_box").body
    assert box.principal_moments[0] / true.principal_moments[0] == pytest.approx(1.91, abs=0.005)
    apart = np.linalg.norm(true.center_of_mass - box.center_of_mass)
    assert apart == pytest.approx(0.081, abs=5e-4)
    assert apart / np.linalg.norm(flight.simulation.setup.surface.extent) == pytest.approx(0.23, abs=0.005)
