# SPDX-License-Identifier: MIT
"""The page's motion: its own tests in Node, and what it says and writes beside what Python says and writes."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import mesh_files as mf
import numpy as np
import pytest
from mass_solids import box, moved, together
from page_tools import TESTS, kernels, node, packages, run_node

from rigid_proto_ros.base.bundled import example_names, example_path, scene_path
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.base.yaml_text import yaml_value
from rigid_proto_ros.page.bundle import SOURCE
from rigid_proto_ros.page.file import take_of
from rigid_proto_ros.scene.scenario import make_scenario, read_scene
from rigid_proto_ros.scene.scenario_run import OfflineRun
from rigid_proto_ros.scene.scene_file import scene_values
from rigid_proto_ros.scene.script import expand_script, parse_script, read_script
from rigid_proto_ros.simulation.commands import nanoseconds


def answered(page_file: Path, **asked: Any) -> dict[str, Any]:
    """What page/test/asked.ts answers."""
    found: dict[str, Any] = json.loads(run_node(TESTS / "asked.ts", kernels(), page_file, input=json.dumps(asked)))
    return found


@pytest.mark.slow
def test_what_the_motion_does_for_those_that_use_it(page_file: Path) -> None:
    environment = {**os.environ, "KERNELS": str(kernels()), "DATA": str(page_file)}
    run_node("--test", *sorted(TESTS.glob("*.test.ts")), env=environment)


def test_the_program_is_of_the_types_that_it_states() -> None:
    compiler = packages() / "typescript" / "bin" / "tsc"
    done = subprocess.run([node(), compiler, "--noEmit"], cwd=SOURCE, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


SCENE = {"mesh": "t_handle", "density": 7850.0}
REFUSED: list[tuple[dict[str, Any], dict[str, Any] | None]] = [
    (SCENE, {"set": {"mass": -1.0}}),
    (SCENE, {"set": {"scale": [0.0, 1.0, 1.0]}}),
    (SCENE, {"set": {"scale": [1.0, 1.0]}}),
    (SCENE, {"set": {"density": 1e-300, "scale": 1e-9}}),
    (SCENE, {"set": {"mesh": "", "inertia_model": "explicit", "explicit_inertia.mass": 0.0}}),
    (SCENE, {"set": {"inertia_model": "explicit", "explicit_inertia.tensor": [1.0, 0.0, 0.0, 1.0, 0.0, 9.0]}}),
    (SCENE, {"set": {"inertia_model": "explicit", "explicit_inertia.tensor": [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}}),
    (SCENE, {"set": {"inertia_model": "explicit", "explicit_inertia.tensor": [-1.0, 0.2, 0.0, 2.0, 0.1, 2.0]}}),
    (SCENE, {"set": {"linear_damping": 1e9}}),
    (SCENE, {"set": {"angular_damping": 1e9}}),
    ({**SCENE, "string.attached": True}, {"set": {"string.frequency": 1e9}}),
    ({**SCENE, "string.attached": True}, {"set": {"string.stiffness": 1e20}}),
    ({**SCENE, "string.attached": True, "string.stiffness": 1e6}, {"set": {"string.damping_ratio": 1e6}}),
    (SCENE, {"set": {"initial.orientation_xyzw": [0.0, 0.0, 0.0, 0.0]}}),
    (SCENE, {"set": {"inertia_model": "walled", "wall_thickness": 0.02}}),
    (SCENE, {"set": {"inertia_model": "walled", "wall_thickness": 0.0}}),
    (SCENE, {"set": {"inertia_model": "walled", "infill": 1.5}}),
    (SCENE, {"set": {"contacts.tip": [0.0, 0.0, 0.0]}}),
    ({**SCENE, "integrator": "lie_midpoint"}, {"set": {"gyroscopic": False}}),
    (SCENE, {"force": [1e20, 0.0, 0.0]}),
    (SCENE, {"at": {"point": [0.0, 0.05, 0.0]}, "impulse": [0.0, 1e18, 0.0]}),
    (SCENE, {"at": {"vertex": 99999}, "force": [1.0, 0.0, 0.0], "duration": 0.5}),
    (SCENE, {"at": {"ray": {"origin": [9.0, 9.0, 9.0], "direction": [1.0, 0.0, 0.5]}}, "force": [1.0, 0.0, 0.0]}),
    ({**SCENE, "mesh": "", "inertia_model": "explicit"}, {"at": {"vertex": 0}, "force": [1.0, 0.0, 0.0]}),
    ({**SCENE, "mesh": "", "inertia_model": "explicit"}, {"at": "origin", "push": 1.0}),
    (SCENE, {"string": {"attach": [0.0, 0.0, 0.07], "target": [1e30, 0.0, 0.0]}}),
    (SCENE, {"force": [1e300, 0.0, 0.0]}),
    ({**SCENE, "scale": [0.0, 1.0, 1.0]}, None),
    ({**SCENE, "integrator": "free_body", "string.attached": True}, None),
]
"""Scenes, and what is refused in them at time 0: an entry, or the scene itself."""


def refused_by_python(values: dict[str, Any], entry: dict[str, Any] | None) -> str:
    """The line that Python says."""
    try:
        run = OfflineRun(make_scenario(values))
        if entry is not None:
            run.submit(expand_script([{"t": 0.0, **entry}]))
    except InputError as error:
        return str(error).removeprefix("script, command 1 at 0 s, ").removeprefix("script, entry 1, ")
    run.advance(1)
    (text,) = run.simulation.refusals.values()
    return text


@pytest.mark.slow
def test_refusals_have_the_words_of_python(page_file: Path) -> None:
    told = answered(page_file, refusals=REFUSED)["refusals"]
    for (values, entry), page in zip(REFUSED, told, strict=True):
        assert page == refused_by_python(values, entry), (values, entry)


@pytest.mark.slow
def test_a_body_of_parts_is_refused_as_one_printed_part(page_file: Path, tmp_path: Path) -> None:
    (tmp_path / "whole.yaml").write_text("parts: {a: {mesh: hammer, density: 500}, b: {mesh: book, mass: 1}}")
    values = {"mesh": str(tmp_path / "whole.yaml")}
    entry = {"set": {"inertia_model": "walled"}}
    told = answered(page_file, take=json.dumps(take_of(values)), untilNs=0, entry=entry)
    assert told["refused"] == refused_by_python(values, entry)


@pytest.mark.slow
def test_numbers_are_written_as_python_writes_them(page_file: Path) -> None:
    rng = np.random.default_rng(1)
    several = [*(10.0 ** rng.uniform(-310, 308, 500) * rng.choice([-1, 1], 500)), *rng.normal(0.0, 10.0, 500)]
    several += [
        *np.round(rng.normal(0.0, 1e3, 300), 2),
        *(10.0 ** np.arange(-10, 23)),
        *range(20),
        1e16,
        123456789012345680.0,
    ]
    several += [9.9999e5, 999999.5, 0.00009999995, 1e-5, 0.1, 5e-324, 1.7976931348623157e308, 0.5e-9, 1.5e-9, 2.5e-9]
    numbers = [float(x) for x in several]
    for x, told in zip(numbers, answered(page_file, numbers=numbers)["numbers"], strict=True):
        assert told[:4] == [repr(x), f"{x:.3g}", f"{x:g}", f"{x:.9g}"]
        assert told[4] == yaml_value(x) and told[5] == f"[{yaml_value(x)}]"
        if abs(x) < 1e6:
            assert told[6] == nanoseconds(x)


def flown(take: dict[str, Any], page_file: Path, seconds: float) -> dict[str, Any]:
    return answered(page_file, take=json.dumps(take), untilNs=nanoseconds(seconds))


def hash_of(scene: Path, seconds: float) -> str:
    run = OfflineRun(read_scene(str(scene)))
    run.advance(nanoseconds(seconds))
    return run.simulation.state.sha256()


@pytest.mark.slow
def test_a_mesh_of_one_s_own_flies_as_python_flies_it(page_file: Path, tmp_path: Path) -> None:
    overlapping = together(box(cells=2), moved(box(cells=2), (0.5, 0.25, 0.0)))
    files = {
        "cube.ply": (mf.ply_binary(), {}),
        "quads.obj": (mf.obj(faces=mf.CUBE_QUADS), {"inertia_model": "shell", "scale": [1.0, 2.0, 0.5], "mass": 1.0}),
        "open.obj": (mf.obj(faces=mf.CUBE_QUADS[1:]), {"mesh_repair": True}),
        "two.obj": (mf.obj(*overlapping), {}),
        "walls.obj": (mf.obj(faces=mf.CUBE_QUADS), {"inertia_model": "walled", "wall_thickness": 0.03}),
        "stretched.obj": (mf.obj(), {"inertia_model": "walled", "wall_thickness": 0.01, "scale": [1.0, -2.0, 0.5]}),
        "parts.yaml": (b"parts: {a: {mesh: cube.ply, mass: 5}, b: {mesh: two.obj, position: [2, 0, 0]}}", {}),
    }
    for name, (content, values) in files.items():
        mesh = tmp_path / name
        mesh.write_bytes(content)
        given = {
            "mesh": str(mesh),
            "initial.angular_velocity": [1.0, 2.0, 0.1],
            "ballast.nut": [10.0, 0.1, 0.2, 0.3],
            **values,
        }
        told = flown(take_of(given), page_file, 1.5)
        saved = tmp_path / "saved"
        saved.mkdir(exist_ok=True)
        (saved / "scene.yaml").write_text(told["files"]["scene"])
        if not name.endswith(".yaml"):
            (saved / told["files"]["mesh"]["name"]).write_text(told["files"]["mesh"]["text"])
        else:  # a page has no files of parts: they are those that it was made of
            assert told["files"]["mesh"] is None
            shutil.copytree(tmp_path, saved, dirs_exist_ok=True, ignore=shutil.ignore_patterns("saved"))
        run = OfflineRun(make_scenario(given))
        run.advance(nanoseconds(1.5))
        assert told["hash"] == run.simulation.state.sha256(), name
        # And so do the files that the page saves.
        assert told["hash"] == hash_of(saved / "scene.yaml", 1.5), name


SCRIPTED = {
    "ballast_in_flight": ("ballast_stops_flip", 8.0),
    "com_or_rim": ("com_or_rim", 6.0),
    "flip_and_poke": ("t_handle", 9.0),
    "heavier_in_flight": ("t_handle", 7.0),
    "pull_on_string": ("t_handle", 8.0),
    "same_force_three_ways": ("t_handle", 8.5),
    "weigh_at_com": ("weigh_by_throwing", 3.0),
    "weigh_by_throwing": ("weigh_by_throwing", 3.0),
    "wheel_spun_up": ("flywheel", 3.0),
}
"""Of each example script the scene that it is for, and seconds."""


@pytest.mark.slow
def test_every_example_script_plays_in_the_page_as_python_plays_it(page_file: Path) -> None:
    assert sorted(SCRIPTED) == sorted(example_names())
    for name, (scene, seconds) in SCRIPTED.items():
        script, values = read_script(example_path(name)), scene_values(scene_path(scene))
        take = take_of(values, script)
        assert len(take["script"]) == len(script)
        told = flown(take, page_file, seconds)
        run = OfflineRun(read_scene(scene), script)
        run.advance(nanoseconds(seconds))
        assert told["hash"] == run.simulation.state.sha256(), name


def test_a_script_of_what_the_page_cant_do_is_refused_in_one_line() -> None:
    values = scene_values(scene_path("t_handle"))
    repeated = parse_script("- {t: 1.0, at: tip, impulse: [0, 0, 1.0e-3], repeat: 3, every: 0.5, jitter: 0.1}")
    times = [entry["t"] for entry in take_of(values, repeated)["script"]]
    assert len(times) == 3 and times == [command.stamp_ns / 1e9 for command in repeated]
    for text, word in (
        ("- {t: 0, thrusters: [1.0]}", "thrusters"),
        ("- {t: 0, set: {publish_rate: 10.0}}", "publish_rate"),
    ):
        with pytest.raises(InputError, match=word) as refused:
            take_of(values, parse_script(text))
        assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_every_bundled_scene_flies_as_python_flies_it(page_file: Path, tmp_path: Path) -> None:
    from rigid_proto_ros.base.bundled import scene_names
    from rigid_proto_ros.page.data import bundled_values

    for name in scene_names():
        values = bundled_values(name)
        told = flown(take_of(values), page_file, 2.0)
        run = OfflineRun(make_scenario(values))
        run.advance(nanoseconds(2.0))
        assert told["hash"] == run.simulation.state.sha256(), name
        (tmp_path / "scene.yaml").write_text(told["files"]["scene"])
        assert told["hash"] == hash_of(tmp_path / "scene.yaml", 2.0), name
        assert math.isfinite(run.simulation.kinetic_energy)
