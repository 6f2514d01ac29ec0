# SPDX-License-Identifier: MIT
"""A lesson as one file opens from disk, moves, and asks nobody for anything."""

from __future__ import annotations

import io
import re
import sys
import time

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser", reason="viser is not installed: no player")

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.picture import style
from rigid_proto_ros.scene.lessons import lesson
from rigid_proto_ros.workbench import lesson_file
from rigid_proto_ros.workbench.drawing import ViserBackend
from rigid_proto_ros.workbench.lessons import COURSES
from rigid_proto_ros.workbench.room import Room


def kept_of(kind: type, monkeypatch) -> list:
    """What the writer of the file makes of this class from now on."""
    made = []

    def keep(*arguments):
        made.append(kind(*arguments))
        return made[-1]

    monkeypatch.setattr(lesson_file, kind.__name__, keep)
    return made


@pytest.fixture(scope="module")
def t_handle(tmp_path_factory):
    """The file of a lesson, alone in its folder."""
    file = tmp_path_factory.mktemp("lesson") / "t_handle.html"
    assert main(["lesson", "t_handle", "--html", str(file), "--duration", "2"]) == 0
    return file


def test_the_file_holds_the_lessons_words_and_refers_to_nothing_outside_it(t_handle) -> None:
    text = t_handle.read_text("utf-8")
    shown = lesson("t_handle")
    for words in (shown.title, shown.question, *shown.choices):
        assert words in text
    assert not re.search(r"""(src|href)=["']?https?:""", text)
    assert list(t_handle.parent.iterdir()) == [t_handle]


@pytest.mark.parametrize("name", ["dropped_term", "spinning_top"])
def test_the_file_shows_the_parts_that_the_page_shows(name, tmp_path, monkeypatch) -> None:
    made = kept_of(ViserBackend, monkeypatch)
    assert main(["lesson", name, "--html", str(tmp_path / "a.html"), "--duration", "0.1"]) == 0
    (backend,) = made
    labels = COURSES[name].labels
    for part in (style.MOMENTUM, style.OMEGA):
        assert backend.wanted(part) == (part in backend.labelled) == (part in labels)
    assert backend.wanted(style.PRINCIPAL_AXES) == (name == "spinning_top")
    assert not backend.wanted(style.TRAIL)


def test_the_arrow_of_a_poke_is_seen_for_most_of_a_second(tmp_path, monkeypatch) -> None:
    seen: list[float] = []

    class Backend(ViserBackend):
        def finish(self, now_s: float) -> None:
            super().finish(now_s)
            arrow = self._nodes.get(style.load_part("poke", "force"))
            seen.extend([now_s] if arrow is not None and arrow.visible else [])

    monkeypatch.setattr(lesson_file, "ViserBackend", Backend)
    assert main(["lesson", "weigh_by_throwing", "--html", str(tmp_path / "a.html"), "--duration", "4"]) == 0
    # It lasts 0.05 s.
    assert seen[-1] - seen[0] == pytest.approx(0.8, abs=0.07)  # two frames


def test_a_body_that_falls_is_followed_with_its_path_while_it_is_in_sight(tmp_path, capsys, monkeypatch) -> None:
    rooms, backends = kept_of(Room, monkeypatch), kept_of(ViserBackend, monkeypatch)
    file = tmp_path / "a.html"
    assert main(["lesson", "thrown_hammer", "--html", str(file)]) == 0
    # The flight of 5 m/s up takes 2·5/9.81 s.
    assert f"{10.0 / 9.81:.6g} s of thrown_hammer" in capsys.readouterr().out
    # 4.7; of ten seconds, 440 m deep, 915.
    assert rooms[0].far < 10.0
    assert backends[0].wanted(style.TRAIL)
    assert "Played at 0.1 of the real speed" in file.read_text("utf-8")


