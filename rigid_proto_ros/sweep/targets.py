# SPDX-License-Identifier: MIT
"""Targets: what a study can vary. A target is a parameter, a component of one, or a field of a poke script entry.

``mass``, ``initial.angular_velocity.x``, ``explicit_inertia.tensor.izz``, ``ballast.tip.mass``; ``script.1.force.z``,
``script.2.at.vertex``, ``script.1.wrench.duration``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, MutableMapping
from dataclasses import dataclass
from typing import Any

from ..base.errors import InputError, one_of
from ..parameters.declarations import READ_ONLY, Parameter, Value, parameter_named
from ..scene.script import ENTRY_KEYS

_COMPONENTS = {3: "x y z", 4: "x y z w", 6: "ixx ixy ixz iyy iyz izz"}
_BALLAST = "mass x y z"
_SCRIPT_FIELDS = sorted(ENTRY_KEYS)


@dataclass(frozen=True)
class Target:
    """name: as the study writes it. For a parameter, ``parameter`` is its name and ``path`` its component (k,) or ().
    For the script, ``entry`` is the entry's number, from 1, and ``path`` the keys of the field.
    """

    name: str
    parameter: str = ""
    entry: int = 0
    path: tuple[Any, ...] = ()

    def put(self, values: MutableMapping[str, Value], entries: list[Any], value: Any) -> None:
        """Set the varied value in the parameters (a complete set) or in the script's entries."""
        if self.parameter:
            whole = _with_component(values[self.parameter], self.path[0], value) if self.path else value
            values[self.parameter] = parameter_named(self.parameter).convert(whole)
            return
        place = entries[self.entry - 1]
        for key, following in zip(self.path, self.path[1:], strict=False):
            if isinstance(place, list):
                place = place[key]
                continue
            if not isinstance(place.get(key), (dict, list)):
                place[key] = [0.0, 0.0, 0.0] if isinstance(following, int) else {}
            place = place[key]
        if self.is_vertex and isinstance(value, float) and value.is_integer():
            value = int(value)  # grids hold doubles
        place[self.path[-1]] = copy.deepcopy(value)

    @property
    def is_vertex(self) -> bool:
        """Whether it is a vertex index."""
        return bool(self.entry) and self.path[-1] == "vertex"

    def component_names(self, count: int) -> list[str]:
        """Names of the ``count`` columns of a vector value; thruster forces are numbered."""
        labels = map(str, range(count)) if self.path == ("thrusters",) else component_labels(self.parameter, count)
        return [f"{self.name}.{label}" for label in labels]


def component_labels(parameter: str, count: int) -> list[str]:
    """Names of a vector's components."""
    if parameter.startswith("ballast.") and count == 4:
        return _BALLAST.split()
    return _COMPONENTS[count].split() if count in _COMPONENTS else [str(k) for k in range(count)]


def _with_component(vector: Value, k: int, value: Any) -> list[Any]:
    given = vector if isinstance(vector, list) else [vector]
    vector = list(given) * (3 if len(given) == 1 else 1)
    vector[k] = value
    return vector


def read_target(name: str, field: str, values: Mapping[str, Value], entries: list[Any]) -> Target:
    """The target of a name. values: the scene's. entries: the script's. Raises InputError, which suggests the nearest
    name.
    """
    if name.split(".")[0] == "script":
        return _script_target(name, field, entries)
    parameter, component = name, ""
    try:
        declared = parameter_named(name)
    except InputError as error:
        parameter, _, component = name.rpartition(".")
        if not parameter:
            raise InputError(field, error.received, error.accepted) from None
        try:
            declared = parameter_named(parameter)
        except InputError:
            raise InputError(field, error.received, error.accepted) from None
    if declared.changes == READ_ONLY:
        raise InputError(field, name, "a parameter that varies; this one is fixed for the node")
    if parameter == "record":
        raise InputError(
            field, name, "a parameter of the motion; a row is recorded by --as-scene and simulate --record"
        )
    if parameter not in values:
        raise InputError(field, name, f"a parameter that the scene has: add {parameter} to `set`")
    path = (_component(declared, component, field),) if component else ()
    return Target(name, parameter, 0, path)


def _component(declared: Parameter, component: str, field: str) -> int:
    labels = component_labels(declared.name, max(declared.lengths, default=0))
    if component not in labels:
        raise InputError(field, component, f"a component of {declared.name}: {', '.join(labels) or 'it has none'}")
    return labels.index(component)


def _script_target(name: str, field: str, entries: list[Any]) -> Target:
    _, _, rest = name.partition(".")
    number, *keys = rest.split(".")
    accepted = f"script.<entry>.<field>, entries 1 to {len(entries)}"
    if not entries:
        raise InputError(field, name, "a study with a script")
    if not number.isdecimal() or not 1 <= int(number) <= len(entries) or not keys:
        raise InputError(field, name, accepted)
    if keys[0] not in _SCRIPT_FIELDS:
        raise InputError(field, keys[0], one_of(keys[0], _SCRIPT_FIELDS))
    if keys[0] == "set":
        # The name of a parameter contains dots.
        keys = ["set", ".".join(keys[1:])]
        try:
            parameter_named(keys[1])
        except InputError as error:
            raise InputError(field, error.received, error.accepted) from None
    path = tuple("xyz".index(key) if key in ("x", "y", "z") else key for key in keys)
    return Target(name, "", int(number), path)
