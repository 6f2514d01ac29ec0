# SPDX-License-Identifier: MIT
"""What the page needs of Python's declarations, as one file: parameters, words, integrators, bodies and scenes.

The file: the length of the JSON text as 4 bytes, the text, then the numbers of meshes, which it tells the places of.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..base.bundled import body_names, scene_path
from ..base.library import stamp
from ..base.vectors import FloatArray, IntArray
from ..mass import INERTIA_MODELS
from ..mass.engines import FORMS, SAYS_NO_PRODUCTS, Form
from ..mass.moments import STRETCHED
from ..mesh.reading import Mesh, load_mesh
from ..motion.integrators import INTEGRATORS
from ..motion.integrators.stepping import ROOM
from ..motion.loads import NEEDS
from ..parameters.declarations import PARAMETERS, PATTERNS, Parameter
from ..scene.lessons import Lesson, lessons
from ..scene.scene_file import scene_values
from ..simulation.record import SCENE_PARAMETERS, field_of
from .words import words

USED = (*SCENE_PARAMETERS, "mesh", "ghost.inertia_model", "ghost.integrator")
"""Parameters that a page has beside ballast and contacts; a scene's others don't change a motion without ROS."""

HAND: dict[str, Any] = {"string.frequency": 8.0, "string.damping_ratio": 0.3, "string.timeout": 0.0}
"""The string of a hand where a scene ties none from its start: bodies of all masses follow alike, 8 rad/s is brisk for
a nut and a satellite, and a hand that holds still holds on.
"""

LONGEST = 10.0
"""Longest side of a mesh [mesh units] above which its unit is taken for a millimetre: few hold what is 10 m long."""

START = "t_handle"
"""Scene of a page that is opened without one."""

_MOST_DIGITS = 15
_LEAST, _LARGEST = -(2**31), 2**31 - 1


def page_data() -> bytes:
    """The whole file."""
    blob = bytearray()
    bodies = {name: _packed(load_mesh(name), blob) for name in body_names()}
    described = {
        "version": page_version(),
        "parameters": [_declared(one) for one in _declarations()],
        "fields": {name: field_of(name) for name in SCENE_PARAMETERS},
        "models": INERTIA_MODELS,
        "stretched": [INERTIA_MODELS.index(model) for model in STRETCHED],
        "integrators": [
            {"name": name, "supports": _supported(name), "order": one.order} for name, one in INTEGRATORS.items()
        ],
        "room": ROOM,
        "words": words(),
        "bodies": bodies,
        "scenes": {one.name: {"title": one.title, "values": bundled_values(one.name)} for one in lessons()},
        "lessons": {one.name: _texts(one) for one in lessons()},
        "forms": {name: _form(form) for name, form in FORMS.items()},
        "start": START,
        "longest": LONGEST,
    }
    text = json.dumps(described, ensure_ascii=False, separators=(",", ":")).encode()
    return struct.pack("<I", len(text)) + text + bytes(blob)


def page_version() -> str:
    """What a page says of itself and of what it makes: pages of one version have the same kernels, so the same bits."""
    from .. import __version__

    return f"{__version__}+{stamp().partition('-')[2][:7]}"


def is_of_page(name: str) -> bool:
    """Whether the page has this parameter."""
    return name in USED or name.startswith(("ballast.", "contacts."))


def page_values(values: dict[str, Any], with_hand: bool = True) -> dict[str, Any]:
    """A scene's parameters as the page has them, with the string of a hand."""
    used = {name: value for name, value in values.items() if is_of_page(name)}
    tied = used.get("string.attached", False)
    given = any(name in used for name in ("string.frequency", "string.timeout"))
    return used if tied or given or not with_hand else {**used, **HAND}


def bundled_values(name: str) -> dict[str, Any]:
    """The parameters of a bundled scene, as the page has them."""
    return page_values(scene_values(scene_path(name)))


def _texts(one: Lesson) -> dict[str, Any]:
    """A lesson, as page/src/lessons.ts reads it."""
    return {
        "title": one.title,
        "question": one.question,
        "choices": one.choices,
        "answer": one.answer,
        "steps": one.sentences,
        "reason": one.reason,
    }


def _form(form: Form) -> dict[str, Any]:
    """What an engine takes, as page/src/forms.ts reads it."""
    return {
        "engine": form.engine,
        "text": form.lines,
        "products": form.products,
        "mirrored": form.mirrored,
        "perM": form.per_m,
        "saysNone": SAYS_NO_PRODUCTS,
    }


def _declarations() -> Iterable[Parameter]:
    yield from (PARAMETERS[name] for name in USED)
    yield from (PATTERNS["ballast."], PATTERNS["contacts."])


def _declared(one: Parameter) -> dict[str, Any]:
    return {
        "name": one.name,
        "type": one.type,
        "default": one.default,
        "description": one.description,
        "unit": one.unit,
        "lower": one.lower if math.isfinite(one.lower) else None,
        "upper": one.upper if math.isfinite(one.upper) else None,
        "above": one.above,
        "lengths": one.lengths,
        "choices": one.choices,
        "changes": one.changes,
        "accepted": one.accepted,
    }


def _supported(name: str) -> list[int]:
    """Numbers of the needs (motion/loads.py, NEEDS) that an integrator meets."""
    return [k for k, need in enumerate(NEEDS) if need in INTEGRATORS[name].supports]


# Meshes, packed: a bundled one has a few decimals, and neighbours are near each other.


def _packed(mesh: Mesh, blob: bytearray) -> dict[str, Any]:
    """Append vertices and triangles as whole numbers; returns what tells them. Vertices are these over 10^digits, each
    the nearest double. Raises ValueError for a mesh that isn't of short decimals, or has polygons.
    """
    whole, digits = _as_integers(mesh.vertices)
    if mesh.polygon_starts is not None:
        raise ValueError(f"{mesh.name} has polygons, not only triangles")
    at = len(blob)
    blob += _planes(whole)
    blob += _planes(mesh.triangles)
    return {"at": at, "vertices": len(mesh.vertices), "triangles": len(mesh.triangles), "digits": digits}


def _as_integers(vertices: FloatArray) -> tuple[IntArray, int]:
    for digits in range(_MOST_DIGITS):
        whole = np.rint(vertices * 10.0**digits)
        if (whole / 10.0**digits == vertices).all() and (np.abs(whole) < _LARGEST / 2).all():
            if np.signbit(vertices[vertices == 0.0]).any():
                break
            return whole.astype(np.int64), digits
    raise ValueError("vertices that are no decimals of a few digits")


def _planes(rows: IntArray) -> bytes:
    """Differences of successive rows (n, 3), column after column, their signs last, as four planes of bytes."""
    steps = np.diff(rows, axis=0, prepend=0).T.ravel()
    if not ((steps > _LEAST // 2) & (steps < _LARGEST // 2)).all():
        raise ValueError("numbers too far from each other")
    return ((steps << 1) ^ (steps >> 63)).astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()
