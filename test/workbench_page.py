# SPDX-License-Identifier: MIT
"""The interactive page in headless Chromium, with its workbench in this process: for tests, and pictures of the docs."""

from __future__ import annotations

import ctypes.util
import io
import math
import os
import re
import shutil
import socket
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from viser._messages import RunJavascriptMessage

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.live.live_simulation import LiveSimulation
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.workbench.main import Workbench

CHROMIUM = os.environ.get("CHROMIUM", shutil.which("chromium") or shutil.which("chromium-browser")) or None
"""The browser; ``CHROMIUM=`` hides the one that is installed."""
if ctypes.util.find_library("atomic") is None:
    CHROMIUM = None  # playwright's own program is linked to it, and not every system has it

NO_CHROMIUM = "there is no browser to drive: sudo apt install chromium libatomic1"
RENDERERS = (
    ["--use-angle=gl-egl", "--ignore-gpu-blocklist"],
    ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
)
"""What draws WebGL without a graphics card: Mesa where it is installed, which compiles viser's shaders in a third of the
time, or Chromium's own."""

QUICK = ["--webgl-antialiasing-mode=none", "--disable-gpu-compositing"]
"""For tests: without a graphics card, smooth edges and a page that WebGL puts together double the cost of a picture."""

PATIENCE_S = 150.0
"""[s] Software WebGL compiles its shaders first, and on a busy machine nothing else moves meanwhile."""

DRAWN_MS = 1000
"""[ms] Between two pictures that nobody waits for: software WebGL would draw as often as it is let, and leave nothing of a
core."""

RARELY_DRAWN = """pause_ms => {
  const request = window.requestAnimationFrame, waiting = new Map();
  let last = 0, timer = 0;
  window.drawNow = () => {
    clearTimeout(timer);
    timer = 0;
    request(time => {
      const draws = [...waiting.values()];
      waiting.clear();
      draws.forEach(draw => draw(time));
    });
  };
  window.requestAnimationFrame = draw => {
    waiting.set(++last, draw);
    timer ||= setTimeout(window.drawNow, pause_ms);
    return last;
  };
  window.cancelAnimationFrame = number => { waiting.delete(number); };
}"""
"""A page with this is drawn picture by picture, so far apart or when drawNow is called."""

SAID_S = 0.06
"""[s] A page says at most every 0.05 s where the pointer is."""

SEE_THROUGH = ".mantine-Notifications-root, .mantine-Notifications-root * {opacity: 0; pointer-events: none !important}"
"""viser says that WebGL runs in software, and stands before the picture while it does."""


NEXT_PICTURE = """() => new Promise(done => {
  requestAnimationFrame(() => done(true));
  drawNow();
  setTimeout(() => done(false), 10000);
})"""


def until(condition, what: str):
    """Wait for a condition; returns its value."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := condition()):
        assert time.monotonic() < deadline, f"no {what} within {PATIENCE_S} s"
        time.sleep(0.05)
    return found


def seen_on(page) -> np.ndarray:
    """A page of the browser as it is drawn, (height, width, 3)."""
    from PIL import Image

    with Image.open(io.BytesIO(page.screenshot(timeout=1e3 * PATIENCE_S))) as image:
        return np.asarray(image.convert("RGB"), dtype=int)


def any_free_port() -> int:
    """A loopback port that the system says is free."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Flown:
    """A body that flies in real time, and its workbench. lesson: one that begins as the first browser is there."""

    def __init__(self, scene: str = "t_handle", lesson: str = "", port: int | None = None, endpoints=None) -> None:
        self.live = LiveSimulation(read_scene(scene), endpoints=endpoints)
        self.workbench = Workbench(self.live, port, lesson=lesson, anew=True)
        self.page, self.server = self.workbench.page, self.workbench.page.server
        self.live.announce()
        self.live.start()

    def end(self) -> None:
        self.workbench.close()
        self.live.stop()

    def node(self, part: str):
        """The viser node of a part of the picture; None where there is none to be seen."""
        node = self.page.backend._nodes.get(part)
        return node if node is not None and node.visible else None


