# SPDX-License-Identifier: MIT
"""Who may look at a node's page and drive it, and what whoever may not can do: nothing."""

from __future__ import annotations

import json
import os
import pty
import random
import re
import select
import socket
import struct
import subprocess
import sys
import time
from typing import Any

import pytest

pytest.importorskip("websockets", reason="websockets is not installed: no page of a node")

from live_rig import Beside, Page, asked, beside, until
from page_browser import Opened
from ros_process import from_source
from websockets.exceptions import ConnectionClosed, InvalidStatus

from rigid_proto_ros.page.server import LINE_S, MOST_WATCHERS, forbidden

HELD_MB = 64.0


@pytest.fixture(scope="module")
def flown():
    with beside() as one:
        yield one


@pytest.fixture(autouse=True)
def nobody_left(flown: Beside):
    """The child is there after each test, has printed no traceback, and holds little."""
    flown.said.clear()
    before = flown.child.memory_info().rss
    yield
    assert flown.child.is_running()
    assert (flown.child.memory_info().rss - before) / 1e6 < HELD_MB
    assert flown.live.call(lambda: True)


def host(flown: Beside) -> str:
    return f"Host: 127.0.0.1:{flown.port}"


def test_the_page_comes_with_headers_that_forbid_frames_and_other_sites(flown: Beside) -> None:
    status, headers, body = asked(flown.port, flown.path, host(flown))
    assert status == 200 and body.startswith(b"<!doctype html>")
    assert headers["x-frame-options"] == "DENY"
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    assert headers["referrer-policy"] == "no-referrer" and headers["x-content-type-options"] == "nosniff"
    packed = asked(flown.port, flown.path, host(flown), "Accept-Encoding: gzip")
    assert packed[1]["content-encoding"] == "gzip" and len(packed[2]) < 0.6 * len(body)


@pytest.mark.parametrize(
    ("path", "lines"),
    [
        ("{path}", ["Host: rebound.example:{port}"]),
        ("{path}", ["Host: 127.0.0.1.rebound.example:{port}"]),
        ("{path}", []),
        ("{path}", ["Host: 127.0.0.1:{port}", "Host: rebound.example"]),
        ("{path}", ["Host: 127.0.0.1:{port}", "Origin: http://other.example"]),
        ("{path}", ["Host: 127.0.0.1:{port}", "Origin: null"]),
        ("{path}", ["Host: 127.0.0.1:{port}", "Origin: http://127.0.0.1:1"]),
        ("/", ["Host: 127.0.0.1:{port}"]),
        ("/live/", ["Host: 127.0.0.1:{port}"]),
        ("/live/wrong", ["Host: 127.0.0.1:{port}"]),
        ("/live/%C3%A4\x80", ["Host: 127.0.0.1:{port}"]),
        ("{page}", ["Host: 127.0.0.1:{port}"]),
        ("{path}/../../etc/passwd", ["Host: 127.0.0.1:{port}"]),
    ],
)
@pytest.mark.parametrize("upgrade", [False, True])
def test_whoever_rebinds_a_name_comes_from_another_site_or_lacks_the_token_is_refused(
    flown, path, lines, upgrade
) -> None:
    names = {"path": flown.path, "port": flown.port, "page": flown.path.replace("live", "page")}
    extra = [
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    ]
    status, _, body = asked(
        flown.port, path.format(**names), *(line.format(**names) for line in lines), *(extra if upgrade else [])
    )
    assert status in (0, 400, 403) and b"<!doctype" not in body


def test_another_site_gets_no_socket(flown: Beside) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        Page(flown.page.address, Origin="http://other.example")
    with Page(flown.page.address, Origin=f"http://127.0.0.1:{flown.port}") as own:
        own.until(lambda: "scene" in own.told, "scene")


@pytest.mark.parametrize(
    ("served", "host", "origin", "refused"),
    [
        ("0.0.0.0", "192.168.1.20:8080", None, False),
        ("0.0.0.0", "[fe80::1]:8080", None, False),
        ("teacher.local", "teacher.local:8080", "http://teacher.local:8080", False),
        ("0.0.0.0", "localhost:8080", "http://localhost:8080", False),
        ("0.0.0.0", "teacher.local:8080", None, True),
        ("teacher.local", "teacher.local.evil.example", None, True),
        ("127.0.0.1", "localhost.:8080", None, True),
        ("127.0.0.1", "[::1", None, True),
        ("127.0.0.1", "127.0.0.1:8080", "http://127.0.0.1.evil.example:8080", True),
    ],
)
def test_a_host_is_a_number_localhost_or_the_name_given(served, host, origin, refused) -> None:
    assert bool(forbidden(served, host, origin)) == refused


