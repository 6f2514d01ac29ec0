# SPDX-License-Identifier: MIT
"""Exported kernels as functions of a shared library, which rigid_proto_ros/kernels builds, and how Python calls them.

Each is a C function ``void NAME(int64_t *block)``. The block has slots of 8 bytes: one for each number returned, then
the arguments in order: a number one slot (a bool 0 or 1); a record one, its address; an array its address and then each
extent. In WebAssembly an address takes a whole slot, too.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import os
import platform
import stat
import struct
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cache import PACKAGE, source_stamp, user_cache
from .errors import InputError, is_missing

ABI = 1
"""Version of what stands above."""

MODULES = (
    "base.rotation",
    "mesh.assembly",
    "mesh.intersection",
    "mesh.topology",
    "mass.closed_form",
    "mass.moments",
    "mass.repair",
    "mass.tensor",
    "mass.walls",
    "motion.body",
    "motion.state",
    "motion.surface",
    "simulation.batch",
    "simulation.effects",
    "simulation.flight",
    "simulation.quantities",
    "simulation.record",
    "sweep.sampling",
    "identify.trajectories",
    "kernels.fused",
)
"""Those that declare exported kernels."""

KERNELS: dict[str, Kernel] = {}
"""All exported kernels of the modules imported so far, by name."""

_CODES = {"f8": "d", "i8": "q", "b1": "?7x"}
"""Numbers in a block, as struct has them."""
_WORD = ctypes.sizeof(ctypes.c_size_t)
_MEMORY = (ctypes.c_size_t * (1 << 44)).from_address(0)
"""All memory as words. NumPy's own ways to an address take ten times as long."""
_OF_ARRAY = object.__basicsize__ // _WORD
"""Where an array object has the address of its content: behind the head of every object, in words."""
_OF_RECORD = _OF_ARRAY + 1
"""Where a record has it: behind the head of objects of several sizes."""
_TYPE_OF: Any = np.generic.dtype.__get__
"""The type of a record; asked for as its attribute it takes six times as long."""
_IN_ORDER = 0x0001 | 0x0100
"""NumPy's flags of an array that is contiguous and aligned."""


