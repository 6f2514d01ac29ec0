# SPDX-License-Identifier: MIT
"""Exported files in other people's hands: Khronos' validator.

It comes from the npm registry into a folder of pytest's cache when this first runs; without npm, node or the registry
these tests skip and say so.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from test_animations import CHANGES, THROWN

from rigid_proto_ros.cli.main import main

pytestmark = [pytest.mark.stress]

PACKAGE = "gltf-validator@2.0.0-dev.3.10"

VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r.issues)));
"""


@pytest.fixture(scope="module")
def modules(request) -> Path:
    if not shutil.which("npm") or not shutil.which("node"):
        pytest.skip("node and npm are not installed")
    folder = Path(request.config.cache.mkdir("exports_npm"))
    if not (folder / "node_modules" / "gltf-validator").is_dir():
        done = subprocess.run(
            ["npm", "install", "--prefix", folder, "--no-audit", "--no-fund", PACKAGE],
            capture_output=True,
            timeout=300,
        )
        if done.returncode:
            pytest.skip(f"npm reached no registry: {done.stderr.decode()[-200:]}")
    return folder


@pytest.fixture(scope="module")
def session(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("flight")
    script = folder / "changes.yaml"
    script.write_text(CHANGES)
    settings = [f"--set={name}={value}" for name, value in THROWN.items()]
    options = ["--script", str(script), "--duration", "1", "--bag", str(folder / "flight.mcap")]
    assert main(["simulate", "hammer", *settings, *options]) == 0
    return folder / "flight.mcap"


SCENES = ("t_handle", "book", "hammer", "teapot", "true_or_box_tensor", "top_on_string", "hollow_box", "plumb_line")


@pytest.mark.parametrize("flight", [["replay", ""], *(["simulate", scene, "--duration", "2"] for scene in SCENES)])
def test_khronos_validator_finds_no_error_and_no_warning(modules, session, flight, tmp_path):
    file = tmp_path / "flight.glb"
    command, what, *options = flight
    assert main([command, what or str(session), "--gltf", str(file), *options]) == 0
    found = json.loads(
        subprocess.run(
            ["node", "-e", VALIDATE, file], cwd=modules, capture_output=True, check=True, timeout=120, text=True
        ).stdout
    )
    assert (found["numErrors"], found["numWarnings"]) == (0, 0), found
