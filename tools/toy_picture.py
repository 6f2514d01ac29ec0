# SPDX-License-Identifier: MIT
"""README's moving picture of the page, drawn in headless Chromium: docs/flight.webp.

    PYTHONPATH=test:test/page python tools/toy_picture.py docs/flight.webp

A hand pulls the T-handle on a string, pokes it, and switches its tensor from the true one to the bounding box's: 6 s. Time
stands between two pictures, so that they are the same however fast the machine is.
"""

from __future__ import annotations

import argparse
import io
import math
from pathlib import Path
from typing import Any

from page_browser import Opened, chromium
from PIL import Image

SCREEN, SIZE = (1280, 720), (800, 450)
RATE, SECONDS = 12, 6.0
"""[1/s] pictures, of the time that they show."""
GRAB_S, PULLED_S, POKE_S, SWITCH_S, PRESSED_S = 0.4, 1.4, 2.4, 3.5, 0.3
GRABBED, POKED = (0.0, 0.0, 0.06), (0.0, 0.0, 0.05)
"""Points of the mesh [m] that the hand grabs and pokes."""
QUALITY = 62

CURSOR = """() => {
  const cursor = document.createElement("div");
  cursor.innerHTML = '<svg width="34" height="34" viewBox="0 0 24 24"><path d="M4 2l6 19 3-8 8-3z" fill="#1d2433" stroke="#fff" stroke-width="1.6"/></svg>';
  cursor.id = "cursor";
  cursor.style.cssText = "position:fixed;left:0;top:0;z-index:99;pointer-events:none;transform-origin:0 0";
  document.body.append(cursor);
}"""
MOVE = "([x, y, held]) => { cursor.style.transform = `translate(${x - 5}px, ${y - 3}px) scale(${held ? 0.82 : 1})`; }"


def draw(page: Opened) -> list[Image.Image]:
    """The pictures one after the other."""
    page.js(CURSOR)
    page.js("page.motion.setGhost({ inertia_model: '' }), page.motion.reset()")
    mouse, at, start, pressed_s = page.page.mouse, (860.0, 560.0), (0.0, 0.0), -1.0
    held = poked = switched = False
    box = page.page.get_by_role("radio", name="bounding box").bounding_box()
    switch = box["x"] + 0.6 * box["width"], box["y"] + 0.6 * box["height"]
    pictures = []
    for frame in range(round(RATE * SECONDS)):
        t = frame / RATE
        if t < GRAB_S:
            at = between(at, seen(page, GRABBED), (t / GRAB_S) ** 2)
        elif t < PULLED_S:
            if not held:
                at = start = seen(page, GRABBED)
                mouse.move(*at)
                mouse.down()
                held = True
            part = (t - GRAB_S) / (PULLED_S - GRAB_S)
            away = math.sin(math.pi * part) ** 2
            at = start[0] - 130.0 * away, start[1] + 30.0 * away
        elif t < POKE_S:
            if held:
                mouse.up()
                held = False
            at = between(at, seen(page, POKED), ((t - PULLED_S) / (POKE_S - PULLED_S)) ** 2)
        elif not poked:
            at, poked, pressed_s = seen(page, POKED), True, t
            press(mouse, at)
        elif t < SWITCH_S:
            if t > POKE_S + PRESSED_S:
                at = between(at, switch, (t - POKE_S - PRESSED_S) / (SWITCH_S - POKE_S - PRESSED_S))
        elif not switched:
            at, switched, pressed_s = switch, True, t
            press(mouse, at)
        mouse.move(*at)
        page.js(MOVE, [*at, held or (pressed_s >= 0.0 and t - pressed_s < PRESSED_S)])
        page.drawn(2)
        shot = page.page.screenshot(animations="disabled")
        pictures.append(Image.open(io.BytesIO(shot)).convert("RGB").resize(SIZE, Image.Resampling.LANCZOS))
        page.fly(1.0 / RATE)
    kinds = [next(kind for kind in ("string", "impulse", "set") if kind in entry) for entry in page.script]
    assert {"string", "impulse", "set"} <= set(kinds), f"a hand missed the body: {kinds}"
    return pictures


def press(mouse: Any, at: tuple[float, float]) -> None:
    """A click on this place."""
    mouse.move(*at)
    mouse.down()
    mouse.up()


def between(a: Any, b: Any, part: float) -> tuple[float, float]:
    """A point on the way."""
    return a[0] + part * (b[0] - a[0]), a[1] + part * (b[1] - a[1])


def seen(page: Opened, point: tuple[float, float, float]) -> tuple[float, float]:
    """Where a point of the mesh is on the screen [px]."""
    body = page.now["body"]
    R, away = body["rotation"], [x - c for x, c in zip(point, body["com"], strict=True)]
    world = [body["row"][i] + sum(R[3 * i + k] * away[k] for k in range(3)) for i in range(3)]
    x, y = page.seen(world)
    return float(x), float(y)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    args = parser.parse_args()
    with chromium() as browser:
        page = Opened(browser, SCREEN)
        page.pause()
        pictures = draw(page)
        page.close()
    first, *others = pictures
    first.save(
        args.file, save_all=True, append_images=others, duration=round(1000 / RATE), loop=0, quality=QUALITY, method=4
    )
    print(f"{args.file}: {len(pictures)} pictures, {args.file.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
