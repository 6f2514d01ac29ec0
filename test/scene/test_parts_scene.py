# SPDX-License-Identifier: MIT
"""A body of parts wherever a mesh may stand: scene, live change, recording, branch, sweep, page, exports."""

import json
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest
from mass_solids import box, moved
from mesh_files import obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.page.file import take_of, values_of_mesh
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.sweep.study import read_study

PARTS = "parts:\n  body: {mesh: body.obj, density: 2700}\n  cover: {mesh: cover.obj, mass: 0.12}\n"
SPIN = "[1.0, 2.0, 0.5]"
SCENE = f'/**:\n  ros__parameters:\n    mesh: "whole.yaml"\n    initial.angular_velocity: {SPIN}\n'
MASS = 2700.0 * 8e-5 + 0.12


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("body.obj").write_bytes(obj(*box((0.1, 0.04, 0.02))))
    Path("cover.obj").write_bytes(obj(*moved(box((0.1, 0.04, 0.004)), (0.0, 0.0, 0.012))))
    Path("whole.yaml").write_text(PARTS)
    Path("scene.yaml").write_text(SCENE)


def flown(capsys, *arguments: str) -> dict:
    assert main(["simulate", *arguments, "--duration", "1", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_file_of_parts_flies_alone_and_as_the_mesh_of_a_scene(capsys) -> None:
    spin = f"initial.angular_velocity={SPIN}"
    assert flown(capsys, "whole.yaml", "--set", spin)["state_hash"] == flown(capsys, "scene.yaml")["state_hash"]
    body = read_scene("scene.yaml").setup.body
    assert body.mass == pytest.approx(MASS, rel=1e-15)
    assert body.center_of_mass == pytest.approx([0.0, 0.0, 0.12 * 0.012 / MASS], abs=1e-17)


def test_mass_and_size_change_in_flight() -> None:
    scenario = read_scene("scene.yaml")
    heavy = scenario.with_changes({"mass": 2.0 * MASS}).setup.body
    assert heavy.inertia == pytest.approx(2.0 * scenario.setup.body.inertia, rel=1e-14, abs=1e-20)
    assert heavy.center_of_mass.tolist() == scenario.setup.body.center_of_mass.tolist()
    large = scenario.with_changes({"scale": [2.0]}).setup.body
    assert large.mass == pytest.approx(8.0 * MASS) and large.inertia[0, 0] == pytest.approx(
        32.0 * scenario.setup.body.inertia[0, 0]
    )
    other = make_scenario({"mesh": "book"}).with_changes({"mesh": "whole.yaml"})
    assert other.setup.body.mass == pytest.approx(MASS)


def test_a_scenario_goes_whole_to_another_process() -> None:
    scenario = read_scene("scene.yaml")
    copy = pickle.loads(pickle.dumps(scenario))
    assert copy.setup.body.row.tobytes() == scenario.setup.body.row.tobytes()
    assert copy.body_mesh.mesh.sha256 == scenario.body_mesh.mesh.sha256


def test_a_recording_of_parts_is_verified_and_drawn_and_a_changed_part_is_noticed(capsys) -> None:
    pytest.importorskip("mcap")
    flown(capsys, "scene.yaml", "--record", "flight.mcap")
    assert main(["replay", "flight.mcap", "--verify"]) == 0
    assert main(["replay", "flight.mcap", "--at", "0.5", "--as-scene", "branch.yaml"]) == 0
    capsys.readouterr()
    assert main(["replay", "flight.mcap", "--gltf", "flight.glb"]) == 0
    data = Path("flight.glb").read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    boxes = [np.subtract(each["max"], each["min"]) for each in document["accessors"] if len(each.get("max", ())) == 3]
    assert any(sides == pytest.approx([0.1, 0.04, 0.024], abs=1e-6) for sides in boxes)  # of the joined mesh
    text = Path("cover.obj").read_text()
    Path("cover.obj").write_text(text + "# another file\n")
    capsys.readouterr()
    assert main(["replay", "flight.mcap", "--verify"]) == 2
    assert "SHA-256" in capsys.readouterr().err
    Path("cover.obj").write_text(text)
    folder = Path("elsewhere")
    folder.mkdir()
    for name in ("flight.mcap", "whole.yaml", "body.obj", "cover.obj"):
        shutil.move(name, folder / name)
    assert main(["replay", str(folder / "flight.mcap"), "--verify"]) == 0


def test_a_sweep_flies_parts_and_knows_them_by_content() -> None:
    Path("study.yaml").write_text("scene: scene.yaml\nduration: 0.1\nvary: {mass: {grid: [0.1, 0.2]}}\n")
    first = read_study("study.yaml").fingerprint
    assert main(["sweep", "study.yaml", "-o", "table.parquet"]) == 0
    assert read_study("study.yaml").fingerprint == first
    Path("whole.yaml").write_text(PARTS.replace("2700", "2701"))
    assert read_study("study.yaml").fingerprint != first


def test_a_page_has_the_joined_mesh_and_the_moments_of_the_sum() -> None:
    values, note = values_of_mesh("whole.yaml")
    take = take_of(values)
    assert note == "" and take["values"]["mesh"] == take["mesh"]["name"] == "whole.yaml"
    assert take["mesh"]["volume"] == pytest.approx(9.6e-5) and "solid" in take["mesh"]


def test_what_is_wrong_with_a_part_is_told_where_a_scene_is_read(capsys) -> None:
    Path("whole.yaml").write_text(PARTS.replace("2700", "heavy"))
    for name in ("whole.yaml", "scene.yaml"):
        assert main(["simulate", name]) == 2
        err = capsys.readouterr().err
        assert "whole.yaml, part body, density: got 'heavy'; accepted: a finite number > 0" in err
        assert err.count("\n") == 1


def test_a_scene_with_a_node_called_parts_stays_a_scene(capsys) -> None:
    Path("other.yaml").write_text("parts:\n  ros__parameters:\n    mesh: book\n/**:\n  ros__parameters: {mass: 2.0}\n")
    assert read_scene("other.yaml", warn=lambda line: None).parameters.mass == 2.0


def test_repair_and_fallback_are_of_each_part(capsys) -> None:
    lines = Path("cover.obj").read_text().splitlines()
    Path("cover.obj").write_text("\n".join(lines[:-1]))
    assert main(["simulate", "scene.yaml"]) == 2
    assert "part cover: open surface" in capsys.readouterr().err
    for setting in ("mesh_repair=true", "mesh_fallback=hull"):
        assert flown(capsys, "scene.yaml", "--set", setting)["time_ns"] == 10**9
    whole = read_scene("scene.yaml", {"mesh_repair": True}).setup.body
    assert whole.mass == pytest.approx(MASS) and np.isfinite(whole.inertia).all()
