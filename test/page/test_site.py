# SPDX-License-Identifier: MIT
"""The folder for a static host: whole, found by its one setting, and opened as a reader opens it."""

from __future__ import annotations

import re
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
import yaml
from page_browser import Opened, page_address
from page_tools import packages

import docs_tables
import static_site
from rigid_proto_ros.scene.lessons import lessons

AT = "https://somebody.example/body/"
ROOT = static_site.ROOT


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    packages()
    page_address()
    folder = tmp_path_factory.mktemp("site")
    static_site.make(folder)
    return folder


@pytest.mark.slow
def test_it_has_the_page_a_start_page_and_one_address_a_lesson(site: Path) -> None:
    names = [one.name for one in lessons()]
    found = {str(file.relative_to(site)) for file in site.rglob("*") if file.is_file()}
    expected = {f"{name}/index.html" for name in names} | {f"{name}.png" for name in names}
    assert found == expected | {"index.html", static_site.PAGE, static_site.PICTURE, ".nojekyll"}
    for file in site.rglob("index.html"):
        text = file.read_text("utf-8")
        for target in re.findall(r'(?:href|src)="([^"#]*)', text):
            leads_to = file.parent / target
            assert leads_to.is_file() or (leads_to / "index.html").is_file(), f"{file}: {target}"
        assert "http://" not in text and "https://" not in text, "it asks no other host for anything"


@pytest.mark.drawn
def test_a_reader_plays_and_opens_a_lesson_by_its_address(site: Path, browser: Any) -> None:
    page = Opened(browser, address=f"{(site / 'book' / 'index.html').as_uri()}")
    page.page.wait_for_selector("#lesson .choice")
    assert page.js("location.hash") == "#lesson=book" and page.js("page.motion.body().name") == "book"
    page.page.goto((site / "index.html").as_uri())
    broken = "[...document.images].filter(image => image.loading !== 'lazy' && !(image.complete && image.naturalWidth)).length"
    assert page.js(broken) == 0
    assert page.page.locator("li a").count() == len(lessons())
    page.page.get_by_role("link", name="Play").click()
    page.page.wait_for_function("window.page && page.motion.snapshot().timeNs > 0")
    page.close()


@pytest.mark.stress
@pytest.mark.drawn
def test_every_address_of_a_lesson_opens_in_it_as_a_host_serves_it(site: Path, browser: Any) -> None:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site))) as host:
        threading.Thread(target=host.serve_forever, daemon=True).start()
        at = f"http://127.0.0.1:{host.server_port}/"
        for one in lessons():
            page = Opened(browser, address=f"{at}{one.name}/")
            page.page.wait_for_selector("#lesson .choice")
            assert page.js("location.hash") == f"#lesson={one.name}"
            assert page.page.locator("#question").inner_text() == one.question
            # Its own file and nothing else, but for the icon that a browser asks every host for.
            asked = {url.partition("#")[0] for url in page.requests if not url.startswith(("data:", "blob:"))}
            assert asked - {f"{at}favicon.ico"} == {f"{at}{one.name}/", f"{at}{static_site.PAGE}"}
            page.context.close()
        host.shutdown()


@pytest.mark.parametrize("published", ["", AT])
def test_readme_and_docs_name_the_address_or_else_the_file(published: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(docs_tables, "address", lambda: published)
    readme = docs_tables.filled((ROOT / "README.md").read_text("utf-8"))
    gallery = docs_tables.filled((ROOT / "docs" / "gallery.md").read_text("utf-8"))
    assert (f"<{AT}>" in readme) == bool(published)
    assert ("rigid_proto workbench --html rigid_body.html" in readme) == (not published)
    for one in lessons():
        assert (f"<{AT}{one.name}/>" in gallery) == bool(published)
        assert (f"rigid_proto lesson {one.name} --html {one.name}.html" in gallery) == (not published)


def test_the_setting_is_read_as_the_workflow_reads_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    assert static_site.address() == (re.findall(r'^site = "(.*)"', text, re.MULTILINE) or [""])[0]
    (tmp_path / "pyproject.toml").write_text(
        re.sub(r'^site = ".*"', f'site = "{AT.rstrip("/")}"', text, flags=re.MULTILINE)
    )
    monkeypatch.setattr(static_site, "ROOT", tmp_path)
    assert static_site.address() == AT


def test_the_workflow_publishes_what_make_site_writes_by_actions_pinned_by_commit() -> None:
    text = (ROOT / ".github" / "workflows" / "site.yml").read_text("utf-8")
    steps = [step for job in yaml.safe_load(text)["jobs"].values() for step in job["steps"]]
    used = [step["uses"] for step in steps if "uses" in step]
    assert used and all(re.fullmatch(r"actions/[a-z-]+@[0-9a-f]{40}", one) for one in used)
    assert any(step.get("run") == "make site" for step in steps)
    assert any(step.get("with", {}).get("path") == "site" for step in steps)
    assert "/site/" in (ROOT / ".gitignore").read_text("utf-8").split()
