# SPDX-License-Identifier: MIT
"""The page's process: ``python -m rigid_proto_ros.workbench.main --node NAME --port PORT``, until SIGINT or SIGTERM."""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
import webbrowser

from ..base.errors import InputError
from ..live.shutdown import Shutdown
from ..rerun_view.ports import LOOPBACK
from ..rerun_view.viewers import has_display

PATIENCE_S = 10.0
"""[s] For a node that is said to be running: discovery takes less than one of them."""

LAST_MESSAGE_S = 0.2
"""[s] For the last message to reach the browsers."""


def main(argv: list[str] | None = None) -> int:
    """Serve the page; returns 0 after a signal, 2 when the input was refused (one line on stderr)."""
    parser = argparse.ArgumentParser(prog="workbench page")
    parser.add_argument("--node", default="/rigid_body")
    parser.add_argument("--running", action="store_true", help="the node has to be running already")
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--host", default=LOOPBACK)
    parser.add_argument("--open", action="store_true")
    parser.add_argument("--anew", action="store_true", help="start simulating when the first browser has connected")
    parser.add_argument("--lesson", default="")
    parser.add_argument("--link", default="")
    args = parser.parse_args(argv)
    try:
        with Shutdown() as shutdown:
            return serve(args, shutdown)
    except InputError as error:
        print(f"rigid_proto workbench: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


def serve(args: argparse.Namespace, shutdown: Shutdown) -> int:
    """Run the page until its end is asked for; open it in a browser where there is a display."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from .page import Page
    from .ros_link import full_name
    from .server import make_server, stop_server

    full_name(args.node)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    address = f"http://{args.host}:{args.port}"
    pages: list[Page] = []

    def on_link(link: str) -> None:
        for page in pages:
            page.deliver(page.follow_link, link)

    server = make_server(args.host, args.port, on_link)
    page = Page(server, args.node, address, args.lesson, args.anew)
    pages.append(page)
    running = asyncio.run_coroutine_threadsafe(page.run(), server.get_event_loop())
    try:
        if args.running:
            page.link.wait_for_node(PATIENCE_S, lambda: shutdown.requested)
        if args.link:
            page.deliver(page.follow_link, args.link)
        print(f"The workbench is at {address}   (Ctrl-C ends it)", flush=True)
        if args.open and has_display():
            webbrowser.open(address)
        shutdown.wait()
    finally:
        running.cancel()
        page.deliver(page.show_ended)
        time.sleep(LAST_MESSAGE_S)
        stop_server(server)
        page.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
