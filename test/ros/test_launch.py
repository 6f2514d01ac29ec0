# SPDX-License-Identifier: MIT
"""The launch file: its arguments are described and used; where launch is installed, the description is built."""

from __future__ import annotations

import importlib.util
import logging
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import rigid_proto_ros
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.parameters.declarations import PARAMETERS
from rigid_proto_ros.ros.poke_client import main as poke_client

SOURCE = Path(rigid_proto_ros.__file__).resolve().parent.parent
FILE = SOURCE / "launch" / "rigid_body.launch.py"
pytestmark = pytest.mark.skipif(not FILE.is_file(), reason="not run from a source tree")

# From ROS; the launch folder of this repository can't be taken for it, because it has no launch_ros beside it.
LAUNCH_INSTALLED = importlib.util.find_spec("launch_ros") is not None


@pytest.fixture
def launch_file(monkeypatch):
    """What the launch file defines, with stand-ins for launch."""
    keep = lambda *_, **given: SimpleNamespace(**given)  # noqa: E731
    configuration = lambda name: SimpleNamespace(perform=lambda context: context.launch_configurations[name])  # noqa: E731
    for name, content in {
        "launch": {"LaunchContext": dict, "LaunchDescription": keep},
        "launch.actions": dict.fromkeys(("DeclareLaunchArgument", "OpaqueFunction", "Shutdown"), keep),
        "launch.logging": {"get_logger": logging.getLogger},
        "launch.substitutions": {"LaunchConfiguration": configuration},
        "launch_ros": {},
        "launch_ros.actions": {"Node": keep},
    }.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**content))
    return SimpleNamespace(**runpy.run_path(str(FILE)))


@pytest.fixture
def launched(launch_file):
    """launched(arguments): the actions."""
    defaults = {name: default for name, default, _ in launch_file.ARGUMENTS}
    return lambda **given: launch_file.nodes(SimpleNamespace(launch_configurations={**defaults, **given}))


def test_every_argument_is_described_and_used_and_those_that_become_parameters_are_the_scenes_by_default(launch_file):
    for name, default, description in launch_file.ARGUMENTS:
        assert len(description) > 10
        assert FILE.read_text("utf-8").count(f'"{name}"') > 1, f"{name} is declared and not used"
        assert default == "" or name not in {*PARAMETERS, "use_sim_time"}
    assert {"mesh", "viewer", "record"} <= PARAMETERS.keys()


def test_client_accepts_the_options_that_the_launch_file_gives_it(capsys) -> None:
    text = FILE.read_text("utf-8")
    for option in ("--node", "--timeout", "--reset"):
        assert f'"{option}"' in text
    script = SOURCE / "msg_examples" / "flip_and_poke.yaml"
    # The first start may build the kernels for minutes; a client without a limit ends with its node.
    assert '"--timeout", "0"' in text and "on_exit=Shutdown()" in text
    assert poke_client([str(script), "--node", "/a/b", "--timeout", "0", "--reset", "--dry-run"]) == 0
    assert '"at": "tip"' in capsys.readouterr().out


def test_a_node_of_another_name_gets_the_scene_its_own_section_and_a_mesh_beside_the_file(launched, tmp_path) -> None:
    (tmp_path / "part.obj").touch()
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "rigid_body: {ros__parameters: {mesh: part.obj, density: 1.0, viewer: web}}\n"
        "/**: {ros__parameters: {mass: 2.0}}\n"
        "/lab/nut: {ros__parameters: {density: 3.0}}\n"
    )
    assert launched(scene=str(scene))[0].parameters == [str(scene)]
    assert launched(scene=str(scene), viewer="none", use_sim_time="true")[0].parameters == [
        str(scene),
        {"viewer": "none", "use_sim_time": True},
    ]
    shared = {"mesh": str(tmp_path / "part.obj"), "viewer": "web", "mass": 2.0}
    assert launched(scene=str(scene), name="nut")[0].parameters == [{**shared, "density": 1.0}]
    assert launched(scene=str(scene), name="nut", namespace="lab")[0].parameters == [{**shared, "density": 3.0}]


def test_any_parameter_is_taken_by_its_name_over_a_file_of_parameters_over_the_scene(launched, tmp_path, caplog):
    own = tmp_path / "own.yaml"
    own.write_text("/**: {ros__parameters: {mass: 2.0}}\n")
    given = {"publish_rate": "500", "gravity": "[0, 0, -9.81]", "publish_tf": "true", "contacts.top": "[0.0, 0.0, 0.1]"}
    (node,) = launched(params_file=str(own), log_level="debug", integrator="rk4", **given)
    values = {"publish_rate": 500.0, "gravity": [0.0, 0.0, -9.81], "publish_tf": True, "contacts.top": [0.0, 0.0, 0.1]}
    assert node.parameters[1:] == [str(own), {"integrator": "rk4", **values}]
    assert node.ros_arguments == ["--log-level", "debug"]
    assert launched(name="nut", params_file=str(own))[0].parameters[1] == {"mass": 2.0}
    with pytest.raises(InputError, match="publish_rate"):
        launched(publish_rate="fast")
    # What is nearly one is warned of; the rest may be another launch file's.
    assert launched(publish_rat="500", world="empty")[0].parameters == launched()[0].parameters
    assert [r.getMessage() for r in caplog.records] == ["publish_rat:=500 is no parameter; did you mean publish_rate?"]


def test_a_script_is_a_file_or_the_name_of_a_bundled_one(launched, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    bundled = str(SOURCE / "msg_examples" / "flip_and_poke.yaml")
    assert launched(script="flip_and_poke")[1].arguments[0] == bundled
    assert launched(script="flip_and_poke.yaml")[1].arguments[0] == bundled
    (tmp_path / "pokes.yaml").touch()
    assert launched(script="pokes.yaml")[1].arguments[0] == "pokes.yaml"


@pytest.mark.skipif(not LAUNCH_INSTALLED, reason="launch_ros comes with a ROS installation, not with the wheels")
@pytest.mark.parametrize("values", [{}, {"script": "flip_and_poke", "name": "nut", "namespace": "lab"}])
def test_description_gives_the_node_and_where_asked_the_client(values: dict) -> None:
    from launch import LaunchContext

    spec = importlib.util.spec_from_file_location("rigid_body_launch", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    context = LaunchContext()
    context.launch_configurations.update({name: default for name, default, _ in module.ARGUMENTS})
    context.launch_configurations.update(values)
    actions = module.nodes(context)
    assert len(description.entities) == len(module.ARGUMENTS) + 1
    assert len(actions) == (2 if values else 1)
