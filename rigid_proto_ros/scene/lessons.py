# SPDX-License-Identifier: MIT
"""Lessons: each bundled scene with a title, a question, steps to try in one sentence each, and the reason. Nothing
shown before the reason gives the answer away.

A lesson is written in the comment at the head of its scene file, in paragraphs: the licence, the title, the question
with its choices A, B, C and the letter of the answer, the steps, the reason, and how to run it. Pages and documents
read it from there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from ..base.bundled import scene_names, scene_path

_QUESTION = re.compile(r"Question: (.+\?) A: (.+) B: (.+) C: (.+) Answer: ([ABC])\.")


@dataclass(frozen=True)
class Lesson:
    """name: name of the scene. question: asked first, with its choices. answer: index of the right choice. sentences:
    the steps to try. reason: the explanation, one paragraph. commands: how to run it. script: name of the bundled
    script that belongs to it, or empty. duration_s: duration of the first command [s].
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
    """All bundled lessons, sorted by name."""
    return [lesson(name) for name in scene_names()]


def lesson(name: str) -> Lesson:
    """The lesson of a bundled scene. Raises InputError for an unknown name."""
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
