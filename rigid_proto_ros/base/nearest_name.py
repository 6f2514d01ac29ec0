# SPDX-License-Identifier: MIT
"""What somebody may have meant by a name that isn't known."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``did you mean X?`` for the known name nearest to ``name``; empty where none is near."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else ""


def one_of(name: str, known: Iterable[str]) -> str:
    """What is accepted instead of ``name``: the nearest known name first, then all of them."""
    known = list(known)
    return " ".join(filter(None, [did_you_mean(name, known), f"one of {', '.join(known)}"]))
