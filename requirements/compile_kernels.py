# SPDX-License-Identifier: MIT
"""Compile what the first flight needs, kept beside the source: ``compile_kernels.py integrators``, or ``flight``.

The two share few kernels and take about as long, so that they run side by side.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.live.warm_up import compile_flight, compile_integrators
from rigid_proto_ros.scene.offline import read_scene


def main(part: str) -> None:
    """Compile one part."""
    if part == "integrators":
        compile_integrators()
    else:
        compile_flight(read_scene(str(scene_path("t_handle"))).setup)


if __name__ == "__main__":
    main(sys.argv[1])
