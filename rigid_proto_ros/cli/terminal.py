# SPDX-License-Identifier: MIT
"""Lines and tables on stdout: in colour on a terminal, aligned plain text otherwise.

``Text`` is what stands in a cell: a plain string, or a string with a style (``("off", "red")``).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence

Text = str | tuple[str, str]

SEVERITY_STYLES = {"error": "bold red", "warning": "yellow", "info": "cyan"}

_CODES = {"bold": "1", "red": "31", "green": "32", "yellow": "33", "cyan": "36"}
"""Of the terminal (ECMA-48, Select Graphic Rendition), by the words of a style."""


def _is_coloured() -> bool:
    # Python has no stdout where it was closed from the start.
    is_terminal = sys.stdout is not None and sys.stdout.isatty()
    return is_terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def line(*parts: Text) -> None:
    """One line of texts side by side."""
    if not _is_coloured():
        print("".join(map(_plain, parts)).rstrip())
        return
    styled = [
        f"\033[{';'.join(_CODES[word] for word in part[1].split())}m{part[0]}\033[0m"
        if isinstance(part, tuple) and part[1]
        else _plain(part)
        for part in parts
    ]
    print("".join(styled).rstrip())


def table(rows: Iterable[Sequence[Text]], head: Sequence[str] = ()) -> None:
    """Columns aligned to their widest cell; labels and head are bold in colour."""
    filled = [tuple(row) for row in rows]
    lines = ([tuple(head)] if head else []) + filled
    widths = [max(len(_plain(row[k])) for row in lines if k < len(row)) for k in range(max(map(len, lines)))]
    for number, row in enumerate(lines):
        bold = bool(head) and number == 0
        cells: list[Text] = []
        for k, cell in enumerate(row):
            text = _plain(cell)
            last = k == len(row) - 1
            padded = text if last else text.ljust(widths[k])
            style = "bold" if bold or (k == 0 and isinstance(cell, str)) else "" if isinstance(cell, str) else cell[1]
            cells.append((padded + ("" if last else "  "), style))
        line(*cells)


def _plain(text: Text) -> str:
    return text if isinstance(text, str) else text[0]
