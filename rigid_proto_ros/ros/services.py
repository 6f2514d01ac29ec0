# SPDX-License-Identifier: MIT
"""The node's own services. All but step run on the executor's thread: each hands a function over to the physics thread
and says what it did.

``~/step`` is taken and answered by the physics thread: a controller in lockstep waits for every answer, and an
executor, which gathers all that it waits for anew each time, costs several times what the step itself does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from .command_queue import Request, RequestQueue


class Services:
    """Reset, pause and the ends of wrench and string; call ``offer`` once."""

    def __init__(self, live: LiveSimulation) -> None:
        self._live = live

    def offer(self, node: Node) -> None:
        """Create the services, private to the node."""
        live = self._live
        triggers = {
            "reset": (live.reset, "simulated time is 0"),
            "clear_wrench": (live.clear_wrench, "no wrench acts; scheduled ones stay"),
            "string/release": (live.release_string, "the string is loose"),
        }
        for name, (function, done) in triggers.items():
            node.create_service(Trigger, f"~/{name}", _answering(partial(_call, function), partial(_text, done)))
        node.create_service(
            SetBool,
            "~/pause",
            _answering(lambda request: live.pause(request.data), lambda r: "paused" if r.data else "running"),
        )


def _call(function: Callable[[], None], _: Any) -> None:
    function()


def _text(text: str, _: Any) -> str:
    return text


def _answering(function: Callable[[Any], None], done: Callable[[Any], str]) -> Callable[[Any, Any], Any]:
    """A service callback that calls function(request) and answers with done(request), or with what was wrong."""

    def answer(request: Any, response: Any) -> Any:
        try:
            function(request)
            response.success, response.message = True, done(request)
        except InputError as error:
            response.success, response.message = False, str(error)
        return response

    return answer


EXPECTED_NS = 1_000_000_000
"""How long after a request the next one is looked for often [ns of wall time]."""


class StepService:
    """The service of one node; ``serve`` takes the requests for its loop."""

    def __init__(self, node: Node, live: LiveSimulation, group: CallbackGroup) -> None:
        self._live = live
        self._queue = RequestQueue(node, Trigger, "step", group)
        self._under_way: tuple[Request, Iterator[None]] | None = None
        self._expected_until_ns = 0

    def serve(self, wall_ns: int) -> bool:
        """Take what is asked for, one request after another, each for as long as a tick has time, and answer. Returns
        whether more is to be expected soon.
        """
        while self._under_way is not None or self._take():
            assert self._under_way is not None
            self._expected_until_ns = wall_ns + EXPECTED_NS
            request, steps = self._under_way
            answer = Trigger.Response(success=True)
            try:
                next(steps)
                return True
            except StopIteration:
                time_s, received = self._live.loop.simulation.time_ns / 1e9, self._live.commands.received.total()
                answer.message = f"simulated time is {time_s:.9g} s; {received} commands received"
            except InputError as error:
                answer = Trigger.Response(success=False, message=str(error))
            self._under_way = None
            self._queue.answer(request, answer)
        return wall_ns < self._expected_until_ns

    def _take(self) -> bool:
        request = self._queue.take()
        if request is not None:
            self._under_way = request, self._live.steps()
        return request is not None
