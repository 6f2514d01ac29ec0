# SPDX-License-Identifier: MIT
"""The page's keys, by viser's commands: each has a hotkey, and Ctrl-K lists them all.

Browsers send no key that is typed into an input. "?" isn't among the hotkeys that viser 1.1 names, but its pages take
any key by the name that browsers give it; H does the same where another version doesn't. test_workbench_screen.py
presses both. Letters W A S D Q E move viser's camera and are left to it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import viser

from .node_control import NodeControl
from .past_view import PastView
from .scene_view import SceneView
from .situation import SituationControl
from .status import Announcements

BACK_S = 1.0
"""[s] That backspace goes back, each time it is pressed."""


@dataclass(frozen=True)
class Keyboard:
    """What the keys act on."""

    node: NodeControl
    past_view: PastView
    situations: SituationControl
    view: SceneView
    announcements: Announcements


@dataclass(frozen=True)
class Key:
    """hotkey and modifier as viser takes them; shown: as it is written on a keyboard."""

    shown: str
    hotkey: str
    does: str
    act: Callable[[Keyboard], Awaitable[None]]
    modifier: str | None = None


async def _pause(page: Keyboard) -> None:
    if page.past_view.moment_ns is not None:
        await page.situations.go_on_from_here()
    else:
        page.node.pause(not page.node.paused)


async def _step(page: Keyboard) -> None:
    if page.past_view.moment_ns is not None:
        page.past_view.step(-1)
    elif page.node.paused:
        page.node.call("step")
    else:
        page.node.pause(True)


async def _back_a_step(page: Keyboard) -> None:
    page.past_view.step(1)


async def _back(page: Keyboard) -> None:
    page.past_view.move_by(BACK_S)


async def _now(page: Keyboard) -> None:
    page.past_view.resume()


async def _reset(page: Keyboard) -> None:
    page.past_view.reset()


async def _centre(page: Keyboard) -> None:
    page.view.centre()


async def _list(page: Keyboard) -> None:
    page.announcements.say(key_list())


KEYS = (
    Key("Space", "space", "pause or resume; after rewinding, continue from there", _pause),
    Key("→", "arrowright", "one step forward; pauses first", _step),
    Key("←", "arrowleft", "one step back", _back_a_step),
    Key("Backspace", "backspace", f"rewind {BACK_S:g} s", _back),
    Key("N", "N", "return to now after rewinding", _now),
    Key("R", "R", "reset", _reset),
    Key("C", "C", "centre on the body", _centre),
    Key("?", "?", "list the keys", _list, "shift"),
    Key("H", "H", "list the keys too", _list),
)


def key_list() -> str:
    """All keys, and the button that no other control stands for, each in a line."""
    keys = [f"{key.shown}: {key.does}" for key in KEYS if key.hotkey != "H"]
    return "\n".join([*keys, "right button: move the view"])


def add_keys(gui: viser.GuiApi, page: Keyboard) -> None:
    """Give all pages the keys."""
    for key in KEYS:
        hotkey: Any = key.hotkey
        modifier: Any = key.modifier
        command = gui.add_command(
            f"{key.does[0].upper()}{key.does[1:]}", hotkey=hotkey, modifier=modifier, description=f"Key {key.shown}"
        )

        @command.on_trigger
        async def _(_: Any, key: Key = key) -> None:
            await key.act(page)
