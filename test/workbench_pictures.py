# SPDX-License-Identifier: MIT
"""The page's own pictures, drawn anew in headless Chromium: ``python test/workbench_pictures.py docs`` writes flight.gif,
workbench.png and true_against_box.png there; ``--lessons FOLDER`` one picture of each lesson.

Time stands between two pictures of the moving one: it is as long on a slow machine as on a fast one.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import time
from pathlib import Path

from PIL import Image
from workbench_page import SOFTWARE_GL, Browser, Flown, chromium

from rigid_proto_ros.scene.lessons import Lesson, lesson, lessons

SIZE, MOVING_SIZE = (1400, 800), (800, 450)
RATE = 10
"""[1/s] Pictures of the moving one, and of simulated time, which is shown as fast as it is."""
COLOURS = 96


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--lessons", action="store_true")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    flown = Flown("t_handle")
    try:
        with chromium(SOFTWARE_GL) as started:
            if args.lessons:
                page = Browser(started, flown, SIZE)
                for each in lessons():
                    begin(page, each)
                    page.page.screenshot(path=args.folder / f"{each.name}_asked.png")
                    play(page, 2.0)
                    page.page.screenshot(path=args.folder / f"{each.name}.png")
                return
            page = Browser(started, flown, MOVING_SIZE)
            draw_moving(page, args.folder / "flight.gif")
            page.page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
            begin(page, lesson("true_or_box_tensor"))
            play(page, 3.0)
            page.page.screenshot(path=args.folder / "true_against_box.png")
            begin(page, lesson("t_handle"))
            play(page, 3.4)
            pull(page, steps=4)
            page.page.screenshot(path=args.folder / "workbench.png")
    finally:
        flown.end()


def begin(page: Browser, shown: Lesson) -> None:
    """A lesson with its question; time stands."""
    flown = page.flown
    flown.page.lessons.name(shown.name)
    asyncio.run_coroutine_threadsafe(flown.page.lessons.begin(), flown.page.loop).result(60.0)
    page.until(lambda: shown.question in page.text, "question")
    time.sleep(1.0)
    page.drawn()


def play(page: Browser, seconds: float, at_once: bool = True) -> list[Image.Image]:
    """Let time go on so far; the pictures on the way, or only the last."""
    flown, pictures = page.flown, []
    flown.page.loop.call_soon_threadsafe(flown.page.lessons.answer, None)
    time.sleep(0.3)
    flown.live.pause(True)
    rate = float(flown.live.scenario.parameters.publish_rate)
    count = 1 if at_once else round(seconds * RATE)
    for _ in range(count):
        flown.live.step(round(rate * seconds / count))
        show(page)
        if not at_once:
            pictures.append(picture(page))
    return pictures


def show(page: Browser) -> None:
    """Wait until the browser has drawn the present state."""
    flown = page.flown
    page.until(lambda: flown.page.state.time_ns == flown.live.state.time_ns, "state on the page")
    page.drawn()
    print(f"{flown.live.state.time_ns * 1e-9:.2f} s", flush=True)


def picture(page: Browser) -> Image.Image:
    with Image.open(io.BytesIO(page.page.screenshot())) as image:
        return image.convert("RGB")


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
        page.page.mouse.move(x - 160.0 * k / steps, y - 70.0 * k / steps)
        time.sleep(0.15)
        pictures += play(page, 1.0 / RATE, at_once=False)
    return pictures


def draw_moving(page: Browser, file: Path) -> None:
    """The T-handle turns over, its ghost with the box's tensor doesn't; then a poke, and a pull on the string."""
    begin(page, lesson("t_handle"))
    page.flown.live.set_parameters({"ghost.inertia_model": "bounding_box"})
    pictures = play(page, 2.8, at_once=False)
    page.click(*com(page))
    time.sleep(0.3)
    pictures += play(page, 1.0, at_once=False)
    pictures += pull(page, steps=15)
    pictures += play(page, 0.5, at_once=False)
    page.release()
    time.sleep(0.3)
    pictures += play(page, 0.7, at_once=False)
    palette = pictures[len(pictures) // 2].quantize(COLOURS)
    frames = [each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures]
    frames[0].save(file, save_all=True, append_images=frames[1:], duration=round(1000 / RATE), loop=0, optimize=True)


if __name__ == "__main__":
    main()
