# SPDX-License-Identifier: MIT
"""The WebAssembly module with a product and a sum in the place of each fused operation, to show that a comparison of bits
notices: module_without_fusing.py FILE, from what `python -m rigid_proto_ros.kernels` keeps of the present sources.
"""

import os
import re
import shutil
import sys
import tempfile
from itertools import count
from pathlib import Path

os.environ.update(NUMBA_OPT="0", RIGID_PROTO_KERNELS="building")

import llvmlite.binding as llvm

from rigid_proto_ros.base.library import kernels_folder, stamp
from rigid_proto_ros.kernels.lowering import lowered
from rigid_proto_ros.kernels.targets import TARGETS, linked, object_code

FUSED = re.compile(r"(%\S+) = call double @llvm\.fma\.f64\(double ([^,]+), double ([^,]+), double ([^)]+)\)")


def main(file: Path) -> None:
    numbers = count()

    def separate(found: re.Match) -> str:
        to, a, b, c = found.groups()
        product = f"%product.{next(numbers)}"
        return f"{product} = fmul double {a}, {b}\n  {to} = fadd double {product}, {c}"

    text, changed = FUSED.subn(separate, str(lowered(Path(kernels_folder()) / stamp() / "kernels.bc", lambda *_: None)))
    assert changed, "no fused operation is there"
    with tempfile.TemporaryDirectory() as work:
        made = linked("wasm32", object_code(llvm.parse_assembly(text), TARGETS["wasm32"]), Path(work))
        shutil.copy(made, file)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