class Browser:
    """One browser page of it."""

    def __init__(self, chromium, flown: Flown, size: tuple[int, int] = (1000, 600)) -> None:
        self.flown, self._told = flown, 0
        self.page = chromium.new_page(viewport={"width": size[0], "height": size[1]}, has_touch=True)
        self.page.set_default_timeout(PATIENCE_S * 1e3)
        self._fingers = self.page.context.new_cdp_session(self.page)
        self.page.add_init_script(f"({RARELY_DRAWN})({DRAWN_MS})")
        known = set(flown.server.get_clients())
        self.page.goto(flown.workbench.address)
        self.page.wait_for_selector("canvas")
        self.drawn()
        self.page.add_style_tag(content=SEE_THROUGH)
        self.until(lambda: re.search(r"\d\.\d\d s", self.text), "time on the page")
        (self.client,) = (client for number, client in flown.server.get_clients().items() if number not in known)

    def drawn(self, pictures: int = 1) -> None:
        """Wait until the page has heard all that it was told so far, and for pictures of it: there a click hits what is drawn."""
        self._told += 1
        heard = RunJavascriptMessage(f"window.heard = {self._told}")
        self.flown.server.gui._websock_interface.queue_message(heard)
        self.until(
            lambda: self._draws() and self.page.evaluate("window.heard") == self._told, "picture of what was told"
        )
        for _ in range(pictures):
            self.until(self._draws, "picture")

    def _draws(self) -> bool:
        """Whether there is a next picture; headless Chromium may stop drawing when its window changes, until it is asked for one."""
        drawn = self.page.evaluate(NEXT_PICTURE)
        if not drawn:
            self.page.screenshot()
        return drawn

    @property
    def text(self) -> str:
        return self.page.inner_text("body")

    def until(self, condition, what: str):
        """Wait for a condition; returns its value."""
        return until(condition, what)

    # The panel

    def tab(self, name: str) -> None:
        tab = self.page.get_by_role("tab", name=name, exact=True)

        def opened() -> bool:
            tab.click(force=True)
            return tab.get_attribute("aria-selected") == "true"

        self.until(opened, f"tab {name}")

    def press(self, name: str) -> None:
        """A button, alone or of a group."""
        self.page.locator("button", has_text=name).first.click()

    def input(self, label: str):
        """The input beside a label."""
        path = f'xpath=//p[label[normalize-space()="{label}"]]/../following-sibling::div//input[not(@type="hidden")]'
        return self.page.locator(path).first

    # The picture

    @property
    def canvas(self) -> dict[str, float]:
        """Of three.js; the plots have others."""
        return self.page.locator("canvas[data-engine]").first.bounding_box()

    def pixel(self, point) -> np.ndarray:
        """Where points (..., 3) of the picture, in its units, are drawn (..., 2), by pinhole geometry."""
        camera, box = self.client.camera, self.canvas
        w, x, y, z = camera.wxyz
        seen = (np.asarray(point, dtype=float) - camera.position) @ matrix_from_quaternion(np.array([x, y, z, w]))
        focal = 0.5 * box["height"] / math.tan(0.5 * camera.fov)
        middle = np.array([box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]])
        return middle + focal * seen[..., :2] / seen[..., 2:]

    def look(self) -> np.ndarray:
        """The page as it is drawn, (height, width, 3)."""
        return seen_on(self.page)

    def click(self, x: float, y: float, modifier: str = "") -> None:
        """Press and release at one place: a poke."""
        if modifier:
            self.page.keyboard.down(modifier)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.up()
        if modifier:
            self.page.keyboard.up(modifier)

    def drag(self, x: float, y: float, dx: float, dy: float, steps: int = 3, button: str = "left") -> None:
        """Press at a point and move on from there in steps; the button stays down."""
        self.page.mouse.move(x, y)
        self.page.mouse.down(button=button)
        for k in range(1, steps + 1):
            self.page.mouse.move(x + dx * k / steps, y + dy * k / steps)
            time.sleep(SAID_S)

    def release(self, button: str = "left") -> None:
        self.page.mouse.up(button=button)

    def touch(self, phase: str, *points: tuple[float, float]) -> None:
        """Fingers on the glass: phase touchStart, touchMove or touchEnd, all points where they are."""
        fingers = [{"x": float(x), "y": float(y), "id": k} for k, (x, y) in enumerate(points)]
        self._fingers.send("Input.dispatchTouchEvent", {"type": phase, "touchPoints": fingers})
        time.sleep(SAID_S)


@contextmanager
def chromium(flags: Sequence[str] = ()) -> Iterator:
    """The browser itself."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        for renderer in RENDERERS:
            args = ["--no-sandbox", "--disable-dev-shm-usage", *renderer, *flags]
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=args)
            page = browser.new_page()
            draws = page.evaluate("document.createElement('canvas').getContext('webgl2') !== null")
            page.close()
            if draws:
                break
            browser.close()
        yield browser
        browser.close()


CAMERA_MESSAGE = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 0.0),
    "fov": 0.7,
    "near": 0.01,
    "far": 100.0,
    "image_height": 4,
    "image_width": 4,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
"""What viser waits for before it calls a page open."""


@contextmanager
def bare_page(port: int) -> Iterator:
    """A page without a browser: a socket as a page opens it."""
    import msgspec.msgpack
    import viser
    from websockets.sync.client import connect

    url, protocol = f"ws://127.0.0.1:{port}", f"viser-v{viser.__version__}"
    # Read by nobody, but taken: a socket that is full answers no ping, and is dropped.
    with connect(url, subprotocols=[protocol], max_size=None, max_queue=None) as page:
        page.send(msgspec.msgpack.encode(CAMERA_MESSAGE))
        yield page


def said(page) -> str:
    """The next of the texts that a server sends to ``bare_page``: its messages, without their arrays."""
    import msgspec.msgpack
    import zstandard

    raw = page.recv(timeout=PATIENCE_S)
    length = int.from_bytes(raw[8:16], "little")
    return str(msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(raw[16 : 16 + length])))
