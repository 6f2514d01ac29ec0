# SPDX-License-Identifier: MIT
"""Locks of ROS domains on this machine, since all nodes of a domain receive each other's messages."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterable

DOMAINS = range(102)
"""Domains whose ports lie below Linux's ephemeral ports (docs.ros.org, "The ROS_DOMAIN_ID")."""


def hold_domain(domains: Iterable[int]) -> tuple[int, socket.socket] | None:
    """The first free domain and its lock, which holds the domain until it is closed; None if none is free, or without
    Linux.

    The lock is an abstract socket, which only Linux has: the kernel frees it when the process ends, even by a crash.
    """
    if not sys.platform.startswith("linux"):
        return None
    for domain in domains:
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            lock.bind(f"\0rigid_proto_ros.domain.{domain}")
        except OSError:
            lock.close()
        else:
            return domain, lock
    return None


def hold_own_domain() -> socket.socket | None:
    """The lock of this process's domain, or None if another process holds it."""
    number = os.environ.get("ROS_DOMAIN_ID") or "0"
    held = hold_domain([int(number)]) if number.isdecimal() else None
    return None if held is None else held[1]
