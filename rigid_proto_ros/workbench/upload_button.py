# SPDX-License-Identifier: MIT
"""The button that takes a mesh file from a browser: what is too large is refused before it is here."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import viser

from ..base.errors import InputError
from .scene_loader import SceneLoader
from .situation import Situation, SituationControl
from .status import Announcements
from .upload import (
    ACCEPTED,
    MAX_BYTES,
    UNITS,
    UPRIGHT,
    Upload,
    Uploads,
    shown_name,
)
from .viser_internals import forget_uploaded, guard_uploads


class UploadButton:
    """Takes a file, shows the verdict on it, asks for its unit and up axis, and flies it where it can fly. place: the
    folder of the panel where it stands; show_verdict(lines) says what is found of a file.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        place: viser.GuiFolderHandle,
        scenes: SceneLoader,
        situations: SituationControl,
        announcements: Announcements,
        show_verdict: Callable[[Sequence[str]], None],
    ) -> None:
        self._scenes = scenes
        self._situations = situations
        self._announcements = announcements
        self._show_verdict = show_verdict
        self.uploads = Uploads()
        self.present: Upload | None = None
        self._flown = ""
        gui = server.gui
        with place:
            self._button = gui.add_upload_button(
                "Upload a mesh",
                icon=viser.Icon.UPLOAD,
                mime_type=",".join(f".{suffix}" for suffix in ACCEPTED),
                hint=f".{', .'.join(ACCEPTED)}; at most {MAX_BYTES // 1_000_000} MB",
            )
            self._unit: Any = gui.add_dropdown(
                "Its unit", tuple(UNITS), visible=False, hint="Unit of the file's coordinates (scale)"
            )
            self._up: Any = gui.add_dropdown(
                "Its up axis",
                tuple(UPRIGHT),
                visible=False,
                hint="The file's axis that points up (initial.orientation_xyzw)",
            )
            self._size = gui.add_markdown("", visible=False)
            self._as_it_is = gui.add_button("Simulate it", visible=False)
            self._repaired = gui.add_button("Simulate it repaired", visible=False)
            self._hull = gui.add_button("Simulate its hull", visible=False)
        guard_uploads(server, self._refuse)

        @self._button.on_upload
        async def _(_: viser.GuiEvent[Any]) -> None:
            file = self._button.value
            forget_uploaded(self._button)
            await self._announcements.while_doing(
                f"reading {shown_name(file.name)[0]}", self._take(file.name, file.content)
            )

        @self._unit.on_update
        async def _(_: viser.GuiEvent[Any]) -> None:
            self._show_size()

        ways: tuple[tuple[viser.GuiButtonHandle, dict[str, object]], ...] = (
            (self._as_it_is, {}),
            (self._repaired, {"mesh_repair": True}),
            (self._hull, {"mesh_fallback": "hull"}),
        )
        for button, changes in ways:

            @button.on_click
            async def _(_: viser.GuiEvent[Any], changes: dict[str, object] = changes) -> None:
                await self._fly(changes)

    def flies(self, mesh: str) -> None:
        """The node's parameter ``mesh`` is this now: files that it doesn't fly go."""
        if self.present is not None and mesh == self.present.path != self._flown:
            self.uploads.fly(self.present)
            self._flown = mesh
        elif self._flown and mesh != self._flown:
            self.uploads.fly(None)
            self._flown = ""

    def attachments(self) -> list[tuple[str, bytes]]:
        """Name and content of the present file, for a recording of its flight."""
        present = self.present
        try:
            return [] if present is None else [(present.name, Path(present.path).read_bytes())]
        except OSError:
            return []  # another one has taken its place

    async def _take(self, name: str, content: bytes) -> None:
        await self._scenes.known()
        try:
            upload = await asyncio.to_thread(self.uploads.take, name, content)
        except InputError as error:
            self._show([f"refused: {error}"], None)
            raise
        self.present = upload
        lines = [*upload.verdict, *([f"refused: {upload.refusal}"] if upload.refusal else [])]
        self._show([f"{upload.name}:", *lines] if lines else [f"{upload.name}: no problems found"], upload)

    def _show(self, lines: list[str], upload: Upload | None) -> None:
        """The verdict, and what is asked before this upload flies; None: nothing is asked."""
        self._show_verdict(lines)
        if upload is not None:
            self._unit.value, self._up.value = upload.likely_unit, upload.likely_up
            self._show_size()
        for handle in (self._unit, self._up, self._size):
            handle.visible = upload is not None
        self._as_it_is.visible = upload is not None and not upload.refusal
        self._repaired.visible = self._hull.visible = upload is not None and bool(upload.refusal)

    def _show_size(self) -> None:
        if self.present is not None:
            self._size.content = f"**{self.present.size_and_mass(self._unit.value)}**"

    async def _fly(self, changes: dict[str, object]) -> None:
        upload = self.present
        if upload is None:
            return
        values = {**upload.flight(self._unit.value, self._up.value), **changes}
        ballast = (await self._scenes.known()).parameters.ballast
        values |= {f"ballast.{name}": [0.0, *place] for name, (_, *place) in ballast.items()}
        self._situations.another_body = True
        await self._announcements.while_doing(f"setting {upload.name}", self._situations.take_to(Situation(values)))
        self._show([f"{upload.name}: simulated"], None)

    def _refuse(self, reason: str) -> None:
        self._show([f"refused: {reason}"], None)
        self._announcements.say(reason)

    def close(self) -> None:
        """Leave nothing on the disk."""
        self.uploads.close()
