# SPDX-License-Identifier: MIT
"""Serves the page over HTTP and a node's motion over WebSockets. Imports no physics.

The address has a random token: ``/page/TOKEN`` is a page with its own simulation, ``/live/TOKEN`` is the page of a node
and its WebSocket. The constants below bound the memory used for clients, to 64 MiB in all.
"""

from __future__ import annotations

import asyncio
import gzip
import hmac
import http
import io
import ipaddress
import logging
import secrets
import socket
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from urllib.parse import urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ..base.errors import InputError
from ..base.ports import LOOPBACK, PORTS_TRIED, ports_to_try

MOST_CONNECTIONS = 96
MOST_OF_ONE_MACHINE = 24
"""Largest number of connections from one network address, so that one machine can't lock out the others."""
MOST_WATCHERS = 64
MOST_PAGES = 16
"""Largest number of pages being sent; each may be buffered in full for a client that reads slowly (1.5 MB)."""
MOST_MESSAGE = 32 * 1024
"""Largest message of a client [bytes]; the declared length is checked before the message is read."""
MOST_QUEUED = 4
"""Largest number of queued messages of a client."""
OPENING_S = 20.0
"""Timeout of a client's request and of sending it the page [s]."""
CLOSING_S = 2.0
"""Timeout of a WebSocket's closing handshake [s]."""
CUTTING_S = 0.2
"""The same for a client that has violated the protocol and may not answer [s]."""

LINE_S = 1.0
"""Shortest period between two log lines about clients [s]."""

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


def new_token() -> str:
    """A secret for an address: 128 random bits."""
    return secrets.token_urlsafe(16)


def forbidden(served_as: str, host: str, origin: str | None) -> str:
    """Why a request isn't from a page of this server, or "".

    Any site's page may open a socket to this machine, which ``Origin`` shows. Any domain name may be made to resolve to
    this machine (DNS rebinding), which ``Host`` shows: it must be a numeric address, localhost, or the configured name.
    """
    name = ""
    try:
        name = urlsplit(f"//{host}").hostname or ""
        ipaddress.ip_address(name)
    except ValueError:
        if not name or name not in ("localhost", served_as.lower()):
            return "its Host is another name than this server's"
    if origin is not None and urlsplit(origin).netloc != host:
        return "a page of another site asked for it"
    return ""


def lan_address() -> str:
    """This machine's address in the local network, or loopback without a network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # chooses a route; nothing is sent
            return str(probe.getsockname()[0])
        except OSError:
            return LOOPBACK


class Lines:
    """Logs refused and ended clients, at most one line per second, without any text sent by the client."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._next_s, self._left_out = 0.0, 0

    def __call__(self, client: ServerConnection | None, what: str) -> None:
        """Log that a client was refused or ended, with the reason."""
        now = time.monotonic()
        if now < self._next_s:
            self._left_out += 1
            return
        others = f" (and {self._left_out} more)" if self._left_out else ""
        self._next_s, self._left_out = now + LINE_S, 0
        address = None if client is None else client.remote_address
        self._say(f"the page: a client at {address[0] if address else 'an unknown address'}: {what}{others}")


class _Connection(ServerConnection):
    """A connection that is aborted if there are too many."""

    lines: Lines
    opened: dict[ServerConnection, str]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        address = str((transport.get_extra_info("peername") or ("",))[0])
        others = sum(1 for other in self.opened.values() if other == address)
        if len(self.opened) >= MOST_CONNECTIONS or (others >= MOST_OF_ONE_MACHINE and not _is_own(address)):
            self.lines(self, "too many connections")
            self.transport.abort()
        self.opened[self] = address

    def connection_lost(self, exc: Exception | None) -> None:
        self.opened.pop(self, None)
        super().connection_lost(exc)


def _is_own(address: str) -> bool:
    try:
        return ipaddress.ip_address(address).is_loopback
    except ValueError:
        return False


