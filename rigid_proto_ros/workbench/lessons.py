# SPDX-License-Identifier: MIT
"""Lessons on the page: a question, then steps to try, with the quantities that the lesson is about. What each lesson
needs from the page, and which of its steps have been completed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import viser

from ..base.bundled import example_path
from ..picture import style
from ..scene.lessons import Lesson, lessons
from ..scene.scenario import Scenario
from .flight import Flight
from .panel import CENTRE_OF_MASS, PATHS, SEE_INTO
from .readouts import (
    COM_PLACE,
    DRIFT,
    ENERGY,
    GHOST_ANGLE,
    MOMENTUM,
    NUMBERS_S,
    ROTATIONAL,
    SPEED,
    SPIN,
    SPINS,
    TRANSLATIONAL,
    Readings,
    html_table,
)
from .server import ANSWERS

TURN = "set initial.angular_velocity"

ALONE = "watch 1"

IN_BODY = ("set density", "set inertia_model")
"""Of what steps set, that which is in the tab Body; the rest is in Forces."""


@dataclass(frozen=True)
class Course:
    """steps: one for each of the lesson's sentences, a tuple of the actions that complete it: ``poke``, ``poke com``,
    ``poke away``, ``drag`` and ``reset``, ``set NAME`` for a parameter, ``show NAME`` for a switch, in this order, then
    ``watch SECONDS`` of simulated time. Parameters and switches may be set before their turn.

    numbers: the readouts shown with the lesson. shows: switches, or parts, that are on. labels: the parts and contacts
    with a label in the picture, at most three; an arrow without a label isn't drawn. speed: simulated seconds per
    second. reveals: switches that are turned on when the question is answered.
    """

    steps: tuple[tuple[str, ...], ...]
    numbers: tuple[str, ...] = (SPIN, SPINS, ENERGY, MOMENTUM, DRIFT)
    shows: tuple[str, ...] = ()
    labels: tuple[str, ...] = (style.MOMENTUM,)
    speed: float = 1.0
    reveals: tuple[str, ...] = ()


PUSHED = (SPEED, SPIN, TRANSLATIONAL, ROTATIONAL, MOMENTUM)
THREE_THROWS = (("watch 3",), (TURN, "reset", "watch 2"), (TURN, "set gyroscopic", "reset", "watch 2"))

COURSES = {
    "ballast_stops_flip": Course(
        (("watch 4",), ("set ballast.tip", "watch 4"), ("set ballast.tip", "watch 4")),
        labels=(style.MOMENTUM, "tip"),
    ),
    "book": Course(THREE_THROWS),
    "com_or_rim": Course((("poke com",), ("reset", "poke away"), (ALONE,)), PUSHED, (CENTRE_OF_MASS,), labels=("rim",)),
    "dropped_term": Course(
        (("watch 2",), ("set gyroscopic", "watch 2"), ("set gyroscopic", "watch 2")),
        (DRIFT, ENERGY, MOMENTUM, SPIN, SPINS),
        labels=(style.MOMENTUM, style.OMEGA),
    ),
    "hammer": Course(
        ((ALONE,), ("set inertia_model", ALONE), ("set inertia_model", "poke", "poke")),
        (SPEED, SPIN, COM_PLACE, ENERGY, MOMENTUM),
        (SEE_INTO,),
        (style.MOMENTUM, "head", "grip"),
        reveals=(CENTRE_OF_MASS,),
    ),
    "hollow_box": Course(
        (("poke",), ("reset", "set inertia_model", "poke"), (ALONE,)),
        (SPIN, SPEED, ROTATIONAL, MOMENTUM, ENERGY),
        (SEE_INTO,),
        (style.MOMENTUM, "corner"),
    ),
    "l_bracket": Course(
        (("watch 0.9",), ("show Principal axes",), ("set gyroscopic", "watch 2")),
        (SPIN, SPINS, DRIFT, MOMENTUM, ENERGY),
        labels=(style.MOMENTUM, style.OMEGA),
    ),
    "plumb_line": Course(
        (("watch 20",), ("set string.attach", "watch 20"), ("poke",)),
        (SPEED, SPIN, ENERGY, COM_PLACE),
        (SEE_INTO, style.STRING_LINE),
        (),
        reveals=(CENTRE_OF_MASS,),
    ),
    "spinning_top": Course(
        (("poke",), (TURN, "reset", "poke"), (TURN, "reset", "poke")),
        (SPIN, SPINS, MOMENTUM, ENERGY, SPEED),
        (style.PRINCIPAL_AXES,),
        (style.MOMENTUM, "stem"),
    ),
    "t_handle": Course(
        (("watch 4",), ("poke", "watch 2"), ("drag", ALONE)),
        labels=(style.MOMENTUM, "tip"),
    ),
    "teapot": Course(
        (("poke",), ("reset", "poke", "reset", "poke"), ("reset", "poke com")), PUSHED, (CENTRE_OF_MASS, SEE_INTO), ()
    ),
    "tennis_racket": Course(THREE_THROWS),
    "thrown_hammer": Course(
        (("watch 0.5",), (TURN, "reset", "watch 0.5"), ("set gravity", "watch 0.2")),
        (COM_PLACE, SPEED, SPIN, ENERGY, MOMENTUM),
        (PATHS,),
        (),
        0.1,
    ),
    "top_on_string": Course(
        (("watch 2",), (TURN, "reset", "watch 2"), (TURN, "reset", ALONE)),
        (SPIN, SPEED, MOMENTUM, ENERGY, COM_PLACE),
        (style.PRINCIPAL_AXES,),
    ),
    "true_or_box_tensor": Course(
        (("watch 2",), ("set inertia_model", "reset", ALONE), (ALONE,)),
        (GHOST_ANGLE, SPIN, SPINS, ENERGY, DRIFT),
    ),
    "weigh_by_throwing": Course(
        (("set density", "reset", "watch 2"), ("poke", "watch 0.5"), ("set density", "reset", "poke")),
        (SPEED, SPIN, SPINS, ENERGY, MOMENTUM),
        labels=(style.MOMENTUM, "corner"),
    ),
}
"""By the lesson's name."""

