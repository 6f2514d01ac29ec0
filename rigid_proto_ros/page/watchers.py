# SPDX-License-Identifier: MIT
"""Those who look at a node's page, and the one who drives: ``python -m rigid_proto_ros.page.watchers``, a child of the
node that ends when its stdin does, however the node has ended. Its settings are its argument.

Between node and child go frames: length (4 bytes, little-endian), kind (1 byte), content. From the node: what all pages
are told (texts, JSON objects; a key that is in KEPT is told to pages that open later, too), pictures (binary, passed on
as they are), and answers. From the child: first where it listens, or why not. From a page come JSON objects:

    {"id": n, "entry": {...}}                                         an entry of a poke script without its time
    {"id": n, "time": "pause" | "resume" | "step" | "reset"}
    {"id": n, "begin": {parameter: value}}                            another scene
    {"hand": "ask" | "give" | "take" | "lock" | "unlock"}
    {"looking": true | false}

One page at a time has the hand. Who does something while nobody has it gets it; who has done nothing for IDLE_S loses
it to the next who does something. The owner, who has the address that the terminal shows, can take it and lock it.
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

TOLD, PICTURE, ANSWERS = range(3)
"""Kinds of frames from the node."""
LISTENS, COMMAND, LOOKING, SAID = range(4)
"""Kinds of frames to the node."""

HEAD = struct.Struct("<IB")

KEPT = ("mesh", "scene", "time")
"""What is told to pages that open later: of each the last one."""

IDLE_S = 20.0
"""[s] Whoever has the hand and does nothing for so long loses it to the next who does something."""

RATE, BURST = 200.0, 400.0
"""[1/s], messages of a page; a drag sends one a picture. More end it."""

MOST_UNANSWERED = 32
"""Of a page's commands."""

MOST_TEXTS = 256
"""Texts that wait for a page; one that reads more slowly is ended."""

PIECE = 64 * 1024
"""[bytes] Long texts are sent in such pieces, so that no page holds more than one of them here."""


def read_frame(stream: IO[bytes]) -> tuple[int, bytes] | None:
    """Kind and content of the next frame; None at the end."""
    head = stream.read(HEAD.size)
    if len(head) < HEAD.size:
        return None
    length, kind = HEAD.unpack(head)
    content = stream.read(length)
    return (kind, content) if len(content) == length else None


def write_frame(stream: IO[bytes], kind: int, content: bytes) -> None:
    """Raises OSError where nobody reads any more."""
    stream.write(HEAD.pack(len(content), kind) + content)
    stream.flush()


