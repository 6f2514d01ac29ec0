# SPDX-License-Identifier: MIT
"""The node's own services but step (step_service.py), on the executor's thread: each hands a function over to the
physics thread and says what it did.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation


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
