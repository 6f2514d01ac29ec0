# SPDX-License-Identifier: MIT
"""MJCF: bodies with geoms and inertials. MuJoCo's compiler resolves default classes, frames, attached models and
orientations.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ..base.errors import InputError, is_missing
from ..base.files import read_bounded
from . import reading as rd
from .mjcf_compiler import Question, ask

MAX_INCLUDES = 200
"""Largest number of includes of a model, including nested ones."""


def _include(parent: Element, main: Path, path: Path, left: Iterator[int]) -> None:
    """Replace each <include> by the content of its file, since MuJoCo itself takes no file twice. File names are
    relative to the folder of the main file, or of ``path``, the including file. left: counts the remaining includes.
    """
    for child in list(parent):
        if child.tag != "include":
            _include(child, main, path, left)
            continue
        if next(left, None) is None:
            raise InputError("robot file", f"{main.name} includes more files", f"at most {MAX_INCLUDES}")
        places = [folder / child.get("file", "") for folder in (main.parent, path.parent)]
        file = next((place for place in places if place.is_file()), places[0])
        text = read_bounded(file, rd.MAX_BYTES, "robot file", "an MJCF file to include", ordinary=True)
        content = rd.parse_xml(text, file)
        _include(content, main, file, left)
        place = list(parent).index(child)
        parent[place : place + 1] = list(content)


def read_mjcf(root: Element, path: Path) -> rd.Robot:
    """The bodies of a <mujoco>. Raises InputError for what MuJoCo refuses, and if MuJoCo isn't installed."""
    if importlib.util.find_spec("mujoco") is None:
        raise InputError("robot file", f"MJCF: {is_missing('mujoco', 'robots')}")
    inertials = {body.get("name", ""): body.find("inertial") for body in root.iter("body")}
    try:
        _include(root, path, path, iter(range(MAX_INCLUDES)))
    except RecursionError:
        raise InputError("robot file", path.name, "elements within each other as deep as MuJoCo takes them") from None
    if any(not model.get("file") for model in root.iter("model")):  # MuJoCo may loop at a later one
        raise InputError("robot file", path.name, "a file for each <model>")
    text = ElementTree.tostring(root, encoding="unicode")
    answer = ask(Question(text, path, inertials, simulated=False))
    # Elements are identified by object, and the answer has copies.
    links = [link if link.element is None else replace(link, element=inertials[link.name]) for link in answer.links]
    return rd.Robot(links, lambda: answer.poses, lambda: ask(Question(text, path, inertials, simulated=True)).links)
