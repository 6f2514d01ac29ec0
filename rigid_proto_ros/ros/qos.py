# SPDX-License-Identifier: MIT
"""Quality of service (QoS) of the node's topics, which users may override by parameter."""

from __future__ import annotations

from copy import copy

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QosCallbackResult, QoSOverridingOptions

from ..session.messages import EVENT_DEPTH, STATE_DEPTH

COMMAND_DEPTH = 5000
"""Commands queued until they are taken; the limit of Fast DDS's history."""

LARGEST_DEPTH = 2**31 - 1

STATE = QoSProfile(depth=STATE_DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
COMMAND = QoSProfile(depth=COMMAND_DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    depth=1,
    history=HistoryPolicy.KEEP_LAST,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

EVENT = QoSProfile(depth=EVENT_DEPTH, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
CLOCK = QoSProfile(depth=1, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT)
TF = QoSProfile(depth=100, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)


def _check(profile: QoSProfile) -> QosCallbackResult:
    """Whether the middleware accepts an overridden profile; it gives no reason itself."""
    reason = f"depth: got {profile.depth}; accepted: 0 to {LARGEST_DEPTH}"
    return QosCallbackResult(successful=0 <= profile.depth <= LARGEST_DEPTH, reason=reason)


OVERRIDABLE = QoSOverridingOptions.with_default_policies(callback=_check)


def own(profile: QoSProfile) -> QoSProfile:
    """A copy for one topic, because rclpy writes overridden values into the profile that it is given."""
    return copy(profile)
