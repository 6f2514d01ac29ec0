# SPDX-License-Identifier: MIT
"""``~/step``, taken and answered by the physics thread: a controller in lockstep waits for every answer, and an
executor, which gathers all that it waits for anew each time, costs several times what the step itself does.
"""

from __future__ import annotations

from collections.abc import Iterator

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation
from .command_queue import Request, RequestQueue

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
