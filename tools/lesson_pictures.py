# SPDX-License-Identifier: MIT
"""The lessons' pictures: each page's first command flown into out/, and its moment drawn; and each lesson as one file to
share, out/gallery/NAME.html. `make pictures` runs this.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
from pathlib import Path

from rigid_proto_ros.cli.main import main as rigid_proto

LESSONS = Path(__file__).resolve().parent.parent / "docs" / "lessons"
SIZE = "1280x800"


def draw(page: Path) -> int:
    """Fly and draw one page's picture; returns the exit status."""
    text = page.read_text("utf-8")
    flight = re.search(r"^rigid_proto (simulate .*)$", text, re.MULTILINE)
    moment = re.search(r"^!\[At ([0-9.]+) s", text, re.MULTILINE)
    if flight is None or moment is None:
        print(f"{page.name}: a page has a command and a picture that says its time", file=sys.stderr)
        return 1
    status = rigid_proto(shlex.split(flight[1]))
    picture = str(page.with_suffix(".png"))
    snapshot = [
        "snapshot",
        f"out/{page.stem}.mcap",
        "--at",
        moment[1],
        "--size",
        SIZE,
        "-o",
        picture,
    ]
    file = f"out/gallery/{page.stem}.html"
    return status or rigid_proto(snapshot) or rigid_proto(["lesson", page.stem, "--html", file])


def main(names: list[str]) -> int:
    """Draw the pictures of these lessons, or of all; returns the first exit status that isn't 0."""
    os.chdir(LESSONS.parent.parent)
    Path("out/gallery").mkdir(parents=True, exist_ok=True)
    pages = [LESSONS / f"{name}.md" for name in names] or sorted(p for p in LESSONS.glob("*.md") if p.stem != "README")
    return next((status for page in pages if (status := draw(page))), 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
