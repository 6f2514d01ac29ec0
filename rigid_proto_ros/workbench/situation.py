# SPDX-License-Identifier: MIT
"""Taking a node into a situation: parameters, a reset, commands stamped with the time at which they act.

The node is paused meanwhile, so that each command is there before its time: the motion that follows is the one that
``poke_client --reset`` or ``simulate`` would give, to the bit.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..base.errors import InputError
from ..motion.frames import parse_frame
from ..scene.command_codec import ScriptCommand, outgoing
from ..scene.parameters import Parameters
from ..scene.scene_file import read_scene_text
from ..scene.script import parse_script, with_contacts
from .history import History
from .node_control import NodeControl
from .past_view import PastView
from .rewind import Rewind, changes_to
from .ros_link import Answered, RosLink
from .status import Announcements

MAX_UNCONFIRMED = 400
"""Commands sent beyond what the node has reported as received, which it does once a second."""

MAX_COMMANDS = 4000
"""More would take a page a minute to send; poke_client has the patience."""

STALLED_S = 5.0
"""[s] A node that answers nothing for this long is gone."""


@dataclass(frozen=True)
class Situation:
    """changes: parameters to be set together. commands: with ``t_ns`` in simulated time after the reset."""

    changes: Mapping[str, object]
    commands: Sequence[ScriptCommand] = field(default_factory=tuple)


def situation_of(scene: str, script: str, present: Mapping[str, object]) -> Situation:
    """The situation of a scene (parameter-file text) and a poke script (YAML text); raises InputError.

    What the scene doesn't name is at its default. Contacts can't change in flight: the script's are taken from the
    scene as the points that they are.
    """
    wanted = Parameters().replaced(read_scene_text(scene).values)
    listed = parse_script(script) if script.strip() else []
    commands = [_at_its_point(command, wanted.contacts) for command in with_contacts(listed, wanted.contacts)]
    if len(commands) > MAX_COMMANDS:
        raise InputError(
            "script", f"{len(commands)} commands are more than {MAX_COMMANDS}; send the script with poke_client"
        )
    return Situation(changes_to(wanted.named(), present), commands)


def _at_its_point(command: ScriptCommand, contacts: Mapping[str, tuple[float, ...]]) -> ScriptCommand:
    """A wrench or poke at a contact as one at the point where the contact lies."""
    if command.kind not in ("wrench", "poke"):
        return command
    frame = parse_frame(command.frame_id, frozenset(contacts))
    if frame.point[0] != "contact":
        return command
    return replace(command, frame_id=replace(frame, point=("point", contacts[frame.point[1]])).text)


class SituationControl:
    """Takes the node into situations, and tells whoever shows or keeps its past. let_go() ends a drag.

    another_body: the body that comes next is another one; what fits it is found anew.
    """

    def __init__(
        self,
        node: NodeControl,
        history: History,
        past_view: PastView,
        announcements: Announcements,
        let_go: Callable[[], None],
    ) -> None:
        self._node = node
        self._history = history
        self._past_view = past_view
        self._announcements = announcements
        self._let_go = let_go
        self._going_back = False
        self.another_body = True

    async def take_to(self, situation: Situation, rewind: Rewind | None = None) -> None:
        """Take the node there; ``rewind`` is what it goes back by. Raises InputError."""
        self._let_go()
        paused = self._past_view.paused_before

        def before_reset() -> None:
            self._history.rewinding(rewind)
            if rewind is None:
                self._history.forget_ghost()
                self._past_view.end()  # the past was another body's

        try:
            await take_to(self._node.link, situation, paused, lambda: self._node.received, before_reset)
        except InputError:
            self._history.rewinding(None)
            self._past_view.resume()
            raise
        self._node.paused = paused
        self._past_view.end()

    async def go_on_from_here(self) -> None:
        """Take the node to the moment that is looked at, and let time go on from there; once, however
        often it is asked for.
        """
        if self._going_back:
            return
        self._going_back = True
        try:
            self._past_view.run_afterwards()
            await self._announcements.while_doing("going back", self._rewind())
        finally:
            self._going_back = False

    async def _rewind(self) -> None:
        moment_ns = self._past_view.moment_ns
        if moment_ns is None:
            return
        try:
            rewind = await asyncio.to_thread(self._history.rewind, moment_ns)
            await self.take_to(Situation(rewind.changes), rewind)
            for note in rewind.notes:
                self._announcements.say(note)
        finally:
            self._past_view.resume()


async def take_to(
    link: RosLink, situation: Situation, paused: bool, received: Callable[[], int], before_reset: Callable[[], None]
) -> None:
    """Take the node there; it is paused or running then as it was, ``paused``, before. Raises InputError when it
    refuses.

    received() gives its count of commands, before_reset() is called right before its time starts again.
    """
    await asked(link, "pause", True)
    try:
        if situation.changes:
            successful, _ = await set_parameters(link, situation.changes)
            if not successful:
                # What acts now may stand in the way of a change that nothing at its own time does.
                await asked(link, "reset")
                successful, reason = await set_parameters(link, situation.changes)
                if not successful:
                    raise InputError("node", reason, "parameters that it accepts")
        before_reset()
        await asked(link, "reset")
        await _send(link, situation.commands, received)
    finally:
        await asked(link, "pause", paused)


async def _send(link: RosLink, commands: Sequence[ScriptCommand], received: Callable[[], int]) -> None:
    first, number, confirmed = received(), 0, 0
    if link.times.offset_ns:
        # The node stamps by a /clock, by another offset since the reset: the second report from here on has it.
        last, deadline = link.times.reports + 2, time.monotonic() + STALLED_S
        while link.times.reports < last:
            if time.monotonic() > deadline:
                raise InputError("node", f"no report on /diagnostics within {STALLED_S:g} s")
            await asyncio.sleep(0.02)
    for message in outgoing(list(commands), offset_ns=link.times.offset_ns):
        link.send(message.topic, message.data)
        number += len(message.commands)
        if number - confirmed >= MAX_UNCONFIRMED or number == len(commands):
            confirmed = number
            deadline = time.monotonic() + STALLED_S
            while received() - first < number:
                if time.monotonic() > deadline:
                    raise InputError("node", f"the node confirmed {received() - first} of {number} commands")
                await asyncio.sleep(0.02)


async def asked(link: RosLink, service: str, data: bool | None = None) -> str:
    """Call a service and wait; returns its message, raises InputError where it fails."""
    answer: asyncio.Future[tuple[bool, str]] = asyncio.get_running_loop().create_future()
    link.call(service, data, _giving(answer))
    successful, message = await _within(answer, service)
    if not successful:
        raise InputError(service, message, "success")
    return message


async def set_parameters(link: RosLink, changes: Mapping[str, object]) -> tuple[bool, str]:
    """Set parameters together and wait; whether the node took them, and its reason where it didn't."""
    answer: asyncio.Future[tuple[bool, str]] = asyncio.get_running_loop().create_future()
    link.set_parameters(dict(changes), _giving(answer))
    return await _within(answer, "set_parameters_atomically")


def _giving(answer: asyncio.Future[tuple[bool, str]]) -> Answered:
    def give(successful: bool, message: str) -> None:
        if not answer.done():  # it may come after we stopped waiting
            answer.set_result((successful, message))

    return give


async def _within(answer: asyncio.Future[tuple[bool, str]], what: str) -> tuple[bool, str]:
    try:
        return await asyncio.wait_for(answer, STALLED_S)
    except TimeoutError:
        raise InputError(what, f"the node gave no answer within {STALLED_S:g} s") from None
