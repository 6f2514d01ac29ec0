# SPDX-License-Identifier: MIT
"""Compiles what most tests need, once, before the suite's workers start and each would compile it for itself."""

from __future__ import annotations

import os
import sys
from contextlib import redirect_stdout
from io import StringIO
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from sweep_studies import POKES, study

from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.cli.main import main as rigid_proto
from rigid_proto_ros.live.live_simulation import warm_up
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.sweep.rows import run_chunk


def node() -> None:
    """What a node flies by."""
    warm_up(read_scene(str(scene_path("t_handle"))).setup)


def surface() -> None:
    """What a mesh is read, checked and summed by; the report is nobody's, and one from the cache would compile nothing."""
    os.environ["RIGID_PROTO_CACHE"] = "off"
    with redirect_stdout(StringIO()):
        assert rigid_proto(["inspect", "t_handle"]) == 0


def batch() -> None:
    """What a sweep flies by."""
    run_chunk(study(POKES, samples=2), 0, 2)


def integrators() -> None:
    """Each by itself, with a string where it supports one."""
    for name in INTEGRATORS:
        for attached in (False, True):
            try:
                run = OfflineRun(read_scene("t_handle", {"integrator": name, "string.attached": attached}))
            except InputError:
                continue
            run.advance(2_000_001)


if __name__ == "__main__":
    # As many at a time as there are cores on the smallest machine that tests run on.
    with get_context("spawn").Pool(2) as pool:
        for done in [pool.apply_async(part) for part in (node, surface, batch, integrators)]:
            done.get()
