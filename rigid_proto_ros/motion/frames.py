# SPDX-License-Identifier: MIT
"""The frame of a wrench: the axes of its components, and its point of application on the body.

A frame is written ``axes@point[;duration=<s>|;impulse][;slot=<name>]``; README and docs list the forms. This module
only parses the text; motion/loads.py resolves the point on the body.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from ..base.errors import CommandRefused, did_you_mean
from ..base.vectors import Vector, vector

AXES = ("world", "body", "normal")
FIXED_POINTS = ("com", "origin")
POINT_FORMS = "com, origin, vertex/<i>, a contact's name, point/<x>,<y>,<z>, ray/<ox>,<oy>,<oz>/<dx>,<dy>,<dz>"
CONTACT_NAME = re.compile(r"[a-z][a-z0-9_]*\Z")
RESERVED_WORDS = frozenset({*AXES, *FIXED_POINTS, "vertex", "point", "ray", "mesh", "duration", "impulse"})

MAX_FRAME_LENGTH = 1024
"""Characters; the longest sensible frame, a ray with 17 digits per number, has about 170."""

MAX_DURATION_S = 1e9
"""The end of a pulse must stay well within the 292 years that int64 nanoseconds can represent."""

SLOT_NAME = re.compile(r"[a-z][a-z0-9_]{0,11}\Z")
"""Twelve characters fit into the integer that identifies a slot in compiled flights."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z")


class Frame(NamedTuple):
    """axes: ``world``, ``body`` or ``normal``; point: a form of POINT_FORMS as a tuple, its keyword first. slot: name
    of the slot whose held wrench it replaces, empty for the unnamed one.
    """

    axes: str
    point: tuple[Any, ...]
    duration_s: float | None = None
    impulse: bool = False
    slot: str = ""

    @property
    def options(self) -> str:
        """The options after the point."""
        slot = f";slot={self.slot}" if self.slot else ""
        if self.duration_s is not None:
            return f";duration={self.duration_s!r}{slot}"
        return ";impulse" if self.impulse else slot

    @property
    def text(self) -> str:
        """The frame as text, with both axes and point."""
        return f"{self.axes}@{point_text(self.point)}{self.options}"


def point_text(point: tuple[Any, ...]) -> str:
    """Text of a point in a frame; numbers keep all their digits."""
    word, *values = point
    if word in FIXED_POINTS:
        return str(word)
    if word == "contact":
        return str(values[0])
    if word == "vertex":
        return f"vertex/{values[0]}"
    return "/".join([word, *(",".join(repr(float(x)) for x in triple) for triple in values)])


@functools.lru_cache(maxsize=1024)  # the same frames recur
def body_names(frame: str) -> tuple[str, ...]:
    """What a body frame is called in commands: ``lab/tool`` is ``tool``, too, since topics are those of one node."""
    return ("body", frame, frame.rpartition("/")[2])


def parse_frame(text: str, world: str = "world", body: str = "body") -> Frame:
    """Parse a ``frame_id``. A word that can name a contact is taken as one; whether the body has it is checked later.

    world, body: names of this node's world and body frames, accepted besides the keywords. Raises CommandRefused with
    reason ``frame``, or ``nonfinite`` for numbers that overflow.
    """
    if len(text) > MAX_FRAME_LENGTH:
        raise CommandRefused("frame", "frame_id", text[:40] + "...", f"at most {MAX_FRAME_LENGTH} characters")
    place, *options = text.split(";")
    axes_words = {"world": "world", "body": "body", "normal": "normal", world: "world"}
    axes_words |= dict.fromkeys(body_names(body), "body")
    if place == "":
        axes, point = "world", ("com",)
    elif "@" in place:
        axes_text, point_part = place.split("@", 1)
        if axes_text not in axes_words:
            raise CommandRefused("frame", "frame_id", text, f"axes {_names(axes_words)} before the @")
        axes, point = axes_words[axes_text], _parse_point(point_part, text)
    elif place in axes_words:
        axes, point = axes_words[place], ("com",)
    else:
        axes, point = "body", _parse_point(place, text, axes_words)
    if axes == "normal" and point == ("com",):
        raise CommandRefused("frame", "frame_id", text, "normal with a point of the surface, such as normal@vertex/0")
    return Frame(axes, point, *_parse_options(options, text))


