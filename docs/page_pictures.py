# SPDX-License-Identifier: MIT
"""The page's own pictures, drawn anew in headless Chromium: ``PYTHONPATH=test python docs/page_pictures.py docs`` writes
workbench.png and true_against_box.png there.

Time stands between two pictures, and isn't said to: a browser without a graphics card takes seconds for each.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import time
from pathlib import Path

from PIL import Image
from workbench_page import PATIENCE_S, Browser, Flown, any_free_port, chromium

from rigid_proto_ros.scene.lessons import Lesson, lesson
from rigid_proto_ros.workbench.flight import Flight
from rigid_proto_ros.workbench.panel import motion_words

SIZE = 1400, 800
RATE = 10
"""[1/s] Pictures of the moving one, and of simulated time, which is shown as fast as it is."""

PAUSED = Flight.paused


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    flown = Flown("t_handle", port=any_free_port())
    shown = flown.page
    shown._words = lambda: motion_words(
        shown._scenario, len(shown.picture.loads.acting), flown.live.loop.simulation.string is not None, False, False
    )
    try:
        with chromium() as started:
            page = Browser(started, flown, SIZE)
            begin(page, lesson("true_or_box_tensor"))
            answer(page)
            play(page, 3.0)
            page.page.screenshot(path=args.folder / "true_against_box.png")
            begin(page, lesson("t_handle"))
            answer(page)
            flown.live.set_parameters({"string.frequency": 3.0})
            play(page, 3.4)
            pull(page, steps=3)
            page.page.screenshot(path=args.folder / "workbench.png")
    finally:
        flown.end()


def begin(page: Browser, shown: Lesson, ghost: str = "") -> None:
    """A lesson with its question. ghost: its inertia model."""
    flown = page.flown
    Flight.paused = PAUSED
    flown.page.lessons.name(shown.name)
    asyncio.run_coroutine_threadsafe(flown.page.lessons.begin(), flown.server.get_event_loop()).result(PATIENCE_S)
    page.until(lambda: shown.question in page.text, "question")
    if ghost:
        flown.live.set_parameters({"ghost.inertia_model": ghost})
        flown.live.reset()
    time.sleep(1.0)
    page.drawn()


def answer(page: Browser) -> None:
    """Show the steps, and let time stand again at once."""
    flown = page.flown
    flown.server.get_event_loop().call_soon_threadsafe(flown.page.lessons.answer, None)
    page.until(lambda: not flown.live.paused, "motion")
    flown.live.pause(True)
    # The bar looks as it does while time goes on.
    Flight.paused = property(lambda _: False)


def play(page: Browser, seconds: float, count: int = 1) -> list[Image.Image]:
    """Let time go on so far; so many pictures on the way."""
    flown, pictures = page.flown, []
    rate = float(flown.live.scenario.parameters.publish_rate)
    for _ in range(count):
        flown.live.step(round(rate * seconds / count))
        page.until(lambda: flown.page.state.time_ns == flown.live.state.time_ns, "state on the page")
        page.drawn()
        with Image.open(io.BytesIO(page.page.screenshot())) as image:
            pictures.append(image.convert("RGB"))
        print(f"{flown.live.state.time_ns * 1e-9:.2f} s", flush=True)
    return pictures


def com(page: Browser) -> tuple[float, float]:
    backend = page.flown.page.backend
    return page.pixel((page.flown.page.state.position - backend.origin) / backend.unit)


def pull(page: Browser, steps: int) -> list[Image.Image]:
    """Drag the body by the string, quickly at first, so that the string is long; the button stays down; a picture a step."""
    x, y = com(page)
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    pictures = []
    for k in range(1, steps + 1):
        part = min(1.0, 3.0 * k / steps)
        page.page.mouse.move(x - 130.0 * part, y - 90.0 * part)
        time.sleep(0.6)  # a page says at most every 0.05 s where the pointer is, and a slow one seldom
        pictures += play(page, 1.0 / RATE)
    return pictures


if __name__ == "__main__":
    main()
