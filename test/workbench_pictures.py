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
from workbench_page import CHROMIUM, FLAGS, Bench, Page

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
        bench = Bench(environment, Path(folder), any_free_port(), "t_handle")
        try:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            page = Page(browser, bench.address, SIZE)
            if args.picture:
                draw_pull(page, args.picture)
            if args.compare:
                draw_comparison(page, args.compare)
            if args.lessons:
                args.lessons.mkdir(parents=True, exist_ok=True)
                for lesson in lessons():
                    page.choose("Lesson", lesson.title)
                    time.sleep(6.0)
                    page.page.screenshot(path=args.lessons / f"{lesson.name}.png")
            browser.close()
        finally:
            bench.process.end()


def draw_comparison(page: Page, picture: Path) -> None:
    """True tensor against box: what a user sees by three actions (start the workbench, open the page, click), counted here."""
    began = time.monotonic()
    actions = ["rigid_proto workbench", "open the page"]
    page.button(START)
    actions.append(f"click {START!r}")
    before_s = page.readout[0]
    found = page.until(lambda: re.search(r"(\d+)° apart", page.text), "the angle between body and ghost")
    page.until(lambda: page.readout[0] < before_s, "a new beginning")
    print(
        f"{len(actions)} actions ({', '.join(actions)}), seen {time.monotonic() - began:.1f} s after the click: {found[0]}"
    )
    assert len(actions) <= 5
    page.until(lambda: page.readout[0] >= 2.0, "two seconds of flight")
    page.page.screenshot(path=picture)


def draw_pull(page: Page, picture: Path) -> None:
    """The T-handle a flip on, in the middle, pulled at by a string."""
    time.sleep(6.0)
    page.choose("Speed", "1/10")
    x, y = page.middle
    # Slow, so that the picture is taken before the body has followed and the string is long.
    page.drag(x, y, -150.0, -60.0, steps=2)
    time.sleep(0.8)
    # A browser draws moved nodes before lines that are made anew: at rest all is where it belongs.
    page.page.keyboard.press("Space")
    page.until(lambda: "The simulation is paused" in page.text, "a pause")
    time.sleep(2.0)
    page.page.screenshot(path=picture)
    page.release()
    page.page.keyboard.press("Space")


if __name__ == "__main__":
    main()
