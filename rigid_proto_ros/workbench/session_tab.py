# SPDX-License-Identifier: MIT
"""Time as a session: lessons, rewind and branch, saving what was done by hand, links."""

from __future__ import annotations

import asyncio
import math
from dataclasses import replace
from typing import TYPE_CHECKING

from ..base.bundled import example_path
from ..base.errors import InputError
from ..scene.lessons import Lesson, lessons
from ..scene.scene_file import read_scene_text
from .link import decode, encode
from .rewind import Rewind
from .situation import Situation, situation_of
from .trails import COM_TRAIL, POINT_TRAIL

if TYPE_CHECKING:
    from .page import Page

NO_LESSON = "–"

MAX_QUERY = 7000
"""Characters of a link that a server reads from an address; a longer one is pasted."""

SPEED_WITH = {"thrown_hammer": 0.1}
"""Simulated seconds per second of a lesson that is over too soon to be seen."""

SHOWN_WITH = {"thrown_hammer": (COM_TRAIL, POINT_TRAIL)}
"""Names of scene_view.SWITCHES that a lesson needs and that are off otherwise."""

STEP_S = 0.05
"""[s] Of the rewind slider."""


class SessionTab:
    """The folder of lessons, and the tab of rewind, save and link."""

    def __init__(self, page: Page, tabs, play_tab) -> None:
        self._page = page
        self._gui = page.server.gui
        self._lessons: dict[str, Lesson] = {lesson.title: lesson for lesson in lessons()}
        self._shown_for_lesson: tuple[str, ...] = ()
        self._speed_before_lesson: float | None = None
        self._going_back = False
        with play_tab:
            self._lesson_folder()
        with tabs.add_tab("Session"):
            self._rewind_folder()
            self._save_folder()
            self._link_folder()

    # Lessons

    def _lesson_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Lesson", order=-1.0):
            choice = gui.add_dropdown("Lesson", (NO_LESSON, *self._lessons), initial_value=NO_LESSON)
            self._text = gui.add_markdown("")
            self._script = gui.add_button("Run its script", visible=False)
        self._choice = choice

        @choice.on_update
        async def _(event) -> None:
            lesson = self._lessons.get(choice.value)
            self._show_lesson(lesson)
            if event.client is not None and lesson is not None:
                await self._fly(lesson.path.read_text("utf-8"), "")

        @self._script.on_click
        async def _(event) -> None:
            lesson = self._lessons.get(choice.value)
            if lesson is not None and lesson.script:
                script = example_path(lesson.script).read_text("utf-8")
                await self._fly(lesson.path.read_text("utf-8"), script)

    def _show_lesson(self, lesson: Lesson | None) -> None:
        self._script.visible = lesson is not None and bool(lesson.script)
        shown = SHOWN_WITH.get(lesson.name, ()) if lesson is not None else ()
        changes = {name: name in shown for name in {*shown, *self._shown_for_lesson}}
        self._shown_for_lesson = shown
        self._page.show_tab.show(changes)
        values = read_scene_text(lesson.path.read_text("utf-8")).values if lesson is not None else {}
        contacts = {n.removeprefix("contacts."): v for n, v in values.items() if n.startswith("contacts.")}
        self._page.view.label_contacts(contacts, str(values.get("mesh", "")))
        if lesson is None:
            self._text.content = ""
        else:
            self._text.content = (
                "\n".join(f"{k}. {s}" for k, s in enumerate(lesson.sentences, 1)) + f"\n\n{lesson.reason}"
            )

    def show_lesson_named(self, name: str) -> None:
        """The page was started with the scene of a lesson."""
        for title, lesson in self._lessons.items():
            if lesson.name == name:
                self._choice.value = title

    async def fly_lesson(self, name: str) -> None:
        """As if it had been picked from the list."""
        self.show_lesson_named(name)
        await self._fly(self._lessons[self._choice.value].path.read_text("utf-8"), "")

    async def _fly(self, scene: str, script: str) -> None:
        await self._page.doing("setting the scene", self._bring(scene, script))

    async def _bring(self, scene: str, script: str) -> None:
        page = self._page
        await page.known()
        situation = situation_of(scene, script, page.scenario.parameters.named())
        await page.bring_about(replace(situation, changes={**situation.changes, **self._speed()}))
        page.new_body()

    def _speed(self) -> dict[str, object]:
        """What the lesson needs for a speed, and after it what was before."""
        lesson = self._lessons.get(self._choice.value)
        present = float(self._page.scenario.parameters.real_time_factor)
        speed = None if lesson is None else SPEED_WITH.get(lesson.name)
        if speed is not None:
            if self._speed_before_lesson is None:
                self._speed_before_lesson = present
            return {"real_time_factor": speed}
        before, self._speed_before_lesson = self._speed_before_lesson, None
        return {} if before is None or present not in SPEED_WITH.values() else {"real_time_factor": before}

    # Rewind

    def _rewind_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Rewind"):
            gui.add_markdown("Go back in time and continue from there; the previous motion stays as a ghost.")
            self._back = gui.add_slider("Seconds back", 0.0, 10.0, STEP_S, 0.0)
            self._go_on = gui.add_button("Continue from here", disabled=True)
            self._forget = gui.add_button("Remove the ghost", visible=False)
            self._looking = gui.add_markdown("")

        @self._back.on_update
        async def _(event) -> None:
            if event.client is not None:
                self._look(float(self._back.value))

        @self._go_on.on_click
        async def _(event) -> None:
            await self.go_on_from_here()

        @self._forget.on_click
        async def _(event) -> None:
            self._page.history.forget_ghost()

    def every_second(self) -> None:
        """How far back one can go grows while the body flies."""
        first_ns, last_ns = self._page.history.span
        if self._page.looking_at is None:
            available = max(10.0, 10.0 * math.ceil((last_ns - first_ns) * 1e-10))
            if self._back.max != available:
                self._back.max = available
        self._forget.visible = self._page.history.ghost is not None

    def _look(self, back_s: float) -> None:
        page = self._page
        if back_s <= 0.0:
            page.resume_after_looking()
            return
        page.look_at(page.history.span[1] if page.looking_from is None else page.looking_from, back_s)
        self._go_on.disabled = False
        self._looking.content = f"Looking at {page.history.simulated_ns(page.looking_at) * 1e-9:.2f} s"

    def look_by(self, seconds: float) -> None:
        """Look further back than now, or less far with a negative number."""
        page = self._page
        last_ns = page.history.span[1] if page.looking_from is None else page.looking_from
        present_ns = last_ns if page.looking_at is None else page.looking_at
        back_s = max(0.0, (last_ns - present_ns) * 1e-9 + seconds)
        self._look(back_s)
        if page.looking_at is not None:
            self._back.value = min(back_s, self._back.max)

    async def go_on_from_here(self) -> None:
        """Take the node to the moment that is looked at, and let time go on from there; once, however often it is asked for."""
        if self._going_back:
            return
        self._going_back = True
        try:
            self._page.run_after_looking()
            await self._page.doing("going back", self._rewind())
        finally:
            self._going_back = False

    def show_now(self) -> None:
        """Nobody looks back any more."""
        self._go_on.disabled = True
        self._looking.content = ""
        self._back.value = 0.0

    async def _rewind(self) -> None:
        page = self._page
        moment_ns = page.looking_at
        if moment_ns is None:
            return
        try:
            rewind: Rewind = await asyncio.to_thread(page.history.rewind, moment_ns)
            await page.bring_about(Situation(rewind.changes, rewind.commands), rewind)
            for note in rewind.notes:
                page.say(note)
        finally:
            page.resume_after_looking()

    # Save

    def _save_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Save as script"):
            gui.add_markdown(
                "What was done since the last reset, as a scene and a script that reproduce it bit for bit."
            )
            save = gui.add_button("Save scene and script")
            notes = gui.add_markdown("")

        @save.on_click
        async def _(event) -> None:
            await self._page.doing("saving", self._save(event.client, notes))

    async def _save(self, client, notes) -> None:
        saved = await asyncio.to_thread(self._page.history.save_as_script)
        client.send_file_download("scene.yaml", saved.scene.encode(), save_immediately=True)
        client.send_file_download("script.yaml", saved.script.encode(), save_immediately=True)
        lines = [
            f"{saved.commands} commands. Reproduce it with:",
            "`rigid_proto simulate scene.yaml --script script.yaml`",
        ]
        notes.content = "\n\n".join([*lines, *saved.notes])

    # Link

    def _link_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Link"):
            make = gui.add_button("Make a link", hint="Scene and script since the last reset, in one line")
            self._link = gui.add_text("Link", "", hint="Copy it, or paste one and open it")
            opening = gui.add_button("Open the link above")

        @make.on_click
        async def _(event) -> None:
            await self._page.doing("making a link", self._make_link())

        @opening.on_click
        async def _(event) -> None:
            await self.open_link(self._link.value)

    async def _make_link(self) -> None:
        saved = await asyncio.to_thread(self._page.history.save_as_script)
        link = encode(saved.scene, saved.script)
        self._link.value = f"{self._page.address}/?{link}" if len(link) <= MAX_QUERY else link

    async def open_link(self, text: str) -> None:
        """Bring the node where a link leads; a refusal is said on the page."""
        try:
            scene, script = decode(text)
        except InputError as error:
            self._page.say(str(error))
            return
        await self._fly(scene, script)
