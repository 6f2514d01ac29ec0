# SPDX-License-Identifier: MIT
"""``rigid_body_node``: start the node and run it until SIGINT or SIGTERM, or ``--until``.

The main thread only waits for the end. A second thread starts the node, including its imports, because compiling
kernels can take minutes and can't be interrupted.
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
"""Polling period of the main thread [s]."""

LAST_START_S = 0.2
"""How long shutdown waits for the start thread [s]: enough for a start that is nearly complete, not for one that
compiles.
"""


def main(argv: list[str] | None = None, as_job: bool = False) -> int:
    """Run the node. Returns 2 if the input was refused (one line on stderr), otherwise exits the process: after a
    signal with 0, since launch reports any other status as a crash, or with 128 + signal number if as_job.
    """
    try:
        ended = threading.Event()
        process = NodeProcess(sys.argv if argv is None else argv, ended.set)
        process.start()
        interrupt = Interrupt()
        with suppress(KeyboardInterrupt):
            # A signal that the system delivers to another thread is handled at the next iteration.
            while not ended.wait(LOOK_S):
                pass
        status = process.end()
        if as_job and interrupt.number:
            status = status or 128 + interrupt.number
        leave(status)
    except Exception as error:
        return tell("rigid_body_node", error)


class NodeProcess(threading.Thread):
    """The thread that starts the node, and the owner of everything that must be closed at the end.

    request_end() is called when the process should end without a signal: after an error, or when simulated time has
    reached ``--until``.
    """

    def __init__(self, argv: list[str], request_end: Callable[[], None]) -> None:
        super().__init__(name="start", daemon=True)
        self._argv = argv
        self._request_end = request_end
        self._error: BaseException | None = None
        # Held until this process ends, so that `rigid_proto demo` uses another domain for its own node.
        self._domain = hold_own_domain()
        self._crashed = self._ending = False
        self._node: RigidBodyNode | None = None
        self._viewer: Observer | None = None
        self._close_page: Callable[[], None] = lambda: None
        self._leave_executor: Callable[[], None] = lambda: None

    def run(self) -> None:
        """Start the node, on this thread."""
        try:
            from .arguments import given_arguments, own_arguments, remapped_node_name

            # Before ROS parses the parameters, since its error messages are worse.
            given = given_arguments(self._argv, remapped_node_name(self._argv), _warn)
            self._begin(given, own_arguments(self._argv).until)
        except BaseException as error:  # raised again by the main thread
            if not self._ending:  # else a closed object has refused a late call
                self._error = error
            self._request_end()

    def _begin(self, given: Mapping[str, object], until_s: float | None) -> None:
        """Create the node and start it. Raises InputError."""
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
            # Parameters of rclpy itself: its message names the parameter and the accepted values.
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
                # An exception in one callback must not stop the other services.
                traceback.print_exc()
        self._request_end()

    def _on_crash(self) -> None:
        self._crashed = True
        self._request_end()

    def end(self) -> int:
        """Close everything, on the main thread, after shutdown was requested. Returns the exit status, or raises the
        exception of the start thread.
        """
        self.join(LAST_START_S)
        if self._error is None:
            begin_closing()
        self._ending = True
        self._close_page()
        if self._node is not None:
            self._node.live.stop()
        elif self._viewer is not None:
            # The node was refused after its viewer had been created.
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
    """The live view, which logs its addresses to the node's log, or None. Rerun is imported only if it is used."""
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
    """Serve the interactive page if the parameter ``viewer`` asks for it; returns the function that closes it."""
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
        # Name the node's parameter instead of the command-line option.
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


def _warn(line: str) -> None:
    print(f"rigid_body_node: {line}", file=sys.stderr)
