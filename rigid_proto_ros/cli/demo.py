# SPDX-License-Identifier: MIT
"""``rigid_proto demo``: node, scripted pokes and a recording in one command; ``make run`` runs it.

Two processes, rigid_body_node and poke_client, communicate over ROS 2; this command starts them, waits, and ends them.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

from ..base.command_line import number_from
from ..base.errors import InputError
from ..base.interrupts import end_with_this_thread, with_this_package

GRACE_S = 5.0
"""Time from SIGTERM to SIGKILL for a process that doesn't end [s]."""

CONFIRM_S = 2.0
"""Least time that the node runs after the last command [s]: the client waits for its confirmation."""

OUT = Path("out")

SPIN = 4.0
"""Spin about the intermediate axis [rad/s]: one or two flips in ten seconds for most bodies."""

DRIFT = 0.12
"""Speed that the push at the COM gives [body diagonals per second]: the body stays in the picture."""

EXAMPLES = (
    ("rigid_proto demo", "the bundled T-handle, poked, 10 s"),
    ("rigid_proto demo part.obj --duration 20", "your own mesh, 20 s"),
    ("rigid_proto demo hammer", "another scene, with pushes of its size"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument(
        "scene", metavar="SCENE", nargs="?", help="scene file, mesh or bundled name (default: t_handle and its script)"
    )
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh")
    parser.add_argument(
        "--duration",
        type=number_from(3.0, 3600.0),
        default=10.0,
        metavar="S",
        help="simulated seconds, or until 2 s after the last poke if that is later (default 10)",
    )


def run(args: argparse.Namespace) -> int:
    """Run node and client and print a summary of the recording."""
    from ..base.bundled import example_path, scene_path
    from ..ros.domain import DOMAINS, hold_domain
    from ..scene.script import read_script
    from .executables import own_executable, text_parameter

    node_executable, client_executable = own_executable("rigid_body_node"), own_executable("poke_client")
    OUT.mkdir(exist_ok=True)
    session, view = OUT / "session.mcap", OUT / "session.rrd"
    named = args.mesh or args.scene
    scene, script = write_demo(named) if named else (scene_path("t_handle"), example_path("flip_and_poke"))
    for file in (session, view):
        file.unlink(missing_ok=True)
    # Time for the last command to act and to be confirmed.
    until_s = max(args.duration, read_script(script)[-1].stamp_ns * 1e-9 + CONFIRM_S)
    print(f"rigid_body_node with {scene}, poke_client with {script}: {until_s:g} s", flush=True)
    with contextlib.ExitStack() as processes:
        environment = with_this_package()
        # A separate ROS domain keeps this demo's pokes from other nodes, and those of others from this one.
        held = None if os.environ.get("ROS_DOMAIN_ID") else hold_domain(DOMAINS)
        if held is not None:
            environment["ROS_DOMAIN_ID"] = str(held[0])
            processes.enter_context(held[1])
            if held[0]:
                print(f"domain 0 is in use; this one is in ROS_DOMAIN_ID={held[0]}", flush=True)
        node = _start(
            [*node_executable, "--until", repr(until_s), "--ros-args", "--params-file", str(scene)]
            + [*text_parameter("record", f"{session.resolve()},{view.resolve()}"), "-p", "start_paused:=true"],
            environment,
            processes,
        )
        client = _start([*client_executable, str(script), "--reset", "--timeout", "0"], environment, processes)
        while node.poll() is None and not client.poll():
            time.sleep(0.05)
        for name, process in (("poke_client", client), ("rigid_body_node", node)):
            if process.poll():
                print(f"rigid_proto demo: {name} ended with status {process.poll()}", file=sys.stderr)
                return 1
    return _report(session, view)


def _start(command: list[str], environment: dict[str, str], processes: contextlib.ExitStack) -> subprocess.Popen[bytes]:
    """Start a process that ends when ``processes`` is closed, also if a signal ends this command. The process has its
    own session, so a Ctrl-C in the terminal reaches only this command.
    """
    process = subprocess.Popen(command, start_new_session=True, preexec_fn=end_with_this_thread(), env=environment)
    processes.callback(_end, process)
    return process


def _end(process: subprocess.Popen[bytes]) -> None:
    """Send SIGTERM, which ends Python silently if it has no handler yet, and SIGKILL after GRACE_S."""
    process.terminate()
    try:
        process.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def write_demo(name: str) -> tuple[Path, Path]:
    """Write demo_pokes.yaml for a scene or a mesh, and for a mesh also demo_scene.yaml. Returns both paths.

    A mesh without a scene spins about an axis close to its intermediate principal axis. Pokes act at the COM and at the
    vertex farthest from the COM. Raises InputError for a body that can't be simulated.
    """
    import numpy as np

    from ..mesh.locate import resolve_mesh
    from ..scene.scenario import read_scene, scene_text
    from ..scene.scene_file import is_mesh, scene_file
    from ..scene.script import script_text

    alone = is_mesh(name)
    scenario = read_scene(name)
    body, surface = scenario.setup.body, scenario.setup.surface
    if surface is None:
        raise InputError("demo", name, "a mesh, or a scene that has one")
    used = np.unique(surface.triangles)  # without vertices that no triangle uses
    points = surface.vertices[used] - body.center_of_mass
    farthest = int(used[np.argmax((points * points).sum(axis=1))])
    diagonal = float(np.linalg.norm(surface.extent))
    spin = SPIN * (body.principal_axes[:, 1] + 0.02 * body.principal_axes[:, 0] + 0.02 * body.principal_axes[:, 2])
    push = body.mass * DRIFT * diagonal
    # In its 1 s this torque changes the spin by at most SPIN / 2, about the axis of the smallest moment.
    torque = 0.5 * SPIN * float(body.principal_moments[0])
    script = [
        {"t": 1.0, "at": "com", "impulse": [push, 0.0, 0.0]},
        {"t": 2.5, "at": {"vertex": farthest}, "push": 0.5 * push, "duration": 0.3},
        {"t": 4.0, "wrench": {"torque": [0.0, 0.0, torque], "axes": "body", "duration": 1.0}},
        {"t": 6.5, "at": "com", "impulse": [-push, 0.0, 0.3 * push]},
    ]
    scene, pokes = OUT / "demo_scene.yaml" if alone else scene_file(name), OUT / "demo_pokes.yaml"
    if alone:
        values = {"mesh": str(resolve_mesh(name).resolve()), "initial.angular_velocity": spin.tolist()}
        scene.write_text(scene_text(values), encoding="utf-8")
    pokes.write_text(script_text(script), encoding="utf-8")
    return scene, pokes


def _report(session: Path, view: Path) -> int:
    """Print a summary of the recording."""
    from ..session.bag import read_runs
    from .executables import as_typed

    recorded = read_runs(session)[-1]
    if not recorded.states.count:
        print(f"rigid_proto demo: {session} contains no states", file=sys.stderr)
        return 1
    print(f"{recorded.states.count} states and {len(recorded.events)} commands and services recorded")
    print(f"Show it:              {as_typed('rerun')} {view}")
    print(f"Check it bit for bit: {as_typed('rigid_proto')} replay {session} --verify")
    return 0
