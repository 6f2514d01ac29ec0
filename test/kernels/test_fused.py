# SPDX-License-Identifier: MIT
"""The kernel for a b + c rounded once has the bits of the processor's operation, which C's fma gives."""

import ctypes
import ctypes.util
import math
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
from fused_triples import triples
from wasm_tools import HERE, built

from rigid_proto_ros.base import library
from rigid_proto_ros.kernels.fused import fused


def wrong(count: int) -> list[tuple[float, ...]]:
    """Triples for which the kernel and C's fma differ."""
    of_c = ctypes.CDLL(ctypes.util.find_library("m")).fma
    of_c.restype, of_c.argtypes = ctypes.c_double, [ctypes.c_double] * 3
    found = []
    with np.errstate(all="ignore"):
        for a, b, c in triples(count):
            got, expected = fused(a, b, c), of_c(a, b, c)
            if struct.pack("<d", got) != struct.pack("<d", expected) and not (math.isnan(got) and math.isnan(expected)):
                found.append((a, b, c, got, expected))
    return found


def test_it_has_the_bits_of_c_for_numbers_of_all_kinds() -> None:
    assert wrong(60_000) == []


@pytest.mark.stress  # it builds a library first
@pytest.mark.skipif(not library.target().startswith("x86"), reason="another processor")
def test_a_processor_without_the_operation_flies_to_the_same_bits_by_a_library_of_its_own() -> None:
    built("x86-64-v2")
    code = """
import sys; sys.path[:0] = ['.', '..', '../simulation']
from test_fused import wrong
from random_scenes import random_scene
from scene_outcomes import outcome, text_of
assert wrong(5000) == []
for seed in range(20):
    print(text_of(outcome(random_scene(seed))))
"""

    def of(kind: str) -> dict[str, str]:
        return {**os.environ, "RIGID_PROTO_PROCESSOR": kind}

    told = [
        subprocess.run([sys.executable, "-c", code], cwd=HERE, env=of(kind), capture_output=True, check=True).stdout
        for kind in (library.target(), "x86-64-v2")
    ]
    assert told[0] == told[1] and told[0].count(b"\n") > 100
