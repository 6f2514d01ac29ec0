# SPDX-License-Identifier: MIT
"""What the page uses of viser and websockets beyond what they promise is there, and does what the page needs."""

from __future__ import annotations

import inspect

import pytest

viser = pytest.importorskip("viser", reason="viser is not installed: no interactive page")

VERSION = f"viser {viser.__version__}"


@pytest.mark.parametrize(
    "name, fields",
    [
        ("ShareUrlRequest", ()),
        ("ShareUrlDisconnect", ()),
        (
            "FileTransferStartUpload",
            ("source_component_uuid", "transfer_uuid", "filename", "part_count", "size_bytes"),
        ),
        ("FileTransferPart", ("transfer_uuid", "content")),
        ("FileTransferPartAck", ("source_component_uuid", "transfer_uuid", "transferred_bytes", "total_bytes")),
    ],
)
def test_viser_has_the_messages_that_the_page_answers_itself(name: str, fields: tuple[str, ...]) -> None:
    from viser import _messages

    kind = getattr(_messages, name, None)
    assert kind is not None, f"{VERSION} has no message {name}: see workbench/viser_internals.py"
    missing = set(fields) - set(inspect.signature(kind).parameters)
    assert not missing, f"{name} of {VERSION} has no {', '.join(missing)}: see workbench/viser_internals.py"


def test_viser_has_the_handlers_that_the_page_replaces() -> None:
    from viser._gui_api import GuiApi
    from viser.infra._infra import WebsockMessageHandler

    source = inspect.getsource(GuiApi)
    for name in ("_current_file_upload_states", "_handle_file_transfer_start", "_handle_file_transfer_part"):
        assert name in source, f"GuiApi of {VERSION} has no {name}: see workbench/viser_internals.py"
    for name in ("register_handler", "unregister_handler"):
        assert hasattr(WebsockMessageHandler, name), f"{VERSION} has no {name}: see workbench/viser_internals.py"
    assert "_websock_server" in inspect.getsource(viser.ViserServer), f"ViserServer of {VERSION} has no _websock_server"


def test_viser_starts_its_server_by_the_function_that_the_page_stands_before() -> None:
    import websockets
    from viser.infra import _infra

    source = inspect.getsource(_infra)
    used = "websockets.asyncio.server" in source and "process_request" in source
    assert used, f"{VERSION} with websockets {websockets.__version__}: see workbench/viser_internals.py"
