# SPDX-License-Identifier: MIT
"""The string as a line from the hand to the knot while it is tied, and not to be seen otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_player import Player, z_up

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

# A string .6 m long: slack at first, pulled taut, let go, and tied once more.
HAND = """
- {t: 0.1, string: {target: [0.3, 0.0, 0.3]}}
- {t: 0.4, string: {target: [0.3, 0.2, 0.5]}}
- {t: 0.5000003, string: {target: [0.5, 0.6, 0.5]}}
- {t: 0.8, string: release}
- {t: 0.9, string: {target: [0.0, 0.3, 0.0]}}
"""
SETTINGS = {"string.timeout": 10.0, "string.rest_length": 0.6, "gravity": [0.0, 0.0, -2.0]}
JUMPS = (0.1, 0.4, 0.5000003, 0.8, 0.9)
TIMES = np.array(sorted({k / 60 for k in range(61)} - set(np.round(JUMPS, 9)) | {t + 1e-6 for t in JUMPS}))
"""Frames, and right after each change."""
ALLOWED = 1e-3 * 0.32


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The .glb and .usda of the flight, and the string's ends (2, 3) at each time, None without a string."""
    folder = tmp_path_factory.mktemp("hand")
    script = folder / "hand.yaml"
    script.write_text(HAND)
    files = [folder / "flight.glb", folder / "flight.usda"]
    settings = [f"--set={name}={value}" for name, value in SETTINGS.items()]
    options = ["--script", str(script), "--duration", "1", "--fps", "60", *settings]
    assert main(["simulate", "hammer", *options, "--gltf", str(files[0]), "--usd", str(files[1])]) == 0
    run, ends = OfflineRun(read_scene("hammer", SETTINGS), read_script(str(script))), []
    for t in TIMES:
        run.advance(round(t * 1e9))
        tied, state = run.simulation.string, run.simulation.state
        ends.append(None)
        if tied is not None:
            knot = state.position + state.rotation @ run.simulation.setup.body.point(tied.attach)
            ends[-1] = np.array([tied.free_end(round(t * 1e9)), knot])
    return *files, ends


def test_the_line_of_gltf_goes_from_the_hand_to_the_knot(flight):
    file, _, true_ends = flight
    player = Player(file)
    worst = 0.0
    for t, true in zip(TIMES, true_ends, strict=True):
        seen = z_up(player.world("string", player.mesh_points("string"), t))
        assert (true is None) == (not np.ptp(seen, axis=0).any()) == (t < 0.1 or 0.8 < t < 0.9)
        if true is not None:
            worst = max(worst, float(np.linalg.norm(seen - true, axis=1).max()))
    assert worst < ALLOWED


def test_the_curve_of_usd_goes_from_the_hand_to_the_knot(flight):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom
    from test_usd import broken_rules

    _, file, true_ends = flight
    stage = Usd.Stage.Open(str(file))
    assert not broken_rules(stage)
    curve = UsdGeom.BasisCurves(stage.GetPrimAtPath("/flight/string"))
    for t, true in zip(TIMES, true_ends, strict=True):
        code = t * stage.GetTimeCodesPerSecond()
        assert (curve.ComputeVisibility(code) == "inherited") == (true is not None)
        if true is not None:
            seen = np.array(curve.GetPointsAttr().Get(code), dtype=float)
            assert np.linalg.norm(seen - true, axis=1).max() < ALLOWED
