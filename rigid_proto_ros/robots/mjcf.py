# SPDX-License-Identifier: MIT
"""MJCF: bodies with geoms and inertials, as MuJoCo's own compiler takes default classes, frames, attached models and
orientations.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from ..base.errors import InputError, is_missing
from ..base.files import read_bounded
from . import reading as rd
from .mjcf_compiler import Question, ask

MAX_ELEMENTS = 20_000
"""Of one model, replicated and attached ones counted: 3000 bodies with a geom each took 3.4 s of a core and 116 MB."""
PIXELS = 1000
"""Of a texture or height field that count as one element."""
MAX_INCLUDES = 200
"""Of one model, the includes of included files counted."""


def _include(parent: Element, main: Path, path: Path, left: Iterator[int]) -> None:
    """Put the content of included files, named from the main file's folder or from that of ``path``, the file that
    includes them, in the place of each <include>: MuJoCo itself takes no file twice. ``left``: how many more may
    follow.
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


def _whole(text: str | None) -> int:
    """A count as a file has it, at least 1; 1 also for what MuJoCo will refuse."""
    try:
        return max(1, int(float(text or "1")))
    except (ValueError, OverflowError):
        return 1


def _elements(element: Element, models: dict[str, int]) -> int:
    """Elements that MuJoCo makes of one: what is replicated as often as that, the points of what is composed, pixels of
    textures and height fields, and the models (elements of each, by name) that are attached.
    """
    total = 1 + sum(_elements(child, models) for child in element)
    words = {name: [_whole(word) for word in text.split()] for name, text in element.attrib.items()}
    if element.tag == "replicate":
        return total * math.prod(words.get("count", []))
    if element.tag in ("composite", "flexcomp"):
        return total + math.prod(words.get("count", []))
    if element.tag in ("texture", "hfield"):
        return (
            total + math.prod(math.prod(words.get(name, [])) for name in ("width", "height", "nrow", "ncol")) // PIXELS
        )
    return total + models.get(element.get("model", ""), 0) if element.tag == "attach" else total


def _check_size(root: Element, path: Path, known: dict[Path, int]) -> None:
    """Put into ``known`` how many elements MuJoCo makes of a file, with the models that it attaches. Raises InputError
    beyond MAX_ELEMENTS, for which MuJoCo may take hours and all memory.
    """
    models, known[path] = {}, 0  # of a model within itself, which MuJoCo refuses
    for model in root.iter("model"):
        file = path.parent / model.get("file", "")
        if file.is_file() and file not in known:
            content = rd.parse_xml(read_bounded(file, rd.MAX_BYTES, "robot file", "an MJCF file", ordinary=True), file)
            _check_size(content, file, known)
        models[model.get("name", "") or file.stem] = known.get(file, 0)
    total = _elements(root, models)
    if total > MAX_ELEMENTS:
        raise InputError("robot file", f"{path.name} replicates to {total:.3g} elements", f"at most {MAX_ELEMENTS}")
    known[path] = total


def read_mjcf(root: Element, path: Path) -> rd.Robot:
    """The bodies of a <mujoco>; raises InputError for what MuJoCo refuses, and without it."""
    if importlib.util.find_spec("mujoco") is None:
        raise InputError("robot file", f"MJCF: {is_missing('mujoco', 'robots')}")
    inertials = {body.get("name", ""): body.find("inertial") for body in root.iter("body")}
    try:
        _include(root, path, path, iter(range(MAX_INCLUDES)))
        _check_size(root, path, {})
    except RecursionError:
        raise InputError("robot file", path.name, "elements within each other as deep as MuJoCo takes them") from None
    if any(not model.get("file") for model in root.iter("model")):  # MuJoCo may loop at a later file after such a one
        raise InputError("robot file", path.name, "a file for each <model>")
    text = ElementTree.tostring(root, encoding="unicode")
    answer = ask(Question(text, path, inertials, simulated=False))
    # An element is known by its place in the file, which a copy hasn't.
    links = [link if link.element is None else replace(link, element=inertials[link.name]) for link in answer.links]
    return rd.Robot(links, lambda: answer.poses, lambda: ask(Question(text, path, inertials, simulated=True)).links)
