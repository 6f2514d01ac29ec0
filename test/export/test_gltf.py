# SPDX-License-Identifier: MIT
"""A flight as glTF: played by the specification's rules it is where the simulation is, at every frame and change."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from gltf_player import Player, z_up
from PIL import Image
from scipy.spatial.transform import Rotation

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.flight_record import FlightRecord, Source, frames, source_of_scene
from rigid_proto_ros.export.gltf import INDICES, TRIANGLES, VERTICES, Document
from rigid_proto_ros.picture.surface import BOX_CORNERS, BOX_TRIANGLES
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

THROWN = {
    "gravity": [0.0, 0.0, -9.81],
    "initial.linear_velocity": [1.0, 0.5, 4.0],
    "initial.angular_velocity": [3.0, 20.0, 1.0],
}
CHANGES = """
- {t: 0.2, at: {vertex: 3}, impulse: [0.1, 0.0, 0.05]}
- {t: 0.30000001, set: {scale: [1.5, 1.5, 0.7]}}
- {t: 0.45, set: {inertia_model: bounding_box}}
- {t: 0.7, set: {scale: [-1.0, 1.0, 1.0]}}
"""
JUMPS = (0.30000001, 0.45, 0.7)
TIMES = np.array(sorted({k / 30 for k in range(31) if k != 21} | {t + s for t in JUMPS for s in (-1e-6, 1e-6)}))
"""Frames, and both sides of each change: there the body is where it was simulated, between them on a straight line."""


def angles_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles (n,) [rad] between attitudes (n, 4)."""
    return (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).magnitude()


def flown(scene: str, settings: dict, script: list, times: np.ndarray) -> list:
    """(state row, body, surface) at each time [s]."""
    run = OfflineRun(read_scene(scene, settings), script)
    states = []
    for t in times:
        run.advance(round(t * 1e9))
        states.append((run.simulation.state.row.copy(), run.simulation.setup.body, run.scenario.body_mesh.surface))
    return states


def test_the_mesh_is_drawn_where_it_flies_through_pokes_rescaling_and_other_models(tmp_path, capsys):
    script, file = tmp_path / "changes.yaml", tmp_path / "flight.glb"
    script.write_text(CHANGES)
    settings = [f"--set={name}={value}" for name, value in THROWN.items()]
    assert main(["simulate", "hammer", *settings, "--script", str(script), "--duration", "1", "--gltf", str(file)]) == 0
    # 31 frames, and two sides of each of three changes, one of which is at a frame, as is the impulse.
    assert f"{file}: 36 frames, 30 a second" in capsys.readouterr().out
    player = Player(file)
    worst = 0.0
    for t, (row, body, surface) in zip(TIMES, flown("hammer", THROWN, read_script(str(script)), TIMES), strict=True):
        box = np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)])
        corners = box * body.scale
        true = (corners - body.center_of_mass) @ matrix_from_quaternion(row[3:7]).T + row[:3]
        seen = z_up(player.world("body mesh", box - box.mean(axis=0), t))
        worst = max(worst, float(np.linalg.norm(seen - true, axis=1).max() / np.linalg.norm(np.ptp(corners, axis=0))))
    assert worst < 2e-5  # measured 1.6e-6
    # An impulse bends the path at its own time.
    assert np.float32(0.2) in player.keys("body", "translation")[0]


def test_a_flight_of_several_meshes_is_refused(tmp_path, capsys):
    (tmp_path / "swap.yaml").write_text("- {t: 0.1, set: {mesh: book}}")
    words = ["--script", str(tmp_path / "swap.yaml"), "--duration", "0.2", "--gltf", str(tmp_path / "a.glb")]
    assert main(["simulate", "hammer", *words]) == 2
    assert "the mesh changes at 0.1 s" in capsys.readouterr().err


def record_of(scene: str, settings: dict, seconds: float) -> tuple[FlightRecord, Source]:
    scenario = read_scene(scene, settings)
    record = FlightRecord()
    OfflineRun(scenario, [], record).advance(round(seconds * 1e9))
    return record, source_of_scene(scenario, [])


@pytest.mark.parametrize("fps", [24.0, 30.0, 240.0])
def test_frames_come_evenly_and_are_the_simulated_states_to_the_bit(fps):
    # 700 rad/s published every 10 ms: more than a turn from state to state.
    settings = {"initial.angular_velocity": [0.0, 3.0, 700.0]}
    record, source = record_of("book", settings, 0.5)
    made, said = frames(record, source, fps)
    assert said == f"{len(made.times_ns)} frames, {fps:g} a second"
    assert np.array_equal(made.times_ns[:-1], np.rint(np.arange(len(made.times_ns) - 1) * 1e9 / fps))
    assert made.times_ns[-1] == 500_000_000
    run = OfflineRun(read_scene("book", settings))
    for time_ns, row in zip(made.times_ns.tolist(), made.rows, strict=True):
        run.advance(time_ns)
        assert np.array_equal(row, run.simulation.state.row)


def test_a_motion_that_cannot_be_simulated_again_is_drawn_as_recorded():
    record, _ = record_of("hammer", THROWN, 0.3)
    _, other = record_of("hammer", {**THROWN, "gravity": [0.0, 0.0, -9.0]}, 0.3)
    for source, reason in ((None, "can't be simulated again"), (other, "isn't the recorded one")):
        made, said = frames(record, source, 30.0)
        assert made is record and reason in said


