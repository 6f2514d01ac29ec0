# SPDX-License-Identifier: MIT
"""Pictures of the interactive page in headless Chromium: ``python test/workbench_pictures.py PICTURE.png`` draws the README's,
``--lessons FOLDER`` one of each lesson.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from playwright.sync_api import sync_playwright
from workbench_page import CHROMIUM, SOFTWARE_GL, Bench, Page

from rigid_proto_ros.scene.lessons import lessons

SIZE = (1400, 800)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", nargs="?", type=Path)
    parser.add_argument("--lessons", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        bench = Bench(Path(folder), "t_handle")
        try:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
            page = Page(browser, bench.address, SIZE)
            if args.picture:
                draw_pull(page, args.picture)
            if args.lessons:
                args.lessons.mkdir(parents=True, exist_ok=True)
                for lesson in lessons():
                    page.choose("Lesson", lesson.title)
                    page.until(lambda one=lesson: one.question in page.text, "question")
                    page.press(lesson.choices[lesson.answer])
                    time.sleep(5.0)
                    page.page.screenshot(path=args.lessons / f"{lesson.name}.png")
            browser.close()
        finally:
            bench.process.end()


def draw_pull(page: Page, picture: Path) -> None:
    """The T-handle, pulled at by a string."""
    page.until(lambda: "What do you think?" in page.text, "question")
    page.press("Turn over, again and again.")
    time.sleep(6.0)
    page.choose("Speed", "1/100")
    time.sleep(2.0)
    x, y = page.middle
    # Slow, so that the picture is taken before the body has followed and the string is long.
    page.drag(x, y, -150.0, -60.0, steps=2)
    time.sleep(3.0)
    page.page.screenshot(path=picture)
    page.release()


if __name__ == "__main__":
    main()
