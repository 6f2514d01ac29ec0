# SPDX-License-Identifier: MIT
"""Repeats recorded calls by the kernels of another processor, under an emulator: replay_elsewhere.py KIND CALLS EMULATOR.

    python test/kernels/recorded_calls.py out/calls scenes 0 60
    python test/kernels/replay_elsewhere.py aarch64 out/calls qemu-aarch64-static

Needs ziglang, whose compiler makes the runner, and the emulator (Debian: qemu-user-static). Prints how many calls of each
kernel were equal to the bit; status 1 if any wasn't.
"""

from __future__ import annotations

import gzip
import json
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

os.environ.update(NUMBA_OPT="0", RIGID_PROTO_KERNELS="building")

from recorded_calls import MOST_KNOWN

from rigid_proto_ros.base.library import kernels_folder, stamp
from rigid_proto_ros.kernels.lowering import lowered
from rigid_proto_ros.kernels.targets import TARGETS, object_code

ZIG = {"aarch64": "aarch64-linux-musl", "x86-64-v2": "x86_64-linux-musl", "x86-64-v3": "x86_64-linux-musl"}


def decoded(file: Path) -> Iterator[list[dict] | bytes]:
    """What is known of the kernels, then each call with its regions as they were."""
    with gzip.open(file) as stream:
        kernels = json.loads(stream.readline())
        yield kernels
        known: dict[tuple[int, int], np.ndarray] = {}
        known_bytes = 0
        while head := stream.read(2):
            kernel = kernels[struct.unpack("<H", head)[0]]
            parts = [head, stream.read(8 * kernel["slots"]), stream.read(8 * kernel["returns"]), stream.read(2)]
            for _ in range(struct.unpack("<H", parts[-1])[0]):
                place = stream.read(12)
                key = struct.unpack("<QI", place)
                change = np.frombuffer(stream.read(key[1]), np.uint8)
                before = change ^ known[key] if key in known else change
                after = before ^ np.frombuffer(stream.read(key[1]), np.uint8)
                parts += [place, before.tobytes(), after.tobytes()]
                known_bytes += 0 if key in known else key[1]
                known[key] = after
            if known_bytes > MOST_KNOWN:
                known, known_bytes = {}, 0
            yield b"".join(parts)


def table(kernels: list[dict]) -> str:
    """table.h of replay_calls.c."""
    lines = [f"void {kernel['name']}(int64_t *block);" for kernel in kernels]
    lines += [f"enum {{ KERNELS = {len(kernels)}, SLOTS = {max(kernel['slots'] for kernel in kernels)} }};"]

    def array(kind: str, values: list[str]) -> None:
        lines.append(f"static {kind} = {{{', '.join(values)}}};")

    array("void (*const kernels[])(int64_t *)", [kernel["name"] for kernel in kernels])
    array("const char *const names[]", [f'"{kernel["name"]}"' for kernel in kernels])
    array("const int returns[]", [str(kernel["returns"]) for kernel in kernels])
    array("const int slots[]", [str(kernel["slots"]) for kernel in kernels])
    most = max(len(kernel["addresses"]) for kernel in kernels) + 1
    array(
        f"const int addresses[][{most}]",
        [f"{{{', '.join(map(str, [*kernel['addresses'], -1]))}}}" for kernel in kernels],
    )
    return "\n".join(lines) + "\n"


def main(kind: str, file: Path, *emulator: str) -> int:
    """Build, replay and tell."""
    whole = lowered(Path(kernels_folder()) / stamp() / "kernels.bc", lambda *_: None)
    calls = decoded(file)
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        (folder / "kernels.o").write_bytes(object_code(whole, TARGETS[kind]))
        (folder / "table.h").write_text(table(next(calls)))
        runner = folder / "runner"
        subprocess.run(
            [
                *(sys.executable, "-m", "ziglang", "cc", "-target", ZIG[kind], "-static", "-O1", "-I", folder),
                *("-o", runner, Path(__file__).with_name("replay_calls.c"), folder / "kernels.o"),
            ],
            check=True,
        )
        with subprocess.Popen([*emulator, runner], stdin=subprocess.PIPE) as process:
            for call in calls:
                process.stdin.write(call)
            process.stdin.close()
        return process.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]), *sys.argv[3:]))