NO_LESSON = Course(())

LONGEST_NS = 500_000_000
"""[ns] Longest time between two watched states; a longer one, or a step back, starts the watching again."""


class LessonProgress:
    """done: how many steps of the present lesson have been completed, one after the other."""

    def __init__(self) -> None:
        self.done = 0
        self._steps: tuple[tuple[str, ...], ...] = ()
        self._open: list[str] = []
        self._watch_ns = 0.0
        self._last_ns: int | None = None

    def begin(self, lesson: str) -> None:
        """Start another lesson, or restart the same one; empty for none."""
        self._steps = COURSES.get(lesson, NO_LESSON).steps
        self._go_to(0)

    def _go_to(self, step: int) -> None:
        self.done = step
        self._open, self._watch_ns = [], 0.0
        for what in self._steps[step] if step < len(self._steps) else ():
            if what.startswith("watch "):
                self._watch_ns = 1e9 * float(what.removeprefix("watch "))
            else:
                self._open.append(what)

    def did(self, what: str) -> bool:
        """Note an action; returns whether it completes a step."""
        if what not in self._open[:1] and not (what.startswith(("set ", "show ")) and what in self._open):
            return False
        self._open.remove(what)
        return self._completed()

    def watched(self, time_ns: int) -> bool:
        """Note that the body was shown at this simulated time; returns whether that completes a step."""
        before, self._last_ns = self._last_ns, time_ns
        if before is None or self._open or self._watch_ns <= 0.0 or not 0 < time_ns - before <= LONGEST_NS:
            return False
        self._watch_ns -= time_ns - before
        return self._completed()

    def _completed(self) -> bool:
        if self._open or self._watch_ns > 0.0:
            return False
        self._go_to(self.done + 1)
        return True


# The panel

FREE = "– (no lesson)"

SPACE = f'<div class="{ANSWERS}"></div>'
"""Empty space for answers on a printed page."""


