# SPDX-License-Identifier: MIT
"""The inspect command: its JSON object, exit statuses, scale and mass, verification, pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mesh_files import CUBE_TRIANGLES, CUBE_VERTICES, obj

from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass import properties


def inspect(capsys, *arguments: str) -> tuple[int, str, str]:
    status = main(["inspect", *arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def report(capsys, *arguments: str) -> dict:
    status, out, err = inspect(capsys, *arguments, "--json")
    assert (status, err) == (0, "")
    assert out.count("\n") == 1
    return json.loads(out)


def refusal(capsys, *arguments: str) -> str:
    status, out, err = inspect(capsys, *arguments)
    assert (status, out) == (2, "")
    assert err.count("\n") == 1
    return err


def test_the_numbers_of_the_json_object_agree_with_each_other(capsys):
    found = report(capsys, "hammer")
    assert found["mass"] == pytest.approx(1000.0 * found["volume"], rel=1e-15)
    assert found["density"] == 1000.0
    axes, moments = np.array(found["principal_axes"]), np.array(found["principal_moments"])
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-14)
    assert axes @ np.diag(moments) @ axes.T == pytest.approx(np.array(found["inertia"]), abs=1e-14 * moments[2])
    assert list(moments) == sorted(moments)
    assert set(found["models"]) == {"solid", "shell", "points", "bounding_box"}
    assert found["models"]["solid"]["inertia"] == found["inertia"]
    assert {m["mass"] for m in found["models"].values()} == {found["mass"]}
    low, high = np.array(found["bounding_box"]["min"]), np.array(found["bounding_box"]["max"])
    assert np.all(low < found["center_of_mass"])
    assert np.all(high > found["center_of_mass"])
    assert found["verdict"] == []
    assert (found["watertight"], found["winding_consistent"], found["components"]) == (True, True, 1)


def test_scale_mirrors_and_stretches(capsys):
    plain = report(capsys, "hammer")
    scaled = report(capsys, "hammer", "--scale", "-2", "1", "1e-1")
    assert scaled["volume"] == pytest.approx(0.2 * plain["volume"], rel=1e-14)
    assert scaled["center_of_mass"][0] == pytest.approx(-2 * plain["center_of_mass"][0], rel=1e-13)
    assert scaled["bounding_box"]["max"][0] == pytest.approx(-2 * plain["bounding_box"]["min"][0], rel=1e-14)
    assert report(capsys, "hammer", "--scale", "0.5")["area"] == pytest.approx(0.25 * plain["area"], rel=1e-14)
    assert report(capsys, "hammer", "--scale", "-.5e0", "1", "1")["volume"] == pytest.approx(0.5 * plain["volume"])


def test_mass_wins_over_size_and_ballast_is_added_to_every_model(capsys):
    found = report(capsys, "book", "--mass", "2.5", "--scale", "2", "--model", "bounding_box")
    assert found["mass"] == 2.5 and found["inertia"] == found["models"]["bounding_box"]["inertia"]
    assert found["density"] == pytest.approx(2.5 / found["volume"], rel=1e-15)
    plain, loaded = report(capsys, "book", "--mass", "2"), report(capsys, "book", "--mass", "2", "--ballast", "1", "0.1", "0", "-1e-2")  # fmt: skip
    assert {m["mass"] for m in loaded["models"].values()} == {3.0}
    expected = (2.0 * np.array(plain["center_of_mass"]) + np.array([0.1, 0.0, -0.01])) / 3.0
    assert loaded["center_of_mass"] == pytest.approx(expected, abs=1e-16)


def test_verification_states_errors_against_exact_arithmetic(capsys):
    found = report(capsys, "hollow_box", "--verify", "--scale", "1", "-3", "1e-3")
    assert set(found["verification"]) == {"volume_error", "center_of_mass_error", "inertia_error"}
    assert max(found["verification"].values()) <= 1e-15


def test_a_verification_that_fails_exits_1(capsys, monkeypatch):
    true = properties.mesh_moments

    def slightly_off(*surface):
        moments = true(*surface)
        return replace(moments, measure=(1 + 1e-12) * moments.measure)

    monkeypatch.setenv("RIGID_PROTO_CACHE", "off")
    monkeypatch.setattr(properties, "mesh_moments", slightly_off)
    status, out, err = inspect(capsys, "book", "--verify", "--json")
    assert status == 1
    assert json.loads(out)["verification"]["volume_error"] == pytest.approx(1e-12, rel=1e-2)
    assert "1e-13" in err


def test_an_open_mesh_has_its_other_models_with_a_given_mass(capsys, tmp_path):
    (tmp_path / "open.obj").write_bytes(obj(faces=CUBE_TRIANGLES[:-2]))
    path = str(tmp_path / "open.obj")
    found = report(capsys, path, "--model", "shell", "--mass", "2")
    assert found["volume"] is None
    assert found["density"] is None
    assert found["models"]["solid"] is None
    assert found["area"] == pytest.approx(5.0)
    assert (found["watertight"], [f["code"] for f in found["verdict"]]) == (False, ["open"])
    assert "--mass" in refusal(capsys, path, "--model", "shell")
    assert report(capsys, path, "--repair")["volume"] == pytest.approx(1.0, rel=1e-15)
    assert report(capsys, path, "--fallback", "hull")["volume"] == pytest.approx(1.0, rel=1e-14)
    assert report(capsys, path, "--fallback", "box", "--verify")["verification"]["volume_error"] <= 1e-15


@pytest.mark.parametrize("shape", ["hull", "box"])
def test_a_flat_mesh_has_no_shape_to_take_instead_and_its_report_is_printed(capsys, tmp_path, shape):
    (tmp_path / "flat.obj").write_bytes(obj(CUBE_VERTICES * [1.0, 1.0, 0.0]))
    arguments = (str(tmp_path / "flat.obj"), "--fallback", shape)
    status, out, err = inspect(capsys, *arguments, "--json")
    assert status == 2 and err.count("\n") == 1 and json.loads(out)["verdict"]
    assert report(capsys, *arguments, "--mass", "2", "--model", "bounding_box")["volume"] is None
    status, out, err = inspect(capsys, *arguments, "--mass", "2", "--model", "bounding_box", "--verify", "--json")
    assert status == 2 and err.count("\n") == 1 and json.loads(out)["verification"] is None


def test_an_open_mesh_that_is_to_be_verified_is_refused_with_its_report(capsys, tmp_path):
    path = tmp_path / "open.obj"
    path.write_bytes(obj(faces=CUBE_TRIANGLES[:-1]))
    status, out, err = inspect(capsys, str(path), "--mass", "1", "--model", "points", "--verify", "--json")
    assert status == 2 and err.count("\n") == 1 and out.count("\n") == 1
    found = json.loads(out)
    assert found["verification"] is None and found["mass"] == 1.0 and found["verdict"]


def test_millimetres_are_suspected(capsys, meshes):
    found = report(capsys, str(meshes / "nefertiti_lowres.obj"))
    unchecked, suspicion = found["verdict"]  # it has 70,000 triangles
    assert (unchecked["code"], suspicion["code"]) == ("self_crossing_unchecked", "unit_suspicion")
    assert "--scale 0.001" in suspicion["message"]
    assert report(capsys, str(meshes / "nefertiti_lowres.obj"), "--scale", "0.001")["verdict"] == [unchecked]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("book", "--scale", "0"), "1e-9 <= |s|"),
        (("book", "--scale", "1", "2"), "one or three"),
        (("book", "--scale", "nan"), "1e-9 <= |s|"),
        (("book", "--mass", "-1"), "> 0"),
        (("book", "--mass", "inf"), "> 0"),
        (("book", "--mass", "nan"), "> 0"),
        (("book", "--density", "0"), "> 0"),
        (("book", "--mass", "1", "--density", "2"), "not both"),
        (("book", "--ballast", "-1", "0", "0", "0"), "mass >= 0"),
        (("--lump", "robot.urdf", "--scale", "2"), "the robot's file says"),
        (("--lump", "robot.urdf", "--model", "shell"), "the robot's file says"),
        (("hammer", "--fix", "OUT"), "--fix: needs --compare ROBOT\n"),
        (("hammer", "--tolerance", "0.1"), "--tolerance: needs --compare ROBOT\n"),
        (("hammer", "--tolerance", "0"), "--tolerance: needs --compare ROBOT\n"),
        (("hammer", "--all"), "--all: needs --compare ROBOT --fix OUT\n"),
        (("hammer", "--as-scene", "x.yaml"), "--as-scene: needs --lump ROBOT\n"),
        (("hammer", "--package-path", "DIR"), "--package-path: needs --compare ROBOT or --lump ROBOT\n"),
        ((), "--compare"),
    ],
)
def test_what_is_refused_says_what_would_be_accepted(capsys, arguments, words):
    assert words in refusal(capsys, *arguments)


@pytest.mark.parametrize(
    "arguments",
    [("book", "--mass", "heavy"), ("book", "--scale", "two"), ("book", "--model", "cuboid"), ("book", "--json", "--urdf"), ("book", "--colour"), ("book", "--model", "explicit")],
)  # fmt: skip
def test_wrong_usage_exits_2_with_one_line(capsys, arguments):
    with pytest.raises(SystemExit) as ended:
        main(["inspect", *arguments])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_printed_report_names_every_model_and_remark(capsys, tmp_path):
    (tmp_path / "inward.obj").write_bytes(obj(faces=CUBE_TRIANGLES[:, ::-1]))
    status, out, _ = inspect(capsys, str(tmp_path / "inward.obj"), "--verify")
    assert status == 0
    for words in ("solid", "shell", "points", "bounding_box", "inward", "1000 kg", "exact rational"):
        assert words in out


def test_what_rounding_leaves_is_0_for_people_and_itself_in_json(capsys):
    assert main(["inspect", "t_handle"]) == 0
    told = capsys.readouterr().out
    assert (
        "inertia             2.14234e-05   0             0 " in told and "centre of mass      0             0  " in told
    )
    assert main(["inspect", "t_handle", "--json"]) == 0
    assert 0.0 < abs(json.loads(capsys.readouterr().out)["inertia"][0][1]) < 1e-14
