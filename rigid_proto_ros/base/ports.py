# SPDX-License-Identifier: MIT
"""Where this package's servers listen: on this machine alone, unless it is asked for more."""

from __future__ import annotations

from collections.abc import Sequence

from .errors import InputError

LOOPBACK = "127.0.0.1"
PORTS_TRIED = 64
"""How many ports above a taken default are tried before giving up."""


def ports_to_try(field: str, asked: int | None, default: int) -> Sequence[int]:
    """The TCP port that was asked for, or those from the default on; raises InputError for one that is none."""
    if asked is None:
        return range(default, min(default + PORTS_TRIED, 65536))
    if not 1 <= asked <= 65535:
        raise InputError(field, asked, "a TCP port, 1 to 65535")
    return [asked]
