# SPDX-License-Identifier: MIT
"""The folder of lessons: one is picked from the list, its text is shown, and the node is taken to its scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import viser

from ..base.bundled import example_path
from ..scene.lessons import Lesson, lessons
from ..scene.scenario import Scenario
from ..scene.scene_file import read_scene_text
from .lesson_progress import LessonProgress
from .scene_loader import SceneLoader
from .situation import SituationControl, situation_of
from .status import Announcements
from .trails import COM_TRAIL, POINT_TRAIL

NO_LESSON = "–"

SPEED_WITH = {"thrown_hammer": 0.1}
"""Simulated seconds per second of a lesson that is over too soon to be seen."""

SHOWN_WITH = {"thrown_hammer": (COM_TRAIL, POINT_TRAIL)}
"""Names of scene_view.SWITCHES that a lesson needs and that are off otherwise."""


class LessonFolder:
    """show(switches) turns what is drawn on or off; label_contacts(points, mesh) writes the names of
    contacts on a mesh.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        play_tab: viser.GuiTabHandle,
        scenes: SceneLoader,
        situations: SituationControl,
        announcements: Announcements,
        show: Callable[[Mapping[str, bool]], None],
        label_contacts: Callable[[Mapping[str, Sequence[float]], str], None],
    ) -> None:
        self._scenes = scenes
        self._situations = situations
        self._announcements = announcements
        self._show = show
        self._label_contacts = label_contacts
        self._lessons: dict[str, Lesson] = {lesson.title: lesson for lesson in lessons()}
        self._progress = LessonProgress()
        self._shown_for_lesson: tuple[str, ...] = ()
        self._speed_before_lesson: float | None = None
        with play_tab, gui.add_folder("Lesson", order=-1.0):
            choice: Any = gui.add_dropdown("Lesson", (NO_LESSON, *self._lessons), initial_value=NO_LESSON)
            self._text = gui.add_markdown("")
            self._script = gui.add_button("Run its script", visible=False)
        self._choice = choice

        @choice.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            self._show_lesson(self._lesson)
            if event.client is not None and self._lesson is not None:
                await self.fly(self._lesson.path.read_text("utf-8"), "")

        @self._script.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            lesson = self._lesson
            if lesson is not None and lesson.script:
                script = example_path(lesson.script).read_text("utf-8")
                await self.fly(lesson.path.read_text("utf-8"), script)

    @property
    def _lesson(self) -> Lesson | None:
        return self._lessons.get(str(self._choice.value))

    def _show_lesson(self, lesson: Lesson | None) -> None:
        self._script.visible = lesson is not None and bool(lesson.script)
        shown = SHOWN_WITH.get(lesson.name, ()) if lesson is not None else ()
        changes = {name: name in shown for name in {*shown, *self._shown_for_lesson}}
        self._shown_for_lesson = shown
        self._show(changes)
        values: Mapping[str, Any] = {}
        if lesson is not None:
            values = read_scene_text(lesson.path.read_text("utf-8")).values
        contacts = {n.removeprefix("contacts."): v for n, v in values.items() if n.startswith("contacts.")}
        self._label_contacts(contacts, str(values.get("mesh", "")))
        self._progress.begin("" if lesson is None else lesson.name)
        self._show_text()

    def _show_text(self) -> None:
        lesson = self._lesson
        if lesson is None:
            self._text.content = ""
            return
        marks = ["✓ " if k < self._progress.done else "" for k in range(len(lesson.sentences))]
        steps = (
            f"{k}. {mark}{sentence}" for k, (mark, sentence) in enumerate(zip(marks, lesson.sentences, strict=True), 1)
        )
        self._text.content = "\n".join(steps) + f"\n\n{lesson.reason}"

    def did(self, what: str) -> None:
        """Something that a step may ask for, as lesson_progress.STEPS names it, was done on the page."""
        if self._progress.did(what):
            self._show_text()

    def acted(self, kind: str) -> None:
        """An event of this kind acted on the body."""
        self.did("drag" if kind == "string_target" else kind)

    def changed(self, old: Scenario, new: Scenario) -> None:
        """Parameters were set."""
        before = old.parameters.named()
        for name, value in new.parameters.named().items():
            if before.get(name) != value:
                self.did(f"set {name}")

    def watched(self, times_ns: Sequence[int]) -> None:
        """The body was seen at these simulated times."""
        for time_ns in times_ns:
            if self._progress.watched(time_ns):
                self._show_text()

    def show_lesson_named(self, name: str) -> None:
        """The page was started with the scene of a lesson."""
        for title, lesson in self._lessons.items():
            if lesson.name == name:
                self._choice.value = title

    async def fly_lesson(self, name: str) -> None:
        """As if it had been picked from the list."""
        self.show_lesson_named(name)
        if self._lesson is not None:
            await self.fly(self._lesson.path.read_text("utf-8"), "")

    async def fly(self, scene: str, script: str) -> None:
        """Take the node to a scene (parameter-file text) and a poke script (YAML text); a refusal is said
        on the page.
        """
        await self._announcements.while_doing("setting the scene", self._take_to(scene, script))

    async def _take_to(self, scene: str, script: str) -> None:
        present = (await self._scenes.known()).parameters
        situation = situation_of(scene, script, present.named())
        changes = {**situation.changes, **self._speed(present.real_time_factor)}
        await self._situations.take_to(replace(situation, changes=changes))
        self._situations.another_body = True
        self._progress.begin("" if self._lesson is None else self._lesson.name)
        self._show_text()

    def _speed(self, present: float) -> dict[str, object]:
        """What the lesson needs for a speed, and after it what was before."""
        lesson = self._lesson
        speed = None if lesson is None else SPEED_WITH.get(lesson.name)
        if speed is not None:
            if self._speed_before_lesson is None:
                self._speed_before_lesson = present
            return {"real_time_factor": speed}
        before, self._speed_before_lesson = self._speed_before_lesson, None
        return {} if before is None or present not in SPEED_WITH.values() else {"real_time_factor": before}
