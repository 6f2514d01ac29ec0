# SPDX-License-Identifier: MIT
"""A lesson as one file opens from disk, moves, and asks nobody for anything."""

from __future__ import annotations

import io
import re
import shutil
import time

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed: no player")

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.lessons import lesson


def test_the_file_holds_the_lessons_words_and_refers_to_nothing_outside_it(tmp_path, capsys) -> None:
    file = tmp_path / "t_handle.html"
    assert main(["lesson", "t_handle", "--html", str(file), "--duration", "1"]) == 0
    assert str(file) in capsys.readouterr().out
    text = file.read_text("utf-8")
    shown = lesson("t_handle")
    for words in (shown.title, shown.question, *shown.choices):
        assert words in text
    assert not re.search(r"""(src|href)=["']?https?:""", text)
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["goat", "--html", "{tmp}/a.html"], ("goat",)),
        (["book", "--html", "{tmp}/a.txt"], ("--html", ".html")),
        (["book", "--html", "{tmp}/a.html", "--duration", "nan"], ("--duration", "nan")),
    ],
)
def test_what_makes_no_file_is_refused_in_one_line(arguments, words, tmp_path, capsys) -> None:
    assert main(["lesson", *(word.replace("{tmp}", str(tmp_path)) for word in arguments)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and all(word in said for word in words)
    assert not list(tmp_path.iterdir())


def test_in_a_browser_the_body_moves_without_a_server_and_without_the_network(tmp_path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api")
    from PIL import Image

    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("there is no browser to drive: sudo apt install chromium")
    file = tmp_path / "lesson.html"
    assert main(["lesson", "t_handle", "--html", str(file), "--duration", "4"]) == 0
    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chromium, args=flags)
        page = browser.new_page(viewport={"width": 900, "height": 600})
        # Software WebGL draws as often as it is let, and leaves nothing of a core.
        draw = "const draw = requestAnimationFrame; window.requestAnimationFrame = f => setTimeout(() => draw(f), 100)"
        page.add_init_script(draw)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto(file.as_uri())
        player = page.frame_locator("iframe")
        slider = player.locator("[role=slider]").first
        slider.wait_for(state="attached", timeout=120_000)

        def looks() -> np.ndarray:
            png = page.locator("iframe").screenshot(timeout=120_000)
            with Image.open(io.BytesIO(png)) as image:
                height = image.height - 60  # without the slider
                return np.asarray(image.convert("RGB").crop((200, 0, image.width, height)), dtype=int)

        deadline = time.monotonic() + 180.0
        first = looks()
        while time.monotonic() < deadline and (np.ptp(first, axis=(0, 1)) < 60).all():
            time.sleep(1.0)
            first = looks()
        assert (np.ptp(first, axis=(0, 1)) > 60).any(), "nothing is drawn"
        moved, seen = 0.0, first
        while time.monotonic() < deadline and moved < 0.01:
            time.sleep(1.0)
            seen = looks()
            # A light body on a light ground: steps of colour are small, and those of the compression none.
            changed = np.abs(seen - first).max(axis=2) > 15
            moved = float(changed.mean())
        assert moved >= 0.01, "nothing moves"
        # What has moved is the body and its shadow: without light both would be next to black.
        assert np.median(seen[changed].max(axis=-1)) > 90, "the body isn't lit"
        assert float(slider.get_attribute("aria-valuemax")) == pytest.approx(4.0, abs=0.01)
        browser.close()
    assert {url.partition(":")[0] for url in asked} <= {"file", "data", "blob", "about"}, asked