class PageServer:
    """The server; it listens after ``begin``. page: the HTML file. tokens: accepted tokens, each with its path prefix,
    ``page`` or ``live``. on_socket(connection, token): handles a WebSocket and returns the code to close it with.
    """

    def __init__(
        self,
        page: bytes,
        tokens: dict[str, str],
        host: str,
        say: Callable[[str], None],
        on_socket: Callable[[ServerConnection, str], Awaitable[int]] | None = None,
    ) -> None:
        self._page, self._packed = page, gzip.compress(page, 6)
        self._tokens, self._host, self._on_socket = tokens, host, on_socket
        self.lines = Lines(say)
        self._sending = 0
        self._server: Server | None = None
        self.port = 0

    async def begin(self, asked: int | None, default: int) -> None:
        """Listen on the port ``asked``, or on the first free port from the default on. Raises InputError."""
        ports = ports_to_try("--port", asked, default)
        logger = logging.getLogger("rigid_proto_ros.page")
        logger.setLevel(logging.CRITICAL + 1)  # dropped and broken connections are not errors
        kind = type("Connection", (_Connection,), {"lines": self.lines, "opened": {}})
        for port in ports:
            try:
                self._server = await serve(
                    self._handle,
                    self._host,
                    port,
                    process_request=self._respond,
                    create_connection=kind,
                    compression=None,
                    server_header=None,
                    open_timeout=OPENING_S,
                    close_timeout=OPENING_S,
                    max_size=MOST_MESSAGE,
                    max_queue=MOST_QUEUED,
                    logger=logger,
                )
            except OSError as error:
                if not is_taken(error):
                    accepted = "an address of this machine, such as 127.0.0.1, or 0.0.0.0 for all of them"
                    raise InputError("--host", self._host, accepted) from None
            else:
                self.port = port
                return
        if asked is not None:
            raise InputError("--port", asked, f"a port on {self._host} that no other program listens on")
        raise InputError("--port", default, f"one of the {PORTS_TRIED} ports from {default} on to be free")

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """The response to a request for the page; None to open a WebSocket."""
        try:
            reason = forbidden(self._host, _only(request.headers, "Host") or "", _only(request.headers, "Origin"))
        except (ValueError, LookupError):
            reason = "its headers are malformed"
        if reason:
            return self._refuse(connection, http.HTTPStatus.FORBIDDEN, reason)
        kind, _, token = request.path.partition("?")[0].lstrip("/").partition("/")
        if token == "" and kind == "favicon.ico":
            return _response(http.HTTPStatus.NOT_FOUND, b"", {})
        given = token.encode(errors="surrogateescape")
        known = [hmac.compare_digest(given, one.encode()) for one, of in self._tokens.items() if of == kind]
        if not any(known):
            return self._refuse(connection, http.HTTPStatus.FORBIDDEN, "its address lacks the token")
        if "Upgrade" in request.headers:
            if kind == "live" and self._on_socket is not None:
                connection.close_timeout = CLOSING_S
                return None
            return self._refuse(connection, http.HTTPStatus.NOT_FOUND, "this page has no socket")
        if self._sending >= MOST_PAGES:
            return self._refuse(
                connection, http.HTTPStatus.SERVICE_UNAVAILABLE, "too many pages are being sent; try again"
            )
        self._sending += 1
        asyncio.ensure_future(self._until_gone(connection))
        packed = "gzip" in request.headers.get("Accept-Encoding", "")
        headers = {"Content-Encoding": "gzip"} if packed else {}
        return _response(http.HTTPStatus.OK, self._packed if packed else self._page, {**headers, **_PAGE_HEADERS})

    async def _until_gone(self, connection: ServerConnection) -> None:
        """Wait until the page is sent or the connection has ended; websockets ends it after OPENING_S."""
        await connection.wait_closed()
        self._sending -= 1

    def _refuse(self, connection: ServerConnection, status: http.HTTPStatus, reason: str) -> Response:
        self.lines(connection, f"refused, {reason}")
        return _response(status, f"{reason}\n".encode(), {"Content-Type": "text/plain; charset=utf-8"})

    async def _handle(self, connection: ServerConnection) -> None:
        assert self._on_socket is not None and connection.request is not None
        code = await self._on_socket(connection, connection.request.path.partition("?")[0].rpartition("/")[2])
        if code != 1000:
            connection.close_timeout = CUTTING_S
        await connection.close(code)
        sent = connection.protocol.close_sent  # this server's close code, whichever side has closed
        ended = _ENDED.get(sent.code) if sent is not None else None
        if ended:
            self.lines(connection, f"ended, {ended}")

    async def close(self) -> None:
        """End all connections."""
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()


_ENDED = {
    1002: "it broke the protocol",
    1003: "a message of a kind that isn't taken",
    1007: "a message that is no text",
    1008: "messages that no page sends",
    1009: f"a message of more than {MOST_MESSAGE // 1024} kB",
    1011: "it answered no more",
    1013: "it read too slowly, or too many look",
}
"""Reasons for ending a connection, by close code."""

_PAGE_HEADERS = {"Content-Type": "text/html; charset=utf-8", "Content-Security-Policy": POLICY}


def _only(headers: Headers, name: str) -> str | None:
    found = headers.get_all(name)
    if len(found) > 1:
        raise LookupError(name)
    return found[0] if found else None


def _response(status: http.HTTPStatus, body: bytes, headers: dict[str, str]) -> Response:
    always = {
        "Content-Length": str(len(body)),
        "Connection": "close",
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cache-Control": "no-store",
    }
    return Response(status.value, status.phrase, Headers({**always, **headers}), body)


def is_taken(error: OSError) -> bool:
    """Whether the address is in use. For several addresses, asyncio puts the errors into the text of another one."""
    import errno

    return error.errno in (errno.EADDRINUSE, errno.EACCES) or "in use" in str(error)


def addresses(host: str, port: int, path: str) -> tuple[str, str]:
    """The page's address for this machine and for others in the network, "" if the server listens on loopback only."""
    lan = host if host not in ("0.0.0.0", "::", "") else lan_address()
    own = LOOPBACK if host in ("0.0.0.0", "::", "") else host
    outside = "" if host == "localhost" or _is_own(host) else f"http://{_in_address(lan)}:{port}/{path}"
    return f"http://{_in_address(own)}:{port}/{path}", outside


def show_code(address: str) -> None:
    """Print an address as a QR code if stdout is a terminal."""
    if not sys.stdout.isatty() or not sys.stdout.encoding.lower().startswith("utf"):
        return
    try:
        import segno
    except ImportError:
        return
    drawn = io.StringIO()
    segno.make(address, micro=False).terminal(drawn, compact=True, border=2)
    # Dark on light in any terminal.
    print(*(f"\033[97;40m{line}\033[0m" for line in drawn.getvalue().splitlines()), sep="\n", flush=True)


def _in_address(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def serve_page(page: bytes, asked: int | None, default: int, host: str) -> tuple[str, str]:
    """Serve a page with its own simulation, on a thread, until this process ends. Returns its addresses for this
    machine and for others. Raises InputError.
    """
    token = new_token()
    server = PageServer(page, {token: "page"}, host, lambda line: print(line, file=sys.stderr, flush=True))
    loop = asyncio.new_event_loop()
    threading.Thread(target=loop.run_forever, name="page", daemon=True).start()
    asyncio.run_coroutine_threadsafe(server.begin(asked, default), loop).result()
    return addresses(host, server.port, f"page/{token}")
