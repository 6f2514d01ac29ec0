# SPDX-License-Identifier: MIT
"""A scene file is typed as rcl types it: one file through both readers."""

import os
import shutil
from pathlib import Path

import pytest

from rigid_proto_ros.base import yaml_text
from rigid_proto_ros.base.bundled import scene_names, scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.yaml_text import scalar
from rigid_proto_ros.mesh.locate import resolve_mesh
from rigid_proto_ros.ros.arguments import given_arguments
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.scene.scene_file import read_scene_file, read_scene_text, scene_values
from rigid_proto_ros.scene.script import parse_script

NUMBERS = "1 -1 +1 0 007 010 0x10 -0x1F 1. 1.0 .5 -.5 +2.5 1e3 1e-3 1.5E+2 1e400 1_000 0b1 0o7 09 1e e5 --1 1:30"
TEXTS = "true True TRUE yes no y N on Off false tRUE ja .inf -.inf .nan .NaN inf nan abc 1abc 2020-01-01"
SCALARS = (
    *NUMBERS.split(),
    *TEXTS.split(),
    *("9223372036854775807", "-9223372036854775808", "9" * 400, "9" * 5000, '"1"', "'true'", '"a b"'),
    *("[1, 2]", "[1.0, 2.0]", "[a, b]", "[true, false]", '["1", "2"]'),
)


@pytest.fixture(scope="module")
def rcl_values(ros_environment, tmp_path_factory):
    """Every sample as rcl reads it, by number, from one parameter file."""
    rclpy = pytest.importorskip("rclpy")
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    lines = "".join(f"    p{k}: {text}\n" for k, text in enumerate(SCALARS))
    path.write_text(f"typed:\n  ros__parameters:\n{lines}")
    before = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    context = rclpy.Context()
    try:
        rclpy.init(args=[], context=context, domain_id=int(ros_environment["ROS_DOMAIN_ID"]))
        node = rclpy.create_node(
            "typed",
            context=context,
            cli_args=["--ros-args", "--params-file", str(path)],
            automatically_declare_parameters_from_overrides=True,
        )
        values = {k: node.get_parameter(f"p{k}").value for k in range(len(SCALARS))}
        node.destroy_node()
    finally:
        context.try_shutdown()
        if before is None:
            del os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"]
        else:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = before
    return path, {k: list(v) if not isinstance(v, (str, bool, int, float)) else v for k, v in values.items()}


def test_every_value_has_the_type_and_value_that_rcl_gives_it(rcl_values):
    path, theirs = rcl_values
    ours = read_scene_file(path, "typed").values
    for number, text in enumerate(SCALARS):
        read, expected = ours[f"p{number}"], theirs[number]
        assert (type(read), repr(read)) == (type(expected), repr(expected)), text


def test_later_sections_win_and_names_are_flattened():
    text = """
/**: {ros__parameters: {mass: 1.0, initial: {position: [1.0, 2.0, 3.0]}}}
rigid_body: {ros__parameters: {mass: 2.0}}
other: {ros__parameters: {mass: 9.0}}
/**/rigid_body: {ros__parameters: {contacts.tip: [0.0, 0.0, 1.0]}}
/rigid_body: {ros__parameters: {mass: 3.0}}
"""
    scene = read_scene_text(text)
    assert scene.values == {"mass": 3.0, "initial.position": [1.0, 2.0, 3.0], "contacts.tip": [0.0, 0.0, 1.0]}
    assert scene.wildcard == {"initial.position"}


NAMESPACED = """
/**: {ros__parameters: {mass: 1.0}}
lab: {tool: {ros__parameters: {density: 2.0}}, "*": {ros__parameters: {step: 0.5}}}
/*/tool: {ros__parameters: {accuracy: 0.5}}
/other/tool: {ros__parameters: {scale: 3.0}}
"""


