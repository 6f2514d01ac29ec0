# SPDX-License-Identifier: MIT
"""``rigid_body_node``: start the node and keep it until SIGINT or SIGTERM, or ``--until``.

The main thread waits for the end and does nothing else: what starts the node runs on a thread of its own, imports
included, since compiling kernels can take minutes and nothing interrupts it.
"""

from __future__ import annotations

import importlib.util
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

from ..base.errors import InputError, is_missing, tell
from ..base.interrupts import Interrupt, leave
from ..live.shutdown import begin_closing, begin_teardown
from .domain import hold_own_domain

if TYPE_CHECKING:
    from rclpy.node import Node

    from ..scene.scenario import Scenario
    from ..simulation.observer import Observer
    from .node import RigidBodyNode

LOOK_S = 1.0
"""Between looks of the main thread."""

LAST_START_S = 0.2
"""How long shutdown waits for a start that is nearly complete; a start that compiles isn't waited for."""


def main(argv: list[str] | None = None, as_job: bool = False) -> int:
    """Run the node; returns 2 when the input was refused (one line on stderr), else ends the process: after a signal
    with 0, since launch reports any other status as a death, or as a job's with 128 + its number.
    """
    try:
        ended = threading.Event()
        process = NodeProcess(sys.argv if argv is None else argv, ended.set)
        process.start()
        interrupt = Interrupt()
        with suppress(KeyboardInterrupt):
            # A signal that the system delivers to another thread is noticed at the next turn.
            while not ended.wait(LOOK_S):
                pass
        status = process.end()
        if as_job and interrupt.number:
            status = status or 128 + interrupt.number
        leave(status)
    except Exception as error:
        return tell("rigid_body_node", error)


class NodeProcess(threading.Thread):
    """The thread that starts the node which the arguments ask for, and what has to be closed at the end.

    request_end() is called when the process should end by itself: after a fault, or when simulated time has come to
    ``--until``.
    """

    def __init__(self, argv: list[str], request_end: Callable[[], None]) -> None:
        super().__init__(name="start", daemon=True)
        self._argv = argv
        self._request_end = request_end
        self._error: BaseException | None = None
        # Held until this process ends: what `rigid_proto demo` says to its own node is then said elsewhere.
        self._domain = hold_own_domain()
        self._crashed = self._ending = False
        self._node: RigidBodyNode | None = None
        self._viewer: Observer | None = None
        self._close_page: Callable[[], None] = lambda: None
        self._leave_executor: Callable[[], None] = lambda: None

    def run(self) -> None:
        """On the thread."""
        try:
            from .arguments import given_arguments, own_arguments, remapped_node_name

            # First, since it says better than ROS what is wrong with a parameter.
            given = given_arguments(self._argv, remapped_node_name(self._argv), _tell)
            self._begin(given, own_arguments(self._argv).until)
        except BaseException as error:  # raised again by the main thread
            if not self._ending:  # else what was closed refuses what is still asked of it
                self._error = error
            self._request_end()

    def _begin(self, given: Mapping[str, object], until_s: float | None) -> None:
        """Make the node and let it run. Raises InputError."""
        from rclpy.exceptions import ParameterException
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos_overriding_options import InvalidQosOverridesError

        from ..simulation.commands import nanoseconds
        from .arguments import begin_ros
        from .node import RigidBodyNode

        begin_ros(self._argv)
        try:
            node = self._node = RigidBodyNode(given, self._make_viewer)
        except (ParameterException, InvalidQosOverridesError, RuntimeError) as error:
            # rclpy's own parameters: its text says which, and what is accepted.
            if isinstance(error, RuntimeError) and "QoS override" not in str(error):
                raise
            raise InputError("ROS arguments", " ".join(str(error).split())) from None
        node.states.pack_all(node.live.loop)
        self._close_page = open_page(node)
        node.live.announce()
        if until_s is not None:
            node.live.loop.end_at(nanoseconds(until_s), self._request_end)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        executing = threading.Thread(target=self._spin, args=(executor.spin,), name="executor", daemon=True)
        executing.start()

        def leave_executor() -> None:
            executor.shutdown(timeout_sec=0.5)
            executing.join(timeout=0.5)

        self._leave_executor = leave_executor
        node.live.start(self._on_crash)
        scenario = node.live.scenario
        mesh, body = scenario.parameters.mesh or "a body without a mesh", scenario.setup.body
        node.get_logger().info(
            f"{node.get_fully_qualified_name()} is simulating {mesh}: {body.mass:.6g} kg, "
            f"integrator {scenario.setup.integrator.name}"
        )

    def _make_viewer(self, scenario: Scenario, node: Node) -> Observer | None:
        self._viewer = make_viewer(scenario, node)
        return self._viewer

    def _spin(self, spin: Callable[[], None]) -> None:
        from rclpy.executors import ExternalShutdownException

        while not self._ending:
            try:
                spin()
                break
            except ExternalShutdownException:
                break
            except Exception:
                # One request that fails by a fault of ours must not take the other services with it.
                traceback.print_exc()
        self._request_end()

    def _on_crash(self) -> None:
        self._crashed = True
        self._request_end()

    def end(self) -> int:
        """On the main thread, when the shutdown was requested: close what there is. Returns the exit status, or raises
        what the start has raised.
        """
        self.join(LAST_START_S)
        if self._error is None:
            begin_closing()
        self._ending = True
        self._close_page()
        if self._node is not None:
            self._node.live.stop()
        elif self._viewer is not None:
            # What the node was refused for came behind it.
            self._viewer.close()
        status = 1 if self._crashed else 0
        if self._error is None and not self.is_alive():
            begin_teardown(status)
        if not self.is_alive() and "rclpy" in sys.modules:
            self._leave_ros()
        if self._error is not None:
            raise self._error
        return status

    def _leave_ros(self) -> None:
        from rclpy.utilities import try_shutdown

        self._leave_executor()
        if self._node is not None:
            self._node.destroy_node()
        try_shutdown()


