# SPDX-License-Identifier: MIT
"""Time as a session: rewind and branch, saving what was done by hand, links."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import viser

from ..base.errors import InputError
from .history import History
from .link import decode, encode
from .past_view import PastView
from .situation import SituationControl
from .status import Announcements

MAX_QUERY = 7000
"""Characters of a link that a server reads from an address; a longer one is pasted."""

STEP_S = 0.05
"""[s] Of the rewind slider."""


class SessionTab:
    """The tab of rewind, save and link. address: of this page. open_scene(scene, script) takes the node
    there, both as texts.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        tabs: viser.GuiTabGroupHandle,
        address: str,
        history: History,
        past_view: PastView,
        situations: SituationControl,
        announcements: Announcements,
        open_scene: Callable[[str, str], Awaitable[None]],
    ) -> None:
        self._gui = gui
        self._address = address
        self._history = history
        self._past_view = past_view
        self._situations = situations
        self._announcements = announcements
        self._open_scene = open_scene
        with tabs.add_tab("Session"):
            self._rewind_folder()
            self._save_folder()
            self._link_folder()
        past_view.on_change = self._show_moment

    # Rewind

    def _rewind_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Rewind"):
            gui.add_markdown("Go back in time and continue from there; the previous motion stays as a ghost.")
            self._back: Any = gui.add_slider("Seconds back", 0.0, 10.0, STEP_S, 0.0)
            self._go_on = gui.add_button("Continue from here", disabled=True)
            self._forget = gui.add_button("Remove the ghost", visible=False)
            self._looking = gui.add_markdown("")

        @self._back.on_update
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                self._past_view.show(float(self._back.value))

        @self._go_on.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self._situations.go_on_from_here()

        @self._forget.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            self._history.forget_ghost()

    def every_second(self) -> None:
        """How far back one can go grows while the body flies."""
        first_ns, last_ns = self._history.span
        if self._past_view.moment_ns is None:
            available = max(10.0, 10.0 * math.ceil((last_ns - first_ns) * 1e-10))
            if self._back.max != available:
                self._back.max = available
        self._forget.visible = self._history.ghost is not None

    def _show_moment(self) -> None:
        moment_ns = self._past_view.moment_ns
        self._go_on.disabled = moment_ns is None
        if moment_ns is None:
            self._looking.content = ""
        else:
            self._looking.content = f"Looking at {self._history.simulated_ns(moment_ns) * 1e-9:.2f} s"
        back_s = min(self._past_view.back_s, self._back.max)
        # What a hand has just set may be more than there is; only what differs by a step is written over it.
        if moment_ns is None or abs(self._back.value - back_s) > 0.5 * STEP_S:
            self._back.value = back_s

    # Save

    def _save_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Save as script"):
            gui.add_markdown(
                "What was done since the last reset, as a scene and a script that reproduce it bit for bit."
            )
            save = gui.add_button("Save scene and script")
            self._saved = gui.add_markdown("")

        @save.on_click
        async def _(event: viser.GuiEvent[Any]) -> None:
            if event.client is not None:
                await self._announcements.while_doing("saving", self._save(event.client))

    async def _save(self, client: viser.ClientHandle) -> None:
        saved = await asyncio.to_thread(self._history.save_as_script)
        client.send_file_download("scene.yaml", saved.scene.encode(), save_immediately=True)
        client.send_file_download("script.yaml", saved.script.encode(), save_immediately=True)
        lines = [
            f"{saved.commands} commands. Reproduce it with:",
            "`rigid_proto simulate scene.yaml --script script.yaml`",
        ]
        self._saved.content = "\n\n".join([*lines, *saved.notes])

    # Link

    def _link_folder(self) -> None:
        gui = self._gui
        with gui.add_folder("Link"):
            make = gui.add_button("Make a link", hint="Scene and script since the last reset, in one line")
            self._link: Any = gui.add_text("Link", "", hint="Copy it, or paste one and open it")
            opening = gui.add_button("Open the link above")

        @make.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self._announcements.while_doing("making a link", self._make_link())

        @opening.on_click
        async def _(_: viser.GuiEvent[Any]) -> None:
            await self.open_link(self._link.value)

    async def _make_link(self) -> None:
        saved = await asyncio.to_thread(self._history.save_as_script)
        link = encode(saved.scene, saved.script)
        self._link.value = f"{self._address}/?{link}" if len(link) <= MAX_QUERY else link

    async def open_link(self, text: str) -> None:
        """Take the node where a link leads; a refusal is said on the page."""
        try:
            scene, script = decode(text)
        except InputError as error:
            self._announcements.say(str(error))
            return
        await self._open_scene(scene, script)
