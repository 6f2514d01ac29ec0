# SPDX-License-Identifier: MIT
"""Every step of every lesson, carried out on the page as its sentence says: each gets its mark. What the motion then
shows is in test_lessons.py and test_lessons_pages.py.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from flown_page import FlownPage, without_waiting

from rigid_proto_ros.base.bundled import scene_names
from rigid_proto_ros.picture import style
from rigid_proto_ros.workbench import readouts
from rigid_proto_ros.workbench.lessons import COURSES, FREE, LessonProgress
from rigid_proto_ros.workbench.panel import PATHS


class User(FlownPage):
    """What a lesson asks of its user, in the words of STEPS."""

    def throw(self, spin: str) -> None:
        """Another initial spin, and a reset."""
        self.set("Initial spin [rad/s]", spin)
        self.reset()

    def push(self, *point: float) -> None:
        """Click at a mesh point from aside, and wait until the poke is over."""
        self.click(point, self.page.state.rotation @ [-0.3, -0.8, -0.5])
        self.fly(0.06)

    def push_com(self) -> None:
        """A click on the mark of the centre of mass, which may lie where there is no body."""
        mark = self.page._com
        assert mark.visible and mark._impl.click_cb and mark._impl.drag_cb, "it lies before the body"
        self.act({"force": [0.0, 0.0, -self.page.pointer.force]})
        self.fly(0.06)

    def drag(self, *point: float) -> None:
        """Grab it there, drag it about, let go."""
        place = self.grab(point)
        for k in range(4):
            self.pull(place + 0.25 * np.array([np.cos(0.8 * k), np.sin(0.8 * k), 0.1 * k]))
            self.fly(0.1)
        assert self.live.loop.simulation.string is not None
        self.let_go()
        assert self.live.loop.simulation.string is None

    def set_model(self, model: str) -> None:
        self.set("Model", model)

    def set_gyroscopic(self, on: bool) -> None:
        self.set("Gyroscopic term ω × Iω", on)

    def set_ballast(self, values: str) -> None:
        """The lesson's own weight is offered first."""
        assert self.widget("Parameter").value == "ballast.tip"
        self.set("Value", values)
        assert self.scenario.parameters.ballast["tip"][0] == float(values.split()[0])

    def set_density(self, density: str) -> None:
        self.set("Density [kg/m³]", density)
        self.reset()

    def tie(self, place: str) -> None:
        self.set("Parameter", "string.attach")
        self.set("Value", place)

    def gravity_off(self) -> None:
        self.set("Gravity", "none")
        assert not self.scenario.setup.gravity.any()

    def see_axes(self) -> None:
        self.set("Principal axes", True)
        arrows = self.page.backend._nodes[style.PRINCIPAL_AXES]
        vectors = arrows.points[:, 1] - arrows.points[:, 0]
        drawn = vectors / np.linalg.norm(vectors, axis=1)[:, None]
        assert arrows.visible and np.abs(drawn).max() < np.cos(np.radians(1.0)), "an axis of the drawing"

    def see_paths(self) -> None:
        assert self.widget(PATHS).value
        self.fly(1.0)
        com, grip = (np.array(self.page.backend._paths[name]) for name in (style.COM_TRAIL, style.TRAIL))
        miss = [float(np.abs(np.polyval(np.polyfit(x, z, 2), x) - z).max()) for x, _, z in (com.T, grip.T)]
        # Points of the drawn path lie on chords between states 0.01 s apart: g dt²/8 is 1.2e-4 m.
        assert miss[0] < 2e-4 and miss[1] > 0.1, "the centre of mass flies a parabola, and the grip doesn't"

    def see_ghost(self) -> None:
        most = 0.0
        for _ in range(8):
            self.fly(1.0)
            most = max(most, float(self.page.readings.values[readouts.GHOST_ANGLE].rstrip("°")))
        assert most > 90.0

    def compare(self, *words: str) -> None:
        """Words of the table of tensors."""
        assert all(word in self.page.body_tab._table.content for word in words), self.page.body_tab._table.content


