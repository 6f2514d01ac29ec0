# SPDX-License-Identifier: MIT
"""Pictures of the interactive page in headless Chromium: ``python test/workbench_pictures.py PICTURE.png`` draws the README's,
``--lessons FOLDER`` one of each lesson, ``--compare PICTURE.png`` body and ghost a click after the page was opened.
"""

from __future__ import annotations

import argparse
import os
import re
import tempfile
import time
from pathlib import Path

from conftest import held_domain
from playwright.sync_api import sync_playwright
from workbench_page import CHROMIUM, SOFTWARE_GL, Bench, Page

from rigid_proto_ros.rerun_view.ports import any_free_port
from rigid_proto_ros.scene.lessons import lessons
from rigid_proto_ros.workbench.side_by_side import START

SIZE = (1400, 800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", nargs="?", type=Path)
    parser.add_argument("--compare", type=Path, metavar="PICTURE.png")
    parser.add_argument("--lessons", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    with held_domain() as domain, tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        started_s = time.monotonic()
        bench = Bench(environment, Path(folder), any_free_port(), "t_handle")
        try:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
            page = Page(browser, bench.address, SIZE)
            if args.compare:
                draw_comparison(page, args.compare, started_s)
            if args.picture:
                draw_pull(page, args.picture)
            if args.lessons:
                args.lessons.mkdir(parents=True, exist_ok=True)
                for lesson in lessons():
                    page.choose("Lesson", lesson.title)
                    time.sleep(6.0)
                    page.page.screenshot(path=args.lessons / f"{lesson.name}.png")
            browser.close()
        finally:
            bench.process.end()


def draw_comparison(page: Page, picture: Path, started_s: float) -> None:
    """True tensor against box: what a user sees by three actions (start the workbench, open the page, click), counted here
    and timed from ``started_s`` [s, monotonic], when the workbench was started.
    """
    clicked_s = time.monotonic()
    actions = ["rigid_proto workbench", "open the page"]
    page.button(START)
    actions.append(f"click {START!r}")
    alike = r"Started alike[^*]*?([1-9]\d*)° apart"
    found = page.until(lambda: re.search(alike, page.text), "the angle between body and ghost")
    seen_s = time.monotonic()
    print(
        f"{len(actions)} actions ({', '.join(actions)}): {found[1]}° apart seen {seen_s - clicked_s:.1f} s after the click, "
        f"{seen_s - started_s:.1f} s after the start of the workbench"
    )
    assert len(actions) <= 5
    # Slow, so that a browser that draws late draws the moment that is asked for.
    page.choose("Speed", "1/10")
    page.page.evaluate("() => document.activeElement.blur()")  # keys typed into an input are text
    page.page.keyboard.press("r")
    page.until(lambda: page.readout[0] < 1.5, "the beginning again")
    page.until(lambda: page.readout[0] >= 2.0, "two seconds of flight")
    page.page.keyboard.press("Space")
    page.until(lambda: "The simulation is paused" in page.text, "a pause")
    page.page.evaluate("() => document.querySelectorAll('*').forEach(element => element.scrollTop = 0)")
    time.sleep(2.0)
    page.page.screenshot(path=picture)
    page.page.keyboard.press("Space")


def draw_pull(page: Page, picture: Path) -> None:
    """The T-handle a flip on, in the middle, pulled at by a string."""
    page.choose("Lesson", "The T-handle that flips by itself")
    page.until(lambda: "12 rad/s" in page.text, "the T-handle")
    time.sleep(6.0)
    page.choose("Speed", "1/100")
    time.sleep(2.0)
    x, y = page.middle
    # Slow, so that the picture is taken before the body has followed and the string is long.
    page.drag(x, y, -150.0, -60.0, steps=2)
    time.sleep(3.0)
    # A browser draws moved nodes before lines that are made anew: at rest all is where it belongs.
    page.page.keyboard.press("Space")
    page.until(lambda: "The simulation is paused" in page.text, "a pause")
    page.page.evaluate("() => document.querySelectorAll('*').forEach(element => element.scrollTop = 0)")
    time.sleep(2.0)
    page.page.screenshot(path=picture)
    page.release()
    page.page.keyboard.press("Space")


if __name__ == "__main__":
    main()
