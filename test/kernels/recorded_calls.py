# SPDX-License-Identifier: MIT
"""Records every call of an exported kernel into a file, for replay_calls.mjs: what it was given and what it made of it.

    recorded_calls.py FILE scenes FIRST COUNT      random scenes of these seeds
    recorded_calls.py FILE some                    tests that call the kernels that scenes don't, each at least once
    recorded_calls.py FILE others                  more of these tests
    recorded_calls.py FILE golden BEGINNING        the computations of the golden hashes whose names begin so
    recorded_calls.py FILE mesh PATH OFFSET        verdict and moments of all models of a mesh, moved along each axis

Several can be given, one after the other. The file is compressed: a line of JSON about the kernels, then the calls. Of each the kernel's number, its block before, the
numbers returned, and the regions of memory that its records and arrays take, overlapping ones as one: address, size, and
the content before and after. Of a region that was in a call before, the content is XORed with what that call left; what
came after is XORed with what was before. Nearly all of it is zeros then. What is known is forgotten where it becomes too much.
"""

from __future__ import annotations

import ctypes
import gzip
import inspect
import json
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from rigid_proto_ros.base import library
from rigid_proto_ros.kernels.layouts import import_kernels

TESTS = Path(__file__).parents[1]
MOST_KNOWN = 1 << 28
"""How many bytes of regions are remembered, here and in replay_calls.mjs."""


class Recorder:
    """Stands in the library's place: functions by name, of which each call is written to ``stream``."""

    def __init__(self, stream) -> None:
        import_kernels()
        self._stream = stream
        self._known, self._known_bytes = {}, 0
        self._numbers = {name: number for number, name in enumerate(library.KERNELS)}
        kernels = [
            {"name": name, "returns": len(kernel.returns), **_places(kernel)}
            for name, kernel in library.KERNELS.items()
        ]
        stream.write(json.dumps(kernels).encode() + b"\n")
        self._libraries = {nogil: load(nogil) for nogil in (False, True)}

    def library(self, nogil: bool) -> _Recorded:
        return _Recorded(self, self._libraries[nogil])

    def call(self, function, kernel: library.Kernel, block) -> None:
        """Call a function with a block, and write what was there before and after."""
        numbers = np.frombuffer(block, np.int64)
        before = numbers.tobytes()
        regions = list(_regions(kernel, numbers))
        contents = [np.frombuffer(ctypes.string_at(at, size), np.uint8) for at, size in regions]
        function(block)
        parts = [struct.pack("<H", self._numbers[kernel.name]), before, numbers[: len(kernel.returns)].tobytes()]
        parts.append(struct.pack("<H", len(regions)))
        for (at, size), content in zip(regions, contents, strict=True):
            after = np.frombuffer(ctypes.string_at(at, size), np.uint8)
            known = self._known.get((at, size))
            parts.append(struct.pack("<QI", at, size))
            parts += [(content if known is None else content ^ known).tobytes(), (content ^ after).tobytes()]
            self._known_bytes += size if known is None else 0
            self._known[at, size] = after
        if self._known_bytes > MOST_KNOWN:
            self._known, self._known_bytes = {}, 0
        self._stream.write(b"".join(parts))


class _Recorded:
    """A library whose functions are recorded."""

    def __init__(self, recorder: Recorder, of) -> None:
        self._recorder, self._of = recorder, of

    def __getitem__(self, name: str):
        function, kernel = self._of[name], library.KERNELS[name]
        function.restype = None

        class Function:
            restype = None

            def __call__(_, block) -> None:
                self._recorder.call(function, kernel, block)

        return Function()


load = library.loaded


@contextmanager
def recorded(file: Path) -> Iterator[None]:
    """Every call within the context is recorded, but for those that were bound before it."""
    with gzip.open(file, "wb", compresslevel=1) as stream:
        library.loaded = Recorder(stream).library
        _forget()
        try:
            yield
        finally:
            library.loaded = load
            _forget()


def _forget() -> None:
    for kernel in library.KERNELS.values():
        kernel._called, kernel._bindings = None, {}


def _places(kernel: library.Kernel) -> dict:
    """Number of slots of a kernel's block, which of them are addresses, and where each array's length is, by name."""
    slot, addresses, lengths = len(kernel.returns), [], {}
    for name, declared in zip(inspect.signature(kernel.function).parameters, kernel.arguments, strict=True):
        kind, dimensions = library.place(declared)
        if kind is not None:
            addresses.append(slot)
        if dimensions:
            lengths[name] = slot + 1
        slot += 1 + dimensions
    return {"slots": slot, "addresses": addresses, "lengths": lengths}


def _regions(kernel: library.Kernel, numbers) -> Iterator[tuple[int, int]]:
    """Address and size of each part of memory that a call's records and arrays take, in order and without overlaps."""
    slot, parts = len(kernel.returns), []
    for declared in kernel.arguments:
        kind, dimensions = library.place(declared)
        if kind is not None:
            extents = numbers[slot + 1 : slot + 1 + dimensions]
            parts.append(
                (int(numbers[slot]), int(numbers[slot]) + kind.itemsize * int(np.prod(extents, dtype=np.int64)))
            )
        slot += 1 + dimensions
    begin = end = 0
    for at, to in sorted(part for part in parts if part[0] < part[1]):
        if at >= end:
            if begin < end:
                yield begin, end - begin
            begin = at
        end = max(end, to)
    if begin < end:
        yield begin, end - begin


