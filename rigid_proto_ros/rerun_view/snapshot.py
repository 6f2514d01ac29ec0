# SPDX-License-Identifier: MIT
"""Pictures of a recorded flight without a display."""

from __future__ import annotations

import io
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from ..base.errors import InputError, one_of
from ..base.files import output_file
from ..session.recorded_session import RecordedSession
from . import entities as e
from .ports import LOOPBACK, PortTakenError, is_free, listens, serve_on_port
from .reader import drawn_times, read_session
from .rrd_file import whole_part
from .viewers import ViewerProcess, open_headless

FIRST_PORT = 19876
"""Where the search for a port begins: away from those that nodes and viewers serve on."""

START_TIMEOUT_S = 60.0
LOAD_TIMEOUT_S = 120.0
DRAWN_STEADY_S = 10.0
"""How long a picture may keep changing (plots load, the camera comes to rest) before it is taken as it is."""

NOTICE_GONE_S = 6.0
"""After this the viewer's note that it runs without a window has left the corner of the window."""

DRIVERS = "a graphics driver: on Debian and Ubuntu `sudo apt install mesa-vulkan-drivers` draws without a graphics card"


STAGES = 4
"""Of a picture: read, viewer started, recording loaded, drawn."""


def take_picture(
    session_path: str | Path,
    at_s: float,
    picture: str | Path,
    view: str = "",
    size: tuple[int, int] = (1600, 900),
    progress: Callable[[float, float], None] = lambda *_: None,
) -> None:
    """Write a .png of the recording at simulated time ``at_s``: the whole layout, its tab of this name, or the view.
    ``progress`` is called with (stages done, all stages).

    Raises InputError for a time that wasn't recorded, a view that isn't there, a picture that can't be written, and a
    machine without the drivers.
    """
    session_path, picture = Path(session_path), Path(picture).absolute()
    progress(0, STAGES)
    session = read_session(session_path)
    if len(session.times):
        check_time(session, at_s)
    else:
        # Of an estimate, say, which is no session.
        _check_between(drawn_times(session_path) if session.complete else None, at_s)
    check_picture(picture)
    progress(1, STAGES)
    with ExitStack() as stack:
        readable = session_path.absolute() if session.complete else stack.enter_context(whole_part(session_path))
        started = time.monotonic()
        client = stack.enter_context(headless_viewer(*size))
        progress(2, STAGES)
        show(client, readable)
        progress(3, STAGES)
        client.set_time(e.SIM_TIME, duration=float(at_s), play_state="paused")
        view_id = bring_to_front(client, view) if view else None
        if view_id is not None:
            pixels = _stable_picture(client, view_id)
        else:
            client.run_command("ui.toggle_top_panel")
            time.sleep(max(0.0, started + NOTICE_GONE_S - time.monotonic()))
            pixels = _without_empty_top(_stable_picture(client, None))
        if is_one_colour(pixels):
            raise InputError("--at", at_s, "a time at which the view shows something; this picture came out blank")
        try:
            picture.write_bytes(pixels)
        except OSError as error:
            raise InputError("-o", str(picture), f"a path that can be written ({error.strerror})") from error


def check_picture(picture: str | Path) -> None:
    """Raise InputError unless a picture could be written there; its folder is made."""
    if Path(picture).suffix.lower() != ".png":
        raise InputError("-o", str(picture), "a file that ends in .png")
    output_file("-o", picture)


def check_time(session: RecordedSession, at_s: float) -> None:
    """Raise InputError unless the session has states around ``at_s``."""
    _check_between((int(session.times[0]), session.end_ns) if len(session.times) else None, at_s)


def _check_between(ends_ns: tuple[int, int] | None, at_s: float) -> None:
    if ends_ns is None:
        raise InputError("session", "the recording has no states")
    begin, end = (1e-9 * time_ns for time_ns in ends_ns)
    if not (np.isfinite(at_s) and begin <= at_s <= end):
        raise InputError("--at", at_s, f"a time within the recording, {begin:g} to {end:g} s")


@contextmanager
def headless_viewer(width: int, height: int) -> Iterator[Any]:
    """A viewer without a window, on loopback, ended on leaving; yields its ``ViewerClient``."""
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
            # A viewer opens with a driver that it can't draw with, and ends at its first picture.
            client.take_screenshot(None)
            return client
        except Exception:
            # Not listening yet; the client raises errors of several kinds.
            time.sleep(0.1)
    raise _ended(log)