def test_no_page_names_a_file(flown: Beside, tmp_path) -> None:
    victim = tmp_path / "victim.mcap"
    with Page(flown.page.address) as page:
        for entry in (
            {"set": {"record": str(victim)}},
            {"set": {"mesh": "/etc/hostname"}},
            {"set": {"mesh": "../part.obj"}},
            {"set": {"mesh": "package://x/y.obj"}},
            {"set": {"viewer": "web"}},
            {"set": {"workbench_port": 1}},
            {"set": {"publish_rate": 1e6}},
            {"service": "reset"},
            {"at": "com", "force": [0, 0, 1], "repeat": {"count": 1000000, "every": 1e-6}},
            {"t": 5, "at": "com", "force": [0, 0, 1]},
            {"more": True},
        ):
            assert page.do(entry=entry), entry
        assert page.do(begin={"mesh": "/etc/hostname"}) and page.do(begin={"mesh": "t_handle", "record": str(victim)})
        assert page.do(begin={"mesh": 3}) and page.do(begin={"scale": "x"})
        assert flown.live.scenario.parameters.mesh == "t_handle" and not victim.exists()
        assert page.do(entry={"set": {"mesh": "hammer"}}) is None
        assert page.do(entry={"set": {"mesh": "t_handle"}}) is None


# For others in the network

BLOCKS = {" ": (1, 1), "▀": (0, 1), "▄": (1, 0), "█": (0, 0)}
"""Dark (1) and light cells, one above the other, on a dark ground."""


def workbench(output: int) -> subprocess.Popen:
    words = ["-m", "rigid_proto_ros.cli.executables", "rigid_proto", "workbench", "--host", "0.0.0.0", "--no-browser"]
    environment = from_source({**os.environ, "PYTHONIOENCODING": "utf-8"})
    return subprocess.Popen([sys.executable, *words], env=environment, stdout=output, stderr=subprocess.DEVNULL)


def test_on_a_terminal_the_address_for_others_is_also_a_code_for_a_camera() -> None:
    segno = pytest.importorskip("segno")
    terminal, end = pty.openpty()
    served = workbench(end)
    os.close(end)
    said = b""
    try:
        while said.count(b"\x1b[97;40m") < 10 or not said.endswith(b"\n"):
            said += os.read(terminal, 65536)
        time.sleep(0.3)
        said += os.read(terminal, 65536) if select.select([terminal], [], [], 0.0)[0] else b""
    finally:
        served.kill()
        served.wait()
        os.close(terminal)
    lines = said.decode().splitlines()
    (address,) = re.findall(r"Others open (http\S+):", said.decode())
    rows = [line.removeprefix("\x1b[97;40m").removesuffix("\x1b[0m") for line in lines if line.startswith("\x1b")]
    cells = [[BLOCKS[block][half] for block in row] for row in rows for half in (0, 1)]
    code = [[int(cell) for cell in row] for row in segno.make(address, micro=False).matrix_iter(border=2)]
    assert cells[: len(code)] == code


def test_what_isnt_a_terminal_gets_the_address_in_words_alone() -> None:
    served = workbench(subprocess.PIPE)
    try:
        said = [served.stdout.readline() for _ in range(2)]
        time.sleep(0.3)
        assert not select.select([served.stdout], [], [], 0.0)[0]
    finally:
        served.kill()
        served.wait()
    assert b"The workbench is at" in said[0] and b"Others open http://" in said[1] and b"\x1b" not in b"".join(said)


# One hand


def test_one_hand_drives_others_watch_ask_and_get_it(flown: Beside) -> None:
    with Page(flown.page.address) as first, Page(flown.page.address) as second:
        assert first.do(entry={"set": {"mass": 0.2}}) is None
        second.until(lambda: second.told.get("hand", {}).get("taken"), "hand that is taken")
        assert "ask for the hand" in str(second.do(entry={"set": {"mass": 0.3}}))
        assert "ask for the hand" in str(second.do(time="pause"))
        assert "ask for the hand" in str(second.do(begin={"mesh": "hammer"}))
        assert flown.live.scenario.parameters.mass == 0.2 and not flown.live.paused
        # Whoever watches sees what the other does.
        second.until(lambda: second.told["scene"]["values"]["mass"] == 0.2, "scene with the new mass")
        second.send({"hand": "ask"})
        first.until(lambda: first.told["hand"]["asking"] == 1, "one who asks")
        first.send({"hand": "give"})
        second.until(lambda: second.told["hand"]["yours"], "hand")
        assert second.do(entry={"set": {"mass": 0.3}}) is None
        assert first.do(entry={"set": {"mass": 0.4}}) is not None
        assert flown.live.scenario.parameters.mass == 0.3


