# SPDX-License-Identifier: MIT
"""``python -m rigid_proto_ros.kernels [native] [wasm]``: build the kernels' library for this machine, or for
WebAssembly, into the user's cache.
"""

from __future__ import annotations

import gzip
import os
import sys
import tempfile
import time
from pathlib import Path

from .lowering import whole_module  # isort: skip
from ..base.library import kernels_folder, stamp, target
from .targets import TARGETS, link_library, link_wasm, object_code


def main() -> int:
    """Build what is asked for."""
    began = time.monotonic()
    asked = sys.argv[1:] or ["native"]
    whole = whole_module(lambda name: print(f"\r\033[Kkernels: {name}, {time.monotonic() - began:.0f} s", end=""))
    print(f"\nlowered, {time.monotonic() - began:.1f} s")
    folder = Path(kernels_folder()) / stamp()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    for one in asked:
        kind = {"native": target(), "wasm": "wasm32"}.get(one, one)
        with tempfile.TemporaryDirectory(dir=folder) as work:
            code = object_code(whole, TARGETS[kind])
            if kind == "wasm32":
                made = link_wasm(code, Path(work))
                end = folder / "kernels.wasm"
            else:
                made = link_library(code, Path(work))
                end = folder / f"kernels-{kind}.so"
            size, zipped = made.stat().st_size, len(gzip.compress(made.read_bytes()))
            os.replace(made, end)
            print(f"{end}: {size} bytes, {zipped} gzipped, {time.monotonic() - began:.1f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
