# SPDX-License-Identifier: MIT
"""Numbers are numbers: whole numbers, text and mixed lists mean the same as doubles, for every numeric parameter."""

from __future__ import annotations

import math

import pytest
from ros_client import RosClient
from ros_process import running_node

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.parameters.declarations import PARAMETERS, PATTERNS, READ_ONLY, Parameter
from rigid_proto_ros.scene.scenario import read_scene
from rigid_proto_ros.scene.scene_file import scene_values

NUMERIC = [p for p in (*PARAMETERS.values(), *PATTERNS.values()) if p.type in ("double", "doubles")]
IDS = [p.name for p in NUMERIC]
SPECIAL = {"explicit_inertia.tensor": [1, 0, 0, 1, 0, 1], "initial.orientation_xyzw": [0, 0, 0, 1]}


def whole(parameter: Parameter) -> object:
    """A whole number, or list of them, that the parameter accepts."""
    if parameter.type == "doubles":
        return SPECIAL.get(parameter.name, list(range(1, parameter.lengths[-1] + 1)))
    return 1 if parameter.upper >= 1 else 0


def mixed(value: object) -> object:
    """The same with whole numbers, doubles and text among each other."""
    if isinstance(value, list):
        return [str(v) if k == 0 else float(v) if k == 1 else v for k, v in enumerate(value)]
    return f" {value}e0 "


@pytest.mark.parametrize("parameter", NUMERIC, ids=IDS)
def test_every_spelling_is_the_same_number(parameter):
    value = whole(parameter)
    doubles = [float(v) for v in value] if isinstance(value, list) else float(value)
    for spelling in (value, str(value), doubles, str(doubles), mixed(value)):
        converted = parameter.convert(spelling)
        assert converted == doubles
        assert all(type(v) is float for v in (converted if isinstance(converted, list) else [converted]))


def test_a_seed_keeps_all_its_digits():
    seed = PARAMETERS["noise.seed"]
    assert seed.convert(2**53 + 1) == 2**53 + 1
    assert seed.convert(3.0) == 3
    for bad in (2**62 + 1, 10**400, -1, True):
        with pytest.raises(InputError):
            seed.convert(bad)


@pytest.mark.parametrize("parameter", NUMERIC, ids=IDS)
def test_what_is_no_number_within_bounds_is_refused_with_field_value_and_what_is_accepted(parameter):
    value = whole(parameter)
    bad = [True, "yes", "", "1_000", None, {}, math.nan, math.inf, "nan", "[1, 2", parameter.upper * 10 + 1e101]
    if isinstance(value, list):
        bad += [
            [*value, 1, 1],
            [],
            [math.nan] * len(value),
            ["x"] * len(value),
            [[1.0]] * len(value),
            [True] * len(value),
        ]
    else:
        bad += [[1.0, 2.0], "[1, 2]"]
    if parameter.lower > -math.inf and not isinstance(value, list):
        bad.append(parameter.lower - 1.0)
        bad += [parameter.lower] if parameter.above else []
    for received in bad:
        with pytest.raises(InputError) as refused:
            parameter.convert(received)
        message = str(refused.value)
        assert message.startswith(parameter.name)
        assert parameter.accepted in message


def settable(parameter: Parameter) -> bool:
    """Parameters whose whole number makes a scene that flies as before but for that number."""
    return parameter.name in PARAMETERS and parameter.name not in ("publish_rate", "real_time_factor", "step")


def scene_lines(spelled) -> str:
    lines = [f"    {p.name}: {spelled(whole(p))}" for p in NUMERIC if settable(p)]
    lines += ["    contacts.tip: " + spelled([1, 2, 3]), "    ballast.nut: " + spelled([1, 0, 0, 1])]
    return "\n".join(["/**:", "  ros__parameters:", "    mesh: book", *lines, ""])


@pytest.mark.parametrize("spelled", [str, lambda value: f'"{value}"'], ids=["whole numbers", "text"])
def test_a_file_means_the_same_however_its_numbers_are_spelled(spelled, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(scene_lines(spelled), encoding="utf-8")
    values = read_scene(str(path)).parameters.named()
    for parameter in filter(settable, NUMERIC):
        assert values[parameter.name] == parameter.convert(whole(parameter)), parameter.name
    assert values["contacts.tip"] == [1.0, 2.0, 3.0]


def test_the_node_takes_every_spelling_from_files_the_command_line_and_services(ros_environment, tmp_path):
    pytest.importorskip("rclpy")
    path = tmp_path / "scene.yaml"
    # One file with all spellings: every other parameter as text, the rest as whole numbers.
    spellings = iter(range(1000))
    path.write_text(scene_lines(lambda v: f'"{v}"' if next(spellings) % 2 else str(v)), encoding="utf-8")
    line = {"linear_damping": 2, "gravity": [0, 0, 3], "angular_damping": "1e-3"}
    with (
        RosClient(ros_environment) as client,
        running_node(ros_environment, tmp_path / "node", line, "--params-file", path),
    ):
        read = client.get(*(p.name for p in NUMERIC if settable(p)))
        given = {"linear_damping": 2.0, "gravity": [0.0, 0.0, 3.0], "angular_damping": 1e-3}
        for parameter in filter(settable, NUMERIC):
            expected = given.get(parameter.name, parameter.convert(whole(parameter)))
            assert read[parameter.name] == expected, parameter.name
        live = [p for p in filter(settable, NUMERIC) if p.changes != READ_ONLY and p.name != "density"]
        for spelled in (lambda value: value, str, lambda value: str(mixed(value))):
            assert client.set_named({p.name: spelled(whole(p)) for p in live}) == [[True, ""]] * len(live)
            assert client.get(*(p.name for p in live)) == {p.name: p.convert(whole(p)) for p in live}


def test_a_parameter_of_an_earlier_version_is_left_out_without_effect_and_refused_by_name_with_one(tmp_path) -> None:
    scene = tmp_path / "old.yaml"
    head = "rigid_body:\n  ros__parameters:\n    "
    scene.write_text(f"{head}imu_noise: {{gyroscope_bias: [0.0, 0.0, 0.0]}}\n    step_until: 0.0\n    mass: 2.0\n")
    assert scene_values(scene) == {"mass": 2.0}
    for name, value in (("imu_noise.gyroscope_range", 2.0), ("noise.gyroscope", "[0.1]")):
        scene.write_text(f"{head}{name}: {value}\n")
        with pytest.raises(InputError, match=f"{name}.*earlier version"):
            scene_values(scene)