def test_a_section_is_for_the_nodes_that_rcl_gives_it_to():
    assert read_scene_text(NAMESPACED, node_name="lab/tool").values == {
        "mass": 1.0,
        "density": 2.0,
        "step": 0.5,
        "accuracy": 0.5,
    }
    assert read_scene_text(NAMESPACED, node_name="tool").values == {"mass": 1.0}
    alone = "tool: {ros__parameters: {mass: 1.0}}"
    assert read_scene_text(alone, node_name="tool").values == {"mass": 1.0}
    assert read_scene_text(alone, node_name="lab/tool").values == {}


def test_a_file_without_a_section_for_the_node_is_warned_of(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("rigid_body: {ros__parameters: {mass: 1.0}}\n")
    told: list[str] = []
    given = given_arguments(["node", "--ros-args", "--params-file", str(path)], "lab/drone", told.append)
    assert given == {}
    assert told == [f"{path}: there is no section for /lab/drone (it has /rigid_body); /** is for every node"]
    assert given_arguments(["node", "--ros-args", "--params-file", str(path)], "rigid_body", told.append)
    path.write_text("drone: {ros__parameters: {mass: 1.0}}\n")
    assert scene_values(path, told.append) == {}
    assert len(told) == 2 and "/rigid_body" in told[1]
    for text in ("", "# only a remark\n", "{}\n"):
        path.write_text(text)
        assert scene_values(path, told.append) == {}
        assert told.pop() == f"{path}: there is no section for /rigid_body (it has none); /** is for every node"


@pytest.mark.parametrize("mesh", ["body.obj", "parts/body.obj", "book"])
def test_a_relative_mesh_lies_in_the_current_folder_or_else_beside_the_scene_file(mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = Path("w/scene.yaml")
    (scene.parent / mesh).parent.mkdir(parents=True)
    scene.write_text(f"/**: {{ros__parameters: {{mesh: {mesh}}}}}\n")
    beside = str(scene.parent / mesh)
    assert scene_values(scene)["mesh"] == mesh  # found nowhere: the refusal names it as it stands there
    shutil.copy(resolve_mesh("t_handle"), beside)
    if mesh == "book":
        assert scene_values(scene)["mesh"] == mesh
        return
    scenario = read_scene(str(scene))
    assert scenario.parameters.mesh == beside
    again = make_scenario(read_scene_text(scenario.text).values)
    assert again.setup.stays_in_place_of(scenario.setup) and again.setup.mesh_sha256 == scenario.body_mesh.mesh.sha256
    Path(mesh).parent.mkdir(exist_ok=True)
    shutil.copy(resolve_mesh("book"), mesh)
    assert scene_values(scene)["mesh"] == mesh


@pytest.mark.parametrize("name", scene_names())
def test_a_bundled_scene_is_for_a_node_of_any_name(name):
    assert read_scene_file(scene_path(name), "lab/drone").values == read_scene_file(scene_path(name)).values != {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\n[a]: {ros__parameters: {}}", "line 2: got '[a]'; accepted: a name"),
        ("? {a: b}\n: {ros__parameters: {}}", "line 1: got 'a mapping'; accepted: a name"),
        ("rigid_body: {? [a] : {mass: 1.0}}", "line 1: got '[a]'; accepted: a name"),
        ("rigid_body: {ros__parameters: {? [a] : 1.0}}", "line 1: got '[a]'; accepted: a name"),
        ("rigid_body:\n  ros__parameters: {mass: &a [*a]}", "line 2: got 'the alias *a'"),
        ("rigid_body:\n  ros__parameters: &a\n    b: *a", "line 3: got 'the alias *a'"),
        ("a: &a {ros__parameters: {}}\nrigid_body: *a", "line 2: got 'the alias *a'"),
    ],
)
def test_names_that_are_none_and_aliases_are_refused_with_their_line(text, words):
    with pytest.raises(InputError) as refused:
        read_scene_text(text)
    assert words in str(refused.value)


@pytest.mark.parametrize("again", ["    mass: 2.0", "    string:\n      stiffness: 2.0"])
def test_a_parameter_that_stands_twice_in_a_section_is_refused_with_both_lines(again):
    text = "rigid_body:\n  ros__parameters:\n    mesh: hammer\n    mass: 1.0\n    string.stiffness: 1.0\n"
    with pytest.raises(InputError) as refused:
        read_scene_text(text + again)
    first, second = (4, 6) if "mass" in again else (5, 7)
    assert str(refused.value).startswith(f"scene, line {second}: ") and f"line {first}'" in str(refused.value)
    later = "/**:\n  ros__parameters:\n    mass: 3.0\n"
    assert read_scene_text(text + later).values["mass"] == 3.0


def test_a_mesh_stands_for_the_scene_of_that_body_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(resolve_mesh("hammer"), "part.OBJ")
    for name in ("part.OBJ", str(tmp_path / "part.OBJ"), "package://rigid_proto_ros/bodies/hammer.obj"):
        scenario = read_scene(name, {"density": 7850.0})
        assert scenario.parameters.mesh == name and scenario.parameters.density == 7850.0
        assert scenario.setup.stays_in_place_of(make_scenario({"mesh": "hammer", "density": 7850.0}).setup)
    with pytest.raises(InputError, match="bundled scenes are"):
        read_scene("parts.stl")


def test_a_wrong_entry_is_told_before_the_rest_of_a_script_is_read(monkeypatch):
    entries = "- {t: 0.0, forc: [0.0, 0.0, 1.0]}\n" + "- {t: 0.0, force: [0.0, 0.0, 1.0]}\n" * 5
    read: list[str] = []
    monkeypatch.setattr(yaml_text, "typed", lambda event: read.append(event.value) or scalar(event.value))
    with pytest.raises(InputError, match="entry 1: there is no key forc"):
        parse_script(entries)
    monkeypatch.undo()
    assert read == ["0.0", "0.0", "0.0", "1.0"]
    for text, words in (
        ("- {t: 0.0, force: [0, 0, 1]}\n---\n- {t: 2}", "another document"),
        ("- {t: 0.0, t: 1.0, force: [0, 0, 1]}", "line 1: got 't twice in one mapping'"),
        ("- {t: 0.0, [a]: 1.0}", "line 1"),
        ("{t: 0.0}", "got 'dict'"),
        ("- {t: 0.0, force: [0, 0, 1]}\n- {t: 0.0", "line 3"),
    ):
        with pytest.raises(InputError) as refused:
            parse_script(text)
        assert words in str(refused.value), text
    assert parse_script("") == parse_script("# nothing\n") == parse_script("[]") == []


def test_a_huge_whole_number_is_a_double():
    assert scalar("9223372036854775808") == 9.223372036854775808e18


def test_a_scene_that_a_node_tells_works_for_a_node_of_any_name(tmp_path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(make_scenario({"mass": 2.5}).text)
    for name in ("rigid_body", "/lab/drone"):
        assert scene_values(path, node_name=name)["mass"] == 2.5


@pytest.mark.parametrize(
    "rules",
    [
        *([], ["__node:=zz"], ["__name:=zz"], ["__ns:=/a/b"], ["__ns:=/a", "__node:=zz"]),
        *(["rigid_body:__node:=zz"], ["other:__node:=zz"], ["__node:=zz", "__node:=b"], ["__ns:=/a", "__ns:=/b"]),
    ],
)
def test_the_name_that_scene_files_are_read_for_is_the_one_that_rcl_gives_the_node(rules, ros_environment):
    rclpy = pytest.importorskip("rclpy")
    from rigid_proto_ros.ros.arguments import remapped_node_name

    arguments = ["rigid_body_node", "--ros-args", *(word for rule in rules for word in ("-r", rule))]
    context = rclpy.Context()
    rclpy.init(args=arguments, context=context, domain_id=int(ros_environment["ROS_DOMAIN_ID"]))
    try:
        node = rclpy.create_node("rigid_body", context=context, start_parameter_services=False)
        name = node.get_fully_qualified_name()
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    assert f"/{remapped_node_name(arguments)}" == name
