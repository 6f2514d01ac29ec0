# SPDX-License-Identifier: MIT
"""What the page asks of the node: parameters, services, and commands in the order in which a hand gave them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from .hand_commands import HandCommands
from .ros_link import Answered, RosLink

ANSWER_S = 10.0
"""[s] After which a call is given up: its node has died, or another one has its name. Reading a big mesh
takes a few.
"""


class ParameterSetter:
    """Sends changes to the node, one call at a time; what comes in meanwhile goes with the next, the newest value
    winning.

    send(changes, done) as RosLink.set_parameters; on_refusal(reason). For an event loop's thread.
    """

    def __init__(self, send: Callable[[dict[str, object], Answered], None], on_refusal: Callable[[str], None]) -> None:
        self._send = send
        self._on_refusal = on_refusal
        self._waiting: dict[str, object] = {}
        self._call: asyncio.TimerHandle | None = None

    def set(self, changes: Mapping[str, object]) -> None:
        """Set parameters soon."""
        self._waiting.update(changes)
        self._go_on()

    @property
    def busy(self) -> bool:
        """Whether the node hasn't answered yet."""
        return self._call is not None

    def _go_on(self) -> None:
        if self._call is not None or not self._waiting:
            return
        changes, self._waiting = self._waiting, {}
        call = self._call = asyncio.get_running_loop().call_later(ANSWER_S, self._give_up)
        self._send(changes, lambda successful, reason: self._done(call, successful, reason))

    def _give_up(self) -> None:
        self._done(self._call, False, f"no answer of the node within {ANSWER_S:g} s")

    def _done(self, call: asyncio.TimerHandle | None, successful: bool, reason: str) -> None:
        if call is None or call is not self._call:
            return  # given up before
        call.cancel()
        self._call = None
        if not successful:
            self._on_refusal(reason)
        self._go_on()


class NodeControl:
    """paused: whether simulated time stands still, as far as is known. diagnostics: the last ones heard.

    say(text) tells of a service that failed, on_refusal(reason) of parameters that were refused.
    """

    def __init__(self, link: RosLink, say: Callable[[str], None], on_refusal: Callable[[str], None]) -> None:
        self.link = link
        self.paused = False
        self.diagnostics: Mapping[str, str] = {}
        self.hand = HandCommands(link, lambda: self.paused)
        self._say = say
        self._setter = ParameterSetter(self.hand.set_parameters, on_refusal)

    @property
    def busy(self) -> bool:
        """Whether parameters that were set aren't answered yet."""
        return self._setter.busy

    @property
    def received(self) -> int:
        """How many commands the node has received, by its last diagnostics."""
        return int(self.diagnostics.get("commands_received", 0))

    def set(self, changes: Mapping[str, object]) -> None:
        """Set parameters soon."""
        self._setter.set(changes)

    def call(self, service: str, data: bool | None = None) -> None:
        """Call a service; a failure is said."""
        if service == "step" or (service == "pause" and not data):
            self.hand.go_on()
        self.link.call(service, data, lambda successful, message: None if successful else self._say(message))

    def pause(self, paused: bool) -> None:
        """Stop or resume simulated time."""
        self.call("pause", paused)

    def on_paused(self, paused: bool) -> None:
        """The node says whether simulated time stands still."""
        self.paused = paused
        if not paused:
            self.hand.go_on()
