# SPDX-License-Identifier: MIT
"""Whether the page can be served on an address, asked before anything starts.

viser goes on to other ports by itself; for an address that isn't this machine's it does so for ever.
"""

from __future__ import annotations

import asyncio
import errno

from ..base.errors import InputError
from ..rerun_view.ports import PORTS_TRIED

_THE_PORTS_FAULT = (errno.EADDRINUSE, errno.EACCES)
"""Taken, or one that only root may listen on; anything else is wrong with the host."""


def check_address(host: str, port: int) -> None:
    """Whether a server could listen there now. Raises InputError naming ``--host`` or ``--port``."""
    error = _bind(host, port)
    if error is not None:
        raise _refusal(host, port, error)


def choose_page_port(host: str, asked: int | None, default: int) -> int:
    """The port to serve on: ``asked`` if it is free, else the first free one from ``default`` on.

    Raises InputError where the host isn't one to listen on, ``asked`` is given and taken, or no port near the default
    is free.
    """
    if asked is not None:
        if not 1 <= asked <= 65535:
            raise InputError("--port", asked, "a TCP port, 1 to 65535")
        check_address(host, asked)
        return asked
    for port in range(default, min(default + PORTS_TRIED, 65536)):
        error = _bind(host, port)
        if error is None:
            return port
        if not _is_the_ports_fault(error):
            raise _refusal(host, port, error)
    raise InputError("--port", default, f"one of the {PORTS_TRIED} ports from {default} on to be free on {host}")


def _bind(host: str, port: int) -> Exception | None:
    """What stands in the way of listening there, asked as a server of asyncio binds: on all that a name stands for."""

    async def bound() -> None:
        server = await asyncio.get_running_loop().create_server(asyncio.Protocol, host, port, start_serving=False)
        server.close()
        await server.wait_closed()

    loop = asyncio.new_event_loop()
    try:
        loop.run_until_complete(bound())
    except (OSError, UnicodeError, ValueError) as error:  # no such address; no name at all
        return error
    finally:
        loop.close()
    return None


def _is_the_ports_fault(error: Exception) -> bool:
    return isinstance(error, OSError) and error.errno in _THE_PORTS_FAULT


def _refusal(host: str, port: int, error: Exception) -> InputError:
    if _is_the_ports_fault(error):
        return InputError("--port", port, f"a port on {host} that no other program listens on, above 1023")
    return InputError("--host", host, "an address of this machine, such as 127.0.0.1, or 0.0.0.0 for all of them")