STEPS: dict[str, tuple[tuple[tuple, ...], ...]] = {
    "ballast_stops_flip": (
        (("fly", 4.1),),
        (("set_ballast", "0.03 0 0 0.07"), ("fly", 4.1)),
        (("set_ballast", "0 0 0 0.07"), ("fly", 4.1)),
    ),
    "book": (
        (("fly", 3.1),),
        (("throw", "0 8 0"), ("fly", 2.1)),
        (("set_gyroscopic", False), ("throw", "8 0.05 0.05"), ("fly", 2.1)),
    ),
    "com_or_rim": ((("push_com",),), (("reset",), ("push", 0.68, 0.0, 0.0)), (("fly", 1.1),)),
    "dropped_term": (
        (("fly", 2.1),),
        (("set_gyroscopic", True), ("fly", 2.1)),
        (("set_gyroscopic", False), ("fly", 2.1)),
    ),
    "hammer": (
        (("fly", 1.1),),
        (("set_model", "bounding_box"), ("fly", 1.1)),
        (("set_model", "solid"), ("push", 0.06, 0.0, 0.29), ("push", 0.0, 0.0, 0.01)),
    ),
    "hollow_box": (
        (("push", 0.095, 0.045, 0.025),),
        (("reset",), ("set_model", "bounding_box"), ("push", 0.095, 0.045, 0.025)),
        (("compare", "solid (true)", "| I₁", "| I₃"), ("fly", 1.1)),
    ),
    "l_bracket": ((("fly", 1.0),), (("see_axes",),), (("set_gyroscopic", False), ("fly", 2.1))),
    "plumb_line": (
        (("fly", 20.1),),
        (("tie", "-0.08 0 0"), ("fly", 20.1)),
        (("push", 0.05, 0.08, 0.0),),
    ),
    "spinning_top": (
        (("push", 0.0, 0.0, 0.07),),
        (("throw", "0 0 60"), ("push", 0.0, 0.0, 0.07)),
        (("throw", "0 0 0"), ("push", 0.0, 0.0, 0.07)),
    ),
    "t_handle": ((("fly", 4.1),), (("push", 0.0, 0.0, 0.068), ("fly", 2.1)), (("drag", 0.0, 0.045, 0.0), ("fly", 1.1))),
    "teapot": (
        (("push", 0.12, 0.0, 0.095),),
        (("reset",), ("push", -0.125, 0.0, 0.0745), ("reset",), ("push", 0.0, 0.0, 0.138)),
        (("reset",), ("push_com",)),
    ),
    "tennis_racket": (
        (("fly", 3.1),),
        (("throw", "6 0.03 0.03"), ("throw", "0.03 0.03 6"), ("fly", 2.1)),
        (("set_gyroscopic", False), ("throw", "0.03 6 0.03"), ("fly", 2.1)),
    ),
    "thrown_hammer": ((("see_paths",),), (("throw", "3 -5 20"), ("fly", 1.02)), (("gravity_off",), ("fly", 1.0))),
    "top_on_string": (
        (("fly", 2.1),),
        (("throw", "0 -300 0"), ("fly", 2.1)),
        (("throw", "0 0 0"), ("fly", 1.1)),
    ),
    "true_or_box_tensor": (
        (("see_ghost",),),
        (("set_model", "bounding_box"), ("reset",), ("fly", 1.1)),
        (("compare", "+37.8 %", "-23.4 %", "-12.9 %", "0.0244 m"), ("fly", 1.1)),
    ),
    "weigh_by_throwing": (
        (("set_density", "7000"), ("fly", 2.1)),
        (("push", 0.07, 0.1, 0.0138), ("fly", 1.0)),
        (("set_density", "700"), ("push", 0.07, 0.1, 0.0138)),
    ),
}
"""What is done for each sentence: methods of User and their arguments."""


@pytest.fixture(scope="module")
def user() -> Iterator[User]:
    with without_waiting():
        user = User()
        yield user
        user.end()


def test_every_sentence_of_every_lesson_has_a_step() -> None:
    assert sorted(STEPS) == scene_names() == sorted(COURSES)
    assert {len(course.steps) for course in COURSES.values()} == {3}
    assert {len(steps) for steps in STEPS.values()} == {3}


@pytest.mark.parametrize("name", sorted(STEPS))
def test_every_step_of_the_lesson_can_be_done_on_the_page_and_gets_its_mark(user: User, name: str) -> None:
    user.set("Lesson", FREE)
    user.said.clear()
    user.pick(name)
    text = user.page.lessons._text
    assert text.content.count("✓") == 0
    for done, step in enumerate(STEPS[name], 1):
        for what, *arguments in step:
            getattr(user, what)(*arguments)
        user.fly(0.02)
        user.until(lambda done=done: text.content.count("✓") == done, f"mark at step {done}, nor at that alone")
    assert not user.said