def make_viewer(scenario: Scenario, node: Node) -> Observer | None:
    """The live view, which says its addresses in the node's log, or None; Rerun is imported only when something is to
    be shown or recorded with it.
    """
    parameters = scenario.parameters
    viewer = parameters.viewer.partition(",")[0]
    if viewer in ("none", "workbench"):
        return None
    if importlib.util.find_spec("rerun") is None:
        raise InputError("viewer", is_missing("rerun-sdk", "rerun"))
    from ..rerun_view.live_view import LiveView

    return LiveView(
        viewer,
        rerun_port=_asked_for("rerun_port", parameters.rerun_port),
        web_port=_asked_for("web_port", parameters.web_port),
        name=node.get_name(),
        report=node.get_logger().info,
        on_error=node.get_logger().warning,
    )


def open_page(node: RigidBodyNode) -> Callable[[], None]:
    """The interactive page, where it is asked for; returns what closes it."""
    parameters = node.live.scenario.parameters
    if "workbench" not in parameters.viewer:
        return lambda: None
    if importlib.util.find_spec("websockets") is None:
        raise InputError("viewer", is_missing("websockets", "workbench"))
    from ..page.live_page import LivePage
    from ..page.server import show_code

    port, say = _asked_for("workbench_port", parameters.workbench_port), node.get_logger().warning
    try:
        page = LivePage(node.live, port, parameters.workbench_host, say)
    except InputError as error:
        # By the name that the node knows it by, which isn't the command's option.
        names = {"--port": "workbench_port", "--host": "workbench_host"}
        raise InputError(names.get(error.field, error.field), error.received, error.accepted) from None
    node.get_logger().info(f"the workbench is at {page.address}")
    if page.guests:
        node.get_logger().info(
            f"others watch at {page.guests}: one at a time drives, and your own page can take the hand and lock it; "
            "they can't read or write files"
        )
        show_code(page.guests)
    return page.close


def _asked_for(name: str, port: int) -> int | None:
    """None for a default port, which may move to the next free one."""
    from ..parameters.declarations import PARAMETERS

    return None if port == PARAMETERS[name].default else port


def _tell(line: str) -> None:
    print(f"rigid_body_node: {line}", file=sys.stderr)
