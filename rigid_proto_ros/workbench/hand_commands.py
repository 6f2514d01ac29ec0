# SPDX-License-Identifier: MIT
"""What is done by hand on the page, sent so that it acts in the order in which it was done.

Single messages of one instant act by their kind and bytes, those of a list in its order. What is done together goes as
a list; and while simulated time stands still, where all is done in one instant, everything is kept and goes as one list
right before time goes on. Parameters that are set meanwhile are the node's at once, so that they are seen, and stand in
the list again: their own changes act after all lists, and then change nothing any more.
"""

from __future__ import annotations

from collections.abc import Callable

from ..scene.command_codec import ScriptCommand, outgoing
from ..scene.declaration import LIVE
from ..scene.parameters import parameter_named
from .rewind import KEPT
from .ros_link import RosLink


class HandCommands:
    """paused() says whether simulated time stands still, as far as is known."""

    def __init__(self, link: RosLink, paused: Callable[[], bool]) -> None:
        self._link = link
        self._paused = paused
        self._kept: list[ScriptCommand] = []
        self._beside: list[ScriptCommand] = []

    @property
    def paused(self) -> bool:
        """Whether what is done now waits for time to go on."""
        return self._paused()

    def do(self, *commands: ScriptCommand) -> None:
        """Something that is done at once, in this order."""
        self._kept += commands
        if not self.paused:
            self.go_on()

    def set_parameters(self, changes: dict[str, object], done: Callable[[bool, str], None]) -> None:
        """As RosLink.set_parameters, in the order of what is done by hand."""
        if not self.paused or not all(map(_is_ordered, changes)):
            self._link.set_parameters(changes, done)
            return
        command = ScriptCommand(0, "set", changes=dict(changes))
        last = self._kept[-1] if self._kept else None
        if last is not None and any(last is beside for beside in self._beside) and _same_names(last, command):
            self._drop(last)  # a slider on its way
        self._kept.append(command)
        self._beside.append(command)

        def answered(successful: bool, reason: str) -> None:
            if not successful:
                self._drop(command)
            done(successful, reason)

        self._link.set_parameters(changes, answered)

    def go_on(self) -> None:
        """Send what was kept: to be called before simulated time goes on, or when that is heard."""
        kept, beside = self._kept, self._beside
        self.forget()
        if len(kept) > len(beside):
            for message in outgoing(kept):
                self._link.send(message.topic, message.data)

    def forget(self) -> None:
        """A reset has dropped what was to come."""
        self._kept, self._beside = [], []

    def _drop(self, command: ScriptCommand) -> None:
        self._kept = [kept for kept in self._kept if kept is not command]
        self._beside = [beside for beside in self._beside if beside is not command]


def _is_ordered(name: str) -> bool:
    return parameter_named(name).changes == LIVE and name not in KEPT


def _same_names(first: ScriptCommand, second: ScriptCommand) -> bool:
    return (first.changes or {}).keys() == (second.changes or {}).keys()