def test_a_guest_can_neither_take_nor_lock_and_the_owner_can(flown: Beside) -> None:
    with beside(host="0.0.0.0") as open_to_all:
        guests = open_to_all.page.guests.replace(open_to_all.page.guests.split("/")[2].rpartition(":")[0], "127.0.0.1")
        assert guests != open_to_all.page.address
        with Page(guests) as pupil, Page(open_to_all.page.address) as teacher:
            assert pupil.do(entry={"set": {"mass": 0.2}}) is None
            pupil.send({"hand": "lock"})
            teacher.send({"hand": "lock"})
            pupil.until(lambda: pupil.told["hand"]["locked"], "lock")
            assert "locked" in str(pupil.do(entry={"set": {"mass": 0.3}}))
            for wish in ("take", "unlock", "ask"):
                pupil.send({"hand": wish})
            assert "locked" in str(pupil.do(entry={"set": {"mass": 0.3}}))
            assert teacher.do(entry={"set": {"mass": 0.5}}) is None
            teacher.send({"hand": "unlock"})
            teacher.send({"hand": "give"})
            pupil.until(lambda: not pupil.told["hand"]["locked"], "end of the lock")
            assert pupil.do(entry={"set": {"mass": 0.6}}) is None


@pytest.mark.stress
@pytest.mark.drawn
def test_the_hands_card_holds_what_owner_and_guest_are_told_in_a_small_window_and_stays_as_high(browser: Any) -> None:
    with beside(host="0.0.0.0") as open_to_all:
        guests = open_to_all.page.guests.replace(open_to_all.page.guests.split("/")[2].rpartition(":")[0], "127.0.0.1")
        pages = [Opened(browser, address=at, bypass_csp=True) for at in (open_to_all.page.address, guests)]
        owner, guest = pages
        high = set()

        def looked(said: str, page: Opened) -> None:
            until(lambda: said in page.page.locator("#live").inner_text(), f"{said} on the page")
            for each in pages:
                each.page.bring_to_front()
                each.drawn()
                inside = "const card = document.getElementById('hand'); "
                assert each.js(f"() => {{ {inside} return card.scrollHeight - card.clientHeight; }}") <= 0
                high.add(round(each.page.locator("#hand").bounding_box()["height"]))

        looked("2 look", owner)
        guest.js("page.motion.set({ mass: 0.5 })")
        looked("Somebody else drives", owner)
        owner.page.get_by_role("button", name="take it").click()
        looked("You drive", owner)
        guest.page.get_by_role("button", name="ask for it").click()
        looked("somebody asks", owner)
        owner.page.get_by_role("button", name="lock").click()
        looked("Its owner drives", guest)
        assert len(high) == 1, "in every state"
        for page in pages:
            page.close()


def test_a_string_is_released_when_its_hand_goes_or_loses_it(flown: Beside) -> None:
    tie = {"string": {"attach": [0.0, 0.0, 0.0], "target": [0.0, 0.0, 0.3]}}
    flown.live.set_parameters({"string.timeout": 0.0})
    for leave in ("close", "reset", "lose"):
        with Page(flown.page.address) as page, Page(flown.page.address) as owner:
            page.until(lambda page=page: "hand" in page.told, "hand")
            owner.send({"hand": "take"})
            owner.until(lambda owner=owner: owner.told.get("hand", {}).get("yours"), "hand")
            owner.send({"hand": "give"})
            owner.until(lambda owner=owner: not owner.told["hand"]["yours"], "free hand")
            assert page.do(entry=tie) is None and flown.string is not None
            if leave == "close":
                page.socket.close()
            elif leave == "reset":  # a browser that was killed
                plain = page.socket.socket
                plain.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                plain.close()
            else:
                owner.send({"hand": "take"})
            until(lambda: flown.string is None, "release of the string")


# Hostile clients


