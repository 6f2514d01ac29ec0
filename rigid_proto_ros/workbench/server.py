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
    server.gui.add_html(STYLE, order=-10.0)
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
            response: Response | None = process_request(connection, request)
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


# How the page is laid out on narrow screens and on paper
#
# On a telephone, and on any narrow window that is higher than wide, the picture is above and the panel below it, not
# over it; a narrow window that is wider than high leaves it three fifths of the width. On paper the whole panel is
# below the picture, however far it was scrolled; backgrounds, which browsers leave out of print, are asked for where
# words and lines depend on them.
#
# viser lays its controls over the lower 60 % of a narrow page, where the body is, and puts other panels below them, a
# long way down; wider pages get a panel of one width, however little is left beside it. It has no setting for any of
# this. A style sheet can change it, and viser passes HTML of its server's on to the page, style sheets included. The
# rules recognise the elements by the styles that viser 1.1 gives them; test_workbench_page.py fails where another
# version gives others.


MARK = "rp-bar"
"""Class of the time bar's line, by which the bar is known."""

ANSWERS = "rp-answers"
"""Class of the room for answers on a printed lesson."""

NARROW = "36em"
"""Pages up to this width get viser's sheet at the bottom (its theme's breakpoint ``xs``)."""

MEDIUM = "(min-width: 36.01em) and (max-width: 59.4em)"
"""Pages on which the panel beside the picture would have more than 40 % of the width."""

PICTURE_SHARE = 56
"""[%] Of a narrow page's height."""

BESIDE_SHARE = 60
"""[%] Of the width, of a picture that has the panel beside it."""

PRINTED_PICTURE = "8cm"
"""Height of the picture on paper: below it the lesson has room for question, numbers and answers on the same page."""

LANDSCAPE_PRINT = "@media print and (orientation: landscape) { body { zoom: 0.8; } }"
"""Style rule for paper that is wider than high: the longest lesson fits on a page, too."""

PANEL_PIXELS = 380
"""Width of the panel beside the picture, until a user drags its edge."""

_SHEET = '.mantine-Paper-root[style*="position: fixed"][style*="max-height: 60%"]'
_PICTURE = 'div[style*="flex-grow: 1"][style*="height: 100%"]:has(canvas)'

# Of any width: dragging its edge changes that, and so does viser on a window that was a telephone's.
_DOCK = '[style*="position: absolute; top: 0px; bottom: 0px; right: 0px; width: "]'
_DOCKED_ROW = f'{_DOCK} [style*="flex-direction: row; position: relative; width: "]'
_DOCKED_PICTURE = '[style*="position: absolute; inset: 0px "]:has(canvas)'

_CANVAS = "canvas[data-engine]"  # three.js marks its own; the plots have others
_MARK_LABEL = '[class*="mark"][class*="label" i]'  # of both kinds of sliders
_SCROLLED = ".mantine-ScrollArea-viewport"

_BAR = f'.mantine-Paper-root:has(> [style*="box-sizing: border-box"] .{MARK})'

# What folds away with the panel hides what overflows: a bar in it would stick to that, which doesn't scroll.
_FOLDING = f'[style*="overflow: hidden"][style*="min-height: 0px"]:has(.{MARK})'

STYLE = f"""<style>
.mantine-Notification-root {{ max-height: 60vh !important; }}
.mantine-Button-root {{ height: auto !important; padding-block: 0.4em; font-size: 0.875rem !important; }}
.mantine-Button-label {{ white-space: normal; overflow: visible; line-height: 1.3; }}
.mantine-Notification-root:has(.tabler-icon-check) {{ display: none; }}
.{MARK} {{ padding: 0 0.6em; font-size: 0.95em; white-space: nowrap; overflow: hidden; text-overflow: ellipsis; }}
.{MARK} b {{ font-size: 1.35em; font-weight: 500; font-variant-numeric: tabular-nums; }}
.{MARK} b {{ display: inline-block; min-width: 4.6em; }}
.{MARK} span {{ opacity: 0.7; }}
.mantine-Input-input {{ text-overflow: ellipsis; }}
.mantine-Checkbox-root {{ --checkbox-size: 1.4em !important; }}
.multi-slider-thumb, .mantine-Slider-thumb {{ width: 1.1em !important; height: 1.1em !important; }}
.mantine-Text-root, [role="tab"], {_MARK_LABEL} {{ color: inherit !important; }}
{_MARK_LABEL} {{ font-size: 0.7rem !important; }}
{_BAR} {{ position: sticky; top: 0; z-index: 20; background: var(--mantine-color-body); margin-top: 0.4em; }}
{_FOLDING} {{ overflow: clip !important; min-width: 0; }}
.{ANSWERS} {{ display: none; }}
@media (max-width: {NARROW}) {{
  {_SHEET} {{ max-height: {100 - PICTURE_SHARE}% !important; width: 100% !important; }}
  {_SHEET} [style*="width: 20em"] {{ width: 100% !important; }}
  {_PICTURE} {{ height: {PICTURE_SHARE}% !important; }}
}}
@media {MEDIUM} {{
  {_DOCKED_ROW} {{ width: 100% !important; }}
  [role="tab"] {{ padding: 0 0.4em !important; }}
  .{MARK} {{ padding: 0 0.1em; }}
}}
@media {MEDIUM} and (orientation: landscape) {{
  {_DOCK} {{ width: {100 - BESIDE_SHARE}% !important; }}
  {_DOCKED_PICTURE} {{ right: {100 - BESIDE_SHARE}% !important; }}
}}
@media {MEDIUM} and (orientation: portrait) {{
  {_DOCK} {{ width: 100% !important; top: {PICTURE_SHARE}% !important; }}
  {_DOCKED_PICTURE} {{ inset: 0 0 {100 - PICTURE_SHARE}% 0 !important; }}
}}
{LANDSCAPE_PRINT}
@media print {{
  html, body, #root, div:has({_SCROLLED}), div:has({_CANVAS}), .mantine-ScrollArea-root, {_SCROLLED} {{
    position: static !important; overflow: visible !important; flex: none !important;
    height: auto !important; min-height: auto !important; max-height: none !important;
  }}
  .mantine-Notifications-root, {_BAR}, [role="tablist"] {{ display: none !important; }}
  {_CANVAS} {{ height: {PRINTED_PICTURE} !important; width: auto !important; }}
  .{ANSWERS}, .mantine-Button-root {{ print-color-adjust: exact; }}
  .{ANSWERS} {{ display: block; height: 12em;
    background: repeating-linear-gradient(transparent 0 1.9em, #999 1.9em calc(1.9em + 1px)); }}
}}
</style>"""

CLASS_STYLE = f"""<style>
:root {{ --mantine-scale: 1.25; }}
[role="tablist"]:has(> :first-child[aria-selected="true"]) {{ display: none !important; }}
.{MARK} {{ white-space: normal; }}
.{MARK} b {{ font-size: 1.7em; }}
{_BAR} .mantine-Button-root {{ padding-inline: 0.2em; }}
</style>"""
"""Class mode: large letters, and nothing but picture, lesson and three buttons."""
