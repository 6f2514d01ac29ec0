# SPDX-License-Identifier: MIT
"""viser's server as the workbench needs it: quiet, on this machine only, and with nothing that leads beyond it."""

from __future__ import annotations

import contextlib
import io
import logging

import viser
from viser import _messages

PANEL_PIXELS = 380
TITLE = "rigid_proto workbench"


def make_server(host: str, port: int) -> viser.ViserServer:
    """A server that listens on exactly this port."""
    # Whoever knocks and goes, a port scan or a browser that thought better of it, is no error of ours.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    # Its greeting would stand between the lines that the command prints.
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
    # A browser could ask for a public tunnel to this server: nobody asked us for that.
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_PIXELS)
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop it, as quietly as it began."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()
