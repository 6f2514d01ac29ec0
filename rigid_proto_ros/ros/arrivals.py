# SPDX-License-Identifier: MIT
"""Messages and service requests that the physics thread takes directly from the middleware, and the wait for them.

Taking a message directly costs a third of an executor's callback, and happens exactly when the motion needs it. rclpy
has no public interface for this, so this file, and no other, uses what rclpy's executors use: ``take_message`` of a
subscription's handle, ``service_take_request`` of a service's handle, wait sets, and a callback group that excludes
executors. Tried with rclpy 7.1.6 (Jazzy). If one of them is missing or fails at the start, ordinary callbacks are used
instead, with a warning, since they cost more time.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import ExitStack
from typing import Any

from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.waitable import Waitable

from . import qos


class ManualCallbackGroup(CallbackGroup):
    """A callback group of which an executor serves only the events, not the messages and requests."""

    def can_execute(self, entity: object) -> bool:
        """Whether it is an event."""
        return isinstance(entity, Waitable)

    def beginning_execution(self, entity: object) -> bool:
        """Whether it is an event."""
        return isinstance(entity, Waitable)

    def ending_execution(self, entity: object) -> None:
        """Do nothing, since the group holds no lock."""


class Messages:
    """The messages of one subscription, as bytes, in order of arrival."""

    def __init__(self, message_type: type) -> None:
        self.message_type = message_type
        self.arrived: deque[bytes] = deque()
        self.subscription: Subscription | None = None

    @property
    def depth(self) -> int:
        """Capacity of the middleware's queue."""
        assert self.subscription is not None
        return int(self.subscription.qos_profile.depth)

    def take(self) -> Iterator[bytes]:
        """Yield the messages that have arrived, at most qos.COMMAND_DEPTH, so that a flood can't block the motion."""
        for _ in range(min(len(self.arrived), qos.COMMAND_DEPTH)):
            yield self.arrived.popleft()


class DirectMessages(Messages):
    """Messages taken directly from the middleware's queue."""

    def take(self) -> Iterator[bytes]:
        """See Messages."""
        assert self.subscription is not None
        handle = self.subscription.handle
        with handle:
            for _ in range(qos.COMMAND_DEPTH):
                taken = handle.take_message(self.message_type, True)
                if taken is None:
                    return
                yield taken[0]


class Requests:
    """The requests of one service; the caller that takes a request answers it."""

    def __init__(self, service_type: Any) -> None:
        self.service_type = service_type
        self.arrived: deque[Future[Any]] = deque()
        self.service: Service | None = None

    def take(self) -> Any:
        """The next request as ``answer`` needs it, or None."""
        return self.arrived.popleft() if self.arrived else None

    def answer(self, request: Any, response: Any) -> None:
        """Send the response to a taken request."""
        request.set_result(response)


class DirectRequests(Requests):
    """Requests taken directly from the middleware's queue."""

    def take(self) -> Any:
        """See Requests."""
        assert self.service is not None
        handle = self.service.handle
        with handle:
            return handle.service_take_request(self.service_type.Request)[1]

    def answer(self, request: Any, response: Any) -> None:
        """See Requests."""
        assert self.service is not None
        self.service.send_response(response, request)


class Arrivals:
    """The messages and requests that one node's physics thread takes. Create all subscriptions and services before the
    first ``wait``.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        reason = why_not_direct(node)
        self.direct = not reason
        if reason:
            node.get_logger().warning(f"commands come by callbacks, which costs time: this rclpy has {reason}")
        self._group = ManualCallbackGroup() if self.direct else MutuallyExclusiveCallbackGroup()
        self._woken = threading.Event()
        self._noted = False
        self._guard = GuardCondition(lambda: None, None, context=node.context)
        self._entities: list[Any] = []
        self._wait_set: Any = None

    def subscribe(
        self, message_type: type, topic: str, profile: QoSProfile, events: SubscriptionEventCallbacks
    ) -> Messages:
        """Subscribe to a topic in the node's private namespace; users may override its QoS."""
        messages = DirectMessages(message_type) if self.direct else Messages(message_type)

        def arrive(data: bytes) -> None:
            messages.arrived.append(data)
            self._woken.set()

        messages.subscription = self._node.create_subscription(
            message_type,
            f"~/{topic}",
            arrive,
            qos.own(profile),
            callback_group=self._group,
            event_callbacks=events,
            raw=True,
            qos_overriding_options=qos.OVERRIDABLE,
        )
        self._entities.append(messages.subscription)
        return messages

    def serve(self, service_type: Any, name: str) -> Requests:
        """Create a service in the node's private namespace."""
        requests = DirectRequests(service_type) if self.direct else Requests(service_type)

        def arrive(*_: Any) -> Any:
            # On the executor's thread, which is blocked until the answer.
            answer: Future[Any] = Future()
            requests.arrived.append(answer)
            self._woken.set()
            return answer.result()

        requests.service = self._node.create_service(service_type, f"~/{name}", arrive, callback_group=self._group)
        self._entities.append(requests.service)
        return requests

    def note(self) -> None:
        """End the wait and make it return true; may be called from any thread."""
        self._noted = True
        self.wake()

    def wake(self) -> None:
        """End the wait; may be called from any thread."""
        if self.direct:
            self._guard.trigger()
        else:
            self._woken.set()

    def wait(self, timeout_s: float) -> bool:
        """Wait until something arrives, ``wake`` is called or the timeout ends. Returns whether something may have
        arrived.
        """
        if not self.direct:
            woken = self._woken.wait(timeout_s)
            self._woken.clear()
            return woken
        with ExitStack() as held:
            for entity in (*self._entities, self._guard, self._node.context):
                held.enter_context(entity.handle)
            wait_set = self._filled_wait_set()
            wait_set.wait(max(0, int(timeout_s * 1e9)))
            noted, self._noted = self._noted, False
            return bool(noted or wait_set.get_ready_entities("subscription") or wait_set.get_ready_entities("service"))

    def _filled_wait_set(self) -> Any:
        services = [entity for entity in self._entities if isinstance(entity, Service)]
        subscriptions = [entity for entity in self._entities if isinstance(entity, Subscription)]
        if self._wait_set is None:
            counts = len(subscriptions), 1, 0, 0, len(services), 0
            self._wait_set = rclpy_implementation.WaitSet(*counts, self._node.context.handle)
        self._wait_set.clear_entities()
        for subscription in subscriptions:
            self._wait_set.add_subscription(subscription.handle)
        for service in services:
            self._wait_set.add_service(service.handle)
        self._wait_set.add_guard_condition(self._guard.handle)
        return self._wait_set


def why_not_direct(node: Node) -> str:
    """Why this rclpy can't be used directly: the missing private function, or wait sets that don't work; else empty."""
    for owner, name in (
        (rclpy_implementation.Subscription, "take_message"),
        (rclpy_implementation.Service, "service_take_request"),
    ):
        if not hasattr(owner, name):
            return f"no {name}"
    try:
        guard = GuardCondition(lambda: None, None, context=node.context)
        context: Any = node.context.handle
        with context, guard.handle:
            wait_set = rclpy_implementation.WaitSet(0, 1, 0, 0, 0, 0, context)
            wait_set.clear_entities()
            wait_set.add_guard_condition(guard.handle)
            guard.trigger()
            wait_set.wait(0)
            ended = wait_set.get_ready_entities("guard_condition")
        guard.destroy()
    except Exception as error:  # exception types differ between versions
        return f"other wait sets ({type(error).__name__}: {error})"
    return "" if ended else "wait sets that nothing wakes"
