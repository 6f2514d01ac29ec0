# SPDX-License-Identifier: MIT
"""What other programs must know of the kernels: the layout of each record, and what each kernel takes and returns."""

from __future__ import annotations

import importlib
import inspect
import json
import sys
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.library import KERNELS, MODULES, place, stamp

PACKAGE = __package__.partition(".")[0]
KINDS = {"float64": "f8", "float32": "f4", "int64": "i8", "int32": "i4", "uint8": "u1", "bool": "b1"}
"""Numbers that a record may hold: they have one size and place on every machine."""


def import_kernels() -> None:
    """Import every module that declares kernels."""
    for module in MODULES:
        importlib.import_module(f"{PACKAGE}.{module}")


def description() -> dict[str, Any]:
    """All of it, of lists, texts and numbers. Raises InputError for a record that isn't one on every machine.

    records: by name; of each its size, and fields by name with offset, count and type: a number's or a record's name.
    kernels: by name; of each the names and types of its arguments, as declared, and what it returns.
    """
    import_kernels()
    names = {kind: name for name, kind in named_records().items()}
    records: dict[str, Any] = {}

    def name_of(kind: np.dtype[Any]) -> str:
        """A record's name; it is described when it is first met, after those that it holds."""
        if kind not in names:
            raise InputError("kernels", f"a record of {kind.names}", "one that is a variable of a module")
        name = names[kind]
        if name not in records:
            records[name] = {"size": kind.itemsize, "fields": {of: field(kind, of) for of in kind.names or ()}}
        return name

    def field(kind: np.dtype[Any], name: str) -> dict[str, Any]:
        assert kind.fields is not None
        of, offset = kind.fields[name][:2]
        each = of.base
        if each.names is None and each.name not in KINDS:
            raise InputError("kernels", f"{names[kind]}.{name} of {each}", ", ".join(KINDS))
        shown = KINDS[each.name] if each.names is None else name_of(each)
        if offset % each.alignment:
            raise InputError("kernels", f"{names[kind]}.{name} at byte {offset}", "an aligned record")
        return {"offset": int(offset), "type": shown, "count": int(np.prod(of.shape, dtype=np.int64))}

    def argument(declared: Any) -> Any:
        kind, dimensions = place(declared)
        if kind is None or kind.names is None:
            return declared
        return name_of(kind) + "[:]" * dimensions

    kernels = {}
    for name, kernel in KERNELS.items():
        parameters = inspect.signature(kernel.function).parameters
        kernels[name] = {
            "arguments": dict(zip(parameters, map(argument, kernel.arguments), strict=True)),
            "returns": kernel.returns,
            "about": inspect.getdoc(kernel.function) or "",
        }
    return {"stamp": stamp(), "records": records, "kernels": kernels}


def named_records() -> dict[str, np.dtype[Any]]:
    """Types of records that are variables of the package, by their names. Raises InputError if two share one."""
    found: dict[str, np.dtype[Any]] = {}
    for module in [module for name, module in sys.modules.items() if name.startswith(PACKAGE)]:
        for name, kind in vars(module).items():
            if isinstance(kind, np.dtype) and kind.names and name.isupper() and found.setdefault(name, kind) != kind:
                raise InputError("kernels", f"two types of records are named {name}", "one each")
    return found


def as_json() -> str:
    """The description as a file."""
    return json.dumps(description(), indent=1) + "\n"
