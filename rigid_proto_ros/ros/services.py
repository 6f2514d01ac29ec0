# SPDX-License-Identifier: MIT
"""The node's own services, on the executor's thread: each hands a function over to the physics thread and
says what it did.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..simulation.commands import ClearWrench, ReleaseString
from .command_intake import CommandIntake
from .physics_thread import Call, step_over
from .simulation_loop import SimulationLoop

WAIT_S = 5.0
"""[s] That time stands still for a list sent before, until what it needs is loaded and compiled."""


class Services:
    """Reset, step, pause and the ends of wrench and string, for one loop; call ``offer`` once."""

    def __init__(self, loop: SimulationLoop, call: Call, intake: CommandIntake) -> None:
        self._loop = loop
        self._call = call
        self._intake = intake

    def offer(self, node: Node) -> None:
        """Create the services, private to the node."""
        triggers = {
            "reset": self._reset,
            "step": self._step,
            "clear_wrench": self._clear_wrench,
            "string/release": self._release_string,
        }
        for name, function in triggers.items():
            node.create_service(Trigger, f"~/{name}", _answering(function))
        node.create_service(SetBool, "~/pause", _answering(self._pause))

    def _reset(self, _: Any) -> str:
        self._call(self._loop.reset)
        return "simulated time is 0"

    def _step(self, _: Any) -> str:
        if not self._loop.timekeeping.paused:
            raise InputError("step", "the simulation is running; pause it first")
        self._take_all()
        reached_ns = step_over(self._call, self._loop, self._loop.periods_of_a_step)
        return f"simulated time is {reached_ns / 1e9:.9g} s; {self._intake.received.total()} commands received"

    def _take_all(self) -> None:
        """Before time goes on: a list sent while it stood acts then, though it has a mesh to be loaded."""
        deadline = time.monotonic() + WAIT_S
        self._call(self._loop.take_commands)
        while self._intake.in_progress:
            if time.monotonic() > deadline:
                raise InputError("schedule", f"a list that is still worked out after {WAIT_S:g} s: try again")
            time.sleep(0.002)
            self._call(self._loop.take_commands)

    def _pause(self, request: Any) -> str:
        if self._loop.timekeeping.paused and not request.data:
            self._take_all()
        self._call(lambda: self._loop.pause(request.data))
        return "paused" if request.data else "running"

    def _release_string(self, _: Any) -> str:
        self._call(lambda: self._loop.simulation.submit(ReleaseString()))
        return "the string is loose"

    def _clear_wrench(self, _: Any) -> str:
        self._call(lambda: self._loop.simulation.submit(ClearWrench()))
        return "no wrench acts; scheduled ones stay"


def _answering(function: Callable[[Any], str]) -> Callable[[Any, Any], Any]:
    """A service callback that answers with what the function says, or with what was wrong."""

    def answer(request: Any, response: Any) -> Any:
        try:
            response.success, response.message = True, function(request)
        except InputError as error:
            response.success, response.message = False, str(error)
        return response

    return answer
