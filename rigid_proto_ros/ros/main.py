# SPDX-License-Identifier: MIT
"""``rigid_body_node``: start the node and keep it until SIGINT or SIGTERM."""

from __future__ import annotations

import sys
import threading
import traceback

from ..base.compilation import told_when_compiling
from ..base.errors import InputError
from ..scene.parameters import PARAMETERS
from .shutdown import Ending, begin_closing, begin_teardown, leave


def main(argv: list[str] | None = None) -> int:
    """Run the node; returns 2 when the input was refused (one line on stderr), else ends the process: with 0 after a signal."""
    argv = sys.argv if argv is None else argv
    # Signals end the main thread's wait; the middleware must outlive the physics thread, so rclpy's handlers stay out.
    try:
        with Ending() as ending:
            status = _run(argv, ending)
    except InputError as error:
        print(f"rigid_body_node: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    return leave(status)


def _run(argv: list[str], ending: Ending) -> int:
    from .arguments import given_arguments, own_arguments
    from .bodies import read_bodies
    from .node_name import remapped_node_name

    bodies = read_bodies(own_arguments(argv).bodies)
    name = remapped_node_name(argv)
    given = given_arguments(argv, name, _warn)

    import rclpy
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from .node import RigidBodyNode
    from .parameter_server import given_parameters
    from .physics_thread import PhysicsThread
    from .warm_up import warm_up

    try:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy's own error types differ between versions
        raise InputError("ROS arguments", " ".join(argv[1:]), " ".join(str(error).split())) from None
    nodes: list[RigidBodyNode] = []
    executor = SingleThreadedExecutor()
    executor_thread = None
    crashed = threading.Event()

    def on_crash() -> None:
        crashed.set()
        ending.ask()

    physics, status = None, 1
    try:
        with told_when_compiling(_say_that_it_compiles):
            if bodies:
                for body_name, values in bodies.items():
                    # What the command line gives is for all of them, and comes after the files.
                    overrides = given_parameters({**values, **given})
                    nodes.append(RigidBodyNode(_make_viewer, body_name, parameter_overrides=overrides))
            else:
                nodes.append(RigidBodyNode(_make_viewer, parameter_overrides=given_parameters(given)))
            for node in nodes:
                node.states.pack_all(warm_up(node.flight.scenario.setup))
        physics = PhysicsThread([node.flight for node in nodes], on_crash)
        for node in nodes:
            node.thread = physics
            executor.add_node(node)

        def spin() -> None:
            while not ending.asked:
                try:
                    executor.spin()
                    break
                except ExternalShutdownException:
                    break
                except Exception:
                    # One request that fails by a fault of ours must not take the other services with it.
                    traceback.print_exc()
            ending.ask()

        executor_thread = threading.Thread(target=spin, name="executor", daemon=True)
        executor_thread.start()
        physics.start()
        for node in nodes:
            node.get_logger().info(f"{node.get_fully_qualified_name()} is simulating {_described(node)}")
        ending.wait()
        status = 1 if crashed.is_set() else 0
    finally:
        if physics is not None:
            begin_closing()
            physics.stop()
        for node in nodes:
            node.close()
        if physics is not None:
            begin_teardown(status)
        executor.shutdown(timeout_sec=0.5)
        if executor_thread is not None:
            executor_thread.join(timeout=0.5)
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return status


def _warn(warning: str) -> None:
    print(f"rigid_body_node: {warning}", file=sys.stderr)


def _make_viewer(scenario, node_name: str):
    """The live view, or None; Rerun is imported only when something is to be shown or recorded with it."""
    parameters = scenario.parameters
    if parameters.viewer == "none":
        return None
    from ..rerun_view import RerunObserver

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


def _asked_for(name: str, port: int) -> int | None:
    """None for a default port, which may move to the next free one."""
    return None if port == PARAMETERS[name].default else port


def _say_that_it_compiles() -> None:
    print("rigid_body_node: compiling kernels, at the first start only ...", file=sys.stderr)


def _described(node) -> str:
    scenario = node.flight.scenario
    mesh = scenario.parameters.mesh or "a body without a mesh"
    return f"{mesh}: {scenario.setup.body.mass:.6g} kg, integrator {scenario.setup.integrator.name}"


if __name__ == "__main__":
    sys.exit(main())
