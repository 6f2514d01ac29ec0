# SPDX-License-Identifier: MIT
"""viser's server as the workbench needs it: quiet, for pages of its own alone, and with nothing that leads beyond it.

Two things viser 1.1 has no setting for, so names of its own are used (test_workbench_server.py says when another
version lacks them): a look at requests before it answers them, and browsers' requests for a public tunnel to be passed
over.
"""

from __future__ import annotations

import contextlib
import functools
import html
import http
import io
import logging
import socket
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server
from viser import _messages
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from ..base.errors import InputError
from ..rerun_view.ports import PortTakenError, serve_on_port
from .page_style import PANEL_PIXELS, lay_out

# ruff: noqa: SLF001 (see above)

LOOPBACK_NAMES = ("127.0.0.1", "localhost", "::1")


def make_server(title: str, host: str, asked: int | None, default: int) -> viser.ViserServer:
    """A server on the port that was asked for, or on the first free one from the default on; one that had to move has
    its port in its title, for there is another one.

    Raises InputError naming ``--host`` or ``--port`` where nothing can listen there.
    """
    _check_host(host)
    # Whoever knocks and goes, a port scan or a browser that thought better of it, is no error of ours.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)

    def serve(port: int) -> viser.ViserServer:
        label = title if port in (asked, default) else f"{title} :{port}"
        # Its greeting would stand between the lines that the command prints.
        with contextlib.redirect_stdout(io.StringIO()), _requests_looked_at(host, label):
            server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
        if server.get_port() != port:
            stop_server(server)  # viser goes on to other ports by itself
            raise PortTakenError
        return server

    server = serve_on_port("--port", asked, default, serve)
    for request in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(request)
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(PANEL_PIXELS)
    lay_out(server)
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop it, as quietly as it began."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def _check_host(host: str) -> None:
    """viser tries for ever to listen on an address that isn't this machine's."""

    try:
        family, _, _, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        socket.create_server(address[:2], family=family).close()
    except (OSError, UnicodeError, ValueError):  # no such address; no name at all
        accepted = "an address of this machine, such as 127.0.0.1, or 0.0.0.0 for all of them"
        raise InputError("--host", host, accepted) from None


@contextlib.contextmanager
def _requests_looked_at(host: str, title: str) -> Iterator[None]:
    """While this lasts, a server that is started turns requests of other sites away, and its page has this title."""
    module: Any = websockets.asyncio.server
    serve = module.serve

    @functools.wraps(serve)
    def guarded(*arguments: Any, process_request: Any, **options: Any) -> Any:
        def process(connection: ServerConnection, request: Request) -> Response | None:
            reason = refusal(host, request.headers.get("Host", ""), request.headers.get("Origin"))
            if reason:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
            is_page = request.path.partition("?")[0] == "/"
            if is_page:
                request.headers.pop("Accept-Encoding", None)  # as it is, so that its title can be set
            response = process_request(connection, request)
            if response is not None and is_page:
                own = f"<title>{html.escape(title)}</title>".encode()
                response.body = response.body.replace(b"<title>Viser</title>", own, 1)
                response.headers.pop("Content-Length", None)
                response.headers["Content-Length"] = str(len(response.body))
            return response

        return serve(*arguments, process_request=process, **options)

    module.serve = guarded
    try:
        yield
    finally:
        module.serve = serve


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
