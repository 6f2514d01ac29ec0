# SPDX-License-Identifier: MIT
"""The node's own services but step (step_service.py), on the executor's thread: each hands a function over to the
physics thread and says what it did.
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
from .physics_thread import Call
from .simulation_loop import SimulationLoop
from .step_service import take_lists

LISTS_S = 0.002
"""Between looks whether lists are worked out [s]."""


class Services:
    """Reset, pause and the ends of wrench and string, for one loop; call ``offer`` once."""

    def __init__(self, loop: SimulationLoop, call: Call, intake: CommandIntake) -> None:
        self._loop = loop
        self._call = call
        self._intake = intake

    def offer(self, node: Node) -> None:
        """Create the services, private to the node."""
        triggers = {
            "reset": self._reset,
            "clear_wrench": self._clear_wrench,
            "string/release": self._release_string,
        }
        for name, function in triggers.items():
            node.create_service(Trigger, f"~/{name}", _answering(function))
        node.create_service(SetBool, "~/pause", _answering(self._pause))

    def _reset(self, _: Any) -> str:
        self._call(self._loop.reset)
        return "simulated time is 0"

    def _pause(self, request: Any) -> str:
        if self._loop.timekeeping.paused and not request.data:
            for _ in take_lists(lambda: self._call(self._loop.take_commands), self._intake):
                time.sleep(LISTS_S)
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
