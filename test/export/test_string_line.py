# SPDX-License-Identifier: MIT
"""The string as a node: between the hand and the knot while it is tied, and not to be seen otherwise."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_player import Player, z_up

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.export.string_line import string_keys
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

HAND = """
- {t: 0.2, string: {target: [0.3, 0.0, 0.3]}}
- {t: 0.4, string: {target: [0.3, 0.2, 0.5]}}
- {t: 0.5000003, string: {target: [0.0, 0.4, 0.5]}}
- {t: 0.8, string: release}
"""
ENDS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hand")
    script = folder / "hand.yaml"
    script.write_text(HAND)
    files = [folder / "flight.glb", folder / "flight.usda"]
    options = ["--script", str(script), "--duration", "1", "--with", "string", "--set", "string.timeout=10.0"]
    assert main(["simulate", "hammer", *options, "--gltf", str(files[0]), "--usd", str(files[1])]) == 0
    return files, script


def true_ends(script, times) -> list:
    """Hand and knot (2, 3) at each time, from the simulation itself; None without a string."""
    run = OfflineRun(read_scene("hammer", {"string.timeout": 10.0}), read_script(str(script)))
    found = []
    for t in times:
        run.advance(round(t * 1e9))
        tied, row = run.simulation.string, run.simulation.state.row
        if tied is None:
            found.append(None)
            continue
        shown = FlightRecord()
        run.simulation.introduce(shown)
        (_, string) = shown.strings[-1]
        lasts = max(string.end_ns - string.begin_ns, 1)
        done = np.clip((round(t * 1e9) - string.begin_ns) / lasts, 0.0, 1.0)
        hand = string.origin + done * (np.asarray(string.target) - string.origin)
        found.append(np.array([hand, row[:3] + matrix_from_quaternion(row[3:7]) @ string.attach]))
    return found


TIMES = np.sort(np.random.default_rng(9).uniform(0.0, 1.0, 150))


def test_the_stick_of_gltf_lies_between_hand_and_knot(flight):
    (file, _), script = flight
    player = Player(file)
    worst = 0.0
    for t, ends in zip(TIMES, true_ends(script, TIMES), strict=True):
        scale = player.value(player.nodes["string"], "scale", t)
        assert (ends is None) == (not scale.any()) == (t < 0.2 or t > 0.8)
        if ends is not None:
            worst = max(worst, float(np.abs(z_up(player.world("string", ENDS, t)) - ends).max()))
    assert worst < 1e-3 * 0.32


def test_the_curve_of_usd_lies_between_hand_and_knot(flight):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom
    from test_usd import broken_rules

    (_, file), script = flight
    stage = Usd.Stage.Open(str(file))
    assert not broken_rules(stage)
    curve = UsdGeom.BasisCurves(stage.GetPrimAtPath("/flight/string"))
    worst = 0.0
    for t, ends in zip(TIMES, true_ends(script, TIMES), strict=True):
        code = t * stage.GetTimeCodesPerSecond()
        assert (curve.ComputeVisibility(code) == "inherited") == (ends is not None)
        if ends is not None:
            worst = max(worst, float(np.abs(np.array(curve.GetPointsAttr().Get(code), dtype=float) - ends).max()))
    assert worst < 1e-3 * 0.32


def test_a_stick_follows_a_direction_that_turns_right_round_and_over():
    t = np.linspace(0.0, 2.0, 401).astype(np.float32).astype(float)
    knots = np.column_stack([np.sin(7 * t), np.sin(3 * t) * np.cos(7 * t), np.cos(3 * t) * np.cos(7 * t)])
    keys = string_keys(t, np.zeros_like(knots), knots)
    middles = 0.5 * (t[1:] + t[:-1])
    _, seen = keys.played(middles)
    true = np.column_stack(
        [np.sin(7 * middles), np.sin(3 * middles) * np.cos(7 * middles), np.cos(3 * middles) * np.cos(7 * middles)]
    )
    # A curve of at most 7.6 rad/s, by great circles of .005 s: (ω h)²/8.
    assert np.linalg.norm(seen - true, axis=1).max() < (7.6 * 0.005) ** 2 / 8
    fewer = string_keys(t, np.zeros_like(knots), knots, 1e-2)
    assert np.linalg.norm(fewer.played(t)[1] - knots, axis=1).max() < 1e-2
    assert len(fewer.attitudes.times) < len(t) / 4
    assert string_keys(t, np.full_like(knots, np.nan), knots) is None