def test_a_step_that_sets_or_shows_something_names_the_tab(user: User) -> None:
    lessons, named = user.page.lessons, {}
    for name, course in COURSES.items():
        lessons.name(name)
        for step, whats in enumerate(course.steps):
            for label in (what.split(".")[0] for what in whats if what.startswith(("set ", "show "))):
                named.setdefault(lessons._where(step), set()).add(label)
    user.set("Lesson", FREE)
    assert named == {
        " *(tab Body)*": {"set density", "set inertia_model"},
        " *(tab Forces)*": {"set ballast", "set gravity", "set gyroscopic", "set initial", "set string"},
        " *(tab Show)*": {"show Principal axes"},
    }


def test_time_that_jumps_was_not_watched_and_another_lesson_begins_without_marks() -> None:
    progress = LessonProgress()
    progress.begin("t_handle")
    for time_s in (0, 10, 20, 5, 30):
        progress.watched(time_s * 10**9)
    assert progress.done == 0
    for k in range(42):
        progress.watched((300 + k) * 10**8)
    assert progress.done == 1
    progress.begin("book")
    assert progress.done == 0


def test_a_drag_is_done_when_the_body_is_released_and_not_by_a_reset(user: User) -> None:
    user.pick("t_handle")
    user.fly(4.1)
    user.push(0.0, 0.0, 0.068)
    user.fly(2.1)
    text = user.page.lessons._text
    assert text.content.count("✓") == 2
    for end in (user.reset, user.let_go):
        place = user.grab((0.0, 0.045, 0.0))
        for _ in range(2):
            user.pull(place + [0.0, 0.1, 0.0])
            user.fly(0.8)
        assert user.page.pointer.dragging
        assert text.content.count("✓") == 2
        end()
        user.fly(1.1)
        assert text.content.count("✓") == (3 if end == user.let_go else 2)


def test_factors_are_those_of_the_body_that_a_lesson_begins_with(user: User) -> None:
    for name in ("com_or_rim", "weigh_by_throwing"):
        user.pick(name)
        user.fly(0.1)
        assert user.widget("Mass ×").value == user.widget("Size ×").value == (0.0,)
        user.set("Mass ×", (0.3,))
        user.set("Size ×", (-0.1,))
        user.fly(0.1)
        user.reset()
        assert (user.widget("Mass ×").value, user.widget("Size ×").value) == ((0.3,), (-0.1,))


def test_beginning_a_lesson_is_no_action_of_its_user(user: User) -> None:
    # The lesson before has another density, which the first step here asks to change.
    for name in ("t_handle", "weigh_by_throwing"):
        user.pick(name)
        user.fly(0.1)
    assert user.scenario.parameters.density == 700.0
    user.fly(3.0)
    assert "✓" not in user.page.lessons._text.content
    user.set_density("7000")
    user.fly(2.1)
    assert user.page.lessons._text.content.count("✓") == 1
    user.press("Begin again")
    user.until(lambda: user.page.lessons._asked, "question")
    user.do(lambda: user.page.lessons.answer(0))
    user.fly(3.0)
    assert user.scenario.parameters.density == 700.0
    assert "✓" not in user.page.lessons._text.content


def test_going_on_from_the_past_is_no_action_of_a_step(user: User) -> None:
    user.pick("top_on_string")
    user.fly(2.1)
    text = user.page.lessons._text
    assert text.content.count("✓") == 1
    user.do(lambda: user.page.flight.look_at(1.0))
    user.until(lambda: user.page._drawn_moment_ns is not None, "past")
    user.do(user.page.flight.go_on_from_here)
    user.fly(2.5)
    assert user.scenario.parameters.initial.angular_velocity != (0.0, -600.0, 0.0)
    assert text.content.count("✓") == 1


@pytest.mark.parametrize(
    "name, before, after",
    [
        ("spinning_top", ("poke",), ("poke", "set initial.angular_velocity", "reset", "poke")),
        ("com_or_rim", ("poke com",), ("poke away", "reset", "poke away")),
        ("hollow_box", ("poke",), ("poke", "set inertia_model", "reset", "poke")),
        ("true_or_box_tensor", None, ("reset", "set inertia_model", "reset")),
    ],
)
def test_a_push_or_a_reset_before_its_turn_does_not_count(name, before, after) -> None:
    progress = LessonProgress()
    progress.begin(name)
    for what in before or ():
        progress.did(what)
    for time_s in range(21) if before is None else ():
        progress.watched(time_s * 10**8)
    progress.watched(0)
    assert progress.done == 1
    *first, last = after
    for what in first:
        progress.did(what)
        for k in range(1, 21):
            progress.watched(k * 10**8)
        progress.watched(0)
        assert progress.done == 1, what
    progress.did(last)
    for k in range(1, 11):
        progress.watched(k * 10**8)
    assert progress.done >= 2
