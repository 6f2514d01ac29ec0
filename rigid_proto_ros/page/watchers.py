# SPDX-License-Identifier: MIT
"""The clients of a node's page: who watches, and who has control. ``python -m rigid_proto_ros.page.watchers`` is a
child process of the node; it ends when its stdin is closed, whichever way the node ends. Its settings are its argument.

Node and child exchange frames: length (4 bytes, little-endian), kind (1 byte), content. The node sends broadcasts
(texts, JSON objects with one key; the last of each key in KEPT is also sent to pages that open later), pictures
(binary, passed on unchanged) and answers. The child first sends its address or an error. A page sends JSON objects:

{"id": n, "entry": {...}}                                         an entry of a poke script without its time
    {"id": n, "time": "pause" | "resume" | "step" | "reset"}
    {"id": n, "begin": {parameter: value}}                            another scene
    {"hand": "ask" | "give" | "take" | "lock" | "unlock"}
    {"looking": true | false}

One page at a time has the hand, i.e. control. A command gives the hand to its page if it is free. A page idle for
IDLE_S loses it to the next page that sends a command. The owner, who has the address shown in the terminal, can take
and lock it.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import struct
import sys
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import IO, Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from ..base.errors import InputError
from .server import MOST_WATCHERS, PageServer, addresses, new_token

BROADCAST, PICTURE, ANSWERS = range(3)
"""Kinds of frames from the node."""
LISTENS, COMMAND, LOOKING, LOG = range(4)
"""Kinds of frames to the node."""

HEAD = struct.Struct("<IB")

KEPT = ("mesh", "scene", "time")
"""Keys of broadcasts whose last text is sent to pages that open later."""

IDLE_S = 20.0
"""A page that has the hand and sends no command for this long [s] loses it to the next page that sends one."""

RATE, BURST = 200.0, 400.0
"""Token bucket of a page's messages: rate [1/s] and burst; exceeding it ends the connection. A drag sends one message
per frame.
"""

MOST_UNANSWERED = 32
"""Largest number of unanswered commands of a page."""

MOST_TEXTS = 256
"""Largest number of texts queued for a page; a page that reads more slowly is disconnected."""

PIECE = 64 * 1024
"""Largest fragment of a text [bytes]; of a long text only one fragment per page is buffered here."""


def read_frame(stream: IO[bytes]) -> tuple[int, bytes] | None:
    """Kind and content of the next frame; None at the end."""
    head = stream.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    length, kind = HEAD.unpack(head)
    content = stream.read(length)
    return (kind, content) if len(content) == length else None


def write_frame(stream: IO[bytes], kind: int, content: bytes) -> None:
    """Write a frame; raises OSError if the other process has ended."""
    stream.write(HEAD.pack(len(content), kind) + content)
    stream.flush()


class Watcher:
    """One page. texts: queued texts. holds: whether it has tied the string. unanswered: number of its unanswered
    commands.
    """

    def __init__(self, number: int, connection: ServerConnection, owner: bool) -> None:
        self.number, self.connection, self.owner = number, connection, owner
        self.looking = True
        self.holds = False
        self.asks = False
        self.unanswered = 0
        self.texts: deque[bytes] = deque()
        self.due = asyncio.Event()
        self.did_s = 0.0
        self._allowed, self._asked_s = BURST, time.monotonic()

    def send(self, text: bytes) -> None:
        """Queue a text; disconnects a page that reads too slowly."""
        if len(self.texts) >= MOST_TEXTS:
            self.end(1013)
            return
        self.texts.append(text)
        self.due.set()

    def end(self, code: int) -> None:
        """End the connection."""
        self.texts.clear()
        asyncio.ensure_future(self.connection.close(code))

    def is_too_fast(self) -> bool:
        """Count a message; returns whether the page has exceeded RATE and BURST."""
        now = time.monotonic()
        self._allowed = min(BURST, self._allowed + RATE * (now - self._asked_s)) - 1.0
        self._asked_s = now
        return self._allowed < 0.0


class Watchers:
    """All pages of a node. owner, guest: tokens. about: sent to each page first. to_node(kind, content):
    sends a frame.
    """

    def __init__(self, owner: str, guest: str, about: dict[str, Any], to_node: Callable[[int, bytes], None]) -> None:
        self._owner, self._guest, self._about, self._to_node = owner, guest, about, to_node
        self._all: dict[int, Watcher] = {}
        self._opened = 0
        self._hand: Watcher | None = None
        self._locked = False
        self._kept: dict[str, bytes] = {}
        self._picture = b""
        self._looking = False

    # From the node

    def broadcast(self, text: bytes) -> None:
        """Send a text, JSON with one key, to all pages."""
        key = text[2 : text.index(b'"', 2)].decode()
        if key in KEPT:
            self._kept[key] = text
        for watcher in self._all.values():
            watcher.send(text)

    def picture(self, picture: bytes) -> None:
        """Send a picture to all pages; it replaces one that wasn't sent yet."""
        self._picture = picture
        for watcher in self._all.values():
            watcher.due.set()

    def answers(self, content: bytes) -> None:
        """Send the results of commands to the pages that sent them."""
        for found in json.loads(content):
            watcher = self._all.get(found.pop("watcher"))
            if watcher is not None:
                watcher.unanswered -= 1
                watcher.send(_json(found))

    # Pages

    async def watch(self, connection: ServerConnection, token: str) -> int:
        """Serve a page until it ends; returns the code to close the connection with."""
        if len(self._all) >= MOST_WATCHERS:
            await connection.close(1013, f"{MOST_WATCHERS} pages look at this node already, and no more can")
            return 1013
        self._opened += 1
        watcher = self._all[self._opened] = Watcher(self._opened, connection, token == self._owner)
        watcher.send(_json({"hello": {**self._about, "owner": watcher.owner}}))
        for key in KEPT:
            if key in self._kept:
                watcher.send(self._kept[key])
        self._send_hand_states()
        self._update_looking()
        sending = asyncio.ensure_future(self._send(watcher))
        try:
            async for message in connection:
                if not isinstance(message, str):
                    return 1003
                if watcher.is_too_fast() or not self._take(watcher, message):
                    return 1008
        except ConnectionClosed:
            pass
        finally:
            sending.cancel()
            del self._all[watcher.number]
            if self._hand is watcher:
                self._hand = None
            self._release_string(watcher)
            self._send_hand_states()
            self._update_looking()
        return 1000

    async def _send(self, watcher: Watcher) -> None:
        shown = b""
        with suppress(ConnectionClosed):
            while True:
                await watcher.due.wait()
                watcher.due.clear()
                while watcher.texts:
                    text = watcher.texts.popleft()
                    await watcher.connection.send(text.decode() if len(text) < PIECE else _pieces(text), text=True)
                if watcher.looking and self._picture is not shown:
                    shown = self._picture
                    await watcher.connection.send(shown)

    def _update_looking(self) -> None:
        """Inform the node whether any page is visible."""
        looking = any(watcher.looking for watcher in self._all.values())
        if looking != self._looking:
            self._looking = looking
            self._to_node(LOOKING, _json(looking))

    def _take(self, watcher: Watcher, message: str) -> bool:
        """Process a page's message; returns whether it is valid."""
        try:
            found = json.loads(message, parse_constant=_no_number)
        except (ValueError, RecursionError):
            return False
        if not isinstance(found, dict):
            return False
        match found:
            case {"looking": bool(looking)} if len(found) == 1:
                watcher.looking = looking
                watcher.due.set()
                self._update_looking()
            case {"hand": "ask" | "give" | "take" | "lock" | "unlock" as wish} if len(found) == 1:
                self._wish(watcher, wish)
            case {"id": int(number), "entry": dict()} | {"id": int(number), "begin": dict()} if len(found) == 2:
                return self._command(watcher, number, found)
            case {"id": int(number), "time": "pause" | "resume" | "step" | "reset"} if len(found) == 2:
                return self._command(watcher, number, found)
            case _:
                return False
        return True

    def _command(self, watcher: Watcher, number: int, command: dict[str, Any]) -> bool:
        if not 0 <= number < 1 << 53:
            return False
        entry = command.get("entry", {})
        release = entry.get("string") == "release"
        if not (self._has_hand(watcher) or (release and watcher.holds)):
            who = "its owner has locked it" if self._locked else "somebody else drives"
            watcher.send(_json({"answer": number, "refusal": f"{who}: ask for the hand"}))
            return True
        if watcher.unanswered >= MOST_UNANSWERED:
            watcher.send(_json({"answer": number, "refusal": "too many commands at once"}))
            return True
        if "string" in entry:
            watcher.holds = not release
        watcher.unanswered += 1
        self._to_node(COMMAND, _json({**command, "watcher": watcher.number}))
        return True

    # The hand

    def _has_hand(self, watcher: Watcher) -> bool:
        """Whether the page has the hand; it gets the hand if it is free."""
        now, hand = time.monotonic(), self._hand
        if hand is not watcher:
            free = hand is None or (now > hand.did_s + IDLE_S and not hand.holds)
            if not free or (self._locked and not watcher.owner):
                return False
            self._pass_to(watcher)
        watcher.did_s = now
        return True

    def _pass_to(self, watcher: Watcher | None) -> None:
        before, self._hand = self._hand, watcher
        if before is not None and before is not watcher:
            self._release_string(before)
        if watcher is not None:
            watcher.asks, watcher.did_s = False, time.monotonic()
        self._send_hand_states()

    def _release_string(self, watcher: Watcher) -> None:
        """Release the string that the page holds, since no other page can."""
        if watcher.holds:
            watcher.holds = False
            self._to_node(COMMAND, _json({"entry": {"string": "release"}, "watcher": 0, "id": 0}))

    def _wish(self, watcher: Watcher, wish: str) -> None:
        if wish == "ask":
            watcher.asks = not self._has_hand(watcher)
        elif wish == "give" and self._hand is watcher:
            waiting = [other for other in self._all.values() if other.asks and not (self._locked and not other.owner)]
            self._pass_to(waiting[0] if waiting else None)
        elif watcher.owner and wish == "take":
            self._pass_to(watcher)
        elif watcher.owner and wish in ("lock", "unlock"):
            self._locked = wish == "lock"
            if self._locked:
                self._pass_to(watcher)
        self._send_hand_states()

    def _send_hand_states(self) -> None:
        waiting = sum(watcher.asks for watcher in self._all.values())
        for watcher in self._all.values():
            state = {"yours": self._hand is watcher, "taken": self._hand is not None, "locked": self._locked}
            watcher.send(
                _json({"hand": {**state, "asking": waiting, "asked": watcher.asks, "watchers": len(self._all)}})
            )


