# SPDX-License-Identifier: MIT
"""Inertials of a robot file rewritten in its own bytes: each <inertial> is replaced, everything around it stays."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from ..base.errors import InputError
from ..base.files import read_bounded
from ..mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from .diagnosis import NOT_UNIFORM, UNIFORM, UNKNOWN, Doctor, LinkDiagnosis, Options
from .model import MAX_BYTES, Link, parse_xml
from .reading import robot_of

_WRITERS = {"robot": urdf_inertial, "sdf": sdf_inertial, "mujoco": mjcf_inertial}
_REPLACED = {"origin", "pose", "mass", "inertia", *("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
"""Elements of an <inertial> that the new one has, or needs no more."""
_TAG = re.compile(rb"""<(?:"[^"]*"|'[^']*'|[^"'>])*>""")  # a > between quotes ends none
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True)
class FixedLink:
    """One link before and after; ``left``: why nothing was written though it isn't uniform, else ""."""

    before: LinkDiagnosis
    after: LinkDiagnosis
    left: str = ""

    @property
    def written(self) -> bool:
        """Whether the link's inertial was rewritten."""
        return self.before is not self.after


@dataclass(frozen=True)
class _Span:
    """An element's place in the file: bytes start to end, its content up to content_end."""

    tag: str
    start: int
    content_end: int
    end: int


def _tag_end(data: bytes, start: int) -> int:
    """The byte after the tag that begins at ``start``."""
    found = _TAG.match(data, start)
    if found is None:  # expat has read one there
        raise ValueError(f"no tag at byte {start}")
    return found.end()


def _spans(data: bytes) -> list[_Span]:
    """The <inertial> and <link> elements in the order in which they begin."""
    found: dict[int, _Span] = {}
    open_ones: list[int] = []
    skipped = len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    parser = expat.ParserCreate("iso-8859-1")  # in which every byte is a character: names and signs are in ASCII

    def begin(_tag: str, _attributes: dict[str, str]) -> None:
        open_ones.append(skipped + parser.CurrentByteIndex)

    def finish(tag: str) -> None:
        start = open_ones.pop()
        content_end = end = _tag_end(data, start)
        if not data[start:end].endswith(b"/>"):
            content_end = skipped + parser.CurrentByteIndex
            end = _tag_end(data, content_end)
        if tag in ("inertial", "link"):
            found[start] = _Span(tag, start, content_end, end)

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.Parse(data[skipped:], True)
    return [found[start] for start in sorted(found)]


def _indent(data: bytes, start: int) -> bytes:
    """The line break and white space before the byte ``start``, empty where something else stands before it."""
    line = data.rfind(b"\n", 0, start)
    if line < 0 or data[line:start].strip():
        return b""
    return data[line - data[:line].endswith(b"\r") : start]


def _rewritten(data: bytes, span: _Span, inertial: str) -> bytes:
    """The file with a new inertial in the place of the old one, or as the last child of a link without one."""
    indent = _indent(data, span.start)
    if span.tag == "inertial":
        return data[: span.start] + inertial.rstrip().encode().replace(b"\n", indent) + data[span.end :]
    at = len(data[: span.content_end].rstrip())
    lead = indent and indent + b"  "
    return data[:at] + lead + inertial.rstrip().encode().replace(b"\n", lead) + data[at:]


def _reason_to_leave(link: Link, diagnosis: LinkDiagnosis, options: Options, places: dict, everything: bool) -> str:
    """Why a link that isn't uniform can't, or shan't, be written; "" when it can."""
    if diagnosis.status == NOT_UNIFORM and not everything:
        return "a body of its shapes can have it; --all makes it uniform"
    if link.problem and not options.mass_of(diagnosis.volume):
        return f"{diagnosis.note}; --mass M or --density D writes one"
    if diagnosis.expected is None:
        if diagnosis.volume:
            return "its mass isn't a positive number; --mass M or --density D says what it is"
        return diagnosis.note
    if link.element is None or id(link.element) not in places:
        return "it stands in another file, or its body has no name"
    if link.element.tag == "inertial":
        frame = link.element.find("pose")
        if frame is not None and frame.get("relative_to", "") not in ("", link.name):
            return f"its <pose> is relative to {frame.get('relative_to')!r}"
        others = [part.tag for part in link.element.iter() if part.tag not in (*_REPLACED, "inertial")]
        if others:
            return f"its <inertial> has a <{others[0]}>, which would be lost"
    return ""


@np.errstate(all="ignore")
def fix_robot(
    path: Path, options: Options, *, link: str | None = None, everything: bool = False
) -> tuple[bytes, list[FixedLink]]:
    """The file's bytes with every wrong inertial (or that of ``link`` alone) rewritten from the link's shapes, and what
    became of each link; ``everything``: those that are possible, but not uniform, as well.

    The mass stays unless the options say another one; COM and tensor become those of a solid of one density. Raises
    InputError for a file that can't be read, is xacro, or isn't written in ASCII's bytes.
    """
    data = read_bounded(path, MAX_BYTES, "fix", "a URDF, SDF or MJCF file")
    root = parse_xml(data, path)
    if b"\0" in data:
        raise InputError("fix", path.name, "a file in UTF-8 or another ASCII-compatible encoding")
    # Included files are put into the tree by reading it.
    elements = [element for element in root.iter() if element.tag in ("inertial", "link")]
    places = {id(element): span for element, span in zip(elements, _spans(data), strict=True)}
    doctor = Doctor(path, robot_of(root, path).links, options)
    if link is not None:
        doctor.require(link)
    write = _WRITERS[str(root.tag)]
    written: dict[int, tuple[_Span, str]] = {}
    diagnosed = doctor.diagnoses(link)
    reasons = []
    for known, diagnosis in diagnosed:
        if diagnosis.status == UNIFORM or (diagnosis.status == UNKNOWN and not known.problem):
            reasons.append(diagnosis.note if diagnosis.status == UNKNOWN else "")
            continue
        reasons.append(_reason_to_leave(known, diagnosis, options, places, everything))
        if not reasons[-1] and known.element is not None and diagnosis.expected is not None:
            written[id(known.element)] = places[id(known.element)], write(diagnosis.expected)
    for span, inertial in sorted(written.values(), key=lambda item: -item[0].start):
        data = _rewritten(data, span, inertial)
    again = Doctor(path, robot_of(parse_xml(data, path), path).links, options, doctor.meshes)
    links = []
    for (known, before), (_, now), left in zip(diagnosed, again.diagnoses(link), reasons, strict=True):
        links.append(FixedLink(before, now if id(known.element) in written else before, left))
    return data, links
