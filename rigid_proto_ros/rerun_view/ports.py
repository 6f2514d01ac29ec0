# SPDX-License-Identifier: MIT
"""TCP ports on the loopback interface: nothing here listens beyond this machine."""

from __future__ import annotations

import socket

from ..base.errors import InputError

LOOPBACK = "127.0.0.1"
PORTS_TRIED = 64
"""How many ports above a taken default are tried before giving up."""


def is_free(port: int) -> bool:
    """Whether a server could listen on this loopback port now."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        # As servers set it: a port whose last connection is still in TIME_WAIT counts as free.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True


def choose_port(field: str, asked: int | None, default: int) -> int:
    """The port to serve on: ``asked`` if it is free, else the first free one from ``default`` on.

    Raises InputError where ``asked`` is given and taken, or no port near the default is free.
    """
    if asked is not None:
        if not 1 <= asked <= 65535:
            raise InputError(field, asked, "a TCP port, 1 to 65535")
        if not is_free(asked):
            raise InputError(field, asked, f"a port on {LOOPBACK} that no other program listens on")
        return asked
    for port in range(default, min(default + PORTS_TRIED, 65536)):
        if is_free(port):
            return port
    raise InputError(field, default, f"one of the {PORTS_TRIED} ports from {default} on to be free on {LOOPBACK}")


def any_free_port() -> int:
    """A loopback port that the system says is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind((LOOPBACK, 0))
        return probe.getsockname()[1]
