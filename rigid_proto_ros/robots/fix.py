# SPDX-License-Identifier: MIT
"""Rewrite inertials in the bytes of a robot file: each <inertial> is replaced, and everything around it stays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ..base.errors import InputError
from ..base.files import read_bounded
from ..mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from ..mass.properties import MassProperties
from ..mass.tensor import SIX
from ..mesh.locate import Search
from .diagnosis import FRAME, NOT_JUDGED, NOT_UNIFORM, UNIFORM, UNKNOWN, LinkDiagnosis, diagnose, missing_inertial
from .link_shapes import Meshes
from .reading import MAX_BYTES, NO_INERTIAL, Link, parse_xml, robot_of

_WRITERS = {"robot": urdf_inertial, "sdf": sdf_inertial, "mujoco": mjcf_inertial}
_REPLACED = {"origin", "pose", "mass", "inertia", *SIX}
"""Elements of an <inertial> that the new one contains or makes unnecessary."""
_ATTRIBUTES = rb"""(?:"[^"]*"|'[^']*'|[^"'>])*"""  # a > in quotes doesn't end a tag
_INERTIAL = re.compile(
    rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|"
    rb"(?P<inertial><inertial(?=[\s/>])" + _ATTRIBUTES + rb"(?:(?<=/)>|>(?:<!--.*?-->|.)*?</inertial\s*>))",
    re.DOTALL,
)
"""An <inertial>, or text that may contain one that is not an element."""
_LINK = re.compile(
    rb"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|(?P<link><link(?=[\s/>])" + _ATTRIBUTES + rb">)", re.DOTALL
)
"""The start of a <link>, or text that may contain one that is not an element."""


@dataclass(frozen=True)
class FixedLink:
    """A link before the change, and whether its inertial was rewritten. left: why an inertial that isn't uniform was
    not rewritten, otherwise "".
    """

    before: LinkDiagnosis
    written: bool
    left: str


def _indent(data: bytes, start: int) -> bytes:
    """The line break and white space before the byte ``start``; empty if something else precedes it."""
    line = data.rfind(b"\n", 0, start)
    if line < 0 or data[line:start].strip():
        return b""
    return data[line - data[:line].endswith(b"\r") : start]


def _reason_to_leave(link: Link, diagnosis: LinkDiagnosis, places: dict[int, tuple[int, int]], everything: bool) -> str:
    """Why the inertial of a link that isn't uniform is not rewritten; "" if it is."""
    if diagnosis.status == NOT_UNIFORM and not everything:
        return "it is possible for its shapes; --all replaces it by that of the uniform solid"
    if diagnosis.status == NOT_JUDGED and not everything:
        return "its shapes are primitives only, which often stand in for others; --all replaces it by that of theirs"
    if link.problem or diagnosis.expected is None or diagnosis.status == UNKNOWN:
        return diagnosis.note or "its mass isn't a positive number"
    if link.element is None or id(link.element) not in places:
        return "it is in another file, or its body has no name"
    others = [part.tag for part in link.element.iter() if part.tag not in (*_REPLACED, "inertial")]
    return f"its <inertial> has a <{others[0]}>, which would be lost" if others else ""


def _make_missing(link: Link, meshes: Meshes, density: float) -> tuple[MassProperties | None, str]:
    """The inertial for a link without one, or None and the reason."""
    if link.owner is None:
        return None, f"{link.problem}; MuJoCo computes it from its geoms"
    try:
        return missing_inertial(link, meshes, density), ""
    except InputError as error:
        return None, f"{link.problem}; {error}"


@np.errstate(all="ignore")
def fix_robot(
    path: Path,
    *,
    folders: tuple[Path, ...] = (),
    accept_open: float = 0.0,
    everything: bool = False,
    density: float = 0.0,
) -> tuple[bytes, list[FixedLink]]:
    """Rewrite every wrong inertial from the link's shapes. Returns the file's new bytes, and the result for each link.
    everything: rewrite also those that are possible but not uniform. density > 0 [kg/m³]: links without an inertial get
    that of their shapes.

    The mass stays; COM and tensor become those of a uniform solid. Raises InputError for a file that can't be read, is
    xacro, or isn't ASCII-compatible.
    """
    data = read_bounded(path, MAX_BYTES, "fix", "a URDF, SDF or MJCF file")
    root = parse_xml(data, path)
    if b"\0" in data:
        raise InputError("fix", path.name, "a file in UTF-8 or another ASCII-compatible encoding")
    # Before robot_of, which puts elements of included files into the tree.
    places = _places(root, "inertial", _INERTIAL, data, path)
    owners = _places(root, "link", _LINK, data, path) if density else {}
    links = robot_of(root, path).links
    meshes = Meshes(Search(path.parent, folders), accept_open)
    write = _WRITERS[str(root.tag)]
    fixed: list[FixedLink] = []
    changes: list[tuple[int, int, bytes]] = []
    for link in links:
        diagnosis = diagnose(link, meshes)
        if density and link.problem == NO_INERTIAL:
            made, reason = _make_missing(link, meshes, density)
            if made is not None:
                start = owners[id(link.owner)][1]
                blank = data[start : len(data) - len(data[start:].lstrip())]  # before the link's first element
                text = write(made).rstrip().encode().replace(b"\n", _indent(blank + b"<", len(blank)))
                changes.append((start, start, blank + text))
            fixed.append(FixedLink(diagnosis, made is not None, reason))
            continue
        right = diagnosis.status in (UNIFORM, FRAME)
        reason = "" if right else _reason_to_leave(link, diagnosis, places, everything)
        is_written = not right and not reason and diagnosis.expected is not None
        if is_written and diagnosis.expected is not None:
            start, end = places[id(link.element)]
            text = write(diagnosis.expected).rstrip().encode().replace(b"\n", _indent(data, start))
            changes.append((start, end, text))
        fixed.append(FixedLink(diagnosis, is_written, reason))
    for start, end, text in sorted(changes, reverse=True):
        data = data[:start] + text + data[end:]
    return data, fixed


def _places(root: Element, tag: str, pattern: re.Pattern[bytes], data: bytes, path: Path) -> dict[int, tuple[int, int]]:
    """Start and end in the file's bytes of each element with a tag, by the element's id, as ``pattern`` finds them."""
    found = [match.span() for match in pattern.finditer(data) if match[tag]]
    elements = list(root.iter(tag))
    if len(found) != len(elements):
        raise InputError("fix", path.name, f"a file whose <{tag}> elements are none within another")
    return {id(element): place for element, place in zip(elements, found, strict=True)}
