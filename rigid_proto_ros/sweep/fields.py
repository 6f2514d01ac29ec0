# SPDX-License-Identifier: MIT
"""Pieces of a study file, checked: each refusal names the field, what stands there and what would be accepted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from ..base.errors import InputError, one_of


def number(value: Any, field: str, lower: float = -1e100, upper: float = 1e100, above: float = -math.inf) -> float:
    """A finite number within bounds; text that reads as one counts, as YAML has 1e-3 for text."""
    if isinstance(value, str):
        try:
            value = float(value)
        except ValueError:
            pass
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not (lower <= value <= upper and value > above)
    ):
        low = f"above {above:g}" if above > -math.inf else f"from {lower:g}"
        raise InputError(field, value, f"a finite number {low} to {upper:g}")
    return float(value)


def whole(value: Any, field: str, lower: int, upper: int) -> int:
    """A whole number within bounds."""
    x = number(value, field, lower, upper)
    if x != int(x):
        raise InputError(field, value, f"a whole number from {lower} to {upper}")
    return int(value) if isinstance(value, int) else int(x)


def mapping(value: Any, field: str, known: Iterable[str], required: Iterable[str] = ()) -> dict[str, Any]:
    """A mapping with known keys alone; an unknown one is answered with the nearest."""
    known = tuple(known)
    if not isinstance(value, Mapping):
        raise InputError(field, value, f"a mapping with the keys {', '.join(known)}")
    for key in value:
        known_name(str(key), field, known)
    for key in required:
        if key not in value:
            raise InputError(f"{field}, {key}", None, f"the key {key}")
    return dict(value)


def known_name(name: str, field: str, known: Iterable[str]) -> str:
    """One of the known names, or a refusal that says which is nearest."""
    known = tuple(known)
    if name not in known:
        raise InputError(field, name, one_of(name, known))
    return name


def names(value: Any, field: str, known: Iterable[str]) -> list[str]:
    """One known name or a list of them."""
    listed = [value] if isinstance(value, str) else value
    if not isinstance(listed, list) or not listed or not all(isinstance(name, str) for name in listed):
        raise InputError(field, value, f"a list of {', '.join(known)}")
    return [known_name(name, field, known) for name in listed]