def _json(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()


def _no_number(_: str) -> float:
    raise ValueError


async def _pieces(text: bytes) -> AsyncIterator[str]:
    """Yield the fragments of a text; the node's texts are ASCII, so each fragment is valid text."""
    for at in range(0, len(text), PIECE):
        yield text[at : at + PIECE].decode()


# The process


class _Child:
    """The child process. It reads and writes frames on threads, because asyncio's pipes differ between systems."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._in, self._out = sys.stdin.buffer, sys.stdout.buffer
        # Frames wait here, so that a node that reads slowly doesn't block the event loop.
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._filled = threading.Event()
        # A library's output must not get between frames.
        sys.stdout = sys.stderr

    async def run(self, settings: dict[str, Any]) -> None:
        """Serve until the node ends."""
        owner, guest, host = new_token(), new_token(), settings["host"]
        watchers = Watchers(owner, guest, settings["about"], self.put)
        with open(settings["page"], "rb") as file:
            page = file.read()
        tokens = {owner: "live", guest: "live"}
        server = PageServer(page, tokens, host, lambda line: self.put(LOG, line.encode()), watchers.watch)
        try:
            await server.begin(settings["port"], settings["default"])
        except InputError as error:
            write_frame(self._out, LISTENS, _json({"refused": [error.field, error.received, error.accepted]}))
            return
        own = addresses(host, server.port, f"live/{owner}")[0]
        others = addresses(host, server.port, f"live/{guest}")[1]
        write_frame(self._out, LISTENS, _json({"address": own, "guests": others}))
        threading.Thread(target=self._write, name="write", daemon=True).start()
        await self._loop.run_in_executor(None, self._read, watchers)

    def put(self, kind: int, content: bytes) -> None:
        """Queue a frame to the node."""
        self._waiting.append((kind, content))
        self._filled.set()

    def _write(self) -> None:
        while True:
            self._filled.wait()
            self._filled.clear()
            while self._waiting:
                try:
                    write_frame(self._out, *self._waiting.popleft())
                except OSError:
                    os._exit(0)  # the node has ended

    def _read(self, watchers: Watchers) -> None:
        handlers = {BROADCAST: watchers.broadcast, PICTURE: watchers.picture, ANSWERS: watchers.answers}
        while (frame := read_frame(self._in)) is not None:
            kind, content = frame
            self._loop.call_soon_threadsafe(handlers[kind], content)


def main() -> None:
    """Run the child process."""
    # The node handles Ctrl-C; this process ends when the node has ended.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(_serve(json.loads(sys.argv[1])))
    os._exit(0)


async def _serve(settings: dict[str, Any]) -> None:
    await _Child().run(settings)


if __name__ == "__main__":
    main()
