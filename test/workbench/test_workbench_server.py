# SPDX-License-Identifier: MIT
"""The page's server: whom it lets in, how much it takes in, and where its links lead. No browser, no ROS."""

from __future__ import annotations

import http.client
import importlib.util
import socket
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.cli.processes import Processes
from rigid_proto_ros.rerun_view.ports import LOOPBACK, any_free_port
from rigid_proto_ros.workbench.controls import Controls
from rigid_proto_ros.workbench.listening import choose_page_port
from rigid_proto_ros.workbench.server import make_server, refusal, stop_server
from rigid_proto_ros.workbench.upload import MAX_BYTES
from rigid_proto_ros.workbench.viser_internals import MAX_TRANSFERS, PART_BYTES, guard_uploads

OPENED: list[str] = []


@pytest.fixture(scope="module")
def server() -> Iterator:
    server = make_server(LOOPBACK, any_free_port(), OPENED.append)
    yield server
    stop_server(server)


NOT_HERE = "203.0.113.7"
"""An address that documents are written about: no machine has it."""


@pytest.mark.parametrize("host", [NOT_HERE, "a..b", "http://127.0.0.1"])
def test_a_host_that_nothing_can_listen_on_is_refused_by_name(host: str) -> None:
    with pytest.raises(InputError, match="--host: got"):
        make_server(host, any_free_port(), OPENED.append)


