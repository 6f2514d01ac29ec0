# SPDX-License-Identifier: MIT
"""The standard action SimulateSteps (simulation_interfaces): publications stepped over while paused, with word after
each, until they are done or the client cancels.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node

from ..base.errors import InputError
from ..live.live_simulation import LiveSimulation


class StepAction:
    """Carries out the goals of one node. action: the type simulation_interfaces.action.SimulateSteps; messages: the
    modules simulation_interfaces.msg.
    """

    def __init__(self, live: LiveSimulation, messages: Any, action: Any) -> None:
        self._live = live
        self._results = messages.Result
        self._action = action

    def offer(self, node: Node) -> None:
        """Create the action server, private to the node."""
        ActionServer(
            node,
            self._action,
            "~/simulate_steps",
            # Each goal brings its own, below.
            execute_callback=lambda _: self._action.Result(),
            handle_accepted_callback=self.accepted,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def accepted(self, goal: Any) -> threading.Thread:
        """Step on a thread of its own: the executor has other requests to serve, that to cancel among them."""
        thread = threading.Thread(target=self._carry_out, args=(goal,), name="steps", daemon=True)
        thread.start()
        return thread

    def _carry_out(self, goal: Any) -> None:
        message = ""
        try:
            self._step(goal, int(goal.request.steps))
        except InputError as error:
            message = str(error)
        # On the executor's thread, which alone ends goals.
        goal.execute(lambda _: self._ended(goal, message))

    def _step(self, goal: Any, steps: int) -> None:
        for done in range(1, steps + 1):
            if goal.is_cancel_requested:
                return
            self._live.step()
            goal.publish_feedback(self._action.Feedback(completed_steps=done, remaining_steps=steps - done))

    def _ended(self, goal: Any, message: str) -> Any:
        end: Callable[[], None] = goal.succeed
        if goal.is_cancel_requested:
            end = goal.canceled
        elif message:
            end = goal.abort
        end()
        result = self._action.Result()
        result.result.result = self._results.RESULT_OPERATION_FAILED if message else self._results.RESULT_OK
        result.result.error_message = message
        return result
