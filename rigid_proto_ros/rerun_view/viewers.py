# SPDX-License-Identifier: MIT
"""Viewer processes: the web viewer's server, the native window and the headless viewer."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import Future
from pathlib import Path
from urllib.parse import quote

from ..base.errors import is_missing
from ..base.interrupts import end_with_this_thread
from ..base.ports import LOOPBACK
from .ports import PortTakenError, listens

STOP_TIMEOUT_S = 1.0
START_TIMEOUT_S = 30.0
"""Timeout of a viewer's start [s], for a busy machine; usually it takes 0.3 s."""


def viewer_program() -> str | None:
    """Path of the ``rerun`` program, installed with the library or on PATH."""
    found = importlib.util.find_spec("rerun_cli")
    for folder in (found.submodule_search_locations or []) if found else []:
        program = Path(folder) / ("rerun.exe" if sys.platform == "win32" else "rerun")
        if program.is_file():
            return str(program)
    return shutil.which("rerun")


def has_display() -> bool:
    """Whether a window could open."""
    return sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _run(command: list[str], log: int, started: Future[subprocess.Popen[bytes]]) -> None:
    # RERUN_APP_ONLY suppresses the analytics question on the terminal. TMPDIR: the viewer leaves its temporary folder
    # behind when it is ended by a signal.
    with tempfile.TemporaryDirectory(prefix="rigid_proto_", ignore_cleanup_errors=True) as folder:
        environment = {**os.environ, "RERUN_APP_ONLY": "true", "TMPDIR": folder}
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=environment,
                preexec_fn=end_with_this_thread(),
            )
        except OSError as error:
            started.set_exception(error)
            return
        started.set_result(process)
        process.wait()


class ViewerProcess:
    """A viewer started here; it ends with ``stop`` or with this process."""

    def __init__(self, *arguments: str, log: int = subprocess.DEVNULL) -> None:
        program = viewer_program()
        if program is None:
            raise FileNotFoundError(is_missing("rerun-sdk", "rerun"))
        started: Future[subprocess.Popen[bytes]] = Future()
        # Started by a thread that waits for it, because the viewer ends with the thread that starts it, and the calling
        # thread may end before.
        run = ([program, *arguments], log, started)
        self._thread = threading.Thread(target=_run, args=run, name="viewer", daemon=True)
        self._thread.start()
        self.process = started.result()

    @property
    def running(self) -> bool:
        """Whether the process is running."""
        return self.process.poll() is None

    def stop(self) -> None:
        """End the process by SIGTERM, and by SIGKILL after STOP_TIMEOUT_S."""
        if self.running:
            self.process.terminate()
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self._thread.join()


def serve_web(web_port: int, stream_address: str) -> tuple[ViewerProcess, str]:
    """Serve the web viewer on loopback; returns its process and the address to open, which shows the stream.

    It is a separate process because the library's in-process server would listen on all interfaces. Raises
    PortTakenError if another process listens on the port, and OSError if the viewer doesn't start.
    """
    process = ViewerProcess(
        *("--serve-web", "--bind", LOOPBACK, "--web-viewer-port", str(web_port), "--port", "auto", stream_address)
    )
    deadline = time.monotonic() + START_TIMEOUT_S
    while not listens(process.process.pid, web_port):
        if not process.running:
            raise PortTakenError(f"port {web_port} was taken by another program")
        if time.monotonic() > deadline:
            process.stop()
            raise OSError(f"the web viewer didn't start within {START_TIMEOUT_S:g} s")
        time.sleep(0.02)
    return process, f"http://{LOOPBACK}:{web_port}/?url={quote(stream_address, safe='')}"


def open_native(stream_address: str) -> ViewerProcess:
    """Open the native viewer's window on the stream."""
    return ViewerProcess("--bind", LOOPBACK, "--port", "auto", "--connect", stream_address)


def open_headless(port: int, width: int, height: int, log: int = subprocess.DEVNULL) -> ViewerProcess:
    """A viewer without a window, controlled through ``port`` on loopback."""
    return ViewerProcess(
        *("--headless", "--bind", LOOPBACK, "--port", str(port), "--window-size", f"{width}x{height}"),
        "--hide-welcome-screen",
        log=log,
    )
