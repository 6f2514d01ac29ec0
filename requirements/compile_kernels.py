# SPDX-License-Identifier: MIT
"""Compile what the first flight needs, kept beside the source: ``compile_kernels.py integrators``, or ``flight``.

The two share few kernels and take about as long, so that they run side by side. Radau and the discrete gradient, for stiff
strings and damping, are compiled by the first flight that needs them.
"""

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.motion.integrators import INTEGRATORS, auto
from rigid_proto_ros.motion.integrators.stepping import method_table, provide_kernel
from rigid_proto_ros.ros.warm_up import warm_up
from rigid_proto_ros.scene.offline import read_scene


def main(part: str) -> None:
    """Compile one part."""
    if part == "integrators":
        table = method_table(auto.AUTO, 0)
        for kind in (auto.STEADY, auto.FREE, auto.TURNING_LOADS, auto.ANY_LOADS, auto.WEAK_LOADS):
            provide_kernel(auto.AUTO, table, kind)
    else:
        # The flight itself is the same under every integrator; this one is compiled soonest.
        warm_up(replace(read_scene(str(scene_path("t_handle"))).setup, integrator=INTEGRATORS["rk4"]))


if __name__ == "__main__":
    main(sys.argv[1])
