# SPDX-License-Identifier: MIT
"""How the page is laid out on a narrow screen and on paper: the picture above, below it and not over it readouts and
controls; on paper all of them, however far they were scrolled. What is said in the corner keeps its lines.

viser lays its controls over the lower 60 % of a narrow page, where the body is, and puts other panels below them, a
long way down; it has no setting for either. A style sheet can change it, and viser passes HTML of its server's on to
the page, style sheets included. The rules recognise the elements by the styles that viser 1.1 gives them;
test_workbench_screen.py fails where another version gives others.
"""

from __future__ import annotations

import viser

NARROW = "36em"
"""Pages up to this width get viser's sheet at the bottom (its theme's breakpoint ``xs``)."""

PICTURE_SHARE = 56
"""[%] Of a narrow page's height."""

_SHEET = '.mantine-Paper-root[style*="position: fixed"][style*="max-height: 60%"]'
_READOUTS = '[aria-label$=" panel Readouts"]'
_PICTURE = 'div[style*="flex-grow: 1"][style*="height: 100%"]:has(canvas)'

_CANVAS = "canvas[data-engine]"  # three.js marks its own; the plots have others
_SCROLLED = ".mantine-ScrollArea-viewport"

STYLE = f"""<style>
.mantine-Notification-root {{ max-height: 60vh !important; }}
.mantine-Notification-description {{ white-space: pre-line; }}
@media (max-width: {NARROW}) {{
  {_SHEET} {{ max-height: {100 - PICTURE_SHARE}% !important; width: 100% !important; }}
  {_SHEET} [style*="width: 20em"] {{ width: 100% !important; }}
  {_SHEET} :has(> * > .mantine-Tabs-root > {_READOUTS}):not([style*="display: none"]) {{
    display: flex !important; flex-direction: column;
  }}
  {_SHEET} :has(> .mantine-Tabs-root > {_READOUTS}) {{ order: -1; }}
  {_PICTURE} {{ height: {PICTURE_SHARE}% !important; }}
}}
@media print {{
  html, body, #root, div:has({_SCROLLED}), div:has({_CANVAS}), .mantine-ScrollArea-root, {_SCROLLED} {{
    position: static !important; overflow: visible !important; flex: none !important;
    height: auto !important; min-height: auto !important; max-height: none !important;
  }}
  .mantine-Notifications-root {{ display: none; }}
}}
</style>"""


def lay_out(server: viser.ViserServer) -> None:
    """Give all pages the style sheet."""
    server.gui.add_html(STYLE, order=-10.0)