def _ended(log: Any) -> InputError:
    """Why the viewer has ended, by its own last words."""
    log.seek(0)
    words = log.read().decode(errors="replace")
    # Without any adapter it says so; with one of OpenGL alone it has no render context at its first picture.
    if "adapter" in words.lower() or "render context" in words:
        return InputError("snapshot", f"there is no graphics adapter that the viewer can draw with; install {DRIVERS}")
    last = (words.strip().splitlines() or ["no message"])[-1]
    return InputError("snapshot", last, f"a viewer that starts; if it is the drivers: {DRIVERS}")


def show(client: Any, recording: Path) -> None:
    """Open a recording in the viewer and wait until it is loaded."""
    client.open(str(recording.absolute()))
    deadline = time.monotonic() + LOAD_TIMEOUT_S
    while time.monotonic() < deadline:
        state = client.get_state()
        loaded = any(timeline.name == e.SIM_TIME for r in state.recordings for timeline in r.timelines)
        if loaded and not state.loading and state.views:
            return
        time.sleep(0.1)
    raise InputError("session", str(recording), f"a recording that the viewer loads within {LOAD_TIMEOUT_S:g} s")


def _stable_picture(client: Any, view_id: str | None) -> bytes:
    """A screenshot of the view, or the window, once two in a row are alike (the first ones still load)."""
    deadline = time.monotonic() + DRAWN_STEADY_S
    before = client.take_screenshot(view_id)
    while True:
        time.sleep(0.3)
        after = client.take_screenshot(view_id)
        if after == before and not is_one_colour(after) or time.monotonic() > deadline:
            return after
        before = after


def _without_empty_top(png: bytes) -> bytes:
    """The picture without the rows of one colour at its top, where the viewer's menu was."""
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image.convert("RGB"), dtype=int)
        inner = pixels[:, 8:-8]
        busy = np.flatnonzero((np.abs(inner - inner[:, :1]) > 12).any(axis=(1, 2)))
        # The window's own border is the first few rows.
        busy = busy[busy > 4]
        top = int(busy[0]) if len(busy) else 0
        kept = io.BytesIO()
        image.crop((0, max(0, top - 8), image.width, image.height)).save(kept, format="png")
    return kept.getvalue()


def bring_to_front(client: Any, name: str) -> str | None:
    """The id of the view of this name, in front now; None for a name of a whole tab, such as ``Lesson``.

    Case doesn't matter; of views with equal names that of the tab in front comes first. Raises InputError with the
    names there are.
    """
    blueprint = client.get_blueprint(of="recording").blueprint
    views = {f"/view/{view.view_id}": view.name for view in client.get_state().views}
    found = _walk(blueprint, f"/container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}", views, ())
    wanted = name.strip().lower()
    path = next((path for path, called in found if called.lower() == wanted), None)
    if path is None:
        raise InputError("--view", name, one_of(name, sorted({called for _, called in found})))
    for parent, child in zip(path[:-1], path[1:], strict=True):
        container = blueprint[parent]["ContainerBlueprint"]
        if container["container_kind"] == "Tabs":
            container["active_tab"] = child
    client.set_blueprint(blueprint, of="recording")
    return path[-1].removeprefix("/view/") if path[-1] in views else None


def _walk(
    blueprint: dict[str, Any], node: str, views: dict[str, str], above: tuple[str, ...]
) -> list[tuple[tuple[str, ...], str]]:
    """(path from the root, name) of everything that has a name at or below ``node``, what is in front first."""
    # The viewer names parts with or without the slash, as their layout came to it.
    node = f"/{node.lstrip('/')}"
    path = (*above, node)
    if node in views:
        return [(path, views[node])]
    container = blueprint.get(node, {}).get("ContainerBlueprint", {})
    found = [(path, container["display_name"])] if "display_name" in container else []
    contents = container.get("contents", [])
    for child in sorted(contents, key=lambda child: child != container.get("active_tab")):
        found += _walk(blueprint, child, views, path)
    return found


def is_one_colour(png: bytes) -> bool:
    """Whether a picture is one colour all over, give or take."""
    with Image.open(io.BytesIO(png)) as image:
        pixels = np.asarray(image.convert("RGB").resize((128, 128)), dtype=float)
    return float(pixels.std(axis=(0, 1)).max()) < 1.0