def messages(chance: random.Random):
    """What no page sends."""

    def value(depth=0):
        kind = chance.randrange(9)
        if kind < 5 or depth > 3:
            return chance.choice(
                [None, True, -1, 1e308, 1 << 70, "", "x" * chance.randrange(200), "\x1b[31m\x07", "\u202e", [], {}]
            )
        if kind < 7:
            return [value(depth + 1) for _ in range(chance.randrange(4))]
        return {
            chance.choice(["id", "entry", "time", "begin", "hand", "looking", "set", "at", "\x00"]): value(depth + 1)
            for _ in range(chance.randrange(4))
        }

    kind = chance.randrange(8)
    if kind == 0:
        return chance.randbytes(chance.randrange(300))
    if kind == 1:
        return "".join(chr(chance.randrange(1, 0xD7FF)) for _ in range(chance.randrange(100)))
    if kind == 2:
        return "[" * chance.randrange(20_000)
    if kind == 3:
        return json.dumps({"id": value(), "entry": value()})
    if kind == 4:
        return json.dumps({"id": 1, chance.choice(["entry", "begin", "time"]): value()})
    if kind == 5:
        return '{"id": 1, "entry": {"force": [NaN, Infinity, 1]}}'
    if kind == 6:
        return json.dumps(
            {"id": 1, "entry": {chance.choice(["wrench", "string", "set", "state", "service", "at", "force"]): value()}}
        )
    return json.dumps(value())


def check_malformed(flown: Beside, count: int, capfd) -> None:
    chance = random.Random(20)
    left = count
    while left:
        with Page(flown.page.address) as page:
            try:
                for _ in range(40):
                    if not left:
                        break
                    left -= 1
                    page.socket.send(messages(chance))
                    page.take()
            except ConnectionClosed:
                pass
        if left % 500 == 0:
            assert flown.live.call(lambda: True)
    with Page(flown.page.address) as page:
        assert page.do(entry={"at": "com", "impulse": [0, 0, 1e-3]}) is None
        page.until(lambda: page.pictures, "picture")
    told = "\n".join(flown.said) + capfd.readouterr().err
    assert "Traceback" not in told and "\x1b" not in told and "xxxx" not in told
    assert all(line.startswith("the page: a client at 127.0.0.1: ended, ") for line in flown.said)


def test_malformed_messages_end_that_connection_in_one_line(flown: Beside, capfd) -> None:
    time.sleep(LINE_S)  # a line of the test before leaves none for that time
    began = time.monotonic()
    check_malformed(flown, 120, capfd)
    until(lambda: flown.said, "line about it")
    assert 1 <= len(flown.said) <= 2 + time.monotonic() - began


@pytest.mark.stress
def test_ten_thousand_malformed_messages(flown: Beside, capfd) -> None:
    check_malformed(flown, 10_000, capfd)


def plain_socket(flown: Beside) -> socket.socket:
    """A WebSocket by hand."""
    plain = socket.create_connection(("127.0.0.1", flown.port), 10.0)
    lines = [
        f"GET {flown.path} HTTP/1.1",
        host(flown),
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Version: 13",
    ]
    plain.sendall("\r\n".join([*lines, "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", "", ""]).encode())
    assert b"101" in plain.recv(100)
    return plain


def test_a_message_that_is_declared_huge_is_ended_before_it_comes(flown: Beside) -> None:
    time.sleep(LINE_S)  # since the line about the test before
    with plain_socket(flown) as plain:
        plain.sendall(b"\x81\xff" + struct.pack(">Q", 1 << 40) + os.urandom(4))
        plain.settimeout(10.0)
        with pytest.raises(ConnectionError):
            while plain.recv(65536):
                plain.sendall(os.urandom(65536))
            raise ConnectionResetError  # closed in good order
    until(lambda: any("more than 32 kB" in line for line in flown.said), "line about it")


def test_an_endless_upload_in_pieces_is_ended_too(flown: Beside) -> None:
    with Page(flown.page.address) as page, pytest.raises(ConnectionClosed):
        page.socket.send("x" * 1000 for _ in range(100_000))
        while True:
            page.take(1.0)


def test_who_sends_more_than_a_page_does_is_ended(flown: Beside) -> None:
    with Page(flown.page.address) as page, pytest.raises(ConnectionClosed):
        for _ in range(5000):
            page.send({"looking": True})
            page.take()


def test_a_page_that_reads_nothing_holds_up_neither_others_nor_memory(flown: Beside) -> None:
    with plain_socket(flown) as stuck, Page(flown.page.address) as page:
        stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        before = flown.child.memory_info().rss
        page.take(3.0)
        assert page.pictures > 40
        assert (flown.child.memory_info().rss - before) / 1e6 < 2.0


def test_more_than_the_told_number_of_watchers_are_refused_by_name(flown: Beside) -> None:
    pages = [Page(flown.page.address) for _ in range(MOST_WATCHERS)]
    try:
        with Page(flown.page.address) as one_more:
            until(lambda: one_more.is_ended, "end of the one too many")
            assert str(MOST_WATCHERS) in one_more.socket.close_reason
        last = pages[-1]
        last.until(lambda: last.pictures > 2, "pictures")
    finally:
        for page in pages:
            page.socket.close()
