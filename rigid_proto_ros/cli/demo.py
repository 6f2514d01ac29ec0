# SPDX-License-Identifier: MIT
"""``rigid_proto demo``: node, scripted pokes and a recording in one go; what ``make run`` runs.

Two real processes, rigid_body_node and poke_client, talk over ROS 2; this one starts them, waits, and ends them.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from ..base.errors import InputError

FLIGHT_S = 10.0
OUT = Path("out")


EXAMPLES = (
    ("rigid_proto demo", "the bundled T-handle, poked, 10 s"),
    ("rigid_proto demo --mesh part.obj --duration 20", "your own mesh, 20 s"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("--mesh", metavar="PATH", help="simulate this mesh instead of the bundled T-handle")
    parser.add_argument(
        "--out", type=Path, default=OUT, metavar="FOLDER", help="folder for the recording (default out)"
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=FLIGHT_S,
        metavar="S",
        help="simulated seconds, or to 0.5 s after the last poke (default 10)",
    )


def run(args: argparse.Namespace) -> int:
    """Fly, and say what happened."""
    from ..base.bundled import example_path, scene_path
    from ..scene.offline import read_scene
    from ..scene.script import read_script
    from .processes import Processes, own_executable, text_parameter

    if not 3.0 <= args.duration <= 3600.0:
        raise InputError("--duration", args.duration, "seconds from 3 to 3600")
    args.out.mkdir(parents=True, exist_ok=True)
    session = args.out / "session.rrd"
    if args.mesh:
        from .demo_scene import write_demo

        scene, script = write_demo(args.mesh, args.out)
    else:
        scene, script = scene_path("t_handle"), example_path("flip_and_poke")
    scenario = read_scene(str(scene))
    session.unlink(missing_ok=True)
    print(f"1. rigid_body_node: {scenario.parameters.mesh}, {scenario.setup.body.mass:.6g} kg", flush=True)
    # The last command has its time to act, and to be confirmed.
    until_s = max(args.duration, read_script(script)[-1].t_ns * 1e-9 + 0.5)
    with Processes() as processes:
        node = processes.start(
            [*own_executable("rigid_body_node"), "--until", repr(until_s), "--ros-args", "--params-file", str(scene)]
            + [*text_parameter("record", str(session.resolve())), "-p", "start_paused:=true"]
        )
        print(f"2. poke_client --reset {script}", flush=True)
        client = processes.start([*own_executable("poke_client"), str(script), "--reset", "--timeout", "0"])
        print(f"3. simulating to {until_s:g} s, recorded for Rerun", flush=True)
        status = _wait_for_flight(node, client)
        if status != 0:
            print(f"rigid_proto demo: poke_client ended with status {status}", file=sys.stderr)
            return 1
        node_status = node.wait()
    if node_status != 0:
        print(f"rigid_proto demo: rigid_body_node ended with status {node_status}", file=sys.stderr)
        return 1
    return _report(session)


def _wait_for_flight(node: subprocess.Popen, client: subprocess.Popen) -> int:
    """Return when the node has come to the end, or its client to a bad one: the client's status, 0 while it goes on."""
    start = time.monotonic()
    while node.poll() is None and not client.poll():
        if sys.stdout.isatty():
            print(f"\r   {time.monotonic() - start:4.1f} s", end="", flush=True)
        time.sleep(0.05)
    if sys.stdout.isatty():
        print("\r\033[K", end="")
    return client.poll() or 0


def _report(session: Path) -> int:
    """What happened, read back from the recording itself."""
    from ..motion.state import State
    from ..rerun_view.reader import read_session
    from ..session.replay import session_scenario

    recorded = read_session(session)
    if not len(recorded.times):
        print(f"rigid_proto demo: {session} contains no states", file=sys.stderr)
        return 1
    inertia = session_scenario(recorded).setup.body.inertia
    first, last = (State(int(recorded.times[k]), recorded.rows[k]) for k in (0, -1))
    print(f"   {len(recorded.times)} states and {len(recorded.events)} commands and services recorded")
    for name, state in (("start", first), ("end", last)):
        x, w = state.position, state.angular_velocity
        size = float((state.angular_momentum(inertia) ** 2).sum()) ** 0.5
        print(
            f"   {name:5s} at {state.time_ns / 1e9:7.3f} s: position ({x[0]:.4g}, {x[1]:.4g}, {x[2]:.4g}) m, "
            f"ω ({w[0]:.4g}, {w[1]:.4g}, {w[2]:.4g}) rad/s, |L| {size:.6g} kg m^2/s"
        )
    print(f"\n{session} is the recorded session. Show it with:\n   .venv/bin/rerun {session}")
    print(f"Simulate it again and compare every state bit for bit:\n   .venv/bin/rigid_proto replay {session} --verify")
    return 0
