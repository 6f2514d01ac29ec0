# SPDX-License-Identifier: MIT
"""TCP ports on the loopback interface."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from typing import TypeVar

from ..base.errors import InputError
from ..base.ports import LOOPBACK, PORTS_TRIED, ports_to_try

_Served = TypeVar("_Served")


def is_free(port: int) -> bool:
    """Whether a server could listen on this loopback port now."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        # As servers do, so that a port whose last connection is in TIME_WAIT counts as free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True


class PortTakenError(OSError):
    """Another process took the port between the check and the server's own attempt."""


def serve_on_port(field: str, asked: int | None, default: int, serve: Callable[[int], _Served]) -> _Served:
    """The result of serve(port) for the port ``asked``, or for the first free port from ``default`` on.

    serve(port) raises PortTakenError if another process was faster. Raises InputError if ``asked`` is taken, or if no
    port near the default is free.
    """
    for port in ports_to_try(field, asked, default):
        if is_free(port):
            try:
                return serve(port)
            except PortTakenError:
                continue
    if asked is not None:
        raise InputError(field, asked, f"a port on {LOOPBACK} that no other program listens on")
    raise InputError(field, default, f"one of the {PORTS_TRIED} ports from {default} on to be free on {LOOPBACK}")


def listens(process_id: int, port: int) -> bool:
    """Whether the process listens on an IPv4 port; without /proc, whether any process does."""
    if not os.path.isfile("/proc/net/tcp"):
        return not is_free(port)
    with open("/proc/net/tcp", encoding="ascii") as table:
        rows = [line.split() for line in table][1:]
    # Columns 1, 3 and 9: local address, state (0A is listening), and the socket's inode.
    sockets = {f"socket:[{row[9]}]" for row in rows if row[3] == "0A" and int(row[1].partition(":")[2], 16) == port}
    folder = f"/proc/{process_id}/fd"
    try:
        return any(os.readlink(f"{folder}/{name}") in sockets for name in os.listdir(folder))
    except OSError:
        return False  # the process has ended or closed a file meanwhile
