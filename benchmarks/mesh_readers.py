# SPDX-License-Identifier: MIT
"""What each reader of our own is worth: its time, and what it reads right, against trimesh.

Time: an ellipsoid of about 100 000 triangles in each format, both tools from the same file by turns in one process,
``load_mesh`` against ``trimesh.load_mesh(process=False)``; the shortest and the median are written. Right: small files
that the formats allow, of a unit cube; a file is read right when its volume and the number of its vertices are those that
were written.

Writes results/mesh_readers.csv beside this file.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import logging
import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np
import trimesh

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE), str(HERE.parent / "test")]

from mass_solids import sphere
from mesh_files import CUBE_QUADS, CUBE_TRIANGLES, CUBE_VERTICES, obj, ply, ply_binary, stl, stl_text

from result_table import ResultTable
from rigid_proto_ros import __version__
from rigid_proto_ros.base.errors import MeshError
from rigid_proto_ros.mesh.reading import load_mesh

COLUMNS = ("what", "format", "file", "tool", "version", "triangles", "best_ms", "median_ms", "result")
REPETITIONS = 7
OURS, THEIRS = "rigid_proto", "trimesh"

Surface = tuple[np.ndarray, np.ndarray]
"""vertices (n, 3), triangles (m, 3)"""


def ours(path: Path) -> Surface:
    mesh = load_mesh(str(path))
    return mesh.vertices, mesh.triangles


def theirs(path: Path) -> Surface:
    mesh = trimesh.load_mesh(path, process=False)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


TOOLS: dict[str, tuple[Callable[[Path], Surface], str]] = {
    OURS: (ours, __version__),
    THEIRS: (theirs, version("trimesh")),
}


def with_normals(data: bytes) -> bytes:
    """The same .obj with a normal for each vertex."""
    lines = data.decode().splitlines()
    vertices = [line for line in lines if line.startswith("v ")]
    faces = ["f " + " ".join(f"{n}//{n}" for n in line.split()[1:]) for line in lines if line.startswith("f ")]
    return "\n".join([*vertices, *("vn" + line[1:] for line in vertices), *faces, ""]).encode()


def large_files(rings: int) -> dict[tuple[str, str], bytes]:
    """By format and what the file is."""
    v, t = sphere(rings, (1.0, 0.7, 0.4))
    return {
        (".obj", "triangles"): obj(v, t),
        (".obj", "with normals"): with_normals(obj(v, t)),
        (".ply", "text"): ply(v, t),
        (".ply", "binary"): ply_binary(v, t),
        (".stl", "text"): stl_text(v, t),
        (".stl", "binary"): stl(v, t),
    }


def interleaved() -> bytes:
    lines = []
    for corners in CUBE_TRIANGLES:
        lines += ["v {} {} {}".format(*CUBE_VERTICES[i]) for i in corners]
        lines.append("f -3 -2 -1")
    return "\n".join([*lines, ""]).encode()


def small_files() -> dict[tuple[str, str], tuple[bytes, int]]:
    """By format and what is special: the cube's bytes and how many vertices its reader should find."""
    rich = obj(faces=CUBE_QUADS).decode().replace("f 1 2 4 3", "f 1/1/1 2//1 \\\n 4/2 3/3/3 # the first")
    bare_cr = stl_text().replace(b"\n", b"\r")
    return {
        (".obj", "quads"): (obj(faces=CUBE_QUADS), 8),
        (".obj", "tabs between the numbers"): (obj().replace(b" ", b"\t"), 8),
        (".obj", "negative indices, v and f lines by turns"): (interleaved(), 36),
        (".obj", "v/vt/vn corners on a continued line"): (("vt 0 0\nvn 0 0 1\n" + rich).encode(), 8),
        (".obj", "a byte order mark"): (b"\xef\xbb\xbf" + obj(), 8),
        (".obj", "a vertex that no face has"): (b"v 9 9 9\n" + obj(faces=CUBE_TRIANGLES + 1), 9),
        (".ply", "quads"): (ply(faces=CUBE_QUADS), 8),
        (".ply", "binary, big-endian, quads"): (ply_binary(faces=CUBE_QUADS, big=True), 8),
        (".stl", "binary, a header that begins with solid"): (b"solid".ljust(80) + stl()[80:], 8),
        (".stl", "text with bare carriage returns"): (bare_cr, 8),
        (".stl", "text in capitals"): (stl_text().upper(), 8),
        (".stl", "binary, bytes after the last triangle are missing"): (stl()[:-70], -1),
        (".obj", "a face with a vertex that isn't there"): (obj() + b"f 1 2 99\n", -1),
    }


def volume(surface: Surface) -> float:
    vertices, triangles = surface
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def judged(read: Callable[[Path], Surface], path: Path, vertices: int) -> str:
    """``right``, ``wrong: …`` or ``refused``; vertices −1: a file that is to be refused."""
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            surface = read(path)
    except MeshError:
        return "refused"
    except Exception as error:
        return f"refused ({type(error).__name__})"
    if vertices < 0:
        return f"wrong: {len(surface[1])} triangles, no word"
    found = volume(surface)
    if not math.isclose(found, 1.0, rel_tol=1e-6):
        return f"wrong: volume {found:.3g}"
    # Corners of .stl files are merged by one and kept apart by the other: numbering has no right there.
    if path.suffix != ".stl" and len(surface[0]) != vertices:
        return f"wrong: {len(surface[0])} vertices, not {vertices}"
    return "right"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rings", type=int, default=158, help="the ellipsoid has 4 rings² triangles")
    rings = parser.parse_args().rings
    logging.disable(logging.CRITICAL)
    table = ResultTable(HERE / "results" / "mesh_readers.csv", COLUMNS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        for (ending, name), data in large_files(rings).items():
            file = path / f"large{ending}"
            file.write_bytes(data)
            times: dict[str, list[float]] = {tool: [] for tool in TOOLS}
            count = 0
            for turn in range(REPETITIONS + 1):  # the first loads what it needs and fills the page cache
                for tool, (read, _) in TOOLS.items():
                    start = time.perf_counter()
                    count = len(read(file)[1])
                    if turn:
                        times[tool].append(1e3 * (time.perf_counter() - start))
            for tool, (_, its_version) in TOOLS.items():
                row = {"what": "time", "format": ending, "file": name, "tool": tool, "version": its_version}
                timed = {"best_ms": min(times[tool]), "median_ms": statistics.median(times[tool])}
                table.add({**row, "triangles": count, **timed})
            best = {tool: min(times[tool]) for tool in TOOLS}
            print(
                f"{ending} {name}: {best[OURS]:.1f} ms, trimesh {best[THEIRS]:.1f} ms, {best[THEIRS] / best[OURS]:.1f} times"
            )
        for number, ((ending, name), (data, vertices)) in enumerate(small_files().items()):
            file = path / f"small{number}{ending}"
            file.write_bytes(data)
            results = {tool: judged(read, file, vertices) for tool, (read, _) in TOOLS.items()}
            for tool, (_, its_version) in TOOLS.items():
                row = {"what": "right", "format": ending, "file": name, "tool": tool, "version": its_version}
                table.add({**row, "result": results[tool]})
            print(f"{ending} {name}: {results[OURS]}; trimesh {results[THEIRS]}")
    table.write()


if __name__ == "__main__":
    main()
