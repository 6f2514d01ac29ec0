# SPDX-License-Identifier: MIT
"""A command topic whose messages the physics thread takes from the middleware's queue itself, and a service whose
requests it takes likewise.

A message taken like this costs a third of one that an executor hands to a callback, and is taken at the moment that the
motion needs it. rclpy has no public way for it, so this one file uses what its own executors use: ``take_message`` of a
subscription's handle, ``service_take_request`` of a service's, and the callback groups of its executors. Tried with
rclpy 7.1.6 (Jazzy).

Lost messages are counted by the middleware, which tells the executor of them in the public way: those that a sender had
to drop before they were fetched. What this side's own queue drops when it is full nobody counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import qos_policy_name_from_kind
from rclpy.waitable import Waitable

from . import qos


class ManualCallbackGroup(CallbackGroup):
    """A callback group of whose entities an executor serves the events alone."""

    def can_execute(self, entity: object) -> bool:
        """Whether it is an event."""
        return isinstance(entity, Waitable)

    def beginning_execution(self, entity: object) -> bool:
        """Whether it is an event."""
        return isinstance(entity, Waitable)

    def ending_execution(self, entity: object) -> None:
        """Nothing is held."""


class CommandQueue:
    """The messages of one topic below the node's name, as bytes.

    queue_full: how often the queue was found full, so that messages may have been dropped here, nobody knows how many.
    messages_lost: how many the middleware has said that their senders dropped.
    """

    def __init__(self, node: Node, message_type: type, topic: str, group: CallbackGroup) -> None:
        self.message_type = message_type
        self.queue_full = 0
        self.messages_lost = 0
        self._subscription = node.create_subscription(
            message_type,
            f"~/{topic}",
            _ignore,
            qos.own(qos.COMMAND),
            callback_group=group,
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=self._on_lost, incompatible_qos=self._on_incompatible
            ),
            raw=True,
            qos_overriding_options=qos.OVERRIDABLE,
        )
        self._depth = self._subscription.qos_profile.depth
        self._logger = node.get_logger()

    def take(self) -> Iterator[bytes]:
        """What has arrived, message by message; at most as many as a queue holds, so that a flood can't hold up the
        motion for ever.
        """
        handle = self._subscription.handle
        with handle:
            for count in range(qos.COMMAND_DEPTH):
                taken = handle.take_message(self.message_type, True)
                if taken is None:
                    return
                if count == self._depth - 1:
                    self.queue_full += 1
                yield taken[0]

    def _on_lost(self, status: Any) -> None:
        self.messages_lost = status.total_count

    def _on_incompatible(self, status: Any) -> None:
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
