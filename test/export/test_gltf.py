# SPDX-License-Identifier: MIT
"""A flight as glTF: played by the specification's rules it is where the simulation is, within the tolerance."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from gltf_player import Player, z_up
from scipy.spatial.transform import Rotation

from rigid_proto_ros.base.rotation import matrix_from_quaternion
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.export.animation import animate
from rigid_proto_ros.export.flight_record import FlightRecord
from rigid_proto_ros.export.interpolation import attitude_angles, slerp
from rigid_proto_ros.export.state_source import StateSource, source_of_scene
from rigid_proto_ros.scene.offline import OfflineRun, read_scene
from rigid_proto_ros.scene.script import read_script

pytest.importorskip("pygltflib")

THROWN = {
    "gravity": [0.0, 0.0, -9.81],
    "initial.linear_velocity": [1.0, 0.5, 4.0],
    "initial.angular_velocity": [3.0, 20.0, 1.0],
}
CHANGES = """
- {t: 0.2, at: {vertex: 3}, impulse: [0.1, 0.0, 0.05]}
- {t: 0.30000001, set: {scale: [1.5, 1.5, 0.7]}}
- {t: 0.45, set: {inertia_model: bounding_box}}
- {t: 0.6, set: {mesh: book}}
- {t: 0.7, set: {scale: [-1.0, 1.0, 1.0]}}
- {t: 0.8, set: {mesh: hammer}}
"""
TIMES = np.sort(np.random.default_rng(4).uniform(0.0, 1.0, 200))


def flown(scene: str, settings: dict, script: list, times: np.ndarray) -> list:
    """(state row, body, surface) at each time [s]."""
    run = OfflineRun(read_scene(scene, settings), script)
    states = []
    for t in times:
        run.advance(round(t * 1e9))
        states.append((run.simulation.state.row.copy(), run.simulation.setup.body, run.scenario.body_mesh.surface))
    return states


def test_the_mesh_is_drawn_where_it_flies_through_pokes_rescaling_other_models_and_meshes(tmp_path, capsys):
    script, file = tmp_path / "changes.yaml", tmp_path / "flight.glb"
    script.write_text(CHANGES)
    settings = [f"--set={name}={value}" for name, value in THROWN.items()]
    options = ["--script", str(script), "--duration", "1", "--gltf", str(file), "--with", "trail"]
    assert main(["simulate", "hammer", *settings, *options]) == 0
    assert "worst error" in capsys.readouterr().out
    player = Player(file)
    states = flown("hammer", THROWN, read_script(str(script)), TIMES)
    names = {"hammer": "body mesh", "book": "body mesh 2"}
    worst = 0.0
    for t, (row, body, surface) in zip(TIMES, states, strict=True):
        shown = [name for name in player.nodes if name.startswith("body mesh") and _size(player, name, t) > 0.0]
        # The hammer that comes back is a mesh of its own.
        assert shown == ["body mesh" if t < 0.6 else names["book"] if t < 0.8 else "body mesh 3"]
        corners = np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]) * body.scale
        true = (corners - body.center_of_mass) @ matrix_from_quaternion(row[3:7]).T + row[:3]
        middle = 0.5 * (surface.vertices.min(axis=0) + surface.vertices.max(axis=0))
        seen = z_up(
            player.world(shown[0], np.array([surface.vertices.min(axis=0), surface.vertices.max(axis=0)]) - middle, t)
        )
        size = np.linalg.norm(np.ptp(corners, axis=0))
        worst = max(worst, float(np.linalg.norm(seen - true, axis=1).max() / size))
        assert np.linalg.norm(z_up(player.world("body", np.zeros((1, 3)), t)) - row[:3]) < 1.01e-3 * size
    # A corner is off by the place's error and by the attitude's times its distance: 1e-3 and .1 degree, of .24 m and more.
    assert worst < 1e-3 + np.radians(0.1)  # measured 1.4e-3
    assert worst > 1e-4, "keys are as few as the tolerance allows"


def _size(player: Player, name: str, t: float) -> float:
    return float(np.ptp(player.world(name, player.mesh_points(name), t), axis=0).max())


def record_of(scene: str, settings: dict, seconds: float, ghost: bool = False) -> tuple[FlightRecord, StateSource]:
    scenario = read_scene(scene, settings)
    record = FlightRecord()
    OfflineRun(scenario, [], record).advance(round(seconds * 1e9))
    return record, source_of_scene(scenario, [])


def test_a_fast_spin_is_not_mistaken_for_a_slow_one_between_published_states():
    # 700 rad/s published every 10 ms: more than a turn from state to state.
    record, source = record_of("book", {"initial.angular_velocity": [0.0, 0.0, 700.0]}, 0.2)
    made = animate(record, source)
    assert made.error[1] < np.radians(0.1)  # measured 6e-5 degrees
    assert len(made.keys[0].attitudes.times) > 0.2 * 700 / np.pi


@pytest.mark.parametrize("share", [1e-2, 1e-3, 1e-5])
def test_fewer_keys_are_enough_where_more_error_is_allowed(share):
    record, source = record_of("hammer", THROWN, 0.5)
    made = animate(record, source, share)
    assert made.error[0] <= share * 0.32 and made.error[1] <= np.radians(100 * share)
    assert len(made.report) == 1
    # A parabola of 9.81 m/s²: straight pieces of h err by g h²/8.
    pieces = 0.5 / np.sqrt(8 * share * 0.3 / 9.81)
    assert 0.8 * pieces < len(made.keys[0].places.times) < 2.5 * pieces + 2


def test_even_keys_say_what_they_err():
    record, source = record_of("hammer", THROWN, 0.5)
    made = animate(record, source, fps=25.0)
    assert np.allclose(np.diff(made.keys[0].places.times)[:-1], 0.04)
    assert made.error[0] == pytest.approx(9.81 * 0.04**2 / 8, rel=0.01)
    assert "beyond the tolerance" in made.report[1]


def test_states_alone_are_keys_where_a_session_cannot_be_simulated_again():
    record, _ = record_of("hammer", THROWN, 0.3)
    made = animate(record, None)
    assert "between its states nothing is known" in made.report[-1]
    assert set(made.motion.times_ns) == set(record.times_ns)
    assert made.error[0] < 1e-3 * 0.32


def test_a_recorded_motion_that_is_not_the_simulated_one_is_drawn_as_recorded():
    record, _ = record_of("hammer", THROWN, 0.3)
    _, other = record_of("hammer", {**THROWN, "gravity": [0.0, 0.0, -9.0]}, 0.3)
    made = animate(record, other)
    assert "isn't the recorded one" in made.report[-1]
    assert made.error[0] < 1e-3 * 0.32


def test_the_ghost_flies_beside_the_body(tmp_path):
    file = tmp_path / "two.glb"
    assert main(["simulate", "true_or_box_tensor", "--duration", "2", "--gltf", str(file), "--with", "ghost"]) == 0
    player, heard = Player(file), []

    class Heard(FlightRecord):
        def ghost_state(self, time_ns, row):
            heard.append(row.copy())

    OfflineRun(read_scene("true_or_box_tensor"), [], Heard()).advance(2 * 10**9)
    seen = [player.value(player.nodes["ghost"], "rotation", k / 100) for k in range(len(heard))]
    angles = attitude_angles(np.array(seen), np.array(heard)[:, 3:7])
    assert angles.max() < np.radians(0.1)
    body = [player.value(player.nodes["body"], "rotation", k / 100) for k in range(len(heard))]
    assert attitude_angles(np.array(body), np.array(heard)[:, 3:7]).max() > np.radians(5)


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
    assert main(["simulate", "book", "--duration", "0", "--gltf", str(file), "--with", "ghost,trail"]) == 0
    assert len(Player(file).keys("body", "translation")[0]) == 1


def test_slerp_and_angles_agree_with_scipy():
    random = np.random.default_rng(2)
    a, b = Rotation.random(500, random_state=random), Rotation.random(500, random_state=random)
    b = Rotation.concatenate([b[:250], a[250:] * Rotation.from_rotvec(random.normal(size=(250, 3)) * 1e-9)])
    u = random.uniform(size=(500, 1))
    step = (a.inv() * b).as_rotvec()
    mine = slerp(a.as_quat(), -b.as_quat(), u)
    assert attitude_angles(mine, (a * Rotation.from_rotvec(u * step)).as_quat()).max() < 1e-15 * 8
    assert np.allclose(attitude_angles(a.as_quat(), b.as_quat()), np.linalg.norm(step, axis=1), rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--gltf", "a.gltf"], ("--gltf", ".glb")),
        (["--gltf", "{tmp}/a.glb", "--tolerance", "0"], ("--tolerance", "0.0", "1e-9")),
        (["--gltf", "{tmp}/a.glb", "--tolerance", "nan"], ("--tolerance", "nan")),
        (["--gltf", "{tmp}/a.glb", "--fps", "-1"], ("--fps", "-1.0")),
        (["--gltf", "{tmp}/a.glb", "--with", "goat"], ("--with", "did you mean ghost?")),
        (["--fps", "10"], ("--fps", "needs --gltf")),
        (["--gltf", "{tmp}/a.glb", "--tolerance", "1e-3", "--fps", "3"], ("--tolerance", "--fps")),
    ],
)
def test_what_makes_no_animation_is_refused_in_one_line(arguments, words, tmp_path, capsys):
    arguments = [word.replace("{tmp}", str(tmp_path)) for word in arguments]
    assert main(["simulate", "book", "--duration", "0.1", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and all(word in err for word in words)
    assert not list(tmp_path.iterdir())


def test_a_library_that_is_missing_is_named_with_the_extra_that_brings_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pygltflib", None)
    assert main(["simulate", "book", "--gltf", str(Path(tmp_path) / "a.glb")]) == 2
    assert "pip install 'rigid_proto_ros[export]'" in capsys.readouterr().err


def test_in_the_lesson_the_ghost_with_the_boxs_centre_turns_about_a_point_2_4_cm_off(tmp_path):
    file = tmp_path / "two.glb"
    settings = ["--set", "inertia_model_com=model", "--duration", "1"]
    assert main(["simulate", "true_or_box_tensor", *settings, "--gltf", str(file), "--with", "ghost"]) == 0
    nodes = {node["name"]: node for node in Player(file).document["nodes"]}
    true, box = (np.array(nodes[name]["extras"]["center_of_mass"]) for name in ("body", "ghost"))
    assert np.linalg.norm(true - box) == pytest.approx(0.024, abs=5e-4)
    offset = np.array(nodes["body mesh"]["translation"]) - nodes["ghost mesh"]["translation"]
    assert np.allclose(offset, box - true)
    assert nodes["ghost"]["extras"]["inertia_model"] == "bounding_box"
