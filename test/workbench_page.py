# SPDX-License-Identifier: MIT
"""A workbench with a page in headless Chromium, for tests and pictures."""

from __future__ import annotations

import math
import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from ros_process import RosProcess

CHROMIUM = os.environ.get("CHROMIUM", shutil.which("chromium") or shutil.which("chromium-browser")) or None
"""The browser; ``CHROMIUM=`` hides the one that is installed."""

NO_CHROMIUM = "there is no browser to drive: sudo apt install chromium"
SOFTWARE_GL = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"]
FLAGS = [*SOFTWARE_GL, "--webgl-antialiasing-mode=none", "--disable-gpu-compositing"]
"""For tests: without a graphics card, smooth edges and a page that WebGL puts together double the cost of a picture."""

PATIENCE_S = 150.0
"""[s] Software WebGL compiles its shaders first, and on a busy machine nothing else moves meanwhile."""

DRAWN_MS = 120
"""[ms] Between two pictures: each is 30 ms of a core's time in software WebGL, which would draw as often as it is let."""

SAID_S = 0.06
"""[s] A page says at most every 0.05 s where the pointer is."""

CAMERA, FIELD_OF_VIEW = np.array([1.45, -2.45, 1.2]), math.radians(40.0)
"""Where a page looks from at first, to its middle, in units of the picture."""


class Bench:
    """``rigid_proto workbench`` in a process of its own."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        environment = {**os.environ, "TMPDIR": str(folder)}
        log = folder / "workbench"
        self.process = RosProcess(
            "rigid_proto", "workbench", "--no-browser", *arguments, environment=environment, log=log
        )
        self.address = self.process.wait_for(r"The workbench is at").split()[4]


class Page:
    """One browser page. The body is at the middle of the canvas while it rests at the world's origin."""

    def __init__(self, browser, address: str, size: tuple[int, int] = (1000, 480)) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]}, has_touch=True)
        self._fingers = None
        self.scene: dict = {}  # that its tests begin with
        self.page.set_default_timeout(PATIENCE_S * 1e3)
        self.page.add_init_script(
            f"const draw = requestAnimationFrame; window.requestAnimationFrame = f => setTimeout(() => draw(f), {DRAWN_MS})"
        )
        self.page.goto(address)
        self.page.wait_for_selector("canvas")
        self.drawn()
        # viser says that WebGL runs in software, and stands before the picture while it does.
        see_through = (
            ".mantine-Notifications-root, .mantine-Notifications-root * {opacity: 0; pointer-events: none !important}"
        )
        self.page.add_style_tag(content=see_through)
        self.until(lambda: re.search(r"\d\.\d\d s", self.text), "time on the page")

    def drawn(self) -> None:
        """Wait for two pictures: what the page has been told is in the second, and there a click hits it."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    @property
    def time_s(self) -> float:
        """As the bar shows it."""
        return float(re.search(r"(\d+\.\d\d) s", self.text)[1])

    @property
    def text(self) -> str:
        return self.page.inner_text("body")

    def until(self, condition, what: str, timeout_s: float = PATIENCE_S):
        """Wait for a condition; returns its value."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            assert time.monotonic() < deadline, f"no {what} within {timeout_s} s: {self.text}"
            time.sleep(0.05)
        return found

    def tab(self, name: str) -> None:
        """Open a tab; a click may fall between two pictures of the panel."""
        tab = self.page.get_by_role("tab", name=name, exact=True)

        def opened() -> bool:
            tab.click(force=True)
            return tab.get_attribute("aria-selected") == "true"

        self.until(opened, f"tab {name}")

    def button(self, name: str) -> None:
        self.page.get_by_role("button", name=name, exact=True).click()

    def press(self, name: str) -> None:
        """A button of a group."""
        self.page.locator("button", has_text=name).first.click()

    def input(self, label: str):
        """The input beside a label."""
        path = f'xpath=//p[label[normalize-space()="{label}"]]/../following-sibling::div//input[not(@type="hidden")]'
        return self.page.locator(path).first

    def write(self, label: str, text: str) -> None:
        field = self.input(label)
        field.fill(text)
        field.press("Enter")

    def choose(self, label: str, option: str) -> None:
        """Take an option of a dropdown."""
        self.input(label).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    @property
    def middle(self) -> tuple[float, float]:
        """Of the canvas [pixels]."""
        box = self.page.locator("canvas").first.bounding_box()
        return box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]

    def ray(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """The view ray through a pixel, by pinhole geometry: origin (3,) [units of the picture] and direction (3,)."""
        box = self.page.locator("canvas").first.bounding_box()
        forward = -CAMERA / np.linalg.norm(CAMERA)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        half = 0.5 * box["height"]
        mx, my = self.middle
        slope = math.tan(0.5 * FIELD_OF_VIEW) / half
        direction = forward + (x - mx) * slope * right + (my - y) * slope * up
        return CAMERA, direction / np.linalg.norm(direction)

    def click(self, x: float, y: float, modifier: str = "") -> None:
        """Press and release at one place: a poke."""
        if modifier:
            self.page.keyboard.down(modifier)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.up()
        if modifier:
            self.page.keyboard.up(modifier)

    def drag(self, x: float, y: float, dx: float, dy: float, steps: int = 3) -> None:
        """Press at a point and move on from there in steps; the button stays down."""
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for k in range(1, steps + 1):
            self.page.mouse.move(x + dx * k / steps, y + dy * k / steps)
            time.sleep(SAID_S)

    def touch(self, phase: str, *points: tuple[float, float]) -> None:
        """Fingers on the glass: phase touchStart, touchMove or touchEnd, all points where they are."""
        if self._fingers is None:
            self._fingers = self.page.context.new_cdp_session(self.page)
        self._fingers.send(
            "Input.dispatchTouchEvent",
            {"type": phase, "touchPoints": [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]},
        )

    def wheel(self, notches: int) -> None:
        """Turn the wheel over the picture's middle, away from the hand."""
        self.page.mouse.move(*self.middle)
        for _ in range(notches):
            self.page.mouse.wheel(0.0, -100.0)
            time.sleep(SAID_S)

    def pinch(self, begin: float, end: float) -> None:
        """Move two fingers from one distance [pixels] beside the picture's middle to another."""
        x, y = self.middle
        for k in range(6):
            away = begin + (end - begin) * k / 5
            self.touch("touchMove" if k else "touchStart", (x - away, y), (x + away, y))
            time.sleep(2.0 * SAID_S)
        self.touch("touchEnd")

    def release(self) -> None:
        self.page.mouse.up()


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
