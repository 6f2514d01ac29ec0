# SPDX-License-Identifier: MIT
"""The main job, end to end, as ``make run`` does it: node, scripted pokes, recording, on a bundled body and a real mesh."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from rerun_flight import verified

pytest.importorskip("rclpy")
pytest.importorskip("rerun")


from rigid_proto_ros.base.bundled import scene_path
from rigid_proto_ros.cli.demo import write_demo
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.ros.domain import hold_domain
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.script import read_script
from rigid_proto_ros.session.bag import read_runs

BARE = """rigid_body:
  ros__parameters: {mesh: "", inertia_model: explicit, explicit_inertia: {mass: 1.0, tensor: [1.0, 0.0, 0.0, 2.0, 0.0, 3.0]}}
"""
SESSION, VIEW = Path("out/session.mcap"), Path("out/session.rrd")


def check_flown(capfd, monkeypatch, folder: Path, *arguments: str) -> None:
    """A session with every state and poke, that verifies; what is drawn in it: test_rerun_recording.py."""
    monkeypatch.chdir(folder)
    assert main(["demo", *arguments]) == 0, capfd.readouterr().err
    told = capfd.readouterr().out
    assert f"rerun {VIEW}" in told and f"replay {SESSION} --verify" in told
    assert ("domain 0 is in use; this one is in ROS_DOMAIN_ID=" in told) == ("ROS_DOMAIN_ID" not in os.environ)
    recorded = read_runs(SESSION)[-1]
    assert recorded.complete and verified(VIEW)
    assert np.sort(recorded.times).tolist() == list(range(0, recorded.end_ns + 1, 10_000_000))
    assert recorded.end_ns == 10_000_000_000
    kinds = [json.loads(line)["kind"] for _, line in recorded.events]
    assert kinds[0] == "reset"
    assert kinds.count("poke") == 3
    assert main(["replay", str(SESSION), "--verify"]) == 0
    assert "reproduced bit for bit" in capfd.readouterr().out


def test_a_bundled_body_flies_its_script_and_leaves_a_session_that_verifies_beside_another(
    tmp_path, monkeypatch, capfd
):
    """Whoever is in domain 0 hears none of its pokes, nor it theirs."""
    # As a user's shell, which names no domain.
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    held = hold_domain([0])  # None where somebody else holds it
    try:
        check_flown(capfd, monkeypatch, tmp_path)
    finally:
        if held is not None:
            held[1].close()


def test_pokes_are_written_for_a_scene_and_for_a_mesh_whose_scene_is_written_too(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    bundled, pokes = write_demo("hammer")
    assert bundled == scene_path("hammer") and not (tmp_path / "out" / "demo_scene.yaml").exists()
    Path("part.obj").write_bytes(resolve_mesh("hammer").read_bytes())
    alone, again = write_demo("part.obj")
    assert read_scene(str(alone)).parameters.mesh == str(tmp_path / "part.obj")
    # The scene gives its hammer another density: pushes are in proportion to the mass.
    weights = [read_scene(name).setup.body.mass for name in ("hammer", "part.obj")]
    pushes = []
    for name in ("hammer", "part.obj"):
        write_demo(name)
        pushes.append(read_script(pokes)[0].force[0])
    assert again == pokes and pushes[0] / pushes[1] == pytest.approx(weights[0] / weights[1])
    Path("bare.yaml").write_text(BARE, "utf-8")
    assert main(["demo", "bare.yaml"]) == 2
    assert (
        capsys.readouterr().err.strip()
        == "rigid_proto demo: demo: got 'bare.yaml'; accepted: a mesh, or a scene that has one"
    )


@pytest.mark.stress
def test_a_real_mesh_flies_too_and_hangs_where_the_state_says(ros_environment, tmp_path, meshes, monkeypatch, capfd):
    monkeypatch.setenv("ROS_DOMAIN_ID", ros_environment["ROS_DOMAIN_ID"])
    check_flown(capfd, monkeypatch, tmp_path, "--duration", "10", "--mesh", str(meshes / "spot.obj"))
    assert [name for name, _ in read_runs(SESSION)[-1].attachments] == ["spot.obj"]
