# SPDX-License-Identifier: MIT
"""What the page needs of viser and websockets that they offer no public way to.

Tried with viser 1.1.1 and websockets 16.1; test_viser_internals.py says which of these names another version lacks.

* viser gathers a file's parts in memory, however many come, and keeps the last one; it takes any file. It has no
  setting for either.
* A browser can ask for a public tunnel to the server. viser has no setting that refuses it; hiding the button doesn't.
* viser starts its server by ``websockets.asyncio.server.serve`` with a ``process_request`` of its own, and takes none.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator
from typing import Any

import viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from .upload import ACCEPTED, MAX_BYTES, shown_name

# ruff: noqa: SLF001 (what this module is for)

PART_BYTES = 512 * 1024
"""viser's pages send files in parts of this size."""

MAX_TRANSFERS = 4
"""Files that come in at one time; each stands in memory until it is whole."""

Gate = Callable[[ServerConnection, Request], Response | None]
"""Asked of each request before viser sees it: an answer that turns it away, or None."""


def refuse_tunnels(server: viser.ViserServer) -> None:
    """Have the server pass over a browser's request for a public address."""
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)


def forget_uploaded(button: viser.GuiUploadButtonHandle) -> None:
    """Don't keep the file that came last in memory."""
    button._impl.value = viser.UploadedFile("", b"")


@contextlib.contextmanager
def requests_go_through(gate: Gate) -> Iterator[None]:
    """While this lasts, a server that is started asks ``gate`` first."""
    module: Any = websockets.asyncio.server
    serve = module.serve

    @functools.wraps(serve)
    def guarded(*arguments: Any, process_request: Gate, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Any:
            return gate(connection, request) or process_request(connection, request)

        return serve(*arguments, process_request=process, **options)

    module.serve = guarded
    try:
        yield
    finally:
        module.serve = serve


def guard_uploads(server: viser.ViserServer, refuse: Callable[[str], None]) -> None:
    """Let files in only as far as they are announced, and announced only up to MAX_BYTES. refuse(reason) is told of
    what is turned away.
    """
    socket, gui = server._websock_server, server.gui
    transfers = gui._current_file_upload_states
    start, part = gui._handle_file_transfer_start, gui._handle_file_transfer_part

    def on_start(client_id: Any, message: _messages.FileTransferStartUpload) -> None:
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
        refuse(reason)

    def on_part(client_id: Any, message: _messages.FileTransferPart) -> None:
        transfer = transfers.get(message.transfer_uuid)
        if transfer is None:
            return
        if transfer["transferred_bytes"] + len(message.content) > transfer["total_bytes"]:
            del transfers[message.transfer_uuid]
            refuse(f"upload: {transfer['filename']} is longer than announced; accepted: a whole file")
            return
        part(client_id, message)

    handlers: tuple[tuple[Any, Any, Any], ...] = (
        (_messages.FileTransferStartUpload, start, on_start),
        (_messages.FileTransferPart, part, on_part),
    )
    for kind, old, new in handlers:
        socket.unregister_handler(kind, old)
        socket.register_handler(kind, new)
