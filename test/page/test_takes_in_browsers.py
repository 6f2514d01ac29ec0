# SPDX-License-Identifier: MIT
"""Random takes in browsers end in the states that Node and Python come to: engines of WebAssembly are held to the bits."""

from __future__ import annotations

import base64
import gzip
import json
import os
import shutil
import signal
import subprocess
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from page_tools import TESTS, kernels, node, packages, run_node
from test_takes import check_equal

SECONDS = 240.0
BROWSERS = {
    "chromium": (
        ("chromium", "chromium-browser"),
        ("--headless", "--no-sandbox", "--disable-gpu", "--user-data-dir={}"),
    ),
    "firefox": (("firefox", "firefox-esr"), ("--headless", "--no-remote", "--profile", "{}")),
}
"""Of each: names of the program, and its arguments before the address, with a folder for its profile."""


def program(name: str) -> str:
    """The browser's program, by the environment (FIREFOX=...) or on PATH; the test skips without."""
    found = os.environ.get(name.upper()) or next(filter(None, map(shutil.which, BROWSERS[name][0])), None)
    if not found:
        pytest.skip(f"there is no {name}: {name.upper()}=PATH names one")
    return found


def taking_page(page_file: Path, folder: Path, count: int, seed: int) -> str:
    """A page that makes takes and sends them back."""
    script, esbuild = folder / "takes.js", packages() / "esbuild" / "bin" / "esbuild"
    run_node(esbuild, TESTS / "takes_browser.ts", "--bundle", "--format=iife", f"--outfile={script}")
    packed = {"kernels": kernels().read_bytes(), "data": page_file.read_bytes()}
    parts = [
        f'<script type="application/gzip" id="{name}">{base64.b64encode(gzip.compress(content)).decode()}</script>'
        for name, content in packed.items()
    ]
    send = 'text => fetch("/done", { method: "POST", body: text })'
    run = f'takes({count}, {seed}).then(JSON.stringify, error => "failed: " + error.stack).then({send});'
    return "\n".join(
        [
            "<!doctype html><meta charset=utf-8>",
            *parts,
            f"<script>{script.read_text()}</script>",
            f"<script>{run}</script>",
        ]
    )


def made_by(browser: str, html: str, profile: Path) -> list[dict[str, Any]]:
    """What the page sends back from this browser."""
    came = threading.Event()
    answer: list[str] = []

    class Served(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200 if self.path == "/" else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            if self.path == "/":
                self.wfile.write(html.encode())

        def do_POST(self) -> None:
            answer.append(self.rfile.read(int(self.headers["Content-Length"])).decode())
            self.send_response(204)
            self.end_headers()
            came.set()

        def log_message(self, format: str, *args: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Served)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    words = [word.format(profile) for word in BROWSERS[browser][1]]
    command = [program(browser), *words, f"http://127.0.0.1:{server.server_port}/"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        assert came.wait(SECONDS), f"{browser}: no takes within {SECONDS} s"
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait(30)
        server.shutdown()
    assert not answer[0].startswith("failed"), answer[0][:2000]
    found: list[dict[str, Any]] = json.loads(answer[0])
    return found


@pytest.mark.drawn
@pytest.mark.slow
@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.stress)])
@pytest.mark.parametrize("browser", BROWSERS)
def test_takes_in_a_browser_end_as_in_node_and_in_python(
    page_file: Path, tmp_path: Path, browser: str, count: int
) -> None:
    program(browser)
    node()
    profile = tmp_path / "profile"
    profile.mkdir()
    made = made_by(browser, taking_page(page_file, tmp_path, count, 2), profile)
    assert len(made) == count
    check_equal(made, tmp_path)
