# SPDX-License-Identifier: MIT
"""Pictures of a flight from an .rrd file, without a display."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..base.errors import InputError
from ..base.files import check_whole_file, whole_file
from ..base.ports import LOOPBACK
from .backend import SIM_TIME
from .ports import PortTakenError, is_free, listens, serve_on_port
from .viewers import ViewerProcess, open_headless

FIRST_PORT = 19876
"""First port tried, away from the ports of nodes and viewers."""

START_TIMEOUT_S = 60.0
LOAD_TIMEOUT_S = 120.0
DRAWN_STEADY_S = 10.0
"""Timeout of waiting for a steady picture while plots load and the camera moves [s]."""

NOTICE_GONE_S = 6.0
"""Time until the viewer's notice that it runs without a window disappears [s]."""

DRIVERS = "a graphics driver: on Debian and Ubuntu `sudo apt install mesa-vulkan-drivers` draws without a graphics card"

BAR = 37
"""Height of the window's top bar [pixels], which is cut off: menu, search, and information about the machine."""

STAGES = 3
"""Stages of progress: viewer started, recording loaded, drawn."""


def take_picture(
    recording: str | Path,
    at_s: float,
    picture: str | Path,
    size: tuple[int, int] = (1600, 900),
    progress: Callable[[float, float], None] = lambda *_: None,
) -> None:
    """Write a .png of an .rrd file at simulated time ``at_s``. progress(done, total) is called with numbers of stages.

    Raises InputError for a picture that can't be written, and on a machine without graphics drivers.
    """
    picture = Path(picture).absolute()
    check_picture(picture)
    progress(0, STAGES)
    started = time.monotonic()
    with headless_viewer(size[0], size[1] + BAR) as client:
        progress(1, STAGES)
        show(client, Path(recording))
        progress(2, STAGES)
        client.set_time(SIM_TIME, duration=float(at_s), play_state="paused")
        time.sleep(max(0.0, started + NOTICE_GONE_S - time.monotonic()))
        pixels = _stable_picture(client)
        if is_one_colour(pixels):
            raise InputError("--at", at_s, "a time at which the view shows something; this picture came out blank")
        with whole_file("-o", picture) as beside:
            beside.write_bytes(_without_bar(pixels))


def check_picture(picture: str | Path) -> None:
    """Raise InputError unless a picture can be written there; creates its folder."""
    if Path(picture).suffix.lower() != ".png":
        raise InputError("-o", str(picture), "a file that ends in .png")
    check_whole_file("-o", picture)


@contextmanager
def headless_viewer(width: int, height: int) -> Iterator[Any]:
    """Context of a viewer without a window, on loopback; yields its ``ViewerClient`` and stops the viewer
    at the end.
    """
    with tempfile.TemporaryFile() as log:
        try:
            port, process = serve_on_port("snapshot", None, FIRST_PORT, lambda port: _start(port, width, height, log))
        except FileNotFoundError as error:
            raise InputError("snapshot", str(error)) from error
        try:
            yield _connected(f"rerun+http://{LOOPBACK}:{port}/proxy", process, log)
        except ConnectionError as error:
            raise _ended(log) from error
        finally:
            process.stop()


def _start(port: int, width: int, height: int, log: Any) -> tuple[int, ViewerProcess]:
    process = open_headless(port, width, height, log.fileno())
    deadline = time.monotonic() + START_TIMEOUT_S
    while process.running and time.monotonic() < deadline and not listens(process.process.pid, port):
        time.sleep(0.05)
    if not process.running and not is_free(port):
        raise PortTakenError(f"port {port} was taken by another program")
    return port, process


def _connected(address: str, process: ViewerProcess, log: Any) -> Any:
    from rerun.experimental import ViewerClient

    deadline = time.monotonic() + START_TIMEOUT_S
    while process.running and time.monotonic() < deadline:
        try:
            client = ViewerClient.connect(address)
            # With an unsuitable driver the viewer starts, but ends at its first picture.
            client.take_screenshot(None)
            return client
        except Exception:
            # Not listening yet; the client raises errors of several kinds.
            time.sleep(0.1)
    raise _ended(log)


def _ended(log: Any) -> InputError:
    """Why the viewer has ended, from the last line of its output."""
    log.seek(0)
    words = log.read().decode(errors="replace")
    # Without any adapter the viewer says so; with an OpenGL adapter only, it has no render context at its first
    # picture.
    if "adapter" in words.lower() or "render context" in words:
        return InputError("snapshot", f"there is no graphics adapter that the viewer can draw with; install {DRIVERS}")
    last = (words.strip().splitlines() or ["no message"])[-1]
    return InputError("snapshot", last, f"a viewer that starts; if drivers are missing: {DRIVERS}")


def show(client: Any, recording: Path) -> None:
    """Open a recording in the viewer and wait until it is loaded."""
    client.open(str(recording.absolute()))
    deadline = time.monotonic() + LOAD_TIMEOUT_S
    while time.monotonic() < deadline:
        state = client.get_state()
        loaded = any(timeline.name == SIM_TIME for r in state.recordings for timeline in r.timelines)
        if loaded and not state.loading and state.views:
            return
        time.sleep(0.1)
    raise InputError("session", str(recording), f"a recording that the viewer loads within {LOAD_TIMEOUT_S:g} s")


def _stable_picture(client: Any) -> bytes:
    """A screenshot of the window, taken when two in a row are equal, since the first ones are still loading."""
    deadline = time.monotonic() + DRAWN_STEADY_S
    before = client.take_screenshot(None)
    while True:
        time.sleep(0.3)
        after: bytes = client.take_screenshot(None)
        if after == before and not is_one_colour(after) or time.monotonic() > deadline:
            return after
        before = after


def _without_bar(png: bytes) -> bytes:
    with Image.open(io.BytesIO(png)) as image:
        image.crop((0, BAR, *image.size)).save(cropped := io.BytesIO(), "PNG")
    return cropped.getvalue()


def is_one_colour(png: bytes) -> bool:
    """Whether a picture has approximately one colour."""
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image.convert("RGB").resize((128, 128)), dtype=float)
    return float(pixels.std(axis=(0, 1)).max()) < 1.0
