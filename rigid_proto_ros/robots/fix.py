# SPDX-License-Identifier: MIT
"""Inertials of a robot file rewritten in its own bytes: values of an <inertial> change, everything around it stays.

Where an attribute or element is missing it is added; comments and order inside the <inertial> stay as well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np

from ..base.errors import InputError
from ..base.files import read_bounded
from ..mass.export import is_flat, quaternion_wxyz
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes, six_from_tensor
from .diagnosis import NOT_UNIFORM, UNIFORM, UNKNOWN, Doctor, LinkDiagnosis, Options
from .model import MAX_BYTES, Link, parse_xml
from .reading import robot_of

_SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=]+)\s*=\s*("[^"]*"|'[^']*')""")


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
    """An element's place in the file: bytes start to end, its start tag to tag_end, its content to content_end."""

    tag: str
    start: int
    tag_end: int
    content_end: int
    end: int


_TAG = re.compile(rb"""<(?:"[^"]*"|'[^']*'|[^"'>])*>""")  # a > between quotes ends none
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def _tag_end(data: bytes, start: int) -> int:
    """The byte after the tag that begins at ``start``."""
    found = _TAG.match(data, start)
    if found is None:  # expat has read one there
        raise ValueError(f"no tag at byte {start}")
    return found.end()


def _spans(data: bytes) -> list[_Span]:
    """The elements of a document, or of an element cut out of one, in the order in which they begin."""
    found: dict[int, _Span] = {}
    open_ones: list[int] = []
    skipped = len(_BYTE_ORDER_MARK) if data.startswith(_BYTE_ORDER_MARK) else 0
    parser = expat.ParserCreate("iso-8859-1")  # in which every byte is a character: names and signs are in ASCII

    def begin(_tag: str, _attributes: dict[str, str]) -> None:
        open_ones.append(skipped + parser.CurrentByteIndex)
        found[open_ones[-1]] = _Span("", 0, 0, 0, 0)  # keeps the place in the order

    def finish(tag: str) -> None:
        start = open_ones.pop()
        content_end = end = tag_end = _tag_end(data, start)
        if not data[start:tag_end].endswith(b"/>"):
            content_end = skipped + parser.CurrentByteIndex
            end = _tag_end(data, content_end)
        found[start] = _Span(tag, start, tag_end, content_end, end)

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.Parse(data[skipped:], True)
    return list(found.values())


class _Edited:
    """The bytes of one element while values in it are changed; ``indent``: the line break and white space before it."""

    def __init__(self, data: bytes, indent: bytes) -> None:
        self.data = data
        self.indent = indent

    def _find(self, *path: str) -> _Span | None:
        """The element at a path of tags below the outermost one."""
        inside = _spans(self.data)
        span: _Span | None = inside[0]
        for tag in path:
            outer = span
            span = next((s for s in inside if outer and s.tag == tag and outer.start < s.start < outer.end), None)
        return span

    def _replace(self, start: int, end: int, text: bytes) -> None:
        self.data = self.data[:start] + text + self.data[end:]

    def _opened(self, *path: str) -> _Span:
        """The element at ``path``, made where it isn't there, written as two tags."""
        span = self.made(*path)
        if span.tag_end == span.end:
            tag = self.data[span.start : span.tag_end].removesuffix(b"/>").rstrip()
            self._replace(span.start, span.end, tag + b"></" + span.tag.encode() + b">")
        return self.made(*path)

    def made(self, *path: str) -> _Span:
        """The element at ``path``; where it isn't there it becomes its parent's last child."""
        span = self._find(*path)
        if span is not None:
            return span
        parent = self._opened(*path[:-1])
        content = self.data[parent.tag_end : parent.content_end]
        at = parent.tag_end + len(content.rstrip())
        lead = self.indent and self.indent + b"  " * len(path)
        tail = b"" if content else self.indent and self.indent + b"  " * (len(path) - 1)
        self._replace(at, at, lead + b"<" + path[-1].encode() + b"/>" + tail)
        return self.made(*path)

    def set_text(self, text: str, *path: str) -> None:
        """Make ``text`` the content of the element at ``path``."""
        span = self._opened(*path)
        old = self.data[span.tag_end : span.content_end]
        start, end = span.tag_end, span.content_end
        if old.strip() and b"<" not in old:  # white space around the old text stays
            start, end = start + len(old) - len(old.lstrip()), start + len(old.rstrip())
        self._replace(start, end, text.encode())

    def set_attribute(self, name: str, text: str, *path: str) -> None:
        """Give the element at ``path`` an attribute."""
        span = self.made(*path)
        place = span.start + len(span.tag) + 1
        for found in self._attributes(span):
            place = found.end()
            if found.group(1) == name.encode():
                self._replace(found.start(2) + 1, found.end(2) - 1, text.encode())
                return
        self._replace(place, place, f' {name}="{text}"'.encode())

    def drop_attribute(self, name: str) -> None:
        """Take an attribute away from the outermost element."""
        for found in self._attributes(self.made()):
            if found.group(1) == name.encode():
                self._replace(found.start(), found.end(), b"")
                return

    def _attributes(self, span: _Span) -> list[re.Match[bytes]]:
        found, place = [], span.start + len(span.tag) + 1
        while (attribute := _ATTRIBUTE.match(self.data, place)) is not None:
            found.append(attribute)
            place = attribute.end()
        return found