class Kernel:
    """A kernel, called as its Python function is. Arrays must be contiguous and of the declared type: none is copied.

    arguments and returns: as in ``exported`` (base/compilation.py). Raises TypeError for what isn't as declared.
    """

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], returns: str, nogil: bool) -> None:
        functools.update_wrapper(self, function)
        self.function, self.name, self.nogil = function, function.__name__, nogil
        self.arguments, self.returns = arguments, returns.split()
        assert KERNELS.setdefault(self.name, self) is self, f"two kernels are named {self.name}"
        self.compiled: Any = None  # numba's dispatcher, where it compiles
        self._called: Any = None
        self._bind: Any = None

    def __call__(self, *arguments: Any) -> Any:
        """Call the library's function."""
        try:
            return (self._called or self._prepared())(*arguments)
        except struct.error as error:
            raise TypeError(f"{self.name}: {error}") from None

    def bound(self, *first: Any) -> Callable[..., Any]:
        """See ``compilation.bound``."""
        if self._bind is None:
            self._prepared()
            count = len(first)
            assert {*self.arguments[count:], *self.returns} == {"i8"} and len(self.returns) == 1, self.name
            given = struct.Struct("=8x" + "".join(map(_codes, self.arguments[:count])))
            self._bind = self._code(_binding(self, count, given.size // 8), "bind", given.pack_into)
        bound: Callable[..., Any] = self._bind(*first)
        return bound

    def _prepared(self) -> Any:
        """Make what packs a block, calls the library's function and unpacks the block, as code for this signature."""
        out = "".join(_CODES[kind] for kind in self.returns)
        packed = struct.Struct(f"={8 * len(self.returns)}x{''.join(map(_codes, self.arguments))}")
        self._unpack = struct.Struct(f"={out}").unpack_from
        self._block = ctypes.c_int64 * (packed.size // 8)
        self._function = loaded(self.nogil)[self.name]
        self._function.restype = None
        self._called = self._code(_calling(self), "call", packed.pack_into)
        return self._called

    def _code(self, source: str, name: str, pack: Any) -> Any:
        """The function of this name that a source defines."""
        known: dict[str, Any] = {f"kind{k}": place(argument)[0] for k, argument in enumerate(self.arguments)}
        known.update(array=np.ndarray, record=np.record, type_of=_TYPE_OF, memory=_MEMORY, looked_at=self._values)
        known.update(new_block=self._block, function=self._function, pack=pack, unpack=self._unpack)
        exec(source, known)
        return known[name]

    def _values(self, arguments: tuple[Any, ...]) -> list[Any]:
        """The arguments as a block has them. Raises TypeError."""
        values: list[Any] = []
        for argument, declared in zip(arguments, self.arguments, strict=False):
            kind, dimensions = place(declared)
            values += [argument] if kind is None else _address_and_extents(argument, kind, dimensions, self.name)
        return values


def _filling(arguments: tuple[Any, ...]) -> str:
    """Code that fills a block with arguments a0, a1 and so on. A loop over them would take twice as long."""
    names = [f"a{k}" for k in range(len(arguments))]
    checks, values = [], []
    for k, (own, declared) in enumerate(zip(names, arguments, strict=True)):
        kind, dimensions = place(declared)
        if kind is None:
            values.append(own)
        elif dimensions == 0:
            checks.append(f"type({own}) is record and type_of({own}) is kind{k}")
            values.append(f"memory[id({own}) // {_WORD} + {_OF_RECORD}]")
        else:
            in_order = f"{own}.flags.num & {_IN_ORDER} == {_IN_ORDER}"
            checks.append(f"type({own}) is array and {own}.dtype is kind{k} and {own}.ndim == {dimensions}")
            checks.append(in_order)
            values.append(f"memory[id({own}) // {_WORD} + {_OF_ARRAY}], *{own}.shape")
    return f"""
    block = new_block()
    if {" and ".join(checks) or "True"}:
        pack(block, 0, {", ".join(values)})
    else:
        pack(block, 0, *looked_at(({"".join(own + ", " for own in names)})))
"""


def _calling(kernel: Kernel) -> str:
    """Code of ``call``, with all arguments."""
    names = ", ".join(f"a{k}" for k in range(len(kernel.arguments)))
    result = {0: "None", 1: "unpack(block)[0]"}.get(len(kernel.returns), "unpack(block)")
    return f"""
def call({names}):
{_filling(kernel.arguments)}
    function(block)
    return {result}
"""


def _binding(kernel: Kernel, count: int, slot: int) -> str:
    """Code of ``bind``, which takes the first arguments and returns a call with the others, integers from a slot on."""
    names = ", ".join(f"a{k}" for k in range(count))
    numbers = [f"n{k}" for k in range(len(kernel.arguments) - count)]
    put = "\n        ".join(f"block[{slot + k}] = {own}" for k, own in enumerate(numbers))
    return f"""
def bind({names}):
{_filling(kernel.arguments[:count])}
    def call({", ".join(numbers)}, kept=({names},)):
        {put}
        function(block)
        return block[0]

    return call
"""


def place(declared: Any) -> tuple[np.dtype[Any] | None, int]:
    """Type and number of dimensions of an argument: 0 for a record, None and 0 for a number."""
    if isinstance(declared, np.dtype):
        return declared, 0
    if isinstance(declared, list):
        return declared[0], 1
    kind, _, extents = declared.partition("[")
    return (np.dtype(kind), extents.count(":")) if extents else (None, 0)


def _codes(declared: Any) -> str:
    """How struct packs an argument."""
    kind, dimensions = place(declared)
    return _CODES[declared] if kind is None else "q" * (1 + dimensions)


def address_of(array: NDArray[Any]) -> int:
    """Address of an array's content."""
    return int(_MEMORY[id(array) // _WORD + _OF_ARRAY])


def _address_and_extents(argument: Any, kind: np.dtype[Any], dimensions: int, name: str) -> tuple[int, ...]:
    """Also of what isn't plainly right: a record alone in an array, a type that is only equal, ... Raises TypeError."""
    if isinstance(argument, np.ndarray | np.void) and argument.dtype == kind:
        of = _OF_ARRAY if isinstance(argument, np.ndarray) else _OF_RECORD
        right = argument.ndim == dimensions or (dimensions == 0 and argument.size == 1)
        if right and argument.flags.num & _IN_ORDER == _IN_ORDER:
            return (_MEMORY[id(argument) // _WORD + of], *argument.shape[:dimensions])
    wanted = f"an array of {kind.names or kind}, contiguous, with {dimensions} dimensions"
    got = repr(argument)
    if isinstance(argument, np.ndarray | np.void):
        got = f"{argument.dtype.names or argument.dtype}, shape {argument.shape}, strides {argument.strides}"
    raise TypeError(f"{name}: got {got}; accepted: {wanted if dimensions else f'a record of {kind.names}'}")


# The library


X86_64 = {
    "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "fma", "bmi2"},
    "x86-64-v3": {"avx2", "fma", "bmi2"},
    "x86-64-v2": set[str](),
}
"""Kinds of processors, the best one first, and what each can do, by Linux's names."""
KINDS = (*X86_64, "aarch64")


def target() -> str:
    """The kind of processor that the library is for: the best one that this processor is, or RIGID_PROTO_PROCESSOR.
    Raises InputError where it isn't one of those, and on another machine.
    """
    machine = platform.machine().lower()
    if machine in ("aarch64", "arm64"):
        able = ["aarch64"]
    elif machine in ("x86_64", "amd64"):
        flags = _cpu_flags()
        able = [kind for kind, needed in X86_64.items() if needed <= flags]
    else:
        raise InputError("kernels", machine, "x86_64 or aarch64; RIGID_PROTO_KERNELS=interpreted runs anywhere, slowly")
    asked = os.environ.get("RIGID_PROTO_PROCESSOR") or able[0]
    if asked not in able:
        raise InputError("RIGID_PROTO_PROCESSOR", asked, f"what this processor is: {', '.join(able)}")
    return asked


def _cpu_flags() -> set[str]:
    """What the first processor can do, by Linux's names; empty where that isn't known."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as stream:
            return next((set(line.split()) for line in stream if line.startswith("flags")), set())
    except OSError:
        return set()


@functools.cache
def stamp() -> str:
    """Hash of all that the kernels are made from. What is built for one is never used for another."""
    sources = [os.path.join(PACKAGE, *module.split(".")) + ".py" for module in (*MODULES, "kernels.targets")]
    return f"{ABI}-{source_stamp(*sources).hex()[:20]}"


def file_name(kind: str) -> str:
    """Name of what is built for a kind of processor."""
    return "kernels.wasm" if kind == "wasm32" else f"kernels-{kind}.so"


def kernels_folder() -> str:
    """The folder for what is built: RIGID_PROTO_KERNELS_FOLDER, or one in the user's cache. Raises InputError if there
    is none.
    """
    asked, cache = os.environ.get("RIGID_PROTO_KERNELS_FOLDER", ""), user_cache()
    if not asked and not cache:
        raise InputError("kernels", "there is no home folder to keep them in; set RIGID_PROTO_KERNELS_FOLDER")
    return os.path.abspath(asked) if asked else os.path.join(cache, "kernels")


def carried_folder() -> str:
    """The folder for what a wheel carries."""
    return os.path.join(PACKAGE, "kernels", "lib")


def check_own(folder: str) -> None:
    """Refuse a folder where somebody else could put a library. Raises InputError and OSError."""
    found, user = os.stat(folder), getattr(os, "getuid", None)
    if user is None:
        return  # rights are another matter there
    if found.st_uid != user() or stat.S_IMODE(found.st_mode) & 0o077:
        raise InputError("kernels", f"{folder} must be this user's and closed to others: remove it, or chmod 700")


@functools.cache
def loaded(nogil: bool) -> Any:
    """The library; nogil: its calls release the interpreter's lock. Where there is none for the present sources it is
    built, which takes a minute. Raises InputError.
    """
    name = file_name(target())
    path = os.path.join(carried_folder(), stamp(), name)
    try:
        if not os.path.isfile(path):
            folder = os.path.join(kernels_folder(), stamp())
            path = os.path.join(folder, name)
            if not os.path.isfile(path):
                os.makedirs(folder, mode=0o700, exist_ok=True)
                _build()
            check_own(folder)
        _check_addresses()
        return (ctypes.CDLL if nogil else ctypes.PyDLL)(path)
    except OSError as error:
        raise InputError("kernels", f"{error}; RIGID_PROTO_KERNELS_FOLDER names another folder for them") from None


def _check_addresses() -> None:
    """Make sure that objects are laid out as ``Kernel`` reads them. Raises InputError."""
    array = np.zeros(2, np.dtype((np.record, [("x", np.int64)])))
    first = array.__array_interface__["data"][0]
    read = (_MEMORY[id(array) // _WORD + _OF_ARRAY], _MEMORY[id(record := array[1]) // _WORD + _OF_RECORD])
    if read != (first, first + 8) or record.dtype is not array.dtype:
        raise InputError("kernels", f"numpy {np.__version__} on {sys.implementation.name}", "one that is known here")


def _build() -> None:
    from .interrupts import end_with_this_thread, with_this_package

    missing = [name for name in ("numba", "llvmlite") if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError("kernels", f"they aren't built for these sources, and {is_missing(missing[0], 'kernels')}")
    print("building the kernels, once; a minute or so ...", file=sys.stderr, flush=True)
    done = subprocess.run(
        [sys.executable, "-P", "-m", "rigid_proto_ros.kernels"],
        env=with_this_package(),
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=end_with_this_thread(),
    )
    if done.returncode:
        raise InputError("kernels", (done.stderr.strip().splitlines() or ["the build failed"])[-1])
