# SPDX-License-Identifier: MIT
"""Mutated files: every reader, the verdict and the repair give a mesh, a verdict or one line, never another exception."""

from pathlib import Path

import mesh_files as mf
import numpy as np
import pytest
from judged_meshes import body, volume
from mass_solids import box, inward, moved, sphere, together

from rigid_proto_ros.base.errors import InputError
from rigid_proto_ros.mesh.reading import read_mesh

MODEL = mf.model(mf.components(2, 'objectid="1"') + mf.cube_object(1), 'objectid="2"')
SEEDS = {
    "obj": [mf.obj(faces=mf.CUBE_QUADS)],
    "off": [mf.off()],
    "ply": [mf.ply(faces=mf.CUBE_QUADS), mf.ply_binary(), mf.ply_binary(faces=mf.CUBE_QUADS, big=True)],
    "stl": [mf.stl(), mf.stl_text()],
    "gltf": [mf.Gltf().gltf()],
    "glb": [mf.Gltf().glb()],
    "3mf": [mf.threemf(MODEL)],
    "dae": [mf.collada('<node><scale>1 1 1</scale><instance_geometry url="#cube"/></node>')],
}
WORDS = b"nan|-1|1e999|99999999999999999999|\0|/|\n| |\xff\xfe|#|f 1 1 1\n|0x1|e|\r".split(b"|")


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """One change, seldom more: a byte, a word put in, a piece cut out, doubled, the end cut off, or a digit."""
    for _ in range(int(rng.geometric(0.7))):
        if not data:
            break
        at, end = sorted(rng.integers(0, len(data) + 1, 2).tolist())
        kind = rng.integers(0, 8)
        if kind == 0:
            data = data[:at] + bytes([int(rng.integers(0, 256))]) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + WORDS[int(rng.integers(len(WORDS)))] + data[at:]
        elif kind == 2:
            data = data[:at] + data[min(end, at + 40) :]
        elif kind == 3:
            data = data[:end] + data[at:end][:200] + data[end:]
        elif kind == 4:
            data = data[:end]
        else:
            digits = np.flatnonzero(np.isin(np.frombuffer(data, np.uint8), list(b"0123456789")))
            at = int(rng.choice(digits)) if len(digits) else at
            data = data[:at] + bytes([int(rng.integers(48, 58))]) + data[at + 1 :]
    return data


def damaged(ending: str, number: int, rng: np.random.Generator) -> bytes:
    """The damaged file of that number; of archives every other one is whole, and what is in it damaged."""
    if ending == "3mf" and number % 2:
        return mf.threemf(mutated(MODEL.encode(), rng).decode("latin-1"))
    return mutated(SEEDS[ending][number % len(SEEDS[ending])], rng)


def broken(number: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A surface whose faces were cut out, doubled, turned or bent, and whose vertices were moved."""
    two = together(box(cells=2), moved(box(cells=2), (0.5, 0.25, 0.0)))
    whole = [box(cells=2), sphere(5), together(box((2.0, 2.0, 2.0), 2), inward(sphere(4))), two]
    vertices, triangles = (part.copy() for part in whole[number % len(whole)])
    for _ in range(int(rng.integers(1, 5))):
        chosen = rng.random(len(triangles)) < rng.choice([0.02, 0.1, 0.5])
        kind = rng.integers(0, 6)
        if kind == 0 and not chosen.all():
            triangles = triangles[~chosen]
        elif kind == 1:
            triangles = np.concatenate([triangles, triangles[chosen]])
        elif kind == 2:
            triangles[chosen] = triangles[chosen][:, [0, 2, 1]]
        elif kind == 3:
            triangles[rng.integers(len(triangles)), rng.integers(3)] = rng.integers(len(vertices))
        elif kind == 4:
            soup = vertices[triangles].reshape(-1, 3)
            vertices = soup + rng.choice([0.0, 1e-15, 1e-9, 1e-6]) * rng.uniform(-1.0, 1.0, soup.shape)
            triangles = np.arange(len(soup)).reshape(-1, 3)
        else:
            vertices[rng.integers(len(vertices))] = vertices[rng.integers(len(vertices))]
    return vertices, triangles


def repaired(vertices: np.ndarray, triangles: np.ndarray, starts: np.ndarray | None, name: str) -> None:
    """A closed verdict after repair has a positive volume; a refusal is an InputError."""
    try:
        made = body((vertices, triangles), starts, repair=True)
        assert not made.verdict.closed or volume(made) > 0.0, name
    except InputError as error:
        assert str(error).isprintable()


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("count", [25, pytest.param(10_000, marks=pytest.mark.stress)])
@pytest.mark.parametrize("ending", SEEDS)
def test_damaged_files_give_a_mesh_or_one_line(ending, count):
    if ending == "dae":
        pytest.importorskip("collada")
    rng = np.random.default_rng(count)
    read = 0
    for number in range(count):
        try:
            content = read_mesh(damaged(ending, number, rng), Path(f"a.{ending}"))
        except InputError as error:
            assert str(error).isprintable(), (number, str(error))
            continue
        vertices, triangles = content.vertices, content.triangles
        assert vertices.shape[1:] == (3,) and triangles.shape[1:] == (3,)
        if triangles.size:
            assert 0 <= triangles.min() <= triangles.max() < len(vertices)
            repaired(vertices, triangles, content.polygon_starts, f"{ending} {number}")
        read += 1
    assert read


@pytest.mark.parametrize("count", [15, pytest.param(10_000, marks=pytest.mark.stress)])
def test_broken_surfaces_are_repaired_or_refused(count):
    rng = np.random.default_rng(2)
    for number in range(count):
        repaired(*broken(number, rng), None, f"{number}")