def test_a_taken_port_is_refused_and_never_another_one(server, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = server.get_port()
    for host in (LOOPBACK, "0.0.0.0"):
        with pytest.raises(InputError, match=f"--port: got {taken}"):
            make_server(host, taken, OPENED.append)
    # Somebody takes it after the first look, and viser goes on to the next one.
    monkeypatch.setattr("rigid_proto_ros.workbench.server.check_address", lambda host, port: None)
    with pytest.raises(InputError, match=f"--port: got {taken}"):
        make_server(LOOPBACK, taken, OPENED.append)


def test_without_a_port_asked_for_the_next_free_one_is_taken_on_the_host_that_is_served() -> None:
    with socket.create_server(("127.0.0.2", 0)) as other:
        taken = other.getsockname()[1]
        assert choose_page_port("127.0.0.2", None, taken) > taken
        with pytest.raises(InputError, match=f"--port: got {taken}"):
            choose_page_port("127.0.0.2", taken, taken)


@pytest.mark.parametrize(
    "arguments, named",
    [
        (["--host", NOT_HERE], "--host"),
        (["--port", "0"], "--port"),
        (["--port", "65536"], "--port"),
        (["--link", "garbage"], "link"),
        (["--link", ""], "link"),
        (["--node", "other", "--link", "http://127.0.0.1:8080/?1.AAAA"], "link"),
    ],
)
def test_an_address_or_a_link_that_leads_nowhere_is_refused_before_anything_starts(
    arguments, named, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(Processes, "start", lambda self, command: pytest.fail(f"started {command}"))
    assert main(["workbench", *arguments]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and f" {named}: " in told.err


def status(server, path: str = "/", **headers: str) -> int:
    connection = http.client.HTTPConnection(LOOPBACK, server.get_port(), timeout=20)
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


def test_a_page_opened_with_a_link_hands_it_on_and_an_image_does_not(server) -> None:
    OPENED.clear()
    assert status(server, "/?1.abc", Sec_Fetch_Dest="image") == 200
    assert OPENED == []
    assert status(server, "/?1.abc-_", Sec_Fetch_Dest="document") == 200
    assert OPENED == ["1.abc-_"]


@pytest.mark.parametrize(("package", "extra"), [("viser", "[workbench]"), ("rclpy", "[ros]")])
def test_without_what_it_needs_the_command_says_so_in_one_line(package, extra, monkeypatch, capsys) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *given: None if name == package else find(name, *given)
    )
    assert main(["workbench"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and package in told.err and extra in told.err


def test_a_running_node_and_a_scene_to_start_one_are_refused_together(capsys) -> None:
    assert main(["workbench", "t_handle", "--node", "other"]) == 2
    assert "not both" in capsys.readouterr().err


def test_nobody_can_ask_for_a_public_tunnel(server) -> None:
    from viser import _messages

    handlers = server._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers


def test_what_one_page_sets_another_one_shows(server) -> None:
    """The panel's inputs belong to the server: its parameters' controls, that all pages share."""
    import msgspec.msgpack
    from websockets.sync.client import connect

    sent: list[dict] = []
    with server.gui.add_folder("Two pages"):
        controls = Controls(server.gui, sent.append, [].append)
        field = controls.number("mass", "Mass")
    address, protocol = f"ws://{LOOPBACK}:{server.get_port()}", f"viser-v{viser.__version__}"
    with connect(address, subprotocols=[protocol]) as one, connect(address, subprotocols=[protocol]) as other:
        update = {"type": "GuiUpdateMessage", "uuid": field._impl.uuid, "updates": {"value": "0.28125"}}
        one.send(msgspec.msgpack.encode(update))
        while b"0.28125" not in other.recv(timeout=20):
            pass
    # What the node has in force is shown on all of them, whoever set it.
    controls.update({"mass": 0.5}, at_once=True)
    assert field.value == "0.5"


class Transfers:
    """viser's own two functions, on as much of it as they need."""

    def __init__(self) -> None:
        self.refused: list[str] = []
        self.started: list[str] = []
        self.taken = 0
        self.acknowledged: list[int] = []
        handlers: dict = {}
        self.transfers: dict[str, dict] = {}
        gui = SimpleNamespace(
            _current_file_upload_states=self.transfers,
            _handle_file_transfer_start=self._start,
            _handle_file_transfer_part=self._part,
        )
        socket = SimpleNamespace(
            unregister_handler=lambda kind, old: None,
            register_handler=handlers.__setitem__,
            queue_message=lambda message: self.acknowledged.append(message.transferred_bytes),
        )
        guard_uploads(SimpleNamespace(_websock_server=socket, gui=gui), lambda why: self.refused.append(why))
        self._on = {kind.__name__: handler for kind, handler in handlers.items()}

    def _start(self, client_id, message) -> None:
        self.started.append(message.transfer_uuid)
        name, total = message.filename, message.size_bytes
        self.transfers[message.transfer_uuid] = {"filename": name, "transferred_bytes": 0, "total_bytes": total}

    def _part(self, client_id, message) -> None:
        self.transfers[message.transfer_uuid]["transferred_bytes"] += len(message.content)
        self.taken += len(message.content)

    def announce(self, name: str, size: int, uuid: str = "a", parts: int | None = None) -> None:
        parts = -(-size // PART_BYTES) if parts is None else parts
        message = SimpleNamespace(
            source_component_uuid="b", transfer_uuid=uuid, filename=name, size_bytes=size, part_count=parts
        )
        self._on["FileTransferStartUpload"](0, message)

    def send(self, content: bytes, uuid: str = "a") -> None:
        self._on["FileTransferPart"](0, SimpleNamespace(transfer_uuid=uuid, content=content))


def test_a_file_of_500_mb_is_refused_before_it_comes_and_its_parts_are_not_kept() -> None:
    transfers = Transfers()
    transfers.announce("huge.stl", 500_000_000)
    for _ in range(3):
        transfers.send(b"\0" * PART_BYTES)
    assert transfers.started == [] and transfers.taken == 0
    assert f"1 to {MAX_BYTES} bytes" in transfers.refused[0]
    assert transfers.acknowledged == [500_000_000]  # the browser's progress display ends


@pytest.mark.parametrize("name", ["page.html", "mesh.exe", "mesh", "..", "scene.yaml", "mesh.obj.zip"])
def test_wrong_types_are_refused_before_they_come(name: str) -> None:
    transfers = Transfers()
    transfers.announce(name, 100)
    assert transfers.started == [] and "accepted: a file named" in transfers.refused[0]


def test_a_file_that_is_longer_than_it_said_is_dropped_whole() -> None:
    transfers = Transfers()
    transfers.announce("liar.obj", 1000)
    transfers.send(b"v" * 600)
    transfers.send(b"v" * 600)
    assert transfers.transfers == {} and "longer than announced" in transfers.refused[0]
    transfers.send(b"v" * 100)
    assert transfers.taken == 600


def test_unfinished_files_are_bounded_in_number_and_a_wrong_count_of_parts_is_refused() -> None:
    transfers = Transfers()
    for k in range(1000):
        transfers.announce("mesh.ply", 1000, uuid=str(k))
    assert len(transfers.transfers) == MAX_TRANSFERS
    assert len(transfers.refused) == 1000 - MAX_TRANSFERS
    other = Transfers()
    other.announce("mesh.ply", 1000, parts=10_000_000)
    assert other.started == []
