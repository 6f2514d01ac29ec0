# SPDX-License-Identifier: MIT
"""The page's server: whom it lets in, how much it takes in, and where its links lead. No browser, no ROS."""

from __future__ import annotations

import http.client
import importlib.util
import re
import socket
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from workbench_page import PATIENCE_S, any_free_port

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.rerun_view.ports import LOOPBACK
from rigid_proto_ros.workbench.main import TITLE, address_of
from rigid_proto_ros.workbench.server import make_server, refusal, stop_server


@pytest.fixture(scope="module")
def server() -> Iterator:
    server = make_server(TITLE, LOOPBACK, None, any_free_port())
    yield server
    stop_server(server)


NOT_HERE = "203.0.113.7"
"""An address that documents are written about: no machine has it."""


@pytest.mark.parametrize("host", ["a..b", "http://127.0.0.1"])
def test_a_host_that_nothing_can_listen_on_is_refused_by_name(host: str) -> None:
    with pytest.raises(InputError, match="--host: got"):
        make_server(TITLE, host, None, any_free_port())


@pytest.mark.parametrize(
    "host, address", [(LOOPBACK, "http://127.0.0.1:8080"), ("::1", "http://[::1]:8080"), ("here", "http://here:8080")]
)
def test_the_address_that_is_told_is_one_that_a_browser_takes(host: str, address: str) -> None:
    assert address_of(SimpleNamespace(get_host=lambda: host, get_port=lambda: 8080)) == address


@pytest.mark.parametrize("in_time", [True, False])
def test_a_port_asked_for_and_taken_is_refused_and_a_default_one_moves_on_and_is_in_the_tabs_title(
    server, monkeypatch: pytest.MonkeyPatch, in_time: bool
) -> None:
    taken = server.get_port()
    if not in_time:  # it was free when it was looked at
        monkeypatch.setattr("rigid_proto_ros.rerun_view.ports.is_free", lambda port: True)
    with pytest.raises(InputError, match=f"--port: got {taken}"):
        make_server(TITLE, LOOPBACK, taken, taken)
    other = make_server(TITLE, LOOPBACK, None, taken)
    port = other.get_port()
    # A second one on this machine has its port in the tab's title, too.
    assert port > taken and title(server) == TITLE and title(other) == f"{TITLE} :{port}"
    stop_server(other)


def title(server) -> str:
    connection = http.client.HTTPConnection(LOOPBACK, server.get_port(), timeout=PATIENCE_S)
    connection.request("GET", "/", headers={"Accept-Encoding": "gzip"})
    (found,) = re.findall("<title>(.*)</title>", connection.getresponse().read().decode())
    connection.close()
    return found


@pytest.mark.parametrize(
    "arguments, named",
    [
        (["--host", NOT_HERE], "--host"),
        (["--port", "0"], "--port"),
        (["--port", "65536"], "--port"),
    ],
)
def test_an_address_that_leads_nowhere_is_refused_before_anything_starts(arguments, named, capsys) -> None:
    assert main(["workbench", *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and f" {named}: " in told.err


def status(server, path: str = "/", **headers: str) -> int:
    connection = http.client.HTTPConnection(LOOPBACK, server.get_port(), timeout=PATIENCE_S)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    found = connection.getresponse().status
    connection.close()
    return found


def test_it_listens_on_loopback_alone(server) -> None:
    with socket.socket() as other:
        # Another address of the same machine: nobody listens there.
        assert other.connect_ex(("127.0.0.2", server.get_port())) != 0


def test_pages_of_other_sites_and_foreign_names_are_turned_away(server) -> None:
    own = f"{LOOPBACK}:{server.get_port()}"
    assert status(server) == 200
    assert status(server, Origin=f"http://{own}") == 200
    assert status(server, Origin="http://example.org") == 403
    assert status(server, Host="rebound.example.org") == 403
    assert status(server, "/../../../etc/passwd") == 404
    assert refusal("0.0.0.0", "workshop.local:8080", "http://workshop.local:8080") == ""
    assert refusal("0.0.0.0", "workshop.local:8080", "http://elsewhere.local") != ""


def test_without_viser_the_command_says_so_in_one_line(monkeypatch, capsys) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *given: None if name == "viser" else find(name))
    assert main(["workbench"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and "viser" in told.err and "[workbench]" in told.err


def test_nobody_can_ask_for_a_public_tunnel(server) -> None:
    from viser import _messages

    assert _messages.ShareUrlRequest not in server._websock_server._incoming_handlers