def _parse_point(part: str, text: str, axes_words: Iterable[str] = ()) -> tuple[Any, ...]:
    word, *values = part.split("/")
    if part in FIXED_POINTS:
        return (part,)
    if word == "vertex" and len(values) == 1 and re.fullmatch(r"\d{1,10}", values[0], re.ASCII):
        return ("vertex", int(values[0]))
    if word == "point" and len(values) == 1:
        return ("point", _parse_triple(values[0], text))
    if word == "ray" and len(values) == 2:
        origin, direction = (_parse_triple(v, text) for v in values)
        if not any(direction):
            raise CommandRefused("frame", "frame_id", text, "a ray whose direction isn't zero")
        return ("ray", origin, direction)
    if CONTACT_NAME.match(part) and part not in RESERVED_WORDS:
        return ("contact", part)
    accepted = f"{', '.join(axes_words)}{', ' if axes_words else ''}{POINT_FORMS}"
    raise CommandRefused("frame", "frame_id", text, accepted)


def contact_point(name: str, contacts: Mapping[str, Vector]) -> Vector:
    """Position of a contact of the body in mesh coordinates; raises CommandRefused (``frame``) listing its contacts."""
    if name not in contacts:
        known = f"a contact of the body ({_names(contacts)})" if contacts else "the body has no contacts"
        accepted = "; ".join(filter(None, [f"{known}, or {POINT_FORMS}", did_you_mean(name, [*contacts, *AXES])]))
        raise CommandRefused("frame", "frame_id", name, accepted)
    return vector(contacts[name])


def _parse_triple(part: str, text: str) -> Vector:
    numbers = part.split(",")
    if len(numbers) != 3 or not all(_NUMBER.match(n) for n in numbers):
        raise CommandRefused("frame", "frame_id", text, "three decimal numbers x,y,z without blanks")
    values = vector([float(n) for n in numbers])
    if not all(math.isfinite(v) for v in values):
        raise CommandRefused("nonfinite", "frame_id", text, "three finite numbers x,y,z")
    return values


def _parse_options(options: list[str], text: str) -> tuple[float | None, bool, str]:
    duration_s, impulse, slot = None, False, ""
    for option in options:
        if option == "impulse" and not impulse:
            impulse = True
        elif option.startswith("duration=") and duration_s is None and _NUMBER.match(option[9:]):
            duration_s = float(option[9:])
            if not 1e-9 <= duration_s <= MAX_DURATION_S:
                raise CommandRefused("frame", "frame_id", text, f"a duration of 1e-9 to {MAX_DURATION_S:g} s")
        elif option.startswith("slot=") and not slot:
            slot = option[5:]
            if not SLOT_NAME.match(slot):
                raise CommandRefused("frame", "frame_id", text, "a slot's name of [a-z][a-z0-9_]*, up to 12 characters")
        else:
            accepted = "after the point only ;duration=<seconds>, ;impulse or ;slot=<name>"
            raise CommandRefused("frame", "frame_id", text, accepted)
    if impulse and (duration_s is not None or slot):
        raise CommandRefused("frame", "frame_id", text, ";impulse alone: it neither lasts nor is replaced")
    return duration_s, impulse, slot


def check_contact_name(name: str) -> None:
    """Raises CommandRefused unless ``name`` can be used as a point in a frame."""
    if not CONTACT_NAME.match(name) or name in RESERVED_WORDS:
        raise CommandRefused(
            "frame", f"contacts.{name}", name, f"[a-z][a-z0-9_]*, and none of {_names(RESERVED_WORDS)}"
        )


def _names(words: Iterable[str]) -> str:
    return ", ".join(sorted(words))
