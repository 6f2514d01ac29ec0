# SPDX-License-Identifier: MIT
"""How the page is laid out on narrow screens and on paper. On a telephone, and on any narrow window that is higher than
wide, the picture is above and the panel below it, not over it; a narrow window that is wider than high leaves it three
fifths of the width. On paper the whole panel is below the picture, however far it was scrolled.

viser lays its controls over the lower 60 % of a narrow page, where the body is, and puts other panels below them, a
long way down; wider pages get a panel of one width, however little is left beside it. It has no setting for any of
this. A style sheet can change it, and viser passes HTML of its server's on to
the page, style sheets included. The rules recognise the elements by the styles that viser 1.1 gives them;
test_workbench_screen.py fails where another version gives others.
"""

from __future__ import annotations

import viser

MARK = "rp-bar"
"""Class of the time bar's line, by which the bar is known."""

ANSWERS = "rp-answers"
"""Class of the room for answers on a printed lesson."""

NARROW = "36em"
"""Pages up to this width get viser's sheet at the bottom (its theme's breakpoint ``xs``)."""

MEDIUM = "(min-width: 36.01em) and (max-width: 59.4em)"
"""Pages on which the panel beside the picture would have more than 40 % of the width."""

PICTURE_SHARE = 56
"""[%] Of a narrow page's height."""

BESIDE_SHARE = 60
"""[%] Of the width, of a picture that has the panel beside it."""

PANEL_PIXELS = 380
"""Width of the panel beside the picture, until a user drags its edge."""

_SHEET = '.mantine-Paper-root[style*="position: fixed"][style*="max-height: 60%"]'
_PICTURE = 'div[style*="flex-grow: 1"][style*="height: 100%"]:has(canvas)'

# Of any width: dragging its edge changes that, and so does viser on a window that was a telephone's.
_DOCK = '[style*="position: absolute; top: 0px; bottom: 0px; right: 0px; width: "]'
_DOCKED_ROW = f'{_DOCK} [style*="flex-direction: row; position: relative; width: "]'
_DOCKED_PICTURE = '[style*="position: absolute; inset: 0px "]:has(canvas)'

_CANVAS = "canvas[data-engine]"  # three.js marks its own; the plots have others
_SCROLLED = ".mantine-ScrollArea-viewport"

_BAR = f".mantine-Paper-root:has(> .mantine-Collapse-root .{MARK})"

STYLE = f"""<style>
.mantine-Notification-root {{ max-height: 60vh !important; }}
.mantine-Button-root {{ height: auto !important; padding-block: 0.25em; }}
.mantine-Button-label {{ white-space: normal; }}
.mantine-Notification-root:has(.tabler-icon-check) {{ display: none; }}
.{MARK} {{ padding: 0 0.6em; font-size: 0.95em; white-space: nowrap; overflow: hidden; text-overflow: ellipsis; }}
.{MARK} b {{ font-size: 1.35em; font-weight: 500; font-variant-numeric: tabular-nums; display: inline-block; min-width:
4.6em; }} .{MARK} span {{ opacity: 0.7; }} {_BAR} {{ position: sticky; top: 0; z-index: 20; background: var(--mantine-
color-body); margin-top: 0.4em; }} .{ANSWERS} {{ display: none; }}
@media (max-width: {NARROW}) {{
  {_SHEET} {{ max-height: {100 - PICTURE_SHARE}% !important; width: 100% !important; }}
  {_SHEET} [style*="width: 20em"] {{ width: 100% !important; }}
  {_PICTURE} {{ height: {PICTURE_SHARE}% !important; }}
}}
@media {MEDIUM} {{
  {_DOCKED_ROW} {{ width: 100% !important; }}
  [role="tab"] {{ padding: 0 0.4em !important; }}
  .{MARK} {{ padding: 0 0.1em; }}
}}
@media {MEDIUM} and (orientation: landscape) {{
  {_DOCK} {{ width: {100 - BESIDE_SHARE}% !important; }}
  {_DOCKED_PICTURE} {{ right: {100 - BESIDE_SHARE}% !important; }}
}}
@media {MEDIUM} and (orientation: portrait) {{
  {_DOCK} {{ width: 100% !important; top: {PICTURE_SHARE}% !important; }}
  {_DOCKED_PICTURE} {{ inset: 0 0 {100 - PICTURE_SHARE}% 0 !important; }}
}}
@media print {{
  html, body, #root, div:has({_SCROLLED}), div:has({_CANVAS}), .mantine-ScrollArea-root, {_SCROLLED} {{
    position: static !important; overflow: visible !important; flex: none !important;
    height: auto !important; min-height: auto !important; max-height: none !important;
  }}
  .mantine-Notifications-root, {_BAR} {{ display: none; }}
  .{ANSWERS} {{ display: block; height: 12em;
    background: repeating-linear-gradient(transparent 0 1.9em, #999 1.9em calc(1.9em + 1px)); }}
}}
</style>"""

CLASS_STYLE = f"""<style>
:root {{ --mantine-scale: 1.25; }}
[role="tablist"] {{ display: none !important; }}
.{MARK} b {{ font-size: 1.7em; }}
</style>"""


def lay_out(server: viser.ViserServer) -> None:
    """Give all pages the style sheet."""
    server.gui.add_html(STYLE, order=-10.0)


class ClassMode:
    """Large letters, and nothing but picture, lesson and three buttons."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._sheet = server.gui.add_html("", order=-9.0)

    def switch(self, on: bool) -> None:
        """On or off."""
        self._sheet.content = CLASS_STYLE if on else ""
