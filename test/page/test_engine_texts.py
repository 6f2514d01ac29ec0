# SPDX-License-Identifier: MIT
"""What the page copies for an engine is what `inspect --for` prints, to the letter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mass_solids import moved, prism
from mesh_files import obj, stl_text
from page_tools import TESTS, kernels, run_node

from rigid_proto_ros.base.bundled import PACKAGE_FOLDER, body_names
from rigid_proto_ros.cli.main import main
from rigid_proto_ros.mass.engines import FORMS, engine_text
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.properties import MassProperties
from rigid_proto_ros.scene.scenario import make_scenario

BODIES: list[dict[str, Any]] = [
    *({"mesh": name, "density": 7850.0} for name in body_names()),
    {"mesh": "l_bracket", "mass": 2.5},
    {"mesh": "l_bracket", "mass": 1e-6, "scale": [0.001, -0.002, 0.0015]},
    {"mesh": "hammer", "mass": 1.2, "scale": [1e3, 1e3, 1e3]},
    {"mesh": "hammer", "mass": 0.7, "ballast.b1": [0.3, 0.01, -0.02, 0.05], "ballast.b2": [0.0, 1.0, 1.0, 1.0]},
    *({"mesh": "teapot", "mass": 1.0, "inertia_model": model} for model in ("shell", "points", "bounding_box")),
]


def answered(page_file: Path, bodies: list[Any]) -> list[Any]:
    asked = json.dumps({"bodies": bodies})
    return json.loads(run_node(TESTS / "asked.ts", kernels(), page_file, input=asked))["bodies"]


def printed(capsys: pytest.CaptureFixture[str], engine: str, mesh: str, values: dict[str, Any]) -> str:
    """By the command line."""
    options: list[str] = []
    for name in ("mass", "density", "scale"):
        if name in values:
            options += [f"--{name}", *map(repr, values[name] if name == "scale" else [values[name]])]
    for name in values:
        if name.startswith("ballast."):
            options += ["--ballast", *map(repr, values[name])]
    assert main(["inspect", mesh, *options, "--model", values.get("inertia_model", "solid"), "--for", engine]) == 0
    return capsys.readouterr().out


def test_bodies_at_hand_are_written_as_the_command_line_prints_them(page_file: Path, capsys, tmp_path: Path) -> None:
    bracket = prism([(0, 0), (0.3, 0), (0.3, 0.05), (0.05, 0.05), (0.05, 0.2), (0, 0.2)], 0.1, twist=0.7, layers=3)
    far = moved(bracket, (50.0, -3.0, 2.0), seed=4)
    own = {
        "far.obj": obj(*far),
        "near.stl": stl_text(*bracket),
        "own.obj": (PACKAGE_FOLDER / "bodies" / "l_bracket.obj").read_bytes(),
    }
    of_bundled = [(values, None) for values in BODIES]
    of_own = [
        ({"mass": 2.5, "scale": [1.0, 2.0, 0.5]}, {"name": name, "text": text.decode()}) for name, text in own.items()
    ]
    found = answered(page_file, of_bundled + of_own)
    for (values, file), texts in zip(of_bundled + of_own, found, strict=True):
        mesh = values.get("mesh", "")
        if file is not None:
            mesh = str(tmp_path / file["name"])
            Path(mesh).write_text(file["text"])
        ballast = [values[name] for name in values if name.startswith("ballast.")]
        given = {name: values[name] for name in ("mass", "density", "scale") if name in values}
        properties = mesh_body(mesh).moments.mass_properties(
            values.get("inertia_model", "solid"), ballast=ballast, **given
        )
        assert texts == {engine: engine_text(engine, properties) for engine in FORMS}, values
    # By the command, which is the same for all, an engine a body, from those with options on.
    for engine, values, texts in zip(FORMS, reversed(BODIES), reversed(found[: len(BODIES)]), strict=False):
        assert texts[engine] == printed(capsys, engine, values["mesh"], values)


TENSORS = (
    [0.02, 0.0, 0.0, 0.03, 0.0, 0.04],
    [0.02, 0.004, -0.003, 0.03, 0.001, 0.04],
    [1.0, 0.0, 0.0, 1.0, 0.0, 1.0],
    [0.02, 2e-9, 0.0, 0.03, 0.0, 0.04],
    [3e-9, 0.0, 1e-10, 3e-9, 0.0, 3e-9],
)


def test_numbers_of_ones_own_are_written_as_python_has_them(page_file: Path) -> None:
    center = [0.0, -0.25, 1 / 3]
    own = {"mesh": "t_handle", "inertia_model": "explicit", "scale": 2.0, "explicit_inertia.mass": 2.0}
    own["explicit_inertia.center_of_mass"] = center
    found = answered(page_file, [({**own, "explicit_inertia.tensor": tensor}, None) for tensor in TENSORS])
    for tensor, texts in zip(TENSORS, found, strict=True):
        body = make_scenario({**own, "explicit_inertia.tensor": tensor}).setup.body
        properties = MassProperties(body.mass, body.center_of_mass, body.inertia)
        assert texts == {engine: engine_text(engine, properties) for engine in FORMS}, tensor
