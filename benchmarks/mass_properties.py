# SPDX-License-Identifier: MIT
"""Mass properties of closed meshes: ours against trimesh, igl, MuJoCo (exact), Drake and numpy-stl, in one process.

Rules: every tool gets the same arrays in the form it likes, built before the clock starts; what a tool keeps from one
call to the next is thrown away by building that form anew. Tools take turns within each repetition; each turn is two
calls, the first with caches that the others have filled (``cold``), the second right after it (the time that counts);
both are medians. Beside the wall clock's stand the process's own time, which other programs on the machine disturb less
(all threads summed), and the best repetition. A tool that fails, refuses, or would take minutes has nan and says so. Errors are those against exact rational arithmetic on the tool's
input as doubles: |ΔV|/V, |Δc| beyond an ulp over the diagonal, max|ΔI|/max|I| about the COM.

Writes results/mass_properties.csv beside this file; ``--quick`` leaves out the largest mesh.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE), str(HERE.parent / "test")]

from mass_solids import box, moved, sphere

from result_table import ResultTable
from rigid_proto_ros import __version__
from rigid_proto_ros.mass.exact_moments import exact_solid_moments, relative_errors
from rigid_proto_ros.mass.moments import solid_moments
from rigid_proto_ros.mass.properties import MeshMoments

COLUMNS = (
    *(
        "what",
        "tool",
        "version",
        "mesh",
        "triangles",
        "place",
        "milliseconds",
        "ns_per_triangle",
        "cpu_ns_per_triangle",
        "best_ns_per_triangle",
        "cold_milliseconds",
        "repetitions",
    ),
    *("volume_error", "center_of_mass_error", "inertia_error", "note"),
)
OURS = "rigid_proto_ros"
BUDGET_S = 0.6
"""Seconds of cold calls after which a tool gets no further repetition of a mesh; one whose first call takes longer is
timed by that."""
PATIENCE_S = 6.0
"""Seconds of processor time a call beyond which a tool is left out of a mesh."""
REPETITIONS = 15
PLACES = {"base": 0.0, "+1e3": 1e3, "+1e6": 1e6}

Result = tuple[float, np.ndarray, np.ndarray]  # volume, centroid (3,), inertia (3, 3) about it at unit density


class Tool:
    """``prepare`` builds the tool's form of a mesh outside the clock; ``compute`` is what is timed; ``read`` takes volume,
    centroid and inertia from what it returned."""

    def __init__(self, name: str, package: str, prepare: Callable, compute: Callable, read: Callable) -> None:
        self.name, self.prepare, self.compute, self.read = name, prepare, compute, read
        self.version = __version__ if package == OURS else version(package)


def ours() -> list[Tool]:
    """What igl.moments gives, too: volume, centroid and second moments; the same by the second path alone; and mass
    properties with all their checks."""

    def prepare(v, t):
        return v, t

    def read_moments(m) -> Result:
        xx, xy, xz, yy, yz, zz = m.second
        return m.measure, m.centroid, np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])

    def read(p) -> Result:
        return p.mass, p.center_of_mass, p.inertia

    return [
        Tool("rigid_proto", OURS, prepare, lambda mesh: solid_moments(*mesh), read_moments),
        Tool("rigid_proto, checked", OURS, prepare, lambda mesh: MeshMoments(*mesh).mass_properties(density=1.0), read),
        Tool(
            "rigid_proto, second path",
            OURS,
            prepare,
            lambda mesh: solid_moments(*mesh, compensated=True),
            read_moments,
        ),
    ]


def trimesh_tool() -> Tool:
    import trimesh

    return Tool(
        "trimesh",
        "trimesh",
        lambda v, t: trimesh.Trimesh(v, t, process=False, validate=False),
        lambda mesh: mesh.mass_properties,
        lambda p: (p["volume"], np.array(p["center_mass"]), np.array(p["inertia"])),
    )


def igl_tool() -> Tool:
    import igl

    def read(moments) -> Result:
        volume, first, inertia = moments
        return volume, first / volume, inertia

    return Tool("igl.moments", "libigl", lambda v, t: (v, t), lambda mesh: igl.moments(*mesh), read)


def mujoco_tool() -> Tool:
    import mujoco

    def prepare(v, t):
        spec = mujoco.MjSpec()
        mesh = spec.add_mesh(name="m")
        mesh.uservert, mesh.userface = v.ravel(), t.ravel().astype(np.int32)
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
        body = spec.worldbody.add_body()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m", density=1.0)
        body.add_freejoint()
        return spec

    def read(model) -> Result:
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, model.body_iquat[1])
        rotation = rotation.reshape(3, 3)
        inertia = rotation @ np.diag(model.body_inertia[1]) @ rotation.T
        return model.body_mass[1], model.body_ipos[1].copy(), inertia

    return Tool("MuJoCo compile, exact", "mujoco", prepare, lambda spec: spec.compile(), read)


def drake_tool() -> Tool:
    from pydrake.geometry import SurfaceTriangle, TriangleSurfaceMesh
    from pydrake.multibody.tree import CalcSpatialInertia

    def prepare(v, t):
        return TriangleSurfaceMesh(triangles=[SurfaceTriangle(*row) for row in t.tolist()], vertices=list(v))

    def read(inertia) -> Result:
        center = inertia.get_com()
        about = inertia.Shift(center).CalcRotationalInertia().CopyToFullMatrix3()
        return inertia.get_mass(), center, about

    return Tool("Drake", "drake", prepare, lambda mesh: CalcSpatialInertia(mesh, 1.0), read)


def numpy_stl_tool() -> Tool:
    from stl.mesh import Mesh

    def prepare(v, t):
        data = np.zeros(len(t), dtype=Mesh.dtype)
        data["vectors"] = v[t]
        return Mesh(data)

    def read(p) -> Result:
        volume, center, inertia = p
        return float(volume), np.asarray(center, float), np.asarray(inertia, float)

    return Tool("numpy-stl (float32)", "numpy-stl", prepare, lambda mesh: mesh.get_mass_properties(), read)


PEERS = {
    "trimesh": trimesh_tool,
    "igl": igl_tool,
    "mujoco": mujoco_tool,
    "pydrake": drake_tool,
    "stl": numpy_stl_tool,
}


def tools() -> list[Tool]:
    """Ours and those peers that are installed."""
    found = ours()
    for module, make in PEERS.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            print(f"{module}: not installed ({error})")
            continue
        found.append(make())
    return found


def meshes(quick: bool) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Ellipsoids of three sizes, one with its vertices and faces in random order, and a thin plate at an angle."""
    shape = (1.0, 0.8, 0.6)
    found = {"ellipsoid 10k": sphere(50, shape), "ellipsoid 100k": sphere(158, shape)}
    vertices, triangles = found["ellipsoid 100k"]
    random = np.random.default_rng(0)
    order = random.permutation(len(vertices))
    shuffled = np.argsort(order)[triangles][random.permutation(len(triangles))]
    found["ellipsoid 100k, shuffled"] = vertices[order], np.ascontiguousarray(shuffled)
    found["plate 1 x 1 x 1e-5, 100k"] = moved(box((1.0, 1.0, 1e-5), 92), (0.0, 0.0, 0.0), 3)
    if not quick:
        found["ellipsoid 1.4M"] = sphere(592, shape)
    return {name: (np.ascontiguousarray(v), np.ascontiguousarray(t)) for name, (v, t) in found.items()}


