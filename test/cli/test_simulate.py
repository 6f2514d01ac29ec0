# SPDX-License-Identifier: MIT
"""What `simulate --json` says of a flight, and the defaults that every scene begins with."""

from __future__ import annotations

import hashlib
import json
import struct

import numpy as np
import pytest

from rigid_proto_ros.base.rotation import rotate
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.scene.scenario import make_scenario


def simulated(capsys, *arguments: str) -> dict:
    assert main(["simulate", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_one_json_object_has_all_that_is_known_of_the_flight_in_full_precision(capsys):
    values = ("gravity=[0.0, 0.0, -9.81]", "mass=2", "initial.linear_velocity=[1, -2, 3]", "linear_damping=0")
    settings = [word for value in values for word in ("--set", value)]
    said = simulated(capsys, "t_handle", "--duration", "1.5", *settings)
    assert said["time_ns"] == 1_500_000_000
    body = make_scenario({"mesh": "t_handle", "mass": 2.0}).setup.body
    # Thrown, and turning freely meanwhile.
    fall = np.array([1.0, -2.0, 3.0 - 9.81 * 1.5])
    assert said["linear_velocity"] == pytest.approx(fall, rel=1e-14)
    assert said["position"] == pytest.approx([1.5, -3.0, 4.5 - 9.81 * 1.5**2 / 2], rel=1e-14)
    spin, attitude = np.array(said["angular_velocity_body"]), said["orientation_xyzw"]
    assert said["angular_velocity"] == pytest.approx(rotate(*attitude, *spin), rel=1e-14)
    momentum = body.inertia @ spin
    assert said["angular_momentum"] == pytest.approx(rotate(*attitude, *momentum), rel=1e-13)
    assert said["kinetic_energy"] == pytest.approx(fall @ fall + spin @ momentum / 2, rel=1e-14)
    assert said["potential_energy"] == pytest.approx(2 * 9.81 * said["position"][2], rel=1e-14)


def test_the_state_hash_is_that_of_time_and_state_as_little_endian_numbers(capsys):
    said = simulated(capsys, "t_handle", "--duration", "0.25")
    parts = ("position", "orientation_xyzw", "linear_velocity", "angular_velocity_body")
    numbers = [x + 0.0 for part in parts for x in said[part]]  # -0.0 + 0.0 is 0.0
    assert said["state_hash"] == hashlib.sha256(struct.pack("<q13d", said["time_ns"], *numbers)).hexdigest()
    assert simulated(capsys, "t_handle", "--duration", "0.25")["state_hash"] == said["state_hash"]


def test_a_density_that_is_set_wins_over_the_mass_of_the_scene(tmp_path, capsys):
    scene = tmp_path / "m.yaml"
    scene.write_text("rigid_body: {ros__parameters: {mass: 2.0, initial.linear_velocity: [1.0, 0.0, 0.0]}}\n")

    def mass(*settings: str) -> float:
        words = [word for setting in settings for word in ("--set", setting)]
        said = simulated(capsys, str(scene), "--duration", "0", *words)
        return 2.0 * said["kinetic_energy"]  # at 1 m/s, without spin

    assert mass() == 2.0
    assert mass("density=5000") == make_scenario({"mesh": "t_handle", "density": 5000.0}).setup.body.mass != 2.0
    assert mass("density=5000", "mass=3") == mass("mass=3", "density=5000") == 3.0


def test_what_a_ghost_goes_without_is_said(tmp_path, capsys):
    pytest.importorskip("mcap")
    script = tmp_path / "pokes.yaml"
    script.write_text("- {t: 0.25, torque: [0, 0, 1]}\n- {t: 0.3, torque: [0, 0, 1]}\n")
    words = ["t_handle", "--set", "ghost.integrator=free_body", "--script", str(script), "--duration", "0.5"]
    assert main(["simulate", *words, "--bag", str(tmp_path / "x.mcap")]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "ghost" in line]
    assert len(lines) == 1 and "the ghost continues without a command" in lines[0] and "free_body" in lines[0]


@pytest.mark.parametrize("gravity", ["0 0 -9.81", "0, 0, -9.81", "[0, 0, -9.81]", "0\t0  -9.81"])
def test_several_numbers_may_stand_with_blanks_between_them(gravity, capsys):
    said = simulated(capsys, "t_handle", "--duration", "1", "--set", f"gravity={gravity}")
    assert said["linear_velocity"] == pytest.approx([0.0, 0.0, -9.81], rel=1e-14)


def test_without_a_duration_a_flight_lasts_ten_seconds_or_one_more_than_its_script(tmp_path, capsys):
    script = tmp_path / "pokes.yaml"
    script.write_text("- {t: 0.5, impulse: [0, 0, 0.001]}\n")
    assert simulated(capsys, "book", "--script", str(script))["time_ns"] == 10_000_000_000
    script.write_text("- {t: 12.25, impulse: [0, 0, 0.001]}\n- {t: 0.5, impulse: [0, 0, 0.001]}\n")
    assert simulated(capsys, "book", "--script", str(script))["time_ns"] == 13_250_000_000
    assert main(["simulate", "book", "--script", str(script), "--duration", "2"]) == 0
    assert "1 of the script's 2 commands act at or after the end, 2 s" in capsys.readouterr().err


def test_a_command_that_is_refused_as_it_acts_fails_the_run_as_poke_client_says_it(tmp_path, capsys):
    script = tmp_path / "script.yaml"
    script.write_text("- {t: 0.1, at: {ray: {origin: [9, 9, 9], direction: [1, 0, 0]}}, force: [1, 0, 0]}\n")
    assert main(["simulate", "book", "--script", str(script), "--duration", "0.2", "--json"]) == 1
    said = capsys.readouterr()
    assert json.loads(said.out)["time_ns"] == 200_000_000
    assert "commands refused: 1, ray_miss" in said.err and "accepted: a ray that meets the body" in said.err
