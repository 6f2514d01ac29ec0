# SPDX-License-Identifier: MIT
"""viser's server as the workbench needs it: quiet, for pages of its own alone, and with nothing that
leads beyond it.
"""

from __future__ import annotations

import contextlib
import http
import io
import logging
from collections.abc import Callable
from urllib.parse import unquote, urlsplit

import viser
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from ..base.errors import InputError
from .listening import check_address
from .page_style import PANEL_PIXELS, lay_out
from .viser_internals import Gate, refuse_tunnels, requests_go_through

TITLE = "rigid_proto workbench"
LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")


def make_server(host: str, port: int, on_link: Callable[[str], None]) -> viser.ViserServer:
    """A server that listens on exactly this port. on_link(text) is called when a page is opened with ``/?<link>``.

    Raises InputError naming ``--host`` or ``--port`` where nothing can listen there.
    """
    check_address(host, port)
    # Whoever knocks and goes, a port scan or a browser that thought better of it, is no error of ours.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    # Its greeting would stand between the lines that the command prints.
    with contextlib.redirect_stdout(io.StringIO()), requests_go_through(_gate(host, on_link)):
        server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
    if server.get_port() != port:
        # Somebody took it in between, and viser went on to the next.
        stop_server(server)
        raise InputError("--port", port, f"a port on {host} that no other program listens on")
    refuse_tunnels(server)  # nobody asked us for one
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_PIXELS)
    lay_out(server)
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop it, as quietly as it began."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def _gate(host: str, on_link: Callable[[str], None]) -> Gate:
    def answer(connection: ServerConnection, request: Request) -> Response | None:
        reason = refusal(host, request.headers.get("Host", ""), request.headers.get("Origin"))
        if reason:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
        path, _, query = request.path.partition("?")
        # Only a page that is opened: an image of another site's page must not set anything.
        opened = request.headers.get("Sec-Fetch-Dest", "document") == "document"
        if path == "/" and query and opened and request.headers.get("Upgrade") != "websocket":
            on_link(unquote(query))
        return None

    return answer


def refusal(served_on: str, host: str, origin: str | None) -> str:
    """Why a request isn't from a page of this server, or empty.

    A page of any site may open a socket to this machine, and a name that somebody else owns may point here: the first
    shows in ``Origin``, the second in ``Host``.
    """
    name = urlsplit(f"//{host}").hostname or ""
    if served_on in LOOPBACK_NAMES and name not in LOOPBACK_NAMES:
        return f"host {host[:80]!r}; accepted: {', '.join(LOOPBACK_NAMES)}"
    if origin is not None and urlsplit(origin).netloc != host:
        return f"a page of {origin[:80]!r}; accepted: pages of {host}"
    return ""
