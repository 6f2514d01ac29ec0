# SPDX-License-Identifier: MIT
"""Compile kernels into the cache: ``compile_kernels.py integrators | flight | scenes``.

The first two are what the first flight needs; they share few kernels and take about as long, so that they run side by
side. ``scenes``, after them, is what any other bundled scene, lesson or example script needs.
"""

import re
import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from rigid_proto_ros.base.bundled import scene_names, scene_path
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.live.warm_up import compile_flight, compile_integrators
from rigid_proto_ros.scene.offline import read_scene


def scenes_and_scripts() -> list[tuple[str, Path | None]]:
    """Every bundled scene by itself, and every example script with the scene that its head names."""
    flown: list[tuple[str, Path | None]] = [(name, None) for name in scene_names()]
    for script in sorted((ROOT / "msg_examples").glob("*.yaml")):
        named = re.search(r"simulate config/(\w+)\.yaml", script.read_text("utf-8"))
        flown.append((named[1] if named else "t_handle", script))
    return flown


def fly_all() -> int:
    """Fly each of them for the usual 10 s; returns the first exit status that isn't 0."""
    for scene, script in scenes_and_scripts():
        with redirect_stdout(StringIO()):
            status = rigid_proto(["simulate", scene, *(["--script", str(script)] if script else [])])
        if status:
            return status
    return 0


def main(part: str) -> int:
    """Compile one part; returns the exit status."""
    if part == "integrators":
        compile_integrators()
    elif part == "flight":
        compile_flight(read_scene(str(scene_path("t_handle"))).setup)
    else:
        return fly_all()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