def scenes(first: str, count: str) -> None:
    """So many random scenes."""
    from random_scenes import random_scene
    from scene_outcomes import outcome

    for seed in range(int(first), int(first) + int(count)):
        outcome(random_scene(seed))


def golden(beginning: str) -> None:
    """What gives the golden hashes whose names begin so."""
    from test_golden_hashes import computations

    chosen = [compute for name, compute in computations().items() if name.startswith(beginning)]
    assert chosen, beginning
    for compute in chosen:
        compute()


def mesh(path: str, offset: str) -> None:
    """All that is computed of a mesh that lies elsewhere."""
    from dataclasses import replace

    from test_golden_hashes import moments

    from rigid_proto_ros.mass.properties import MeshMoments
    from rigid_proto_ros.mesh.reading import load_mesh
    from rigid_proto_ros.mesh.topology import mesh_topology

    read = load_mesh(path)
    read = replace(read, vertices=np.ascontiguousarray(read.vertices + float(offset)))
    mesh_topology(read.vertices, read.triangles)
    moments(MeshMoments(read.vertices, read.triangles, read.polygon_starts, name=path))


def call_small_ones() -> None:
    """Kernels of a few numbers, with random ones; and the fused operation with all kinds of numbers."""
    from fused_triples import triples

    from rigid_proto_ros.base.rotation import quaternion_of_axes
    from rigid_proto_ros.kernels.fused import fused
    from rigid_proto_ros.mesh.assembly import multiply_matrices, node_matrix, place_vertices
    from rigid_proto_ros.mesh.topology import turn_triangles
    from rigid_proto_ros.motion.body import fill_body
    from rigid_proto_ros.motion.state import shift_com
    from rigid_proto_ros.simulation.quantities import DIFFERENCES, NAMES, STATE, attitude_angle, difference, quantity

    rng = np.random.default_rng(7)
    with np.errstate(all="ignore"):
        for a, b, c in triples(5000):
            fused(a, b, c)
    for _ in range(50):
        vectors = [rng.normal(size=STATE) for _ in range(3)]
        matrices = [rng.normal(size=(4, 4)) for _ in range(3)]
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        quaternion_of_axes(axes * np.linalg.det(axes), np.empty(4))
        multiply_matrices(*matrices)
        node_matrix(rng.normal(size=10), matrices[0])
        place_vertices(rng.normal(size=(9, 3)), matrices[1], np.empty((9, 3)))
        turn_triangles(np.arange(9).reshape(3, 3), np.arange(9).reshape(3, 3))
        fill_body(2.0, vectors[0][:3], axes, np.array([1.0, 2.0, 2.5]), axes, np.ones(3), np.empty(33))
        shift_com(vectors[0], *rng.normal(size=3))
        attitude_angle(vectors[0][3:7], vectors[1][3:7])
        for code in range(len(NAMES)):
            quantity(code, vectors[0], vectors[2])
        for code in range(len(DIFFERENCES)):
            difference(code, vectors[0], vectors[1])


SOME = (
    "mass/test_mass_models.py",
    "mass/test_inertia_tensor.py",
    "mesh/test_mesh_verdict.py::test_repair_welds_a_torn_surface_and_caps_flat_holes_exactly",
    "mesh/test_mesh_verdict.py::test_repair_turns_faces_to_agree",
    "mesh/test_mesh_verdict.py::test_copies_that_close_the_surface_stay_and_those_that_spoil_it_go",
    "mesh/test_mesh_verdict.py::test_a_flat_mesh_is_told_no_remedy_that_does_not_help",
    "mass/test_walls.py::test_full_infill_is_the_solid",
    "mass/test_walls.py::test_thickness_infill_and_size_change_in_flight",
    "motion/test_surface.py",
    "identify/test_fitting.py::test_a_poked_throw_tells_all_ten_parameters",
    "sweep/test_sweep_bits.py::test_rows_have_the_bits_of_the_simulation_whatever_chunk_they_are_in[pokes]",
    "sweep/test_sweep_bits.py::test_energies_and_momentum_are_those_of_the_body_and_gravity_in_force",
)
"""Tests of this suite that call the other kernels: of meshes, sweeps and identification."""
OTHERS = (
    *("mass/test_mass_models.py", "mass/test_inertia_tensor.py", "mass/test_walls.py"),
    *("mesh/test_mesh_verdict.py",),
    *("mesh/test_mesh_formats.py", "motion/test_surface.py", "simulation/test_live_body.py"),
    *("identify/test_fitting.py::test_a_poked_throw_tells_all_ten_parameters", "sweep/test_sweep_bits.py"),
)


def run_tests(*names: str) -> None:
    """Kernels that scenes don't call."""
    import pytest

    call_small_ones()
    # Whether they pass is told where they run by themselves.
    pytest.main(["-q", "-p", "no:cacheprovider", *names])


SOURCES = {
    "scenes": (scenes, 2),
    "some": (partial(run_tests, *SOME), 0),
    "others": (partial(run_tests, *OTHERS), 0),
    "golden": (golden, 1),
    "mesh": (mesh, 2),
}
"""What can be recorded, and how many words it takes."""


def main(file: Path, words: list[str]) -> None:
    """Record what is asked for."""
    os.environ["RIGID_PROTO_CACHE"] = "off"
    os.chdir(TESTS)
    with recorded(file):
        while words:
            source, count = SOURCES[words[0]]
            source(*words[1 : 1 + count])
            words = words[1 + count :]


if __name__ == "__main__":
    sys.path[:0] = [str(TESTS), str(TESTS / "simulation")]
    main(Path(sys.argv[1]).absolute(), sys.argv[2:])
