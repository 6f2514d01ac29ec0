# SPDX-License-Identifier: MIT
"""ROS domains, each held by one user of this machine at a time: all nodes of a domain hear what one of them says."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterable

DOMAINS = range(102)
"""Domains whose ports lie below those that Linux gives to anybody (docs.ros.org, "The ROS_DOMAIN_ID")."""


def hold_domain(domains: Iterable[int]) -> tuple[int, socket.socket] | None:
    """The first of the domains that nobody here holds, and the lock that holds it until it is closed; None without one.

    An abstract socket is the lock, which Linux alone has: the kernel frees it with the process, so that a crash leaves
    nothing behind.
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
    """The lock of the domain that this process' nodes are in, unless somebody else holds it already."""
    number = os.environ.get("ROS_DOMAIN_ID") or "0"
    held = hold_domain([int(number)]) if number.isdecimal() else None
    return None if held is None else held[1]
