# SPDX-License-Identifier: MIT
"""The folder for a static host: start page, one address a lesson, and the page itself.

    python tools/static_site.py FOLDER        # writes it
    python tools/static_site.py --address     # prints the address at which it is published, if there is one

That address is one setting, ``site`` of ``[tool.rigid_proto_ros]`` in pyproject.toml; README and documents name it as soon as
it is set (tools/docs_tables.py).
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tomllib
from html import escape
from pathlib import Path

from rigid_proto_ros.page.file import write_page
from rigid_proto_ros.scene.lessons import Lesson, lessons

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGE = "rigid_body.html"
"""The page itself: whoever saves it has all of it."""
PICTURE = "flight.webp"

_STYLE = """
body { margin: 0; font: 1.05rem/1.5 system-ui, sans-serif; color: #1d2433; background: #f1f4f9; }
main { max-width: 68rem; margin: 0 auto; padding: 1.5rem; }
a { color: #2a4bb5; }
.toy { display: block; border-radius: 18px; overflow: hidden; background: #fff; box-shadow: 0 4px 24px #1d24331f; color: inherit;
  text-decoration: none; }
.toy img { display: block; width: 100%; height: auto; }
.toy span { display: block; padding: 1rem 1.4rem; font-size: 1.3rem; font-weight: 700; color: #fff; background: #3355c8; text-align: center; }
ul { list-style: none; margin: 0; padding: 0; display: grid; gap: 1.2rem; grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); }
li a { display: block; height: 100%; border-radius: 14px; overflow: hidden; background: #fff; box-shadow: 0 2px 12px #1d243314; color: inherit;
  text-decoration: none; }
li a:hover, li a:focus-visible, .toy:hover, .toy:focus-visible { outline: 3px solid #3355c8; }
li i { display: block; aspect-ratio: 16 / 11; overflow: hidden; background: #0d0f12; }
li img { display: block; width: 166%; margin: -7% 0 0; } /* of a recording's picture the motion, without what stands beside it */
li b, li span { display: block; padding: .7rem 1rem 0; }
li span { padding: .2rem 1rem 1rem; font-size: .95rem; color: #4b5873; }
"""


def address() -> str:
    """Where the folder is published, ending in "/"; "" if nowhere."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        found = tomllib.load(file)["tool"]["rigid_proto_ros"]["site"]
    return f"{found.rstrip('/')}/" if found else ""


def make(folder: Path) -> None:
    """Write the folder anew. Raises InputError where the page can't be built."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    write_page(folder / PAGE)
    shutil.copy(DOCS / PICTURE, folder)
    (folder / ".nojekyll").touch()  # GitHub's pages are otherwise put through a generator
    for one in lessons():
        shutil.copy(_picture(one), folder / f"{one.name}.png")
        (folder / one.name).mkdir()
        (folder / one.name / "index.html").write_text(lesson_page(one), "utf-8")
    (folder / "index.html").write_text(start_page(), "utf-8")


def _picture(one: Lesson) -> Path:
    return DOCS / "lessons" / f"{one.name}.png"


def start_page() -> str:
    """index.html: the toy, and every lesson with its picture."""
    cards = "\n".join(
        f'<li><a href="{one.name}/"><i><img src="{one.name}.png" alt="" loading="lazy"></i><b>{escape(one.title)}</b>'
        f"<span>{escape(one.question)}</span></a></li>"
        for one in lessons()
    )
    alt = "A T-handle is pulled on a string, poked, and gets the tensor of its bounding box"
    return _html(
        "One rigid body",
        f"""<h1>One rigid body</h1>
<p>Pull it, poke it, change its size and mass, and swap its tensor of inertia for that of a box. It is one file, which works without a
network: <a href="{PAGE}" download>keep it</a>, and <a href="{PAGE}">open</a> it in any browser.</p>
<a class="toy" href="{PAGE}"><img src="{PICTURE}" alt="{alt}" width="800" height="450"><span>Play</span></a>
<h2>Lessons</h2>
<ul>
{cards}
</ul>""",
        '<meta name="description" content="A rigid body in the browser: pull, poke, and see its inertia.">',
    )


def lesson_page(one: Lesson) -> str:
    """NAME/index.html: leads to the lesson, and tells its title and picture to those who show links."""
    target = f"../{PAGE}#lesson={one.name}"
    described = [
        ("og:title", one.title),
        ("og:description", one.question),
        ("og:image", f"{address() or '../'}{one.name}.png"),
    ]
    head = [f'<meta property="{name}" content="{escape(text, quote=True)}">' for name, text in described]
    head.append(f'<meta http-equiv="refresh" content="0; url={target}">')
    return _html(one.title, f'<p><a href="{target}">{escape(one.title)}</a></p>', "\n".join(head))


def _html(title: str, body: str, head: str) -> str:
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
{head}
<style>{_STYLE}</style>
</head>
<body><main>
{body}
</main></body>
</html>
"""


def main(argv: list[str] | None = None) -> int:
    """Write the folder or print the address; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python tools/static_site.py", description="The folder for a static host.")
    parser.add_argument("folder", type=Path, nargs="?", default=ROOT / "site")
    parser.add_argument("--address", action="store_true", help="print where it is published, and write nothing")
    args = parser.parse_args(argv)
    if args.address:
        print(address())
        return 0
    make(args.folder)
    print(f"{args.folder}: {PAGE}, index.html and {len(lessons())} lessons; open index.html, or serve the folder")
    return 0


if __name__ == "__main__":
    sys.exit(main())
