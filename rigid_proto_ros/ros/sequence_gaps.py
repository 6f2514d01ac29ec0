# SPDX-License-Identifier: MIT
"""Messages that a publisher sent and a subscription never saw, by the gaps in their sequence numbers.

Numbers are each publisher's own, and a message doesn't say whose it is. So a gap counts only where every number since the
last one is known to be of one publisher; with several nothing is said but that some were lost, which the middleware tells
when a writer's own queue was full before its messages were fetched.
"""

from __future__ import annotations

from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription


class SequenceGaps:
    """Counts for one subscription whose messages are taken by hand: ``before`` for each, ``emptied`` when none is left."""

    def __init__(self, subscription: Subscription) -> None:
        # Taken by hand too: an executor would tell of a publisher after its messages.
        self._matched = _event(subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED)
        try:
            self._lost = _event(subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST)
        except UnsupportedEventTypeError:
            self._lost = None
        self._ever = 0
        self._one_alone = False
        self._last: int | None = None

    def before(self, number: int | None) -> int:
        """How many were lost between the message before and this one; 0 where that can't be known."""
        if number is None:
            return 0
        last, self._last = self._last, number
        if last is None or number == last + 1:
            return 0
        ever, present = self._publishers()
        if ever > 1 and not (self._one_alone and ever == self._ever and present == 1):
            self._one_alone = False
            return 0
        return max(0, number - last - 1)

    def emptied(self) -> bool:
        """The queue is empty: what comes from now on is from those who are there now. Returns whether the middleware has
        told of lost messages since the last time.
        """
        ever, present = self._publishers()
        if ever > 1 and not (self._one_alone and ever == self._ever):
            self._last = None
        self._ever, self._one_alone = ever, present == 1
        if self._lost is None:
            return False
        with self._lost:
            status = self._lost.take_event()
        return status is not None and status.total_count_change > 0

    def _publishers(self) -> tuple[int, int]:
        """How many there have ever been, and how many there are."""
        with self._matched:
            status = self._matched.take_event()
        return status.total_count, status.current_count


def _event(subscription: Subscription, kind: QoSSubscriptionEventType):
    with subscription.handle:
        return rclpy_implementation.EventHandle(subscription.handle, kind)
