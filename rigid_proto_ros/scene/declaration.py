# SPDX-License-Identifier: MIT
"""What is declared of a parameter, and the fields of a dataclass that declare one: ``mass: float =
number(0.0, "Mass.", "kg")``.
"""

from __future__ import annotations

import dataclasses
import math
import re
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import InputError, did_you_mean

LIVE, AT_RESET, READ_ONLY = "live", "at the next reset", "read-only"

HUGE = 1e100
"""Bound of positions, speeds and forces: squares stay finite."""

Value = bool | int | float | str | list[float]
"""A parameter's value as files and ROS have it."""

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z")


@dataclass(frozen=True)
class Parameter:
    """type: ``double``, ``doubles``, ``integer``, ``bool`` or ``string``, one of the ``choices``. lower
    and upper are inclusive unless ``above``: then values must lie above lower. lengths: accepted
    lengths of ``doubles``. changes: LIVE, AT_RESET or READ_ONLY. default: None where the name is the user's choice.
    """

    name: str
    type: str
    default: Value | None
    description: str
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    above: bool = False
    lengths: tuple[int, ...] = ()
    choices: tuple[str, ...] = ()
    changes: str = LIVE

    @property
    def accepted(self) -> str:
        """What the parameter accepts, in words."""
        if self.choices:
            return ", ".join(repr(c) if c == "" else c for c in self.choices)
        if self.type == "bool":
            return "true or false"
        if self.type == "string":
            return "text"
        words = {"double": "a finite number", "integer": "a whole number"}.get(self.type)
        if words is None:
            words = f"{' or '.join(str(n) for n in self.lengths)} finite numbers"
        if self.lower > -math.inf:
            words += f" {'>' if self.above else '>='} {self.lower:g}"
        if self.upper < math.inf:
            words += f"{' and' if self.lower > -math.inf else ''} <= {self.upper:g}"
        return f"{words} [{self.unit}]" if self.unit else words

    def convert(self, value: object) -> Value:
        """The value in the parameter's own type, checked; raises InputError.

        Numbers are numbers: whole numbers and text that reads as a number, or as a list of numbers, are converted.
        """
        converted = _CONVERSIONS[self.type](value)
        if converted is None or not self._within_bounds(converted):
            hint = did_you_mean(str(value), filter(None, self.choices))
            raise InputError(self.name, _shown(value), "; ".join(filter(None, [self.accepted, hint])))
        return converted

    def _within_bounds(self, value: Value) -> bool:
        if isinstance(value, bool):
            return True
        if isinstance(value, str):
            return not self.choices or value in self.choices
        numbers = value if isinstance(value, list) else [value]
        if self.lengths and len(numbers) not in self.lengths:
            return False
        above = all(n > self.lower if self.above else n >= self.lower for n in numbers)
        return above and all(math.isfinite(n) and n <= self.upper for n in numbers)


def _to_double(value: object) -> float | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, (int, float)):
        try:
            return float(value)
        except OverflowError:
            return None
    if isinstance(value, str) and _NUMBER.match(value.strip()):
        return float(value)
    return None


def _to_doubles(value: object) -> list[float] | None:
    if isinstance(value, str):
        text = value.strip()
        if text.startswith("[") and text.endswith("]"):
            value = [item.strip(" '\"") for item in text[1:-1].split(",")]
        elif len(items := text.replace(",", " ").split()) > 1:
            value = items
    alone = _to_double(value)
    if alone is not None:
        return [alone]
    if not isinstance(value, (list, tuple, array, np.ndarray)):
        return None
    numbers = []
    for item in value:
        number = _to_double(item)
        if number is None:
            return None
        numbers.append(number)
    return numbers


def _to_integer(value: object) -> int | None:
    number = _to_double(value)
    return int(number) if number is not None and math.isfinite(number) and number == int(number) else None


_CONVERSIONS: dict[str, Callable[[object], Value | None]] = {
    "double": _to_double,
    "doubles": _to_doubles,
    "integer": _to_integer,
    "bool": lambda value: value if isinstance(value, bool) else None,
    "string": lambda value: value if isinstance(value, str) else None,
}


def _shown(value: object) -> object:
    if isinstance(value, array):
        value = value.tolist()
    text = repr(value)
    return value if len(text) <= 80 else text[:77] + "..."


# Fields that declare a parameter; the name comes from the dataclass (``declared``)


def number(
    default: float,
    description: str,
    unit: str = "",
    *,
    lower: float,
    upper: float,
    above: bool = False,
    changes: str = LIVE,
) -> Any:
    """A double."""
    return _field(
        default, Parameter("", "double", default, description, unit, lower, upper, above=above, changes=changes)
    )


def numbers(
    default: tuple[float, ...],
    description: str,
    unit: str = "",
    *,
    lower: float = -HUGE,
    upper: float = HUGE,
    lengths: tuple[int, ...] = (),
    changes: str = LIVE,
) -> Any:
    """Doubles, as many as the default has unless ``lengths`` says otherwise."""
    lengths = lengths or (len(default),)
    declaration = Parameter(
        "", "doubles", list(default), description, unit, lower, upper, lengths=lengths, changes=changes
    )
    return _field(default, declaration)


def switch(default: bool, description: str, *, changes: str = LIVE) -> Any:
    """True or false."""
    return _field(default, Parameter("", "bool", default, description, changes=changes))


def text(default: str, description: str, *, choices: tuple[str, ...] = (), changes: str = LIVE) -> Any:
    """Text, free or one of the choices."""
    return _field(default, Parameter("", "string", default, description, choices=choices, changes=changes))


def whole(default: int, description: str, unit: str = "", *, lower: int, upper: int) -> Any:
    """A whole number."""
    return _field(default, Parameter("", "integer", default, description, unit, lower, upper))


def port(default: int, description: str) -> Any:
    """A port of this machine, set at start."""
    return _field(default, Parameter("", "integer", default, description, "", 1, 65535, changes=READ_ONLY))


def _field(default: object, declaration: Parameter) -> Any:
    return dataclasses.field(default=default, metadata={"declaration": declaration})


def declared(group: Any, prefix: str = "") -> dict[str, Parameter]:
    """The parameters that a dataclass instance declares, by dotted name: those of an inner dataclass
    below its field's name.
    """
    found: dict[str, Parameter] = {}
    for field in dataclasses.fields(group):
        name = f"{prefix}{field.name}"
        value = getattr(group, field.name)
        if "declaration" in field.metadata:
            found[name] = dataclasses.replace(field.metadata["declaration"], name=name)
        elif dataclasses.is_dataclass(value):
            found |= declared(value, f"{name}.")
    return found