class LessonPanel:
    """on_lesson(course) is called when a lesson begins or ends; reveal(names) with the switches that its answer turns
    on; for_class(on) when class mode, which shows only picture, lesson and three buttons, begins or ends.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        flight: Flight,
        readings: Readings,
        on_lesson: Callable[[Course], None],
        reveal: Callable[[Sequence[str]], None],
        for_class: Callable[[bool], None],
    ) -> None:
        self._flight = flight
        self._readings = readings
        self._on_lesson = on_lesson
        self._reveal = reveal
        self._lessons: dict[str, Lesson] = {lesson.title: lesson for lesson in lessons()}
        self._progress = LessonProgress()
        self._guess: int | None = None
        self._asked = False
        self._due_s = 0.0
        with tabs.add_tab("Lesson"):
            choice: Any = gui.add_dropdown("Lesson", (FREE, *self._lessons), initial_value=FREE)
            self._text = gui.add_markdown("")
            self._choices: list[Any] = [gui.add_button(letter, visible=False) for letter in "ABC"]
            self._numbers = gui.add_html("")
            self._script = gui.add_button("Do it with exact forces", visible=False, hint="Run the lesson's script")
            self._again = gui.add_button("Begin again", visible=False, hint="Restart the lesson")
            # In this tab, since class mode hides the others.
            self._class: Any = gui.add_checkbox("Class mode", False, hint="Large letters; F11 for full screen")
            gui.add_html(SPACE)
        self._choice = choice

        async def choose(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self.begin()

        choice.on_update(choose)

        @self._script.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            lesson = self.lesson
            if lesson is not None and lesson.script:
                await self._fly(lesson, example_path(lesson.script).read_text("utf-8"), False)

        async def for_class_mode(_: viser.GuiEvent[Any]) -> None:
            for_class(self._class.value)
            self._show_buttons()

        self._class.on_update(for_class_mode)

        @self._again.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self.begin()

        for number, button in enumerate(self._choices):

            async def answer(_: viser.GuiEvent[Any], number: int = number) -> None:
                self.answer(number)

            button.on_click(answer)

    @property
    def lesson(self) -> Lesson | None:
        """The lesson that is shown, or None."""
        return self._lessons.get(str(self._choice.value))

    @property
    def course(self) -> Course:
        """What the lesson that is shown needs from the page."""
        lesson = self.lesson
        return NO_LESSON if lesson is None else COURSES.get(lesson.name, NO_LESSON)

    def name(self, name: str) -> None:
        """Choose the lesson of a bundled scene."""
        self._choice.value = next(title for title, lesson in self._lessons.items() if lesson.name == name)

    def leave(self) -> None:
        """Leave the lesson, since another body is simulated."""
        self._choice.value = FREE
        self.show()

    def show(self) -> None:
        """Show the chosen lesson, whose scene is already simulated, beginning with its question."""
        lesson = self.lesson
        self._guess, self._asked = None, lesson is not None
        self._show_buttons()
        self._progress.begin("" if lesson is None else lesson.name)
        self._on_lesson(self.course)
        self._show_text()

    def _show_buttons(self) -> None:
        lesson, alone = self.lesson, bool(self._class.value)
        self._choice.visible = not alone
        self._script.visible = lesson is not None and bool(lesson.script) and not alone
        self._again.visible = lesson is not None and not alone

    async def begin(self) -> None:
        """Begin the chosen lesson, or leave the body alone."""
        lesson = self.lesson
        if lesson is None:
            self.show()
        else:
            await self._fly(lesson, "", True)

    async def _fly(self, lesson: Lesson, script: str, asks: bool) -> None:
        course = COURSES.get(lesson.name, NO_LESSON)
        if await self._flight.fly(lesson.path.read_text("utf-8"), script, paused=asks, speed=course.speed):
            self.show()
            if not asks:
                self.answer(None)

    def answer(self, choice: int | None) -> None:
        """Note the guess, or None, and let the motion show the answer."""
        if self._asked:
            self._guess, self._asked = choice, False
            self._reveal(self.course.reveals)
            self._flight.look_at_present()
            self._flight.pause(False)
            self._show_text()

    def _show_text(self) -> None:
        lesson = self.lesson
        for number, button in enumerate(self._choices):
            button.visible = lesson is not None and self._asked
            if lesson is not None and self._asked:
                button.label = f"{'ABC'[number]}   {lesson.choices[number]}"
        self._text.content = "" if lesson is None else self.text(lesson)

    def text(self, lesson: Lesson) -> str:
        """The question, or the steps to try, with a mark at each completed step."""
        if self._asked:
            return f"**What do you think?**\n\n{lesson.question}"
        lines = []
        if self._guess is not None:
            lines = [f"*{lesson.question}* You said **{'ABC'[self._guess]}**: {lesson.choices[self._guess]}", ""]
        done = self._progress.done
        for k, sentence in enumerate(lesson.sentences):
            mark = "✓ " if k < done else "**→** " if k == done else ""
            lines.append(f"{k + 1}. {mark}{sentence}{self._where(k) if k == done else ''}")
        if done == len(lesson.sentences):
            right = lesson.answer == self._guess
            correct = f"It is **{'ABC'[lesson.answer]}**: {lesson.choices[lesson.answer]}"
            lines += ["", f"{'**You were right.**' if right else correct} {lesson.reason}"]
        return "\n".join(lines)

    def _where(self, step: int) -> str:
        """The tab in which the step sets or shows something, or empty."""
        steps = self.course.steps
        whats = [what for what in (steps[step] if step < len(steps) else ()) if what.startswith(("set ", "show "))]
        if not whats:
            return ""
        tab = "Show" if whats[0].startswith("show ") else "Body" if whats[0] in IN_BODY else "Forces"
        return f" *(tab {tab})*"

    # Actions that the steps require

    def did(self, what: str) -> None:
        """Note an action on the page, by its name in Course.steps."""
        if self._progress.did(what):
            self._show_text()

    def changed(self, old: Scenario, new: Scenario) -> None:
        """Parameters were set."""
        before = old.parameters.named()
        for name, value in new.parameters.named().items():
            if before.get(name) != value:
                self.did(f"set {name}")

    def watched(self, times_ns: Sequence[int]) -> None:
        """The body was seen at these simulated times."""
        if self._asked and not self._flight.paused:
            self.answer(None)  # the user resumed without an answer
        for time_ns in times_ns:
            if self._progress.watched(time_ns):
                self._show_text()

    def draw(self, now_s: float) -> None:
        """Update the lesson's numbers if that is due."""
        if now_s >= self._due_s:
            self._due_s = now_s + NUMBERS_S
            values = self._readings.values
            self._numbers.content = html_table((name, values[name]) for name in self.course.numbers if name in values)
