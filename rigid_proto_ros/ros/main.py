# SPDX-License-Identifier: MIT
"""``rigid_body_node``: start the node and keep it until SIGINT or SIGTERM, or ``--until``.

The main thread waits for the end and does nothing else: what starts the node runs on a thread of its own, imports
included, since compiling kernels can take minutes and nothing interrupts it.
"""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.interrupts import leave
from ..live.shutdown import Shutdown, begin_closing, begin_teardown

if TYPE_CHECKING:
    from .node_process import NodeProcess

LAST_START_S = 0.2
"""How long a start that is nearly done is waited for at the end; one that compiles is left alone."""


def main(argv: list[str] | None = None, as_job: bool = False) -> int:
    """Run the node; returns 2 when the input was refused (one line on stderr), else ends the process: after a signal
    with 0, since launch reports any other status as a death, or as a job's with 128 + its number.
    """
    try:
        with Shutdown() as shutdown:
            start = _Start(sys.argv if argv is None else argv, shutdown)
            start.start()
            number = shutdown.wait()
            status = start.end()
            if as_job and number:
                status = status or 128 + number
            leave(status)
    except InputError as error:
        print(f"rigid_body_node: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


class _Start(threading.Thread):
    """Starts the node that the arguments ask for; should that fail, it requests the shutdown."""

    def __init__(self, argv: list[str], shutdown: Shutdown) -> None:
        super().__init__(name="start", daemon=True)
        self._argv = argv
        self._shutdown = shutdown
        self._process: NodeProcess | None = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """On the thread."""
        try:
            from .arguments import given_arguments, own_arguments, remapped_node_name

            # First, since it says better than ROS what is wrong with a parameter.
            given = given_arguments(self._argv, remapped_node_name(self._argv), _warn)
            own = own_arguments(self._argv)
            from .node_process import NodeProcess

            self._process = NodeProcess(self._argv, given, self._shutdown.request, own.until)
            self._process.start()
        except BaseException as error:  # raised again by the main thread
            self._error = error
            self._shutdown.request()

    def end(self) -> int:
        """On the main thread, when the shutdown was requested: close what there is. Returns the exit status, or raises
        what the start has raised.
        """
        self.join(LAST_START_S)
        if self._error is not None:
            if self._process is not None:
                self._process.close()
                self._process.leave_ros()
            raise self._error
        begin_closing()
        status = 0 if self._process is None else self._process.close()
        if not self.is_alive() and self._process is not None:
            begin_teardown(status)
            self._process.leave_ros()
        return status


def _warn(warning: str) -> None:
    print(f"rigid_body_node: {warning}", file=sys.stderr)
