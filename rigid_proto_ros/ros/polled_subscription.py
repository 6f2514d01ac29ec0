# SPDX-License-Identifier: MIT
"""Subscriptions whose messages are taken from the middleware's queue by whoever wants them, and by no executor."""

from __future__ import annotations

from rclpy.callback_groups import CallbackGroup


class TakenByHand(CallbackGroup):
    """A callback group whose entities no executor may serve."""

    def can_execute(self, entity) -> bool:
        return False

    def beginning_execution(self, entity) -> bool:
        return False

    def ending_execution(self, entity) -> None:
        pass
