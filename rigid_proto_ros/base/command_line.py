# SPDX-License-Identifier: MIT
"""What the three executables' command lines have in common: one-line refusals with the nearest known name, examples in
--help, and how far long work is, as one line on a terminal.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any, NoReturn

from .errors import did_you_mean, one_of

NEGATIVE_NUMBER = re.compile(r"-(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\Z")
"""argparse knows no exponents and takes -2e-4 for an option."""


class Parser(argparse.ArgumentParser):
    """Usage errors are one line on stderr and exit status 2. examples: (command, what it does), shown
    below --help's options. instead_of(option) says what does the work of an option that there isn't, or "".
    """

    def __init__(self, *, examples: Iterable[tuple[str, str]] = (), **kwargs: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **kwargs)
        self._negative_number_matcher = NEGATIVE_NUMBER
        self.instead_of: Callable[[str], str] = lambda _: ""
        self.show_examples(examples)

    def show_examples(self, examples: Iterable[tuple[str, str]]) -> None:
        """Commands to copy, each under a line that says what it does."""
        lines = [line for command, meaning in examples for line in (f"  # {meaning}", f"  {command}")]
        if lines:
            self.epilog = "\n".join(["examples:", *lines])

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As argparse does it, but what isn't known is refused by the command that it was given to, which
        knows its options.
        """
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._unknown(unknown))
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """One line, exit status 2."""
        self.exit(2, f"{self.prog}: {' '.join(message.split())} (see {self.prog} --help)\n")

    def _unknown(self, words: list[str]) -> str:
        options = [word for word in words if word.startswith("-")]
        if not options:
            return f"{words[0]!r} is an unexpected argument"
        name = options[0].partition("=")[0]
        known = (option for option in self._option_string_actions if option.startswith("--"))
        hint = self.instead_of(name) or did_you_mean(name, known)
        return f"no option {name}" + (f"; {hint}" if hint else "")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        known = [str(choice) for choice in action.choices]
        if action.metavar == "COMMAND":
            raise argparse.ArgumentError(None, f"there is no command {value!r}; {one_of(str(value), known)}")
        raise argparse.ArgumentError(action, f"there is no {value!r}; {one_of(str(value), known)}")


def number_from(lower: float, upper: float) -> Callable[[str], float]:
    """The type of an option that takes a number within these bounds."""

    def number(text: str) -> float:
        if not lower <= (value := float(text)) <= upper:
            raise argparse.ArgumentTypeError(f"got {text}; accepted: a number from {lower:g} to {upper:g}")
        return value

    return number


FIRST_S, EVERY_S = 1.0, 0.2
"""[s] Before the first sign of life, and between two."""


class Progress:
    """``with Progress("reading cow.obj") as progress:`` shows how far the work is, and how long it still takes at its
    present rate, when it calls ``fraction``. before: what was done before it began. shown False shows nothing.
    """

    def __init__(self, what: str, shown: bool = True, before: float = 0.0) -> None:
        self.what, self._before = what, before
        self._shown = shown and sys.stderr.isatty()
        self._started = time.monotonic()
        self._next = self._started + FIRST_S

    def fraction(self, done: float, total: float = 1.0) -> None:
        """``done`` of ``total`` is finished."""
        now = time.monotonic()
        if self._shown and now >= self._next:
            self._next = now + EVERY_S
            percent = 100.0 * min(1.0, done / total) if total else 100.0
            took, own = now - self._started, done - self._before
            left = f", {took * (total - done) / own:.0f} s left" if own > 0.0 else ""
            print(f"\r{self.what}: {percent:.0f} %, {took:.0f} s{left}\033[K", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
