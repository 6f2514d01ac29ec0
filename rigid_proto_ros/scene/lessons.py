# SPDX-License-Identifier: MIT
"""Lessons: the bundled scenes, each with a title, a question to answer first, steps to try, a sentence each, and why.
Nothing before the reason gives the answer away.

All of it stands in the comment at the head of the scene's file, in paragraphs: the licence, the title, the question
with its choices A, B, C and the answer's letter, the steps, the reason, and how to run it. Pages and
documents take it from there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from ..base.bundled import scene_names, scene_path

_QUESTION = re.compile(r"Question: (.+\?) A: (.+) B: (.+) C: (.+) Answer: ([ABC])\.")


@dataclass(frozen=True)
class Lesson:
    """name: of the scene. question: what is asked first, with its choices; answer: the number of the right one.
    sentences: the steps to try. reason: why, in a paragraph. commands: how to run it. script: name of the
    bundled example that goes with it, or empty. duration_s: of the first command.
    """

    name: str
    title: str
    question: str
    choices: tuple[str, ...]
    answer: int
    sentences: tuple[str, ...]
    reason: str
    commands: str
    script: str
    duration_s: float
    path: Path


def lessons() -> list[Lesson]:
    """All bundled lessons, by name."""
    return [lesson(name) for name in scene_names()]


def lesson(name: str) -> Lesson:
    """The lesson of a bundled scene; raises InputError for a name that is none."""
    path = scene_path(name)
    head: list[str] = []
    for line in path.read_text("utf-8").splitlines():
        if not line.startswith("#"):
            break
        head.append(line.removeprefix("#").strip())
    paragraphs = [" ".join(part.split("\n")) for part in "\n".join(head).split("\n\n")]
    _, title, asked, trials, *reasons, commands = paragraphs
    question = _QUESTION.fullmatch(asked)
    assert question is not None, asked
    sentences = tuple(re.split(r"(?<=[.!?]) (?=[A-Z])", trials))
    script = re.search(r"msg_examples/(\w+)\.yaml", commands)
    duration = re.search(r"--duration (\d+)", commands)
    text, *choices, letter = question.groups()
    return Lesson(
        path.stem,
        title,
        text,
        tuple(choices),
        "ABC".index(letter),
        sentences,
        " ".join(reasons),
        commands,
        script[1] if script else "",
        float(duration[1]) if duration else 10.0,
        path,
    )
