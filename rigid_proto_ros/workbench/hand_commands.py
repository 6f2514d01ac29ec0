# SPDX-License-Identifier: MIT
"""What is done by hand on the page, sent so that it acts in the order in which it was done.

Single messages of one instant act by their kind and bytes, those of a list in its order. What is done together goes as a list;
and while simulated time stands still, where all is done in one instant, everything is kept and goes as one list right before time
goes on.
"""

from __future__ import annotations

from collections.abc import Callable

from ..command_codec import ScriptCommand, outgoing
from .ros_link import RosLink


class HandCommands:
    """paused() says whether simulated time stands still, as far as is known."""

    def __init__(self, link: RosLink, paused: Callable[[], bool]) -> None:
        self._link = link
        self._paused = paused
        self._kept: list[ScriptCommand] = []

    @property
    def paused(self) -> bool:
        """Whether what is done now waits for time to go on."""
        return self._paused()

    def do(self, *commands: ScriptCommand) -> None:
        """Something that is done at once, in this order."""
        self._kept += commands
        if not self.paused:
            self.go_on()

    def go_on(self) -> None:
        """Send what was kept: to be called before simulated time goes on, or when that is heard."""
        kept, self._kept = self._kept, []
        for message in outgoing(kept):
            self._link.send(message.topic, message.data)

    def forget(self) -> None:
        """A reset has dropped what was to come."""
        self._kept.clear()
