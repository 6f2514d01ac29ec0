# SPDX-License-Identifier: MIT
"""The node of one process and the threads that it needs, from the arguments to the end."""

from __future__ import annotations

import importlib.util
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import rclpy
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from ..base.compilation import notify_when_compiling
from ..base.errors import InputError, is_missing
from ..live.warm_up import IntegratorsCompiling, warm_up
from ..scene.parameters import PARAMETERS
from ..scene.scenario import Scenario, nanoseconds
from ..simulation.observer import Observer
from .diagnostics import Reports
from .node import RigidBodyNode

if TYPE_CHECKING:
    from ..workbench.main import Workbench


class NodeProcess:
    """given: parameters by name, as files and ``-p`` give them. request_end() is called when the process should end by
    itself: after a fault, or when simulated time has come to until_s.
    """

    def __init__(
        self,
        argv: list[str],
        given: Mapping[str, object],
        request_end: Callable[[], None],
        until_s: float | None = None,
    ) -> None:
        self._argv = argv
        self._given = given
        self._request_end = request_end
        self._until_s = until_s
        self._ending = False
        self._crashed = False
        self._node: RigidBodyNode | None = None
        self._executor: Executor | None = None
        self._executing: threading.Thread | None = None
        self._reports: Reports | None = None
        self._page: Workbench | None = None

    def start(self) -> None:
        """Make the node, which may compile for minutes, and let it run. Raises InputError."""
        try:
            # The middleware must outlive the physics thread, so rclpy's own handlers of signals stay out.
            rclpy.init(args=self._argv, signal_handler_options=SignalHandlerOptions.NO)
        except Exception as error:  # rclpy's own error types differ between versions
            raise InputError("ROS arguments", " ".join(self._argv[1:]), " ".join(str(error).split())) from None
        integrators = IntegratorsCompiling()

        def begin_compiling() -> None:
            print("rigid_body_node: compiling kernels, at the first start only; up to a minute ...", file=sys.stderr)
            integrators.begin()

        with notify_when_compiling(begin_compiling):
            node = self._node = RigidBodyNode(self._given, _make_viewer)
            setup = node.live.scenario.setup
            integrators.wait(setup)
            node.states.pack_all(warm_up(setup))
        self._page = _make_page(node)
        if self._until_s is not None:
            node.live.loop.end_at(nanoseconds(self._until_s), self._request_end)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._executing = threading.Thread(target=self._spin, args=(self._executor,), name="executor", daemon=True)
        self._executing.start()
        self._reports = Reports(node.diagnostics)
        self._reports.start()
        node.live.start(self._on_crash)
        node.get_logger().info(f"{node.get_fully_qualified_name()} is simulating {_described(node.live.scenario)}")

    def _spin(self, executor: Executor) -> None:
        while not self._ending:
            try:
                executor.spin()
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

    def close(self) -> int:
        """End the motion and the recordings; returns the exit status that this makes."""
        self._ending = True
        if self._reports is not None:
            self._reports.stop()
        if self._page is not None:
            self._page.close()
        if self._node is not None:
            self._node.live.stop()
        return 1 if self._crashed else 0

    def leave_ros(self) -> None:
        """After ``close``, once ``start`` has returned or raised."""
        if self._executor is not None:
            self._executor.shutdown(timeout_sec=0.5)
        if self._executing is not None:
            self._executing.join(timeout=0.5)
        if self._node is not None:
            self._node.destroy_node()
        rclpy.try_shutdown()


def _make_viewer(scenario: Scenario, node_name: str) -> Observer | None:
    """The live view, or None; Rerun is imported only when something is to be shown or recorded with it."""
    parameters = scenario.parameters
    if parameters.viewer in ("none", "workbench"):
        return None
    from ..rerun_view.observer import RerunObserver

    def tell(line: str) -> None:
        print(f"{node_name}: {line}", file=sys.stderr)

    return RerunObserver(
        viewer=parameters.viewer,
        rerun_port=_asked_for("rerun_port", parameters.rerun_port),
        web_port=_asked_for("web_port", parameters.web_port),
        name=node_name,
        report=tell,
        on_error=tell,
    )


def _make_page(node: RigidBodyNode) -> Workbench | None:
    """The interactive page, where it is asked for."""
    parameters = node.live.scenario.parameters
    if parameters.viewer != "workbench":
        return None
    if importlib.util.find_spec("viser") is None:
        raise InputError("viewer", is_missing("viser", "workbench"))
    from ..workbench.main import Workbench

    page = Workbench(node.live, _asked_for("workbench_port", parameters.workbench_port))
    print(f"{node.get_name()}: the workbench is at {page.address}", file=sys.stderr)
    return page


def _asked_for(name: str, port: int) -> int | None:
    """None for a default port, which may move to the next free one."""
    return None if port == PARAMETERS[name].default else port


def _described(scenario: Scenario) -> str:
    mesh = scenario.parameters.mesh or "a body without a mesh"
    return f"{mesh}: {scenario.setup.body.mass:.6g} kg, integrator {scenario.setup.integrator.name}"
