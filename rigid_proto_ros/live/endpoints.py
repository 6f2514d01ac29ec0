# SPDX-License-Identifier: MIT
"""What surrounds a simulation loop: who gets its states, where its commands come from, who hears what went wrong."""

from __future__ import annotations

import sys

from ..motion.state import State


class Endpoints:
    """Null object, and the interface: override what is of interest. Called on the physics thread, except where it says
    otherwise.

    messages_lost: how many messages were sent and never arrived. queue_full: how often a queue of incoming messages was
    found full, so that more may have been lost, nobody knows how many.
    """

    queue_full = 0
    messages_lost = 0

    def publish(self, state: State) -> None:
        """A state is due."""

    def has_subscribers(self) -> bool:
        """Whether anybody gets what ``publish`` is called for; asked some times a second. Without subscribers no state
        is built for them.
        """
        return False

    def take_commands(self, wall_ns: int, all_topics: bool) -> bool:  # noqa: ARG002 (the interface)
        """Submit what has arrived, on quiet topics too if ``all_topics``; whether commands come in these seconds."""
        return False

    def serve_steps(self, wall_ns: int) -> bool:  # noqa: ARG002 (the interface)
        """Answer requests for steps; whether more are to be expected soon."""
        return False

    def parameters_changed(self) -> None:
        """A command has changed the parameters, or a recording has stopped by itself; from any thread."""

    def warn(self, message: str) -> None:
        """Tell the user; from any thread."""
        print(message, file=sys.stderr)

    def failed(self, message: str) -> None:
        """Tell the user that the motion or a recording has stopped; from any thread."""
        print(message, file=sys.stderr)