def test_the_hanging_book_is_shown_until_it_has_come_to_rest(tmp_path, capsys, monkeypatch) -> None:
    ends_ns = []
    monkeypatch.setattr(lesson_file, "lesson_html", lambda _, record: ends_ns.append(record.times_ns[-1]) or "drawn")
    assert main(["lesson", "plumb_line", "--html", str(tmp_path / "a.html")]) == 0
    assert "40 s of plumb_line" in capsys.readouterr().out
    assert ends_ns == [40_000_000_000]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["goat", "--html", "{tmp}/a.html"], ("goat",)),
        (["book", "--html", "{tmp}/a.txt"], ("--html", ".html")),
        (["book", "--html", "{tmp}/a.html", "--duration", "nan"], ("--duration", "nan")),
    ],
)
def test_what_makes_no_file_is_refused_in_one_line(arguments, words, tmp_path, capsys) -> None:
    with pytest.raises(SystemExit) as end:  # as argparse ends what it refuses itself
        sys.exit(main(["lesson", *(word.replace("{tmp}", str(tmp_path)) for word in arguments)]))
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and all(word in said for word in words)
    assert not list(tmp_path.iterdir())


def test_in_a_browser_the_body_moves_without_a_server_and_without_the_network(t_handle, monkeypatch) -> None:
    sync_api = pytest.importorskip("playwright.sync_api")
    from workbench_page import CHROMIUM, DRAWN_MS, FLAGS, NO_CHROMIUM, RARELY_DRAWN, SEE_THROUGH

    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    with sync_api.sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 700, "height": 320})
        page.add_init_script(f"({RARELY_DRAWN})({DRAWN_MS})")
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto(t_handle.as_uri())
        player = page.frame_locator("iframe")
        slider = player.locator("[role=slider]").first
        slider.wait_for(state="attached", timeout=120_000)
        page.frames[1].add_style_tag(content=SEE_THROUGH)

        def looks() -> np.ndarray:
            png = page.locator("iframe").screenshot(timeout=120_000)
            with Image.open(io.BytesIO(png)) as image:
                height = image.height - 60  # without the slider
                return np.asarray(image.convert("RGB").crop((0, 0, image.width, height)), dtype=int)

        def until(seen, what: str) -> np.ndarray:
            deadline = time.monotonic() + 180.0
            while not seen(picture := looks()):
                assert time.monotonic() < deadline, what
                time.sleep(0.5)
            return picture

        first = until(lambda picture: _body(picture).mean() > 0.005, "no lit body is drawn")
        # A light body on a light ground: steps of colour are small, and those of the compression none.
        until(lambda picture: (np.abs(picture - first).max(axis=2) > 15).mean() > 0.01, "nothing moves")
        assert float(slider.get_attribute("aria-valuemax")) == pytest.approx(2.0, abs=0.01)
        # A narrow window that is wider than high has player and words side by side.
        player_box, words = page.locator("iframe").bounding_box(), page.locator("aside")
        assert player_box["height"] == 320 and words.bounding_box()["x"] >= player_box["x"] + player_box["width"]
        page.emulate_media(media="print")
        assert words.evaluate("aside => aside.scrollHeight - aside.clientHeight") <= 0, "words that paper cuts off"
        assert re.findall(rb"/Type\s*/Page\b", page.pdf(format="A4")) == [b"/Type /Page"], "more than a page"
        monkeypatch.setattr(lesson_file, "_recorded", lambda *_: "")
        page.set_content(lesson_file.lesson_html(lesson("thrown_hammer"), FlightRecord()))
        printed = page.pdf(format="A4", landscape=True)
        assert re.findall(rb"/Type\s*/Page\b", printed) == [b"/Type /Page"], "more than a page"
        browser.close()
    assert {url.partition(":")[0] for url in asked} <= {"file", "data", "blob", "about"}, asked


def _body(picture: np.ndarray) -> np.ndarray:
    """Where the body is: its colour is warm, those of ground and sky are cold."""
    return (picture[..., 0] - picture[..., 2] > 2) & (picture[..., 0] > 110)
