# SPDX-License-Identifier: MIT
"""The string as a node: from the hand to the knot while it is tied, hanging through while it is slack, and not to be
seen otherwise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gltf_player import Player, z_up

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.picture.string import POINTS, string_curves
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.simulation.observer import StringChanged

# A string .6 m long: slack at first, pulled taut, slack again while gravity turns, let go, and tied once more.
HAND = """
- {t: 0.1, string: {target: [0.3, 0.0, 0.3]}}
- {t: 0.4, string: {target: [0.3, 0.2, 0.5]}}
- {t: 0.5000003, string: {target: [0.5, 0.6, 0.5]}}
- {t: 0.55, string: {target: [0.1, 0.1, 0.2]}}
- {t: 0.65, set: {gravity: [3.0, 0.0, 1.0]}}
- {t: 0.8, string: release}
- {t: 0.9, string: {target: [0.0, 0.3, 0.0]}}
"""
SETTINGS = {"string.timeout": 10.0, "string.rest_length": 0.6, "gravity": [0.0, 0.0, -2.0]}
JUMPS = (0.1, 0.4, 0.5000003, 0.55, 0.65, 0.8, 0.9)
TIMES = np.array(sorted({k / 60 for k in range(61)} - set(np.round(JUMPS, 9)) | {t + 1e-6 for t in JUMPS}))
"""Frames, and right after each change."""
ALLOWED = 1e-3 * 0.32


def read(script):
    return read_scene("hammer", SETTINGS), read_script(str(script))


def fly_on_string(folder: Path) -> tuple[list[Path], Path]:
    """The .glb and .usda of the flight, and its script."""
    script = folder / "hand.yaml"
    script.write_text(HAND)
    files = [folder / "flight.glb", folder / "flight.usda"]
    settings = [f"--set={name}={value}" for name, value in SETTINGS.items()]
    options = ["--script", str(script), "--duration", "1", "--fps", "60", "--with", "string", *settings]
    assert main(["simulate", "hammer", *options, "--gltf", str(files[0]), "--usd", str(files[1])]) == 0
    return files, script


def curves_of(script: Path) -> list[np.ndarray | None]:
    """The string's points (POINTS, 3) at each time, from the simulation itself; None without a string."""
    run = OfflineRun(*read(script))
    found = []
    for t in TIMES:
        run.advance(round(t * 1e9))
        tied, row = run.simulation.string, run.simulation.state.row
        if tied is None:
            found.append(None)
            continue
        shown = FlightRecord()
        run.simulation.introduce(shown)
        string = [event.string for event in shown.changes if isinstance(event, StringChanged)][-1]
        lasts = max(string.end_ns - string.begin_ns, 1)
        done = np.clip((round(t * 1e9) - string.begin_ns) / lasts, 0.0, 1.0)
        hand = string.origin + done * (np.asarray(string.target) - string.origin)
        knot = row[:3] + matrix_from_quaternion(row[3:7]) @ string.attach
        found.append(string_curves(hand[np.newaxis], knot[np.newaxis], 0.6, run.simulation.setup.gravity)[0])
    bent = [curve is not None and np.linalg.norm(curve[12] - 0.5 * (curve[0] + curve[-1])) > 0.01 for curve in found]
    assert 0.15 < np.mean(bent) < 0.5, "slack for a part of the flight"
    return found


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return fly_on_string(tmp_path_factory.mktemp("hand"))


@pytest.fixture(scope="module")
def true_curves(flight):
    return curves_of(flight[1])


def test_the_mesh_of_gltf_is_the_hanging_string(flight, true_curves):
    (file, _), _ = flight
    player = Player(file)
    worst = 0.0
    for t, curve in zip(TIMES, true_curves, strict=True):
        scale = player.value(player.nodes["string"], "scale", t)
        assert (curve is None) == (not scale.any()) == (t < 0.1 or 0.8 < t < 0.9)
        if curve is not None:
            # Opposite corners of the cross-sections, whose middles are the string's points.
            points = player.mesh_points("string", t).reshape(POINTS, -1, 3).mean(axis=1)
            seen = z_up(player.world("string", points, t))
            worst = max(worst, float(np.linalg.norm(seen - curve, axis=1).max()))
    assert worst < ALLOWED  # measured 1.1e-5 m
    weights = player.keys("string", "weights")[1]
    assert weights.min() == 0.0 and weights.max() == 1.0
    (names,) = {tuple(mesh["extras"]["targetNames"]) for mesh in player.document["meshes"] if "extras" in mesh}
    assert names == ("span x", "span y", "span z", "sag x", "sag z"), "gravity has no y"


def test_the_curve_of_usd_is_the_hanging_string(flight, true_curves):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom
    from test_usd import broken_rules

    (_, file), _ = flight
    stage = Usd.Stage.Open(str(file))
    assert not broken_rules(stage)
    curve = UsdGeom.BasisCurves(stage.GetPrimAtPath("/flight/string"))
    worst = 0.0
    for t, true in zip(TIMES, true_curves, strict=True):
        code = t * stage.GetTimeCodesPerSecond()
        assert (curve.ComputeVisibility(code) == "inherited") == (true is not None)
        if true is not None:
            seen = np.array(curve.GetPointsAttr().Get(code), dtype=float)
            worst = max(worst, float(np.linalg.norm(seen - true, axis=1).max()))
    assert worst < ALLOWED


def test_a_string_that_is_never_slack_is_a_straight_one_of_two_ends(tmp_path):
    file = tmp_path / "straight.glb"
    assert main(["simulate", "top_on_string", "--duration", "0.2", "--gltf", str(file), "--with", "string"]) == 0
    player = Player(file)
    ends = player.mesh_points("string", 0.1).reshape(2, -1, 3).mean(axis=1)
    run = OfflineRun(read_scene("top_on_string"), [])
    run.advance(100_000_000)
    tied, state = run.simulation.string, run.simulation.state
    true = [tied.free_end(100_000_000), state.position + state.rotation @ run.simulation.setup.body.point(tied.attach)]
    assert np.abs(z_up(player.world("string", ends, 0.1)) - true).max() < 1e-3
