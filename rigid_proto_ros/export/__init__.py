# SPDX-License-Identifier: MIT
"""Motion for other tools: tables, glTF and USD."""

from importlib.util import find_spec

from ..base.errors import InputError, is_missing

LIBRARIES = {"--parquet": ("pyarrow.parquet", "pyarrow"), "--usd": ("pxr", "usd-core")}
"""By option, the module that writes such files, and its package."""


def check_library(option: str) -> None:
    """Raise InputError if the library for this option isn't installed."""
    module, package = LIBRARIES.get(option, ("", ""))
    if module and (find_spec(module.partition(".")[0]) is None or find_spec(module) is None):
        raise InputError(option, is_missing(package, "export"))
