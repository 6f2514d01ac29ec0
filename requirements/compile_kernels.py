# SPDX-License-Identifier: MIT
"""Compile kernels into the cache: ``compile_kernels.py integrators | flight | first | scenes``.

The first two share few kernels, so that they run side by side. ``first``, after them, is the few that are still missing
for the flight of `make run`. ``scenes`` is what any other bundled scene, lesson or example script needs.
"""

import re
import sys
import tempfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from rigid_proto_ros.base.bundled import example_path, scene_names, scene_path
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.live.live_simulation import warm_up
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.simulation.flight_arrays import _entry


def scenes_and_scripts() -> list[tuple[str, Path | None]]:
    """Every bundled scene by itself, and every example script with the scene that its head names."""
    flown: list[tuple[str, Path | None]] = [(name, None) for name in scene_names()]
    for script in sorted((ROOT / "msg_examples").glob("*.yaml")):
        named = re.search(r"simulate config/(\w+)\.yaml", script.read_text("utf-8"))
        flown.append((named[1] if named else "t_handle", script))
    return flown


def fly(*words: str) -> int:
    """`simulate` without what it prints; returns its exit status."""
    with redirect_stdout(StringIO()):
        return rigid_proto(["simulate", *words])


def compile_integrators() -> None:
    """The flight of one body, by all integrators."""
    _entry()


def compile_flight() -> None:
    """What every flight needs besides: its body."""
    read_scene("t_handle")


def fly_first() -> int:
    """What `make run` flies and shows; returns the exit status."""
    warm_up(read_scene(str(scene_path("t_handle"))).setup)
    script = str(example_path("flip_and_poke"))
    with tempfile.TemporaryDirectory() as folder:
        return fly("t_handle", "--script", script, "--duration", "9", "--record", f"{folder}/session.rrd")


def fly_all() -> int:
    """Fly each of them for the usual 10 s; returns the first exit status that isn't 0."""
    for scene, script in scenes_and_scripts():
        if status := fly(scene, *(["--script", str(script)] if script else [])):
            return status
    return 0


def main(part: str) -> int:
    """Compile one part; returns the exit status."""
    if part == "integrators":
        compile_integrators()
    elif part == "flight":
        compile_flight()
    else:
        return fly_first() if part == "first" else fly_all()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
