# SPDX-License-Identifier: MIT
"""A command topic whose messages the physics thread takes from the middleware's queue itself, what was lost on the way,
and a service whose requests it takes likewise.

A message taken like this costs a third of one that an executor hands to a callback, and is taken at the moment that the
motion needs it. rclpy has no public way for it, so this one file uses what its own executors use: ``take_message`` of a
subscription's handle, ``EventHandle`` of rclpy.impl.implementation_singleton and the callback groups of its executors.
Tried with rclpy 7.1.6 (Jazzy); test/ros/test_command_queue.py says when a release breaks it.

Lost messages show in the gaps of sequence numbers. Numbers are each publisher's own, and a message doesn't say whose it
is. So a gap counts only where every number since the last one is known to be of one publisher; with several nothing is
said but that some were lost, which the middleware tells when a writer's own queue was full before its messages were
fetched.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.subscription import Subscription

from . import qos

MANY = 2
"""Publishers where the middleware doesn't count them: gaps can't be told from several senders then."""


class ManualCallbackGroup(CallbackGroup):
    """A callback group whose entities no executor may serve."""

    def can_execute(self, entity: object) -> bool:  # noqa: ARG002 (rclpy calls it so)
        """Never."""
        return False

    def beginning_execution(self, entity: object) -> bool:  # noqa: ARG002 (rclpy calls it so)
        """Never."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Nothing began."""


class CommandQueue:
    """The messages of one topic below the node's name, as bytes.

    queue_full: how often a queue was found full, here or at a sender. sequence_gaps: messages that were sent and never
    arrived, as far as that can be known.
    """

    def __init__(self, node: Node, message_type: type, topic: str, group: CallbackGroup) -> None:
        self.message_type = message_type
        self.queue_full = 0
        self.sequence_gaps = 0
        self._subscription = node.create_subscription(
            message_type,
            f"~/{topic}",
            _ignore,
            qos.own(qos.COMMAND),
            callback_group=group,
            raw=True,
            qos_overriding_options=qos.OVERRIDABLE,
        )
        self._depth = self._subscription.qos_profile.depth
        self._logger = node.get_logger()
        self._incompatible = _event(
            self._subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS
        )
        self._gaps = SequenceGaps(self._subscription)

    def take(self, note_publishers: bool) -> Iterator[bytes]:
        """What has arrived, message by message; at most as many as a queue holds, so that a flood can't hold up the
        motion for ever. note_publishers: look who publishes here, if nothing has arrived.
        """
        handle = self._subscription.handle
        with handle:
            for count in range(qos.COMMAND_DEPTH):
                taken = handle.take_message(self.message_type, True)
                if taken is None:
                    if note_publishers:
                        self._warn_of_incompatible_publishers()
                    if (note_publishers or count) and self._gaps.emptied():
                        self.queue_full += 1
                    return
                if count == self._depth - 1:
                    self.queue_full += 1
                data, information = taken
                self.sequence_gaps += self._gaps.before(information.get("publication_sequence_number"))
                yield data

    def _warn_of_incompatible_publishers(self) -> None:
        """As rclpy does for a subscription that an executor serves."""
        status = _taken(self._incompatible)
        if status is not None and status.total_count_change > 0:
            policy = qos_policy_name_from_kind(status.last_policy_kind)
            self._logger.warning(
                f"a publisher on {self._subscription.topic_name} offers incompatible QoS (last policy: {policy}): "
                "none of its messages will be received; commands have to be reliable"
            )


def _ignore(message: object) -> None:
    """Called by nobody."""


Request = tuple[Any, Any]
"""A request as the middleware gives it: the message, and what says whose it is."""


class RequestQueue:
    """The requests to a service below the node's name, taken and answered outside any executor."""

    def __init__(self, node: Node, service_type: Any, name: str, group: CallbackGroup) -> None:
        self._request_type = service_type.Request
        self._service = node.create_service(service_type, f"~/{name}", _ignore_request, callback_group=group)

    def take(self) -> Request | None:
        """The next request, or None."""
        handle = self._service.handle
        with handle:
            request, header = handle.service_take_request(self._request_type)
        return None if header is None else (request, header)

    def answer(self, request: Request, response: Any) -> None:
        """Answer one that was taken."""
        self._service.send_response(response, request[1])


def _ignore_request(request: object, response: Any) -> Any:  # noqa: ARG001 (rclpy calls it so)
    """Called by nobody."""
    return response


class SequenceGaps:
    """Counts for one subscription: ``before`` for each message, ``emptied`` when none is left."""

    def __init__(self, subscription: Subscription) -> None:
        # Taken here too: an executor would tell of a publisher after its messages.
        self._matched = _event(subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED)
        self._lost = _event(subscription, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST)
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
        """The queue is empty: what comes from now on is from those who are there now. Returns whether the middleware
        has told of lost messages since the last time.
        """
        ever, present = self._publishers()
        if ever > 1 and not (self._one_alone and ever == self._ever):
            self._last = None
        self._ever, self._one_alone = ever, present == 1
        status = _taken(self._lost)
        return status is not None and status.total_count_change > 0

    def _publishers(self) -> tuple[int, int]:
        """How many there have ever been, and how many there are."""
        status = _taken(self._matched)
        if status is None:
            return MANY, MANY
        return status.total_count, status.current_count


def _event(subscription: Subscription, kind: QoSSubscriptionEventType) -> Any:
    """The event of a subscription; None where the middleware doesn't know it."""
    with subscription.handle:
        try:
            return rclpy_implementation.EventHandle(subscription.handle, kind)
        except UnsupportedEventTypeError:
            return None


def _taken(event: Any) -> Any:
    if event is None:
        return None
    with event:
        return event.take_event()
