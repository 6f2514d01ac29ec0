# SPDX-License-Identifier: MIT
"""The room of the lesson: a question first, then what to try and to see, and the numbers that it speaks of."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import viser

from ..base.bundled import example_path
from ..scene.lessons import Lesson, lessons
from ..scene.scenario import Scenario
from .flight import Flight
from .lesson_course import COURSES, NO_LESSON, Course, LessonProgress
from .readouts import Readings, html_table
from .server import ANSWERS

FREE = "– (no lesson)"

NUMBERS_S = 0.2
"""[s] How often the numbers are written anew."""

SPACE = f'<div class="{ANSWERS}"></div>'
"""Room for answers, on paper."""


class LessonPanel:
    """on_lesson(course) is called when one begins, or none. for_class(on): class mode, with nothing but picture, lesson
    and three buttons, begins or ends.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        flight: Flight,
        readings: Readings,
        on_lesson: Callable[[Course], None],
        for_class: Callable[[bool], None],
    ) -> None:
        self._flight = flight
        self._readings = readings
        self._on_lesson = on_lesson
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
            self._script = gui.add_button("Do it with exact forces", visible=False, hint="Runs the lesson's script")
            self._again = gui.add_button("Begin again", visible=False, hint="The lesson from its start")
            # Here, for class mode hides the other tabs.
            self._class: Any = gui.add_checkbox("Class mode", False, hint="In large letters; F11 fills the screen")
            gui.add_html(SPACE)
        self._choice = choice

        @choice.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self.begin()

        @self._script.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            lesson = self.lesson
            if lesson is not None and lesson.script:
                await self._fly(lesson, example_path(lesson.script).read_text("utf-8"), False)

        @self._class.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            for_class(self._class.value)
            self._show_buttons()

        @self._again.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self.begin()

        for number, button in enumerate(self._choices):

            @button.on_click
            async def _(_: viser.GuiEvent[Any], number: int = number) -> None:
                self.answer(number)

    @property
    def lesson(self) -> Lesson | None:
        """The one that is shown, or None."""
        return self._lessons.get(str(self._choice.value))

    @property
    def course(self) -> Course:
        """What it needs."""
        lesson = self.lesson
        return NO_LESSON if lesson is None else COURSES.get(lesson.name, NO_LESSON)

    def name(self, name: str) -> None:
        """Choose the lesson of a bundled scene."""
        self._choice.value = next(title for title, lesson in self._lessons.items() if lesson.name == name)

    def leave(self) -> None:
        """Another body flies: no lesson."""
        self._choice.value = FREE
        self.show()

    def show(self) -> None:
        """Show the chosen lesson, whose scene flies already, from its question on."""
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
        """A guess, or none: the motion shows what is right."""
        if self._asked:
            self._guess, self._asked = choice, False
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
        """The question, or what to try, with marks at what is done."""
        if self._asked:
            return f"**What do you think?**\n\n{lesson.question}"
        lines = []
        if self._guess is not None:
            lines = [f"*{lesson.question}* You said **{'ABC'[self._guess]}**: {lesson.choices[self._guess]}", ""]
        done = self._progress.done
        for k, sentence in enumerate(lesson.sentences):
            mark = "✓ " if k < done else "**→** " if k == done else ""
            lines.append(f"{k + 1}. {mark}{sentence}")
        if done == len(lesson.sentences):
            right = lesson.answer == self._guess
            correct = f"It is **{'ABC'[lesson.answer]}**: {lesson.choices[lesson.answer]}"
            lines += ["", f"{'**You were right.**' if right else correct} {lesson.reason}"]
        return "\n".join(lines)

    # What the steps ask for

    def did(self, what: str) -> None:
        """Something that a step may ask for, as Course.steps names it, was done on the page."""
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
            self.answer(None)  # somebody would rather see it
        for time_ns in times_ns:
            if self._progress.watched(time_ns):
                self._show_text()

    def draw(self, now_s: float) -> None:
        """Write the lesson's numbers where that is due."""
        if now_s >= self._due_s:
            self._due_s = now_s + NUMBERS_S
            values = self._readings.values
            content = html_table((name, values[name]) for name in self.course.numbers if name in values)
            if self._numbers.content != content:
                self._numbers.content = content
