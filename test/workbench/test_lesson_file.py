# SPDX-License-Identifier: MIT
"""A lesson as one file: its words, what it shows of the motion, and for how long. In a browser: test_workbench_page.py."""

from __future__ import annotations

import re
import sys

import pytest

pytest.importorskip("viser", reason="viser is not installed: no player")

from rigid_proto_ros.cli.main import main
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


def test_the_file_holds_the_lessons_words_and_refers_to_nothing_outside_it(tmp_path) -> None:
    file = tmp_path / "t_handle.html"
    assert main(["lesson", "t_handle", "--html", str(file), "--duration", "0.1"]) == 0
    text = file.read_text("utf-8")
    shown = lesson("t_handle")
    for words in (shown.title, shown.question, *shown.choices):
        assert words in text
    assert not re.search(r"""(src|href)=["']?https?:""", text)
    assert list(tmp_path.iterdir()) == [file]


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
