# SPDX-License-Identifier: MIT
"""The main job, end to end, as ``make run`` does it: node, scripted pokes, recording, on a bundled body and a real mesh."""

from __future__ import annotations

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from ros_process import SOURCE, from_source, run

pytest.importorskip("rclpy")
pytest.importorskip("rerun")


def fly(ros_environment, folder, *arguments):
    from rigid_proto_ros.rerun_view.rrd_file import read_session, record_batches

    done = run("rigid_proto", "demo", *arguments, environment=ros_environment, cwd=folder, timeout=180)
    assert done.returncode == 0, done.stderr
    session = folder / "out" / "session.rrd"
    assert "out/session.rrd" in done.stdout
    return session, read_session(session), list(record_batches(session))


def check(session, recorded, batches, pokes):
    """The mesh once, a pose for every published state, arrows while the pokes act."""
    assert recorded.complete
    assert recorded.mesh_chunks == 1
    order = np.argsort(recorded.times)
    times = recorded.times[order]
    assert times[0] == 0
    assert set(np.diff(times)) == {10_000_000}
    poses = [
        batch
        for entity, _, batch in batches
        if entity == "world/body" and "Transform3D:translation" in batch.schema.names
    ]
    positions = np.concatenate([np.array(b.column("Transform3D:translation").flatten().to_pylist()) for b in poses])
    assert len(positions.reshape(-1, 3)) == len(times)
    kinds = [json.loads(line)["kind"] for _, line in recorded.events]
    assert kinds[0] == "reset"
    assert kinds.count("poke") == pokes
    arrows = [
        entity
        for entity, _, batch in batches
        if any(name.startswith("Arrows3D:vectors") for name in batch.schema.names)
    ]
    assert any("load" in entity for entity in arrows), sorted(set(arrows))


def test_a_bundled_body_flies_its_script_and_leaves_a_session_that_verifies_also_beside_another(
    ros_environment, tmp_path
):
    """Two at once, and neither hears the other's pokes."""
    # As a user's shell, which names no domain.
    environment = {name: value for name, value in ros_environment.items() if name != "ROS_DOMAIN_ID"}
    folders = [tmp_path / name for name in "ab"]
    for folder in folders:
        folder.mkdir()
    with ThreadPoolExecutor() as both:
        flown = list(both.map(lambda folder: fly(environment, folder, "--duration", "10"), folders))
    for session, recorded, batches in flown:
        check(session, recorded, batches, pokes=3)
        assert recorded.times.max() == recorded.end_ns == 10_000_000_000
    verified = run("rigid_proto", "replay", flown[0][0], "--verify", environment=ros_environment)
    assert verified.returncode == 0, verified.stderr
    assert "reproduced bit for bit" in verified.stdout


@pytest.mark.stress
def test_a_real_mesh_flies_too_and_hangs_where_the_state_says(ros_environment, tmp_path, meshes):
    session, recorded, batches = fly(ros_environment, tmp_path, "--duration", "7", "--mesh", meshes / "spot.obj")
    check(session, recorded, batches, pokes=3)
    assert len(recorded.vertices) == 11533
    verified = run("rigid_proto", "replay", session, "--verify", environment=ros_environment)
    assert verified.returncode == 0, verified.stderr


@pytest.mark.stress
def test_what_the_set_up_compiles_is_all_that_the_first_flight_needs(ros_environment, tmp_path):
    environment = {**ros_environment, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    for part in ("integrators", "flight", "first"):
        command = [sys.executable, str(SOURCE / "requirements" / "compile_kernels.py"), part]
        subprocess.run(command, env=from_source(environment), check=True)
    compiled = sorted((tmp_path / "kernels").rglob("*.nbc"))
    done = run("rigid_proto", "demo", environment=environment, cwd=tmp_path)
    assert done.returncode == 0 and "compiling" not in done.stderr, done.stderr
    assert compiled and sorted((tmp_path / "kernels").rglob("*.nbc")) == compiled
