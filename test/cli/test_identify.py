# SPDX-License-Identifier: MIT
"""``rigid_proto identify`` on our own sessions: the verdict, numbers as JSON and URDF, one line for bad input."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from rigid_proto_ros.cli.main import main

POKES = "- {t: 0.5, at: {point: [0.0, 0.03, 0.02]}, force: [1.0, 0.5, 2.0], duration: 0.05}\n"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    """A T-handle poked in flight, as a session, and what it is."""
    folder = tmp_path_factory.mktemp("identify")
    script, bag = folder / "pokes.yaml", folder / "flight.mcap"
    script.write_text(POKES)
    assert main(["simulate", "t_handle", "--script", str(script), "--duration", "1.5", "--bag", str(bag)]) == 0
    return bag, {"mass": 0.1570796, "folder": folder}


def _json(capsys: pytest.CaptureFixture, *words: str) -> dict:
    capsys.readouterr()
    assert main(["identify", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def _inspected(capsys: pytest.CaptureFixture) -> dict:
    capsys.readouterr()
    assert main(["inspect", "t_handle", "--density", "7850", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_poked_session_gives_back_the_body_that_was_flown(flight: tuple, capsys: pytest.CaptureFixture) -> None:
    truth, found = _inspected(capsys), _json(capsys, str(flight[0]))
    assert found["hidden"] == []
    assert found["mass"]["value"] == pytest.approx(truth["mass"], rel=1e-6)
    assert found["inertia"]["iyy"]["value"] == pytest.approx(truth["inertia"][1][1], rel=1e-6)
    assert found["inertia"]["izz"]["value"] == pytest.approx(truth["inertia"][2][2], rel=1e-6)


def test_a_session_with_a_flywheel_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    bag = str(tmp_path / "wheel.mcap")
    wheel = ["--set", "rotor.momentum=[0.0, 1e-4, 0.0]"]
    assert main(["simulate", "t_handle", "--duration", "0.5", "--bag", bag, *wheel]) == 0
    assert main(["replay", bag, "--verify"]) == 0
    capsys.readouterr()
    assert main(["identify", bag]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "has a flywheel" in line


def test_held_wrenches_count_as_long_as_they_acted(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    # Each of its own slot: for a time that is longer or shorter than the timeout, replaced, and ended by hand; and a poke
    # that is ended in the moment in which it begins.
    script, bag = tmp_path / "held.yaml", tmp_path / "held.mcap"
    script.write_text(
        "- {t: 0.1, wrench: {at: {point: [0.0, 0.03, 0.02]}, force: [0.2, 0.1, 0.1], slot: a, duration: 1.9}}\n"
        "- {t: 0.2, wrench: {at: com, force: [0.0, 0.2, 0.0], slot: b, duration: 0.3}}\n"
        "- {t: 0.4, wrench: {at: com, force: [0.1, 0.0, 0.3], slot: c}}\n"
        "- {t: 0.6, at: {point: [0.01, 0.0, 0.02]}, force: [0.0, 0.0, 0.5], slot: c, duration: 1.0}\n"
        "- {t: 2.2, wrench: {at: com, force: [0.0, 0.3, 0.0]}}\n"
        "- {t: 2.4, at: com, force: [9.0, 0.0, 0.0]}\n"
        "- {t: 2.4, service: clear_wrench}\n"
    )
    assert main(["simulate", "t_handle", "--script", str(script), "--duration", "3", "--bag", str(bag)]) == 0
    truth, found = _inspected(capsys), _json(capsys, str(bag))
    assert found["fits"]
    assert found["mass"]["value"] == pytest.approx(truth["mass"], rel=1e-6)
    assert found["inertia"]["iyy"]["value"] == pytest.approx(truth["inertia"][1][1], rel=1e-6)


def test_sessions_of_two_gravities_count_each_with_its_own(flight: tuple, capsys: pytest.CaptureFixture) -> None:
    folder = flight[1]["folder"]
    fall = ["--script", str(folder / "pokes.yaml"), "--duration", "1", "--set", "gravity=[0, 0, -9.81]"]
    assert main(["simulate", "t_handle", *fall, "--bag", str(folder / "fall.mcap")]) == 0
    truth, found = _inspected(capsys), _json(capsys, str(folder / "fall.mcap"), str(flight[0]))
    assert found["fits"]
    assert found["mass"]["value"] == pytest.approx(truth["mass"], rel=1e-5)


def test_a_session_from_the_middle_of_a_long_push_on_tells_the_body(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    script, bag = tmp_path / "push.yaml", tmp_path / "push.mcap"
    script.write_text("- {t: 0.2, at: tip, force: [0.05, 0.02, 0], duration: 1}\n")
    assert main(["simulate", "t_handle", "--script", str(script), "--duration", "3", "--bag", str(bag)]) == 0
    truth, found = _inspected(capsys), _json(capsys, str(bag), "--from", "0.7")
    assert found["fits"]
    assert found["inertia"]["iyy"]["value"] == pytest.approx(truth["inertia"][1][1], rel=1e-4)


def test_its_urdf_is_an_inertial(flight: tuple, capsys: pytest.CaptureFixture) -> None:
    truth = _inspected(capsys)["mass"]
    assert main(["identify", str(flight[0]), "--urdf"]) == 0
    written = ElementTree.fromstring(capsys.readouterr().out).find("mass").get("value")
    assert float(written) == pytest.approx(truth, rel=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nowhere.mcap"], "session"),
        (["FLIGHT", "--from", "2", "--to", "1"], "--from"),
        (["FLIGHT", "--from", "9"], "--from"),
        (["FLIGHT", "--from", "1e300"], "--from"),
        (["FLIGHT", "--pose", "/rigid_body/pose", "--from", "1e300"], "--from"),
        (["FLIGHT", "--gravity", "1e200", "0", "0"], "can't be simulated"),
        (["FLIGHT", "--mass", "1e-300"], "can't be simulated"),
        (["FLIGHT", "--mass", "-1"], "--mass"),
        (["FLIGHT", "--fit", "mass,colour"], "--fit"),
        (["FLIGHT", "--to", "0.5", "--urdf"], "--urdf"),
        (["FLIGHT", "--pose", "/elsewhere"], "--pose"),
        (["FLIGHT", "--fit", "mass,gyro_bias"], "gyro_bias needs an Imu that measures rate"),
        (["FLIGHT", "--fit", "imu_place"], "imu_place needs an Imu that measures acceleration"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    flight: tuple, capsys: pytest.CaptureFixture, words: list[str], message: str
) -> None:
    assert main(["identify", *(str(flight[0]) if word == "FLIGHT" else word for word in words)]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert said[0].startswith("rigid_proto identify: ")
    assert message in said[0]


def test_without_scipy_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    for name in [name for name in sys.modules if name.startswith("rigid_proto_ros.identify.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    assert main(["identify", "x.mcap"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "scipy is missing: pip install 'rigid_proto_ros[identify]'" in line