def test_the_ghost_flies_beside_the_body(tmp_path):
    file = tmp_path / "two.glb"
    assert main(["simulate", "true_or_box_tensor", "--duration", "2", "--gltf", str(file)]) == 0
    player = Player(file)
    OfflineRun(read_scene("true_or_box_tensor"), [], heard := FlightRecord()).advance(2 * 10**9)
    times = np.array(heard.ghosts.times_ns[::10])  # every third frame is a published state
    ghosts = np.array(heard.ghosts.rows[::10])[:, 3:7]
    seen = {name: [player.value(player.nodes[name], "rotation", t * 1e-9) for t in times] for name in ("body", "ghost")}
    assert angles_between(np.array(seen["ghost"]), ghosts).max() < 1e-6
    assert angles_between(np.array(seen["body"]), ghosts).max() > np.radians(5)


def test_a_body_without_a_mesh_is_a_node_without_one(tmp_path):
    file = tmp_path / "none.glb"
    explicit = ["--set", "mesh=", "--set", "inertia_model=explicit", "--set", "explicit_inertia.mass=1.0"]
    tensor = ["--set", "explicit_inertia.tensor=[0.1, 0.0, 0.0, 0.2, 0.0, 0.25]"]
    assert main(["simulate", "book", *explicit, *tensor, "--duration", "0.5", "--gltf", str(file)]) == 0
    document = Player(file).document
    assert "meshes" not in document or not document["meshes"]
    assert document["nodes"][1]["extras"]["mass"] == 1.0


def test_a_flight_of_no_length_is_one_key(tmp_path):
    file = tmp_path / "still.glb"
    assert main(["simulate", "book", "--duration", "0", "--gltf", str(file)]) == 0
    assert len(Player(file).keys("body", "translation")[0]) == 1


def test_in_the_lesson_the_ghost_with_the_boxs_centre_turns_about_a_point_2_4_cm_off(tmp_path):
    file = tmp_path / "two.glb"
    settings = ["--set", "inertia_model_com=model", "--duration", "1"]
    assert main(["simulate", "true_or_box_tensor", *settings, "--gltf", str(file)]) == 0
    nodes = {node["name"]: node for node in Player(file).document["nodes"]}
    true, box = (np.array(nodes[name]["extras"]["center_of_mass"]) for name in ("body", "ghost"))
    assert np.linalg.norm(true - box) == pytest.approx(0.024, abs=5e-4)
    offset = np.array(nodes["body mesh"]["translation"]) - nodes["ghost mesh"]["translation"]
    assert np.allclose(offset, box - true)
    assert nodes["ghost"]["extras"]["inertia_model"] == "bounding_box"


def painted_cube(file: Path) -> bytes:
    """A .glb of a cube in two parts of a material each, one of them with a picture; returns that picture."""
    packed = io.BytesIO()
    Image.new("RGB", (2, 2), (200, 10, 10)).save(packed, "png")
    document = Document(0)
    for name, colour in (("red", (200, 10, 10)), ("blue", (10, 10, 200))):
        document.material(name, colour)
    picture = packed.getvalue() + bytes(-len(packed.getvalue()) % 4)
    document.data += picture
    view = document.add("bufferViews", buffer=0, byteOffset=0, byteLength=len(picture))
    image = document.add("images", bufferView=view, mimeType="image/png")
    texture = document.add("textures", source=image)
    document.lists["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": texture}
    corners = document.accessor(0.05 * BOX_CORNERS + [0.3, 0.0, 0.1], VERTICES, bounds=True)
    cube = document.node("cube", None)
    for half, material in ((BOX_TRIANGLES[:6], 0), (BOX_TRIANGLES[6:], 1)):
        indices = document.accessor(half.ravel(), INDICES)
        mesh = document.mesh("half", {"POSITION": corners}, indices, TRIANGLES, material)
        document.node(f"half {material}", cube, mesh=mesh)
    file.write_bytes(document.binary())
    return picture


def test_a_glb_keeps_its_materials_and_pictures_and_is_where_the_body_is(tmp_path):
    picture, file = painted_cube(tmp_path / "cube.glb"), tmp_path / "flight.glb"
    settings = {"mesh": str(tmp_path / "cube.glb"), "scale": [2.0, 1.0, 1.0], **THROWN}
    arguments = [f"--set={name}={value}" for name, value in settings.items()]
    assert main(["simulate", "t_handle", "--duration", "0.5", *arguments, "--gltf", str(file), "--fps", "24"]) == 0
    player = Player(file)
    made = player.document
    assert [material["name"] for material in made["materials"]] == ["red", "blue"]
    texture = made["textures"][made["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    view = made["bufferViews"][made["images"][texture["source"]]["bufferView"]]
    assert player.binary[view["byteOffset"] :][: view["byteLength"]] == picture
    run = OfflineRun(read_scene("t_handle", settings), [])
    for k in (0, 5, 12):
        run.advance(round(k / 24 * 1e9))
        state, body = run.simulation.state, run.simulation.setup.body
        expected = [state.position + state.rotation @ body.point(v) for v in 0.05 * BOX_CORNERS + [0.3, 0.0, 0.1]]
        for name in ("half 0", "half 1"):
            drawn = z_up(player.world(name, player.mesh_points(name), k / 24))
            assert np.abs(drawn - expected).max() < 1e-6
