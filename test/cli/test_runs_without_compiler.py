# SPDX-License-Identifier: MIT
"""No command imports a compiler, and scipy only those that say so: what imports one of these here ends with an error."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from ros_process import RosProcess, run

import rigid_proto_ros
from rigid_proto_ros.base import library

COMPILERS = ("numba", "llvmlite")
BODIES = Path(rigid_proto_ros.__file__).parent / "bodies"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot, a sweep and a recording to work on; below it packages that can't be imported."""
    library.loaded(False)  # built where it isn't yet
    made = tmp_path_factory.mktemp("light")
    for name in (*COMPILERS, "scipy"):
        package = made / "refusing" / name
        package.mkdir(parents=True)
        told = f"import sys; print('{name} is imported', file=sys.stderr); raise ModuleNotFoundError(name='{name}')\n"
        (package / "__init__.py").write_text(told, "utf-8")
    for name in COMPILERS:
        (made / "refusing compilers" / name).mkdir(parents=True)
        (made / "refusing compilers" / name / "__init__.py").symlink_to(made / "refusing" / name / "__init__.py")
    (made / "robot.urdf").write_text(
        f'<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" '
        f'izz="1"/></inertial><visual><geometry><mesh filename="{BODIES / "hammer.obj"}"/></geometry></visual></link></robot>\n',
        "utf-8",
    )
    (made / "script.yaml").write_text("- {t: 0.1, at: com, impulse: [0.0, 0.1, 0.0]}\n- {t: 0.2, set: {mass: 2.0}}\n")
    (made / "study.yaml").write_text(
        "scene: t_handle\nduration: 0.1\nvary: {mass: {grid: [1.0, 2.0]}}\nmeasure: {final: [spin]}\n", "utf-8"
    )
    done = run(
        *("rigid_proto", "simulate", "t_handle", "--script", "script.yaml", "--duration", "1", "--bag", "flown.mcap"),
        environment=refusing(made, "compilers"),
        cwd=made,
    )
    assert done.returncode == 0, done.stderr
    return made


def refusing(folder: Path, which: str = "") -> dict[str, str]:
    """An environment in which these packages can't be imported: compilers, or they and scipy."""
    path = [str(folder / f"refusing {which}".rstrip()), *filter(None, [os.environ.get("PYTHONPATH", "")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path)}


COMMANDS = (
    "--help",
    "inspect hammer --verify",
    "inspect hammer --urdf",
    "inspect hammer --json --model shell",
    "inspect hollow_box --repair --fallback box",
    "simulate t_handle --duration 1 --record own.mcap --gltf own.glb --csv own.csv",
    "replay flown.mcap --verify",
    "replay flown.mcap --parquet flown.parquet",
    "replay flown.mcap --repair whole.mcap",
    "replay flown.mcap --at 0.5 --as-scene branch.yaml",
    "sweep study.yaml -o rows.parquet",
    "lesson t_handle --html lesson.html",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_needs_neither_compiler_nor_scipy(folder: Path, command: str) -> None:
    done = run("rigid_proto", *command.split(), environment=refusing(folder), cwd=folder)
    assert "is imported" not in done.stdout + done.stderr
    assert done.returncode in (0, 1), done.stderr


@pytest.mark.parametrize(
    "command",
    [
        "inspect teapot --fallback hull",
        "identify flown.mcap",
        "inspect --compare robot.urdf",
        "inspect --lump robot.urdf",
    ],
)
def test_what_needs_scipy_needs_no_compiler(folder: Path, command: str) -> None:
    pytest.importorskip("scipy")
    done = run("rigid_proto", *command.split(), environment=refusing(folder, "compilers"), cwd=folder)
    assert "is imported" not in done.stdout + done.stderr


def test_the_node_and_its_client_need_neither(folder: Path, ros_environment: dict[str, str]) -> None:
    pytest.importorskip("rclpy")
    environment = {**ros_environment, "PYTHONPATH": refusing(folder)["PYTHONPATH"]}
    arguments = ("--ros-args", "-p", "record:=node.mcap")
    node = RosProcess("rigid_body_node", *arguments, environment=environment, log=folder / "node")
    try:
        done = run("poke_client", "script.yaml", environment=environment, cwd=folder)
        assert done.returncode == 0, done.stderr
    finally:
        node.end()
    assert "is imported" not in node.errors + done.stderr


def test_a_robot_without_scipy_is_judged_as_far_as_that_goes_and_told_the_rest(folder: Path) -> None:
    done = run("rigid_proto", "inspect", "--compare", "robot.urdf", "--json", environment=refusing(folder), cwd=folder)
    assert done.returncode == 1 and json.loads(done.stdout)["links"][0]["status"] == "explained"
    told = [line for line in done.stderr.splitlines() if not line.endswith("is imported")]
    assert told == [
        "rigid_proto inspect: scipy is missing: pip install 'rigid_proto_ros[meshes]'; until then nobody looks along the "
        "normals of a shape's hull, nor for a hull as the cause"
    ]