def _number(value: float) -> str:
    """The shortest digits that give the number back."""
    return repr(float(value) + 0.0).removesuffix(".0")


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(_number, values))


def _write_urdf(inertial: _Edited, element: Element, properties: MassProperties, mass_changes: bool) -> None:
    inertial.set_attribute("xyz", _numbers(properties.center_of_mass), "origin")
    if any(word.strip("+-0.") for word in (getattr(element.find("origin"), "attrib", {}).get("rpy", "")).split()):
        inertial.set_attribute("rpy", "0 0 0", "origin")
    if mass_changes:
        inertial.set_attribute("value", _number(properties.mass), "mass")
    for name, value in zip(_SIX, six_from_tensor(properties.inertia), strict=True):
        inertial.set_attribute(name, _number(value), "inertia")


def _write_sdf(inertial: _Edited, _element: Element, properties: MassProperties, mass_changes: bool) -> None:
    inertial.set_text(f"{_numbers(properties.center_of_mass)} 0 0 0", "pose")
    if mass_changes:
        inertial.set_text(_number(properties.mass), "mass")
    for name, value in zip(_SIX, six_from_tensor(properties.inertia), strict=True):
        inertial.set_text(_number(value), "inertia", name)


def _write_mjcf(inertial: _Edited, element: Element, properties: MassProperties, mass_changes: bool) -> None:
    """In the form that the element has: ``fullinertia``, or ``diaginertia`` with the principal axes as ``quat``."""
    inertial.set_attribute("pos", _numbers(properties.center_of_mass))
    if mass_changes:
        inertial.set_attribute("mass", _number(properties.mass))
    (a, b, c), axes = principal_axes(properties.inertia)
    if element.get("fullinertia") and not is_flat(a, b, c):
        xx, xy, xz, yy, yz, zz = six_from_tensor(properties.inertia)
        inertial.set_attribute("fullinertia", _numbers((xx, yy, zz, xy, xz, yz)))
        return
    for name in ("fullinertia", "axisangle", "xyaxes", "zaxis", "euler"):
        inertial.drop_attribute(name)
    inertial.set_attribute("quat", _numbers(quaternion_wxyz(axes)))
    inertial.set_attribute("diaginertia", _numbers((a, b, min(c, a + b))))


_Writer = Callable[[_Edited, Element, MassProperties, bool], None]
_WRITERS: dict[str, _Writer] = {"robot": _write_urdf, "sdf": _write_sdf, "mujoco": _write_mjcf}


def _indent(data: bytes, start: int) -> bytes:
    """The line break and white space before the byte ``start``, empty where something else stands before it."""
    line = data.rfind(b"\n", 0, start)
    if line < 0 or data[line:start].strip():
        return b""
    return data[line - data[:line].endswith(b"\r") : start]


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
    frame = link.element.find("pose")
    if link.element.tag == "inertial" and frame is not None and frame.get("relative_to", "") not in ("", link.name):
        return f"its <pose> is relative to {frame.get('relative_to')!r}"
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
    spans = [span for span in _spans(data) if span.tag in ("inertial", "link")]
    # Included files are put into the tree by reading it.
    elements = [element for element in root.iter() if element.tag in ("inertial", "link")]
    places = {id(element): span for element, span in zip(elements, spans, strict=True)}
    doctor = Doctor(path, robot_of(root, path).links, options)
    if link is not None:
        doctor.require(link)
    written: dict[int, tuple[_Span, bytes]] = {}
    diagnosed = doctor.diagnoses(link)
    reasons = []
    for known, diagnosis in diagnosed:
        if diagnosis.status == UNIFORM or (diagnosis.status == UNKNOWN and not known.problem):
            reasons.append(diagnosis.note if diagnosis.status == UNKNOWN else "")
            continue
        reasons.append(_reason_to_leave(known, diagnosis, doctor.options, places, everything))
        if not reasons[-1] and known.element is not None and diagnosis.expected is not None:
            span = places[id(known.element)]
            text = _rewritten(data, span, known, diagnosis.expected, _WRITERS[str(root.tag)])
            written[id(known.element)] = span, text
    for span, text in sorted(written.values(), key=lambda item: -item[0].start):
        data = data[: span.start] + text + data[span.end :]
    again = Doctor(path, robot_of(parse_xml(data, path), path).links, options, doctor.meshes)
    after = again.diagnoses(link)
    links = []
    for (known, before), (_, now), left in zip(diagnosed, after, reasons, strict=True):
        links.append(FixedLink(before, now if id(known.element) in written else before, left))
    return data, links


def _rewritten(data: bytes, span: _Span, link: Link, properties: MassProperties, write: _Writer) -> bytes:
    """The element's bytes with the values of ``properties``; of a link without an inertial, with one added."""
    if span.tag == "inertial" and link.element is not None:
        inertial = _Edited(data[span.start : span.end], _indent(data, span.start))
        changes = not math.isclose(properties.mass, link.mass, rel_tol=1e-15)
        write(inertial, link.element, properties, changes)
        return inertial.data
    whole = _Edited(data[span.start : span.end], _indent(data, span.start))
    place = whole.made("inertial")
    inertial = _Edited(whole.data[place.start : place.end], whole.indent and whole.indent + b"  ")
    write(inertial, Element("inertial"), properties, True)
    return whole.data[: place.start] + inertial.data + whole.data[place.end :]
