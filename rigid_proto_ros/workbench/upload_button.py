# SPDX-License-Identifier: MIT
"""The button that takes a mesh file from a browser: what is too large is refused before it is here."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

import viser
from viser import _messages

from ..base.errors import InputError
from .situation import Situation
from .upload import (
    ACCEPTED,
    MAX_BYTES,
    UNITS,
    UPRIGHT,
    Upload,
    Uploads,
    shown_name,
)

if TYPE_CHECKING:
    from .page import Page

PART_BYTES = 512 * 1024
"""viser's pages send files in parts of this size."""

MAX_TRANSFERS = 4
"""Files that come in at one time; each stands in memory until it is whole."""


class UploadButton:
    """Takes a file, shows the verdict on it, asks for its unit and up axis, and flies it where it can fly."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self.uploads = Uploads()
        self.present: Upload | None = None
        self._flown = ""
        gui = page.server.gui
        with page.body_tab.upload_place:
            self._button = gui.add_upload_button(
                "Upload a mesh",
                icon=viser.Icon.UPLOAD,
                mime_type=",".join(f".{suffix}" for suffix in ACCEPTED),
                hint=f".{', .'.join(ACCEPTED)}; at most {MAX_BYTES // 1_000_000} MB",
            )
            self._unit = gui.add_dropdown("Its unit", tuple(UNITS), visible=False, hint="Of the file's numbers (scale)")
            self._up = gui.add_dropdown("Its up axis", tuple(UPRIGHT), visible=False, hint="initial.orientation_xyzw")
            self._size = gui.add_markdown("", visible=False)
            self._as_it_is = gui.add_button("Simulate it", visible=False)
            self._repaired = gui.add_button("Simulate it repaired", visible=False)
            self._hull = gui.add_button("Simulate its hull", visible=False)
        guard_uploads(page.server, self._refuse)

        @self._button.on_upload
        async def _(event) -> None:
            file = self._button.value
            self._button._impl.value = viser.UploadedFile("", b"")  # so that it isn't kept in memory
            await page.doing(f"reading {shown_name(file.name)[0]}", self._take(file.name, file.content))

        @self._unit.on_update
        async def _(event) -> None:
            self._show_size()

        for button, changes in (
            (self._as_it_is, {}),
            (self._repaired, {"mesh_repair": True}),
            (self._hull, {"mesh_fallback": "hull"}),
        ):

            @button.on_click
            async def _(event, changes: dict = changes) -> None:
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
        await self._page.known()
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
        self._page.body_tab.show_verdict(lines)
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

    async def _fly(self, changes: dict) -> None:
        page, upload = self._page, self.present
        if upload is None:
            return
        values = {**upload.flight(self._unit.value, self._up.value), **changes}
        for name, value in page.scenario.parameters.named().items():
            if name.startswith("ballast."):
                values[name] = [0.0, *value[1:]]
        page.new_body()
        await page.doing(f"setting {upload.name}", page.bring_about(Situation(values)))
        self._show([f"{upload.name}: simulated"], None)

    def _refuse(self, client_id: int, reason: str) -> None:
        self._show([f"refused: {reason}"], None)
        self._page.say(reason)

    def close(self) -> None:
        """Leave nothing on the disk."""
        self.uploads.close()


def guard_uploads(server: viser.ViserServer, refuse) -> None:
    """Let files in only as far as they are announced, and announced only up to MAX_BYTES.

    viser gathers a file's parts in memory, however many come. refuse(client_id, reason) is told of what is turned away.
    """
    socket, gui = server._websock_server, server.gui
    transfers = gui._current_file_upload_states
    start, part = gui._handle_file_transfer_start, gui._handle_file_transfer_part

    def on_start(client_id, message: _messages.FileTransferStartUpload) -> None:
        name, suffix = shown_name(message.filename)
        parts = -(-message.size_bytes // PART_BYTES)
        if suffix not in ACCEPTED:
            reason = f"upload: {name}; accepted: a file named .{', .'.join(ACCEPTED)}"
        elif not 0 < message.size_bytes <= MAX_BYTES or message.part_count != parts:
            reason = f"upload: {name}, {message.size_bytes} bytes; accepted: 1 to {MAX_BYTES} bytes"
        elif len(transfers) >= MAX_TRANSFERS:
            reason = f"upload: {name}; accepted: {MAX_TRANSFERS} files at one time"
        else:
            start(client_id, message)
            return
        # The browser goes on showing progress until it is told that all has come.
        done = _messages.FileTransferPartAck(
            message.source_component_uuid, message.transfer_uuid, message.size_bytes, message.size_bytes
        )
        socket.queue_message(done)
        refuse(client_id, reason)

    def on_part(client_id, message: _messages.FileTransferPart) -> None:
        transfer = transfers.get(message.transfer_uuid)
        if transfer is None:
            return
        if transfer["transferred_bytes"] + len(message.content) > transfer["total_bytes"]:
            del transfers[message.transfer_uuid]
            refuse(client_id, f"upload: {transfer['filename']} is longer than it said; accepted: a whole file")
            return
        part(client_id, message)

    for kind, old, new in (
        (_messages.FileTransferStartUpload, start, on_start),
        (_messages.FileTransferPart, part, on_part),
    ):
        socket.unregister_handler(kind, old)
        socket.register_handler(kind, new)
