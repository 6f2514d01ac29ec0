# SPDX-License-Identifier: MIT
"""A ROS domain that no other test session or benchmark on this machine holds, whichever checkout it runs from."""

from __future__ import annotations

import os
import socket


def hold_domain() -> tuple[int, socket.socket]:
    """The domain, in 1..101, and the lock that holds it until it is closed. Raises RuntimeError when all are held.

    An abstract socket is the lock: the kernel frees it with the process, so a crash leaves nothing behind.
    """
    for k in range(101):
        domain = 1 + (os.getpid() + k) % 101
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            lock.bind(f"\0rigid_proto_ros.domain.{domain}")
        except OSError:
            lock.close()
            continue
        return domain, lock
    raise RuntimeError("all ROS domains 1..101 are held by others")