class Watcher:
    """One page. texts: what it is still to be told. holds: whether it has tied the string. unanswered: how many of its
    commands are.
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

    def tell(self, text: bytes) -> None:
        """Send a text; a page that reads too slowly is ended."""
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
        """Whether it sends more than a page does."""
        now = time.monotonic()
        self._allowed = min(BURST, self._allowed + RATE * (now - self._asked_s)) - 1.0
        self._asked_s = now
        return self._allowed < 0.0


class Watchers:
    """owner, guest: tokens. to_node(kind, content) sends a frame."""

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

    def told(self, text: bytes) -> None:
        """All pages are told; JSON whose first key says what it is about."""
        key = text[2 : text.index(b'"', 2)].decode()
        if key in KEPT:
            self._kept[key] = text
        for watcher in self._all.values():
            watcher.tell(text)

    def picture(self, picture: bytes) -> None:
        """The newest picture takes the place of one that wasn't sent yet."""
        self._picture = picture
        for watcher in self._all.values():
            watcher.due.set()

    def answers(self, content: bytes) -> None:
        """What became of commands goes to the pages that gave them."""
        for found in json.loads(content):
            watcher = self._all.get(found.pop("watcher"))
            if watcher is not None:
                watcher.unanswered -= 1
                watcher.tell(_json(found))

    # Pages

    async def watch(self, connection: ServerConnection, token: str) -> int:
        """A page, until it ends; returns the code to close it with."""
        if len(self._all) >= MOST_WATCHERS:
            await connection.close(1013, f"{MOST_WATCHERS} pages look at this node already, and no more can")
            return 1013
        self._opened += 1
        watcher = self._all[self._opened] = Watcher(self._opened, connection, token == self._owner)
        watcher.tell(_json({"hello": {**self._about, "owner": watcher.owner}}))
        for key in KEPT:
            if key in self._kept:
                watcher.tell(self._kept[key])
        self._tell_hands()
        self._look()
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
            self._let_go(watcher)
            self._tell_hands()
            self._look()
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

    def _look(self) -> None:
        looking = any(watcher.looking for watcher in self._all.values())
        if looking != self._looking:
            self._looking = looking
            self._to_node(LOOKING, _json(looking))

    def _take(self, watcher: Watcher, message: str) -> bool:
        """Take a page's message; whether it is one that pages send."""
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
                self._look()
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
            watcher.tell(_json({"answer": number, "refusal": f"{who}: ask for the hand"}))
            return True
        if watcher.unanswered >= MOST_UNANSWERED:
            watcher.tell(_json({"answer": number, "refusal": "too many commands at once"}))
            return True
        if "string" in entry:
            watcher.holds = not release
        watcher.unanswered += 1
        self._to_node(COMMAND, _json({**command, "watcher": watcher.number}))
        return True

    # The hand

    def _has_hand(self, watcher: Watcher) -> bool:
        """Whether it drives, or does from now on."""
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
            self._let_go(before)
        if watcher is not None:
            watcher.asks, watcher.did_s = False, time.monotonic()
        self._tell_hands()

    def _let_go(self, watcher: Watcher) -> None:
        """What it held is released: nobody else can."""
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
        self._tell_hands()

    def _tell_hands(self) -> None:
        waiting = sum(watcher.asks for watcher in self._all.values())
        for watcher in self._all.values():
            state = {"yours": self._hand is watcher, "taken": self._hand is not None, "locked": self._locked}
            watcher.tell(
                _json({"hand": {**state, "asking": waiting, "asked": watcher.asks, "watchers": len(self._all)}})
            )


def _json(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":")).encode()


def _no_number(_: str) -> float:
    raise ValueError


async def _pieces(text: bytes) -> AsyncIterator[str]:
    """Texts from the node are ASCII: each piece is text by itself."""
    for at in range(0, len(text), PIECE):
        yield text[at : at + PIECE].decode()


# The process


class _Child:
    """Reads and writes frames on threads of their own: each system waits for pipes in another way."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._in, self._out = sys.stdin.buffer, sys.stdout.buffer
        # Behind what the node doesn't read at once nothing here waits, but for the pages' commands.
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._written = threading.Event()
        # What a library prints doesn't come between frames.
        sys.stdout = sys.stderr

    async def run(self, settings: dict[str, Any]) -> None:
        """Serve until the node ends."""
        owner, guest, host = new_token(), new_token(), settings["host"]
        watchers = Watchers(owner, guest, settings["about"], self.put)
        with open(settings["page"], "rb") as file:
            page = file.read()
        tokens = {owner: "live", guest: "live"}
        server = PageServer(page, tokens, host, lambda line: self.put(SAID, line.encode()), watchers.watch)
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
        """Write a frame, without waiting for it."""
        self._waiting.append((kind, content))
        self._written.set()

    def _write(self) -> None:
        while True:
            self._written.wait()
            self._written.clear()
            while self._waiting:
                try:
                    write_frame(self._out, *self._waiting.popleft())
                except OSError:
                    os._exit(0)  # the node has ended

    def _read(self, watchers: Watchers) -> None:
        handlers = {TOLD: watchers.told, PICTURE: watchers.picture, ANSWERS: watchers.answers}
        while (frame := read_frame(self._in)) is not None:
            kind, content = frame
            self._loop.call_soon_threadsafe(handlers[kind], content)


def main() -> None:
    """Be the child."""
    # Ctrl-C is the node's: this process ends when that has ended.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(_serve(json.loads(sys.argv[1])))
    os._exit(0)


async def _serve(settings: dict[str, Any]) -> None:
    await _Child().run(settings)


if __name__ == "__main__":
    main()