def timed(tool: Tool, vertices, triangles) -> tuple[float, float, Result]:
    """Seconds by the wall clock, seconds of the processors' time, and the result."""
    prepared = tool.prepare(vertices, triangles)
    wall, cpu = time.perf_counter(), time.process_time()
    result = tool.compute(prepared)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    return wall, cpu, tool.read(result)


def one_mesh(
    table: ResultTable, everything: list[Tool], rates: dict[str, float], name: str, vertices, triangles
) -> None:
    """Errors at every place, times at the base place; ``rates`` are seconds a triangle known from smaller meshes."""
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    notes: dict[tuple[str, str], str] = {}
    errors: dict[tuple[str, str], dict] = {}
    first: dict[str, tuple[float, float]] = {}
    for place, shift in PLACES.items():
        there = vertices + shift
        exact = exact_solid_moments(there, triangles)
        for tool in everything:
            expected = rates.get(tool.name, 0.0) * len(triangles)
            if expected > PATIENCE_S:
                notes[tool.name, place] = f"left out: some {expected:.0f} s by its rate on smaller meshes"
                continue
            try:
                wall, cpu, (volume, center, inertia) = timed(tool, there, triangles)
                first.setdefault(tool.name, (wall, cpu))
                errors[tool.name, place] = relative_errors(exact, volume, center, inertia, diagonal)
            except Exception as error:
                notes[tool.name, place] = f"{type(error).__name__}: {' '.join(str(error).split())[:80]}"
    cold: dict[str, list[float]] = {tool.name: [] for tool in everything}
    warm: dict[str, list[tuple[float, float]]] = {tool.name: [] for tool in everything}
    for _ in range(REPETITIONS):
        for tool in everything:
            if tool.name not in first or (tool.name, "base") in notes:
                continue
            if first[tool.name][1] > BUDGET_S:
                cold[tool.name], warm[tool.name] = [first[tool.name][0]], [first[tool.name]]
            elif sum(cold[tool.name]) < BUDGET_S:
                cold[tool.name].append(timed(tool, vertices, triangles)[0])
                warm[tool.name].append(timed(tool, vertices, triangles)[:2])
    for tool in everything:
        walls, cpus = zip(*(warm[tool.name] or [(float("nan"), float("nan"))]), strict=True)
        median = statistics.median(walls)
        rates[tool.name] = max(rates.get(tool.name, 0.0), np.nan_to_num(statistics.median(cpus)) / len(triangles))
        for place in PLACES:
            row = {"what": "mass properties", "tool": tool.name, "version": tool.version, "mesh": name}
            row |= {"triangles": len(triangles), "place": place, "note": notes.get((tool.name, place), "")}
            row |= errors.get((tool.name, place), {})
            if place == "base":
                row |= {"milliseconds": 1e3 * median, "ns_per_triangle": 1e9 * median / len(triangles)}
                row |= {"cpu_ns_per_triangle": 1e9 * statistics.median(cpus) / len(triangles)}
                row |= {"best_ns_per_triangle": 1e9 * min(walls) / len(triangles)}
                row |= {"cold_milliseconds": 1e3 * statistics.median(cold[tool.name] or [float("nan")])}
                row |= {"repetitions": len(warm[tool.name])}
            table.add(row)


