# SPDX-License-Identifier: MIT
"""``~/step``, taken and answered by the physics thread: a controller in lockstep waits for every answer, and an
executor, which gathers all that it waits for anew each time, costs several times what the step itself does.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from ..base.errors import InputError
from .command_intake import CommandIntake
from .command_queue import Request, RequestQueue
from .physics_thread import advance_by
from .simulation_loop import SimulationLoop

WAIT_S = 5.0
"""[s] That time stands still for a list sent before, until what it needs is loaded and compiled."""

EXPECTED_NS = 1_000_000_000
"""How long after a request the next one is looked for often [ns of wall time]."""


class StepService:
    """The service of one node; ``serve`` takes the requests for its loop."""

    def __init__(self, node: Node, loop: SimulationLoop, intake: CommandIntake, group: CallbackGroup) -> None:
        self._loop = loop
        self._intake = intake
        self._queue = RequestQueue(node, Trigger, "step", group)
        self._under_way: tuple[Request, Generator[None, None, str]] | None = None
        self._expected_until_ns = 0

    def serve(self, wall_ns: int) -> bool:
        """Take what is asked for, one request after another, each for as long as a tick has time, and answer. Returns
        whether more is to be expected soon.
        """
        while self._under_way is not None or self._take():
            assert self._under_way is not None
            self._expected_until_ns = wall_ns + EXPECTED_NS
            request, step = self._under_way
            try:
                next(step)
                return True
            except StopIteration as done:
                answer = Trigger.Response(success=True, message=done.value)
            except InputError as error:
                answer = Trigger.Response(success=False, message=str(error))
            self._under_way = None
            self._queue.answer(request, answer)
        return wall_ns < self._expected_until_ns

    def _take(self) -> bool:
        request = self._queue.take()
        if request is not None:
            self._under_way = request, step(self._loop, self._intake)
        return request is not None


def step(loop: SimulationLoop, intake: CommandIntake) -> Generator[None, None, str]:
    """Take all commands that have arrived and advance as far as the parameters say, on the physics thread; yields while
    its ticks go on with that. Returns what is answered; raises InputError where it can't be done.
    """
    if loop.timekeeping.paused:
        yield from take_lists(loop.take_commands, intake)
    if not loop.timekeeping.paused:
        raise InputError("step", "the simulation is running; pause it first")
    yield from advance_by(loop, loop.periods_of_a_step)
    return f"simulated time is {loop.simulation.time_ns / 1e9:.9g} s; {intake.received.total()} commands received"


def take_lists(take_commands: Callable[[], None], intake: CommandIntake) -> Iterator[None]:
    """Before time goes on: a list sent while it stood acts then, though it has a mesh to be loaded. Yields while that
    is waited for; raises InputError when it takes longer than WAIT_S.
    """
    deadline = time.monotonic() + WAIT_S
    take_commands()
    while intake.in_progress:
        if time.monotonic() > deadline:
            raise InputError("schedule", f"a list is still being prepared after {WAIT_S:g} s; try again")
        yield
        take_commands()
