# SPDX-License-Identifier: MIT
"""The node's own services but ``~/step`` (commands.py). They run on the executor's thread: each hands a function over
to the physics thread and says what it did.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation


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
