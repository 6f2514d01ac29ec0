# SPDX-License-Identifier: MIT
"""The page in headless Chromium, as a person has it: mouse, fingers, keys, and what is seen."""

from __future__ import annotations

import ctypes.util
import io
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.page.bundle import built_page

CHROMIUM = os.environ.get("CHROMIUM", shutil.which("chromium") or shutil.which("chromium-browser")) or None
"""The browser; ``CHROMIUM=`` hides the one that is installed."""
if ctypes.util.find_library("atomic") is None:
    CHROMIUM = None  # playwright's own program is linked to it, and not every system has it

SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
NO_WEBGL = ["--disable-3d-apis"]
PATIENCE_MS = 90_000
"""[ms] Software WebGL compiles its shaders first, and on a busy machine nothing else moves meanwhile."""

ON_BODY = """away => {
  const { motion, picture: { eye } } = page, free = document.getElementById("free").getBoundingClientRect();
  const x0 = free.left + free.width / 2, y0 = free.top + free.height / 2;
  for (let r = away; r < 300; r += 3) for (let a = 0; a < 6.28; a += 0.2) {
    const x = Math.round(x0 + r * Math.cos(a)), y = Math.round(y0 + r * Math.sin(a)), { origin, direction } = eye.ray(x, y);
    const hit = motion.firstHit(origin, direction);
    if (hit) return { x, y, mesh: [...hit.mesh], normal: [...hit.normal] };
  }
  return null;
}"""
"""A place on the screen where the body is, some pixels from the middle, and what of it is there."""


@contextmanager
def chromium(flags: list[str] = SOFTWARE) -> Iterator[Any]:
    """The browser; skips where there is none."""
    if CHROMIUM is None:
        pytest.skip("there is no browser to drive: sudo apt install chromium libatomic1")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-dev-shm-usage", *flags]
        )
        yield browser
        browser.close()


def page_address() -> str:
    """The page as it lies on the disk."""
    try:
        return built_page().as_uri()
    except InputError as error:
        pytest.skip(str(error))


class Opened:
    """One page. It stands still until it is told to fly, so that what is aimed at stays there."""

    def __init__(
        self, browser: Any, size: tuple[int, int] = (1280, 720), touch: bool = False, address: str = "", **context: Any
    ) -> None:
        self.context = browser.new_context(viewport={"width": size[0], "height": size[1]}, has_touch=touch, **context)
        self.faults: list[str] = []
        self.requests: list[str] = []
        self.open(address or page_address())

    def open(self, address: str) -> None:
        """In a tab of its own."""
        self.page = self.context.new_page()
        self.page.set_default_timeout(PATIENCE_MS)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("console", lambda said: self.faults.append(said.text) if said.type == "error" else None)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(address)
        self.page.wait_for_function("window.page && page.times.first")

    def beside(self) -> Opened:
        """The same page once more, in another tab of the same browser."""
        other = copy(self)
        other.open(self.page.url)
        return other

    def close(self) -> None:
        self.context.close()
        assert not self.faults, self.faults

    def js(self, code: str, *arguments: Any) -> Any:
        return self.page.evaluate(code, *arguments)

    def drawn(self, pictures: int = 2) -> None:
        """Wait for that many pictures more."""
        self.js(
            "n => new Promise(done => { const next = () => n-- > 0 ? requestAnimationFrame(next) : done(); next(); })",
            pictures,
        )

    def pause(self) -> None:
        self.js("page.clock.setPaused(true)")
        self.drawn()

    def fly(self, seconds: float) -> None:
        """On by simulated time, however fast the machine is."""
        self.js("s => page.motion.advance(page.motion.snapshot().timeNs + s * 1e9)", seconds)
        self.drawn()

    @property
    def now(self) -> dict[str, Any]:
        return self.js("JSON.parse(JSON.stringify(page.motion.snapshot()))")

    @property
    def script(self) -> list[dict[str, Any]]:
        return self.js("JSON.parse(JSON.stringify(page.motion.history().script))")

    def value(self, name: str) -> Any:
        return self.js("name => page.motion.values()[name]", name)

    def on_body(self, away: float = 0.0) -> dict[str, Any]:
        found = self.js(ON_BODY, away)
        assert found is not None, "the body is nowhere to be seen"
        return found

    def seen(self, point: list[float]) -> np.ndarray:
        """Where a point of the world is on the screen [px]."""
        code = "p => { const { eye } = page.picture, at = eye.target.clone().set(...p); eye.project(at, at); return [at.x, at.y]; }"
        return np.array(self.js(code, point))

    def covered(self) -> list[str]:
        """What stands before the body's box or an arrow's tip, by what it is."""
        return self.js(COVERED)

    def look(self, path: Path | None = None) -> np.ndarray:
        from PIL import Image

        raw = self.page.screenshot(timeout=PATIENCE_MS, **({} if path is None else {"path": str(path)}))
        with Image.open(io.BytesIO(raw)) as image:
            return np.asarray(image.convert("RGB"), dtype=int)

    def touch(self, phase: str, *points: tuple[float, float]) -> None:
        """Fingers on the glass: phase touchStart, touchMove or touchEnd, all points where they are."""
        if not hasattr(self, "fingers"):
            self.fingers = self.context.new_cdp_session(self.page)
        places = [{"x": float(x), "y": float(y), "id": k} for k, (x, y) in enumerate(points)]
        self.fingers.send("Input.dispatchTouchEvent", {"type": phase, "touchPoints": places})
        self.drawn()


COVERED = """() => {
  const { motion, picture } = page, { eye } = picture, info = motion.body(), { body } = motion.snapshot(), places = [];
  const R = body.rotation, at = (x, y, z) => [0, 1, 2].map(i => body.row[i] + R[3 * i] * x + R[3 * i + 1] * y + R[3 * i + 2] * z);
  for (let k = 0; k < info.vertices.length; k += 3)
    places.push(["body", at(...[0, 1, 2].map(i => info.vertices[k + i] * body.scale[i] - body.com[i]))]);
  for (const name of ["omega", "momentum"]) {
    const { node } = picture[name], shaft = node.children[0], head = node.children[1];
    if (node.visible) places.push([name, node.localToWorld(head.position.clone().setY(head.position.y + head.scale.y)).toArray()]);
  }
  const found = new Set();
  for (const [what, p] of places) {
    const seen = eye.target.clone().set(...p);
    eye.project(seen, seen);
    const top = document.elementFromPoint(seen.x, seen.y), said = document.querySelector("#say.on")?.getBoundingClientRect();
    if (said && seen.x > said.left && seen.x < said.right && seen.y < said.bottom) found.add(`${what} behind what is said`);
    if (top?.closest("#stage") === null || top === null) found.add(`${what} behind ${top?.closest("[id]")?.id ?? "the window's edge"}`);
  }
  return [...found];
}"""
