# SPDX-License-Identifier: MIT
"""The page of a body that flies in this process: served, shown and ended."""

from __future__ import annotations

import asyncio
import sys
import webbrowser
from collections.abc import Callable

import viser

from ..base.bundled import scene_names
from ..live.live_simulation import LiveSimulation
from ..parameters.declarations import Parameters
from ..rerun_view.ports import LOOPBACK
from ..rerun_view.viewers import has_display
from ..scene.scenario import Scenario
from .page import Page
from .server import make_server, stop_server

TITLE = "rigid_proto workbench"

TURN_S = 2e-4
"""[s] Python's own 5 ms are longer than the period of a body that is published at 1 kHz."""


class Workbench:
    """Serves the page of one body until ``close``. port: the one asked for, None for the first free one from the
    default on. lesson, anew: as Page has them. server: one that serves already.

    Raises InputError naming ``--host`` or ``--port`` where nothing can listen there.
    """

    def __init__(
        self,
        live: LiveSimulation,
        port: int | None = None,
        host: str = LOOPBACK,
        lesson: str = "",
        anew: bool = False,
        server: viser.ViserServer | None = None,
    ) -> None:
        # The physics thread shares the interpreter with the page: it waits this long for its turn at most.
        sys.setswitchinterval(TURN_S)
        title = TITLE if live.name == "rigid_body" else f"{TITLE} {live.name}"
        self._server = server or make_server(title, host, port, Parameters().workbench_port)
        self.address = address_of(self._server)
        self.page = Page(self._server, live, lesson, anew)
        self._running = asyncio.run_coroutine_threadsafe(self.page.run(), self._server.get_event_loop())

    def close(self) -> None:
        """End the pages."""
        self._running.cancel()
        stop_server(self._server)
        self.page.close()


def address_of(server: viser.ViserServer) -> str:
    """Where a browser finds it."""
    host = server.get_host()
    return f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"


def serve(
    read: Callable[[], Scenario],
    scene: str,
    port: int | None,
    host: str,
    opens: bool,
    wait: Callable[[], object],
) -> None:
    """Fly a scenario with its page until ``wait`` returns or raises. read(): the scenario. scene: its name; one of a
    lesson begins with its question.

    Raises InputError as Workbench does, and as ``read`` does.
    """
    server = make_server(TITLE, host, port, Parameters().workbench_port)
    told: list[str] = []

    def tell() -> None:
        if not told:
            told.append(address_of(server))
            print(f"The workbench is at {told[0]}   (Ctrl-C ends it)", flush=True)
            if opens and has_display():
                webbrowser.open(told[0])

    try:
        live = LiveSimulation(read())
    except BaseException:
        stop_server(server)
        raise
    workbench = Workbench(live, lesson=scene if scene in scene_names() else "", anew=True, server=server)
    try:
        tell()
        live.announce()
        live.start()
        wait()
    finally:
        workbench.close()
        live.stop()
