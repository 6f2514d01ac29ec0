# SPDX-License-Identifier: MIT
"""The node's own services. All but step run on the executor's thread: each hands a function over to the physics thread
and says what it did.

``~/step`` is taken and answered by the physics thread: a controller in lockstep waits for every answer, and an
executor, which gathers all that it waits for anew each time, costs several times what the step itself does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from .command_queue import Request, RequestQueue


def offer_services(node: Node, live: LiveSimulation) -> None:
    """Create reset, pause and the ends of wrench and string, private to the node."""

    def offer(service_type: Any, name: str, function: Callable[[Any], None], done: Callable[[Any], str]) -> None:
        """A service that calls function(request) and answers with done(request), or with what was wrong."""

        def answer(request: Any, response: Any) -> Any:
            try:
                function(request)
                response.success, response.message = True, done(request)
            except InputError as error:
                response.success, response.message = False, str(error)
            return response

        node.create_service(service_type, f"~/{name}", answer)

    offer(Trigger, "reset", lambda _: live.reset(), lambda _: "simulated time is 0")
    offer(Trigger, "clear_wrench", lambda _: live.clear_wrench(), lambda _: "no wrench acts; scheduled ones stay")
    offer(Trigger, "string/release", lambda _: live.release_string(), lambda _: "the string is loose")
    offer(SetBool, "pause", lambda request: live.pause(request.data), lambda r: "paused" if r.data else "running")


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
