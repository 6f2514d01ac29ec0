# SPDX-License-Identifier: MIT
"""Lines and tables on stdout: in colour on a terminal where rich is installed, aligned plain text otherwise.

``Text`` is what stands in a cell: a plain string, or a string with a rich style (``("off", "red")``).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

Text = str | tuple[str, str]

SEVERITY_STYLES = {"error": "bold red", "warning": "yellow", "info": "cyan"}


def _rich_console() -> Console | None:
    """rich's console, or None: the output is piped, or rich isn't installed."""
    if not sys.stdout.isatty():
        return None
    try:
        from rich.console import Console
    except ImportError:
        return None
    return Console(highlight=False, soft_wrap=True)


def line(*parts: Text) -> None:
    """One line of texts side by side."""
    console = _rich_console()
    if console is None:
        print("".join(map(_plain, parts)).rstrip())
        return
    from rich.text import Text as RichText

    console.print(RichText.assemble(*parts))


def table(rows: Iterable[Sequence[Text]], head: Sequence[str] = (), right: Iterable[int] = ()) -> None:
    """Columns aligned to their widest cell, those numbered in ``right`` on the right; labels and head are
    bold in colour.
    """
    filled = [tuple(row) for row in rows]
    right = set(right)
    lines = ([tuple(head)] if head else []) + filled
    widths = [max(len(_plain(row[k])) for row in lines if k < len(row)) for k in range(max(map(len, lines)))]
    for number, row in enumerate(lines):
        bold = bool(head) and number == 0
        cells: list[Text] = []
        for k, cell in enumerate(row):
            text = _plain(cell)
            last = k == len(row) - 1
            padded = text.rjust(widths[k]) if k in right else text if last else text.ljust(widths[k])
            style = "bold" if bold or (k == 0 and isinstance(cell, str)) else "" if isinstance(cell, str) else cell[1]
            cells.append((padded + ("" if last else "  "), style))
        line(*cells)


def _plain(text: Text) -> str:
    return text if isinstance(text, str) else text[0]
