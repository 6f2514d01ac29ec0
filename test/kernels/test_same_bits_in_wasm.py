# SPDX-License-Identifier: MIT
"""The kernels in WebAssembly do what the library does to the last bit: every call that scenes and meshes make is repeated."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from wasm_tools import HERE, module, node, replayed

from rigid_proto_ros.base.library import KERNELS
from rigid_proto_ros.kernels.layouts import description, import_kernels
from rigid_proto_ros.mass.moments import MODELS

OF_OTHERS = {"make_body"}
"""Kernels that only other kernels call."""


def recorded(folder: Path, *words: object) -> Path:
    """A file of the calls that this makes, see recorded_calls.py."""
    module(), node()
    command = [sys.executable, HERE / "recorded_calls.py", folder / "calls", *words]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "calls"


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calls of twenty random scenes and of some tests of meshes, sweeps and identification."""
    return recorded(tmp_path_factory.mktemp("recorded"), "scenes", 0, 20, "some")


def check_equal(calls: Path, least: int) -> None:
    came = replayed(calls, module())
    assert came["different"] == 0, {name: of for name, of in came["kernels"].items() if of["different"]}
    assert came["equal"] >= least


@pytest.mark.stress
@pytest.mark.parametrize("first", range(0, 2000, 50))
def test_two_thousand_random_scenes(tmp_path: Path, first: int) -> None:
    check_equal(recorded(tmp_path, "scenes", first, 50), 500)


@pytest.mark.stress
def test_meshes_sweeps_and_identification(tmp_path: Path) -> None:
    check_equal(recorded(tmp_path, "others"), 20_000)


@pytest.mark.stress
@pytest.mark.parametrize("beginning", ["mass", "moments", "scene", "whole scene", "script", "by", "auto", "rows"])
def test_the_computations_of_the_golden_hashes(tmp_path: Path, beginning: str) -> None:
    check_equal(recorded(tmp_path, "golden", beginning), 1)


@pytest.mark.stress
@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("name", ["spot.obj", "sword.obj", "sword_quads.obj", "nefertiti_lowres.obj"])
def test_moments_of_real_meshes(meshes: Path, tmp_path: Path, name: str, offset: float) -> None:
    check_equal(recorded(tmp_path, "mesh", meshes / name, offset), len(MODELS))


@pytest.mark.slow
def test_every_call_of_scenes_and_meshes_leaves_the_same_bytes(calls: Path) -> None:
    came = replayed(calls, module())
    assert came["different"] == 0, {name: of for name, of in came["kernels"].items() if of["different"]}
    import_kernels()
    missing = set(KERNELS) - set(came["kernels"]) - OF_OTHERS
    assert came["equal"] > 10_000 and not missing, missing


@pytest.mark.stress
def test_a_product_and_a_sum_for_each_fused_operation_would_be_noticed(calls: Path, tmp_path: Path) -> None:
    other = tmp_path / "unfused.wasm"
    subprocess.run([sys.executable, HERE / "module_without_fusing.py", other], check=True)
    came = replayed(calls, other)["kernels"]
    # Measured for scenes alone: 100 of 125 and 5 of 867.
    assert came["moments_of"]["different"] > 50 and came["operate"]["different"] > 0


@pytest.mark.slow
def test_a_knot_that_is_not_projected_onto_the_surface_would_be_noticed(calls: Path) -> None:
    came = replayed(calls, module(), "command", "triangles")
    changed = {name for name, of in came["kernels"].items() if of["different"]}
    assert changed == {"command"}


def test_the_module_is_small() -> None:
    assert module().stat().st_size <= 300_000


def test_records_are_told_with_the_places_that_numpy_gives_them() -> None:
    from rigid_proto_ros.simulation.flight import FLIGHT

    told = description()
    fields = told["records"]["FLIGHT"]["fields"]
    assert told["records"]["FLIGHT"]["size"] == FLIGHT.itemsize and list(fields) == list(FLIGHT.names)
    assert all(fields[name]["offset"] == FLIGHT.fields[name][1] for name in FLIGHT.names)
    row = fields["row"]
    assert (row["type"], row["count"]) == ("f8", 13) and fields["problem"]["type"] == "PROBLEM"
    assert told["kernels"]["fused"] | {"about": ""} == {
        "arguments": {"a": "f8", "b": "f8", "c": "f8"},
        "returns": ["f8"],
        "about": "",
    }


def test_the_page_reads_and_writes_records_and_calls_kernels_by_the_generated_file(tmp_path: Path) -> None:
    version = subprocess.run([node(), "--version"], capture_output=True, text=True, check=True).stdout
    if tuple(map(int, version.strip()[1:].split(".")[:2])) < (22, 18):
        pytest.skip(f"Node {version.strip()} doesn't read TypeScript")
    accessors = tmp_path / "kernels.ts"
    subprocess.run(
        [sys.executable, "-m", "rigid_proto_ros.kernels", "wasm", "--typescript", accessors],
        check=True,
        capture_output=True,
    )
    (tmp_path / "use.mts").write_text(f"""
import fs from "node:fs";
import {{ Kernels, Flight, STAMP }} from "./kernels.ts";
const bytes = fs.readFileSync({str(module())!r});
const kernels = await Kernels.load(bytes);
const memory = kernels.memory;
const flight = new Flight(memory);
flight.nowNs = -5e15 - 7;
flight.tied = true;
flight.row[12] = 0.1;
const start = memory.memory.buffer.byteLength;
memory.reserve(10 * start);
const a = memory.numbers(4), b = memory.numbers(4);
memory.f8(a.at, 4).set([0, 0, 0, 1]);
memory.f8(b.at, 4).set([1, 0, 0, 0]);
let refused = "";
const changed = Buffer.from(bytes), at = changed.indexOf(STAMP);
changed.write("0", at);
try {{ await Kernels.load(changed); }} catch (error) {{ refused = (error as Error).message; }}
console.log(JSON.stringify([flight.nowNs, flight.tied, flight.row[12], kernels.attitudeAngle(a, b), refused]));
""")
    done = subprocess.run([node(), tmp_path / "use.mts"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    now_ns, tied, last, angle, refused = json.loads(done.stdout)
    assert (now_ns, tied, last, angle) == (-5e15 - 7, True, 0.1, np.pi)
    assert "make kernels" in refused
