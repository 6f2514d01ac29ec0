# SPDX-License-Identifier: MIT
"""The page reads mesh files to the numbers that Python reads, and finds their moments to the last bit; or refuses both."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

import mesh_files as mf
import numpy as np
import pytest
from mass_solids import box, inward, moved, sphere, together
from mesh.test_mesh_fuzz import SEEDS, mutated
from page_tools import TESTS, kernels, run_node

from rigid_proto_ros.base.bundled import BODIES, body_names
from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.moments import MODELS, mesh_moments
from rigid_proto_ros.mass.verdict import check_surface
from rigid_proto_ros.mesh.reading import Mesh, load_mesh, read_mesh

ENDINGS = ("obj", "stl", "ply", "glb")


def on_the_page(page_file: Path, folder: Path) -> dict[str, Any]:
    """What page/test/meshes.ts tells of the files in a folder and of the bundled bodies."""
    found: dict[str, Any] = json.loads(run_node(TESTS / "meshes.ts", kernels(), page_file, folder))
    return found


def digest(numbers: Any, kind: str) -> str:
    """SHA-256 of an array, "" for none."""
    return "" if numbers is None else hashlib.sha256(np.ascontiguousarray(numbers, dtype=kind).tobytes()).hexdigest()


def check_numbers(told: dict[str, Any], mesh: Mesh) -> None:
    assert told["vertices"] == digest(mesh.vertices, "<f8")
    assert told["triangles"] == digest(mesh.triangles, "<i4")
    assert told["starts"] == digest(mesh.polygon_starts, "<i4")


def check_moments(told: dict[str, Any], mesh: Mesh, models: tuple[str, ...] = MODELS) -> None:
    for model in models:
        moments = mesh_moments(model, mesh.vertices, mesh.triangles, mesh.polygon_starts)
        flat = [moments.measure, *moments.reference, *moments.center, *moments.center_low, *moments.second]
        assert told["moments"][MODELS.index(model)] == [float(x) for x in flat], model


@pytest.mark.slow
def test_bundled_bodies_are_on_the_page_as_in_their_files(page_file: Path, tmp_path: Path) -> None:
    for name in body_names():
        (tmp_path / f"{name}.obj").write_bytes((BODIES / f"{name}.obj").read_bytes())
    told = on_the_page(page_file, tmp_path)
    for name in body_names():
        mesh = load_mesh(name)
        for one in (told[name], told[f"{name}.obj"]):
            check_numbers(one, mesh)
            check_moments(one, mesh)
            assert one["closed"] and not one["inward"]


@pytest.mark.slow
def test_real_meshes_have_the_moments_that_python_finds(page_file: Path, meshes: Path, tmp_path: Path) -> None:
    files = [file for file in sorted(meshes.iterdir()) if file.suffix[1:] in ENDINGS]
    for file in files:
        (tmp_path / file.name).symlink_to(file)
    told = on_the_page(page_file, tmp_path)
    assert len(files) >= 6
    for file in files:
        mesh, one = load_mesh(str(file)), told[file.name]
        verdict = mesh_body(mesh).verdict
        check_numbers(one, mesh)
        check_moments(one, mesh, MODELS if verdict.closed else MODELS[1:])
        assert (one["closed"], one["inward"]) == (verdict.closed, verdict.inward), file.name


@pytest.mark.slow
def test_each_form_of_each_ending_is_read_as_python_reads_it(page_file: Path, tmp_path: Path) -> None:
    whole = {
        "polygons.obj": mf.obj(faces=mf.CUBE_QUADS),
        "turned.obj": b"\xef\xbb\xbf# a\\\r\nv 0 0 0 1\r\n v 1 0\\\r\n 0\r\nv 0 1 0\r\nv 0 0 1\r\nvn 0 0 1\r\nf -4//1 2/1 \\\r\n-1\r\nf 1 4 3\r\nf 4 2 3\r\nf 3 2 1",
        "binary.stl": mf.stl(),
        "text.stl": mf.stl_text(),
        "streamed.stl": mf.stl(count=0),
        "text.ply": mf.ply(faces=mf.CUBE_QUADS),
        "little.ply": mf.ply_binary(),
        "big.ply": mf.ply_binary(faces=mf.CUBE_QUADS, big=True),
        "scene.glb": mf.Gltf().glb(),
    }
    for name, data in whole.items():
        (tmp_path / name).write_bytes(data)
    told = on_the_page(page_file, tmp_path)
    for name, data in whole.items():
        mesh = read_mesh(data, Path(name))
        check_numbers(told[name], mesh)
        check_moments(told[name], mesh)


@pytest.mark.slow
def test_accessors_of_another_kind_or_too_short_are_refused_in_the_same_words(page_file: Path, tmp_path: Path) -> None:
    changes: dict[str, tuple[int, dict[str, Any]]] = {
        "flat": (0, {"type": "VEC2"}),
        "wide": (0, {"type": "VEC4", "count": 6}),
        "pairs": (1, {"type": "VEC2", "count": 18}),
        "short": (0, {"count": 9}),
        "long": (1, {"count": 39}),
    }
    for name, (accessor, change) in changes.items():
        file = mf.Gltf()
        file.json["accessors"][accessor].update(change)
        (tmp_path / f"{name}.glb").write_bytes(file.glb())
    told = on_the_page(page_file, tmp_path)
    for name in changes:
        with pytest.raises(InputError) as refused:
            read_mesh((tmp_path / f"{name}.glb").read_bytes(), Path(f"{name}.glb"))
        assert told[f"{name}.glb"]["refused"] == str(refused.value)


def check_damaged(page_file: Path, folder: Path, count: int, seed: int) -> None:
    rng, contents = np.random.default_rng(seed), {}
    for ending in ENDINGS:
        for number in range(count):
            contents[f"{number}.{ending}"] = mutated(SEEDS[ending][number % len(SEEDS[ending])], rng)
    for name, data in contents.items():
        (folder / name).write_bytes(data)
    told = on_the_page(page_file, folder)
    read = 0
    for name, data in contents.items():
        one = told[name]
        try:
            mesh = read_mesh(data, Path(name))
        except InputError:
            assert "refused" in one, name
            assert one["refused"].isprintable(), name
            continue
        assert "refused" not in one, (name, one)
        if np.isfinite(mesh.vertices).all():
            check_numbers(one, mesh)
        read += 1
    assert 0 < read < len(contents)


@pytest.mark.slow
def test_damaged_files_are_read_alike_or_refused_in_one_line(page_file: Path, tmp_path: Path) -> None:
    check_damaged(page_file, tmp_path, 150, 1)


@pytest.mark.stress
@pytest.mark.parametrize("seed", range(2, 8))
def test_thousands_of_damaged_files_are_read_alike_or_refused(page_file: Path, tmp_path: Path, seed: int) -> None:
    check_damaged(page_file, tmp_path, 1000, seed)


@pytest.mark.slow
def test_corners_that_differ_by_rounding_count_as_joined_on_the_page_too(page_file: Path, tmp_path: Path) -> None:
    vertices, triangles = sphere(8)
    random = np.random.default_rng(3)
    for name, apart in (("cracked", 1e-8), ("gaping", 1e-4)):
        shift = random.uniform(-apart, apart, (3 * len(triangles), 3))
        own = np.arange(3 * len(triangles)).reshape(-1, 3)
        (tmp_path / f"{name}.obj").write_bytes(mf.obj(vertices[triangles.ravel()] + shift, own))
    told = on_the_page(page_file, tmp_path)
    assert told["cracked.obj"]["closed"] and not told["gaping.obj"]["closed"]
    mesh = load_mesh(str(tmp_path / "cracked.obj"))
    body = mesh_body(mesh)
    said = [
        re.split(r"([\d.]+(?:e-?\d+)?)", text)
        for text in (body.verdict.findings[0].message, told["cracked.obj"]["messages"][0])
    ]
    assert said[0][::2] == said[1][::2] and "depend on it by at most" in said[0][4]
    assert list(map(float, said[0][1::2])) == list(map(float, said[1][1::2]))
    moments = body.moments.moments("solid")
    flat = [moments.measure, *moments.reference, *moments.center, *moments.center_low, *moments.second]
    assert told["cracked.obj"]["moments"][0] == [float(x) for x in flat]
    check_moments({"moments": told["cracked.obj"]["moments"]}, mesh, MODELS[1:])
    check_numbers(told["cracked.obj"], mesh)


@pytest.mark.slow
def test_open_and_wrongly_wound_surfaces_are_told_with_what_to_do(page_file: Path, tmp_path: Path) -> None:
    vertices, triangles = box(cells=2)
    mixed = triangles.copy()
    mixed[3] = mixed[3, [0, 2, 1]]
    surfaces = {
        "closed": (vertices, triangles),
        "open": (vertices, triangles[1:]),
        "mixed": (vertices, mixed),
        "inward": inward((vertices, triangles)),
        "cavity": together(box((2.0, 2.0, 2.0), 2), inward(sphere(4))),
        "apart": together((vertices, triangles), moved((vertices, triangles), (9.0, 0.0, 0.0))),
        "twice": (vertices, np.concatenate([triangles, triangles])),
    }
    for name, (points, faces) in surfaces.items():
        (tmp_path / f"{name}.obj").write_bytes(mf.obj(points, faces))
    told = on_the_page(page_file, tmp_path)
    for name, (points, faces) in surfaces.items():
        one, verdict = told[f"{name}.obj"], check_surface(points, faces)
        assert (one["closed"], one["inward"]) == (verdict.closed, verdict.inward), name
        errors = [finding.code for finding in verdict.findings if finding.severity == "error"]
        assert [code for code in one["codes"] if code in errors] == errors, name
