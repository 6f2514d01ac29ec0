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
from ..base.interrupts import end_with_this_thread, with_this_package
from .options import add_mesh

GRACE_S = 5.0
"""A process that doesn't end within this time of SIGTERM is killed."""

FLIGHT_S = 10.0
CONFIRM_S = 2.0
"""How long the node goes on at least after the last command: the client waits for its confirmation."""

OUT = Path("out")
CLEAR = "\r\033[K"
"""Takes back the line that a terminal shows."""

SPIN = 4.0
"""rad/s about the middle axis: a flip or two in ten seconds for most bodies."""

DRIFT = 0.12
"""Body diagonals a second that the push at the COM gives: it stays in the picture."""

EXAMPLES = (
    ("rigid_proto demo", "the bundled T-handle, poked, 10 s"),
    ("rigid_proto demo --mesh part.obj --duration 20", "your own mesh, 20 s"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    add_mesh(parser, "simulate this mesh instead of the bundled T-handle")
    parser.add_argument(
        "--out", type=Path, default=OUT, metavar="FOLDER", help="folder for the recording (default out)"
    )
    parser.add_argument(
        "--duration",
        type=float,
        default=FLIGHT_S,
        metavar="S",
        help="simulated seconds, or to 2 s after the last poke (default 10)",
    )


def run(args: argparse.Namespace) -> int:
    """Fly, and say what happened."""
    from ..base.bundled import example_path, scene_path
    from ..scene.offline import read_scene
    from ..scene.script import read_script
    from .executables import own_executable, text_parameter

    if not 3.0 <= args.duration <= 3600.0:
        raise InputError("--duration", args.duration, "seconds from 3 to 3600")
    node_executable, client_executable = own_executable("rigid_body_node"), own_executable("poke_client")
    args.out.mkdir(parents=True, exist_ok=True)
    session = args.out / "session.rrd"
    if args.mesh:
        scene, script = write_demo(args.mesh, args.out)
    else:
        scene, script = scene_path("t_handle"), example_path("flip_and_poke")
    scenario = read_scene(str(scene))
    session.unlink(missing_ok=True)
    print(f"1. rigid_body_node: {scenario.parameters.mesh}, {scenario.setup.body.mass:.6g} kg", flush=True)
    # The last command has its time to act, and to be confirmed.
    until_s = max(args.duration, read_script(script)[-1].stamp_ns * 1e-9 + CONFIRM_S)
    with Processes() as processes:
        node = processes.start(
            [*node_executable, "--until", repr(until_s), "--ros-args", "--params-file", str(scene)]
            + [*text_parameter("record", str(session.resolve())), "-p", "start_paused:=true"]
        )
        print(f"2. poke_client --reset {script}", flush=True)
        client = processes.start([*client_executable, str(script), "--reset", "--timeout", "0"])
        status = _wait_for_flight(node, client, until_s)
        if status != 0:
            print(f"rigid_proto demo: poke_client ended with status {status}", file=sys.stderr)
            return 1
        node_status = node.wait()
    if node_status != 0:
        print(f"rigid_proto demo: rigid_body_node ended with status {node_status}", file=sys.stderr)
        return 1
    return _report(session)


def write_demo(mesh: str, folder: Path) -> tuple[Path, Path]:
    """Write demo_scene.yaml and demo_pokes.yaml into ``folder``; returns both paths.

    The body spins about its middle principal axis, a little off; pokes act at the COM and at the vertex farthest from
    it. Raises InputError for a mesh that can't fly.
    """
    import numpy as np

    from ..scene.scenario import make_scenario
    from ..scene.yaml_text import dump_yaml

    scenario = make_scenario({"mesh": str(Path(mesh).resolve()) if Path(mesh).exists() else mesh})
    body, surface = scenario.setup.body, scenario.setup.surface
    if surface is None:
        raise InputError("--mesh", mesh, "a mesh")
    points = surface.vertices - body.center_of_mass
    farthest = int(np.argmax((points * points).sum(axis=1)))
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    spin = SPIN * (body.principal_axes[:, 1] + 0.02 * body.principal_axes[:, 0] + 0.02 * body.principal_axes[:, 2])
    push = body.mass * DRIFT * diagonal
    # A torque that would turn the body by its own spin in a second, about its stiffest axis.
    torque = 0.5 * SPIN * float(body.principal_moments[0])
    scene = {
        "rigid_body": {
            "ros__parameters": {
                "mesh": scenario.parameters.mesh,
                "initial": {"angular_velocity": [float(w) for w in spin]},
            }
        }
    }
    script = [
        {"t": 1.0, "at": "com", "impulse": [push, 0.0, 0.0]},
        {"t": 2.5, "at": {"vertex": farthest}, "push": 0.5 * push, "duration": 0.3},
        {"t": 4.0, "wrench": {"torque": [0.0, 0.0, torque], "axes": "body", "duration": 1.0}},
        {"t": 6.5, "at": "com", "impulse": [-push, 0.0, 0.3 * push]},
    ]
    scene_path, script_path = folder / "demo_scene.yaml", folder / "demo_pokes.yaml"
    scene_path.write_text(dump_yaml(scene), encoding="utf-8")
    script_path.write_text(dump_yaml(script), encoding="utf-8")
    return scene_path, script_path


def _wait_for_flight(node: subprocess.Popen, client: subprocess.Popen, until_s: float) -> int:
    """Return when the node has come to the end, or its client to a bad one: the client's status, 0 while it goes on."""
    start, told = time.monotonic(), False
    while node.poll() is None and not client.poll():
        if client.poll() == 0 and not told:
            # It has waited until the last command acted.
            told = True
            print(
                f"{CLEAR if sys.stdout.isatty() else ''}3. simulating to {until_s:g} s, recorded for Rerun", flush=True
            )
        if sys.stdout.isatty():
            print(f"\r   {time.monotonic() - start:4.1f} s", end="", flush=True)
        time.sleep(0.05)
    if sys.stdout.isatty():
        print(CLEAR, end="")
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
            f"ω ({w[0]:.4g}, {w[1]:.4g}, {w[2]:.4g}) rad/s, |L| {size:.6g} kg m²/s"
        )
    print(f"\n{session} is the recorded session. Show it with:\n   .venv/bin/rerun {session}")
    print(f"Simulate it again and compare every state bit for bit:\n   .venv/bin/rigid_proto replay {session} --verify")
    return 0


class Processes:
    """Starts processes and ends them all on leaving, also when the command itself is ended by a signal."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen] = []

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        for process in reversed(self._running):
            self.end(process)

    def start(self, command: list[str]) -> subprocess.Popen:
        """Start a process in a session of its own: a Ctrl-C at the terminal reaches this command alone,
        which ends them.
        """
        process = subprocess.Popen(
            command, start_new_session=True, preexec_fn=end_with_this_thread(), env=with_this_package()
        )
        self._running.append(process)
        return process

    def end(self, process: subprocess.Popen) -> int:
        """SIGTERM, of which Python dies quietly where it has no handler yet, then after a while SIGKILL; returns the
        status.
        """
        if process in self._running:
            self._running.remove(process)
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(GRACE_S)
            except subprocess.TimeoutExpired:
                process.kill()
        return process.wait()
