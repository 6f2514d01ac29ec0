# SPDX-License-Identifier: MIT
"""The page's own pictures, drawn anew in headless Chromium: ``python test/workbench_pictures.py docs`` writes flight.gif,
workbench.png and true_against_box.png there; ``--lessons FOLDER`` one picture of each lesson.

Time goes so slowly meanwhile that a browser without a graphics card keeps up.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import time
from pathlib import Path

from PIL import Image
from workbench_page import SOFTWARE_GL, Browser, Flown, chromium

from rigid_proto_ros.rerun_view.ports import any_free_port
from rigid_proto_ros.scene.lessons import Lesson, lesson, lessons

SIZE, MOVING_SIZE = (1400, 800), (800, 450)
RATE = 10
"""[1/s] Pictures of the moving one, and of simulated time, which is shown as fast as it is."""
COLOURS = 128

SLOW = 0.015
"""Simulated seconds per second."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lessons", action="store_true")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    flown = Flown("t_handle", port=any_free_port())
    try:
        with chromium(SOFTWARE_GL) as started:
            if args.lessons:
                page = Browser(started, flown, SIZE)
                for each in lessons():
                    begin(page, each)
                    page.page.screenshot(path=args.folder / f"{each.name}_asked.png")
                    hurry(page, 1.0)
                    page.page.screenshot(path=args.folder / f"{each.name}.png")
                return
            page = Browser(started, flown, MOVING_SIZE)
            draw_moving(page, args.folder / "flight.gif")
            page.page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
            begin(page, lesson("true_or_box_tensor"))
            hurry(page, 3.0)
            page.page.screenshot(path=args.folder / "true_against_box.png")
            begin(page, lesson("t_handle"))
            hurry(page, 3.4)
            pull(page, steps=3)
            page.page.screenshot(path=args.folder / "workbench.png")
    finally:
        flown.end()


def begin(page: Browser, shown: Lesson, ghost: str = "") -> None:
    """A lesson with its question, slow; then it is played from its beginning. ghost: its inertia model."""
    flown = page.flown
    flown.page.lessons.name(shown.name)
    asyncio.run_coroutine_threadsafe(flown.page.lessons.begin(), flown.page.loop).result(60.0)
    page.until(lambda: shown.question in page.text, "question")
    flown.live.set_parameters(
        {"real_time_factor": SLOW, "ghost.inertia_model": ghost} if ghost else {"real_time_factor": SLOW}
    )
    flown.live.reset()
    time.sleep(1.0)
    page.drawn()


def play(page: Browser, seconds: float) -> list[Image.Image]:
    """Let time go on so far; the pictures on the way."""
    flown, pictures = page.flown, []
    flown.page.loop.call_soon_threadsafe(flown.page.lessons.answer, None)
    start_s = flown.live.state.time_ns * 1e-9
    for k in range(1, round(seconds * RATE) + 1):
        page.until(lambda due_s=start_s + k / RATE: flown.page.state.time_ns * 1e-9 >= due_s, "time that goes on")
        page.drawn()
        with Image.open(io.BytesIO(page.page.screenshot())) as image:
            pictures.append(image.convert("RGB"))
        print(f"{flown.live.state.time_ns * 1e-9:.2f} s", flush=True)
    return pictures


def hurry(page: Browser, seconds: float) -> None:
    """Go on so far without pictures."""
    flown = page.flown
    flown.page.loop.call_soon_threadsafe(flown.page.lessons.answer, None)
    flown.live.set_parameters({"real_time_factor": 0.3})
    page.until(lambda: flown.page.state.time_ns * 1e-9 >= seconds, "time that goes on")
    flown.live.set_parameters({"real_time_factor": SLOW})
    page.drawn()


def com(page: Browser) -> tuple[float, float]:
    backend = page.flown.page.backend
    return page.pixel((page.flown.page.state.position - backend.origin) / backend.unit)


def pull(page: Browser, steps: int) -> list[Image.Image]:
    """Drag the body by the string, the button stays down; a picture a step."""
    x, y = com(page)
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    pictures = []
    for k in range(1, steps + 1):
        page.page.mouse.move(x - 130.0 * k / steps, y - 60.0 * k / steps)
        pictures += play(page, 1.0 / RATE)
    return pictures


def draw_moving(page: Browser, file: Path) -> None:
    """The T-handle turns over, its ghost with the box's tensor doesn't; then a poke, and a pull on the string."""
    begin(page, lesson("t_handle"), "bounding_box")
    pictures = play(page, 2.6)
    page.click(*com(page))
    pictures += play(page, 0.8)
    pictures += pull(page, steps=12)
    page.release()
    pictures += play(page, 0.7)
    width, height = pictures[0].size
    # Colours of all that is seen at some time.
    sheet = Image.new("RGB", (width, height * len(pictures)))
    for k, each in enumerate(pictures):
        sheet.paste(each, (0, k * height))
    palette = sheet.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    frames = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=round(1000 / RATE), loop=0, optimize=True)


if __name__ == "__main__":
    main()