def rescale(table: ResultTable, name: str, vertices, triangles) -> None:
    """A rescale with another mass and ballast on the ten numbers, against a new pass over scaled vertices."""
    moments = MeshMoments(vertices, triangles)
    moments.mass_properties()
    scales = np.random.default_rng(1).uniform(0.5, 2.0, (400, 3))
    closed, again = [], []
    for scale in scales:
        started = time.perf_counter()
        moments.mass_properties(scale=scale, density=500.0, ballast=((1.0, 0.1, 0.2, 0.3),))
        closed.append(time.perf_counter() - started)
    for scale in scales[:7]:
        started = time.perf_counter()
        MeshMoments(vertices * scale, triangles).mass_properties(density=500.0)
        again.append(time.perf_counter() - started)
    for tool, times in (("rigid_proto", closed), ("rigid_proto, a new pass", again)):
        table.add(
            {
                "what": "rescale",
                "tool": tool,
                "version": __version__,
                "mesh": name,
                "triangles": len(triangles),
                "place": "base",
                "milliseconds": 1e3 * statistics.median(times),
                "ns_per_triangle": 1e9 * statistics.median(times) / len(triangles),
                "repetitions": len(times),
                "note": "",
            }
        )


def load(table: ResultTable, name: str, vertices, triangles) -> None:
    """Reading an .obj file with six decimals: ours and trimesh."""
    from rigid_proto_ros.mesh.reading import load_mesh

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.obj"
        with path.open("w") as file:
            np.savetxt(file, vertices, "v %.6f %.6f %.6f")
            np.savetxt(file, triangles + 1, "f %d %d %d")
        readers = [("rigid_proto", OURS, lambda: load_mesh(str(path)))]
        try:
            import trimesh

            options = {"process": False, "maintain_order": True, "skip_materials": True, "force": "mesh"}
            readers.append(("trimesh", "trimesh", lambda: trimesh.load(path, **options)))
        except ImportError:
            pass
        for tool, package, read in readers:
            times = []
            read()
            for _ in range(3):
                started = time.perf_counter()
                read()
                times.append(time.perf_counter() - started)
            median = statistics.median(times)
            row = {
                "what": "load .obj",
                "tool": tool,
                "version": __version__ if package == OURS else version(package),
                "mesh": name,
                "place": "base",
            }
            row |= {"triangles": len(triangles), "milliseconds": 1e3 * median, "repetitions": 3, "note": ""}
            table.add(row | {"ns_per_triangle": 1e9 * median / len(triangles)})


def main() -> None:
    """Run, write the table and print what it says."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="without the largest mesh")
    parser.add_argument("-o", type=Path, default=HERE / "results" / "mass_properties.csv", help="the table's path")
    args = parser.parse_args()
    logging.disable(logging.WARNING)  # numpy-stl doubts that single-precision corners close
    np.seterr(all="ignore")
    table = ResultTable(args.o, COLUMNS)
    everything = tools()
    everything[0].compute(everything[0].prepare(*sphere(40)))  # loaded before anything is timed
    everything[1].compute(everything[1].prepare(*sphere(40)))
    everything[2].compute(everything[2].prepare(*sphere(40)))
    everything[0].compute(everything[0].prepare(*sphere(200)))
    chosen, rates = meshes(args.quick), {}
    for name, mesh in chosen.items():
        one_mesh(table, everything, rates, name, *mesh)
        _show(table, name)
    largest = list(chosen)[-1]
    rescale(table, largest, *chosen[largest])
    load(table, largest, *chosen[largest])
    for row in table.rows:
        if row["what"] != "mass properties":
            print(f"{row['what']:10} {row['tool']:26} {row['mesh']:18} {row['milliseconds']:.4g} ms")
    table.write()
    print(f"wrote {args.o}")


def _show(table: ResultTable, name: str) -> None:
    print(name)
    rows = [row for row in table.rows if row["mesh"] == name]
    base = {row["tool"]: row for row in rows if row["place"] == "base"}
    for tool, row in base.items():
        errors = {r["place"]: r["inertia_error"] for r in rows if r["tool"] == tool}
        words = "  ".join(f"{place} {error:.1e}" for place, error in errors.items())
        ratio = row["cpu_ns_per_triangle"] / base["rigid_proto"]["cpu_ns_per_triangle"]
        print(
            f"  {tool:26} {row['ns_per_triangle']:9.1f} ns/triangle, processor {row['cpu_ns_per_triangle']:9.1f} "
            f"({ratio:7.1f} x ours), best {row['best_ns_per_triangle']:9.1f}   inertia off: {words}"
        )


if __name__ == "__main__":
    main()
