# SPDX-License-Identifier: MIT
"""The one error family: every message names the field and says what is wrong with it, in one line."""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Iterable
from typing import Any

LONGEST = 4000
"""Characters of a text that is shown: a file's own may have millions."""


def printable(text: str) -> str:
    """A text that has words of a file in it, as one line for a terminal or log: control characters and marks that turn
    a text round are escaped, and what is longer than anybody reads is cut off.
    """
    shown = text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."
    return shown if shown.isprintable() else "".join(map(_shown, shown))


def _shown(character: str) -> str:
    return character if character.isprintable() else " " if character.isspace() else repr(character)[1:-1]


class InputError(ValueError):
    """Input that was refused: what was received and what is accepted; or, without ``accepted``, a sentence that says
    both, which reads better where what was received isn't one value.

    The command line prints ``str(error)`` as its one line on stderr and exits with status 2; the node keeps the old
    value in force and returns the same text.
    """

    def __init__(self, field: str, received: object, accepted: str = "") -> None:
        self.field = field
        self.received = received
        self.accepted = accepted
        super().__init__(
            printable(f"{field}: got {received!r}; accepted: {accepted}" if accepted else f"{field}: {received}")
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process."""
        return type(self), (self.field, self.received, self.accepted)


class MeshError(InputError):
    """A mesh that can't be read, or whose surface doesn't bound a solid where one is needed."""


class TensorError(InputError):
    """An inertia tensor or mass that no rigid body has."""


class CommandRefused(InputError):
    """A wrench, string or schedule command that was refused; ``reason`` is the diagnostics counter it goes to."""

    def __init__(self, reason: str, field: str, received: object, accepted: str = "") -> None:
        self.reason = reason
        super().__init__(field, received, accepted)

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process."""
        return type(self), (self.reason, self.field, self.received, self.accepted)


def tell(program: str, error: Exception) -> int:
    """Print one line on stderr of what was refused, couldn't be written or has no room in memory, and return the exit
    status; any other error is raised again.
    """
    if isinstance(error, BrokenPipeError):
        # The reader of our output went away, as `| head` does; Python would complain again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    if isinstance(error, UnicodeEncodeError):
        error = InputError("a name", error.object, "text; libraries that read or write files take no other")
    if isinstance(error, InputError | OSError | MemoryError):
        print(f"{program}: {' '.join(str(error).split()) or 'out of memory'}", file=sys.stderr)
        return 2
    raise error


def is_missing(package: str, extra: str) -> str:
    """Says that a package isn't installed, and how one of this package's extras installs it."""
    return f"{package} is missing: pip install 'rigid_proto_ros[{extra}]'"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """``did you mean X?`` for the known name nearest to ``name``, in capitals or not; empty where none is near."""
    small = {word.lower(): word for word in known}
    near = difflib.get_close_matches(name.lower(), small, n=1, cutoff=0.5)
    return f"did you mean {small[near[0]]}?" if near else ""


def one_of(name: str, known: Iterable[str]) -> str:
    """What is accepted instead of ``name``: all known names, and the nearest one again."""
    known = list(known)
    return "; ".join(filter(None, [f"one of {', '.join(known)}", did_you_mean(name, known)]))
