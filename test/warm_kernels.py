# SPDX-License-Identifier: MIT
"""Compiles what most tests need, once, before the suite's workers start and each would compile it for itself."""

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.ros.warm_up import warm_up
from rigid_proto_ros.scene.offline import read_scene

if __name__ == "__main__":
    warm_up(read_scene(str(scene_path("t_handle"))).setup)
