# SPDX-License-Identifier: MIT
"""How kernels come to run: ``njit`` and ``exported``; and records whose fields are accessed by name, ``p.moments``, in
Python and in compiled functions alike.

A kernel is a function of numbers, records and arrays. It runs in one of these ways, chosen when this module is imported
by the environment variable RIGID_PROTO_KERNELS:

* ``library``: exported kernels are functions of a shared library that was built ahead (base/library.py). The small ones
  that only serve others are part of the library; where Python calls one, it runs as plain Python.
* ``interpreted``: all of them run as plain Python, for readable tracebacks. NUMBA_DISABLE_JIT=1 does the same.
* ``building``: numba compiles them into each other, for the library (rigid_proto_ros/kernels).
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from . import library
from .errors import InputError
from .vectors import Records

WAYS = ("library", "interpreted", "building")


def _chosen_way() -> str:
    plain = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    way = os.environ.get("RIGID_PROTO_KERNELS") or ("interpreted" if plain else "library")
    if way not in WAYS:
        raise InputError("RIGID_PROTO_KERNELS", way, ", ".join(WAYS))
    return way


WAY = _chosen_way()
COMPILED = WAY == "building"
"""Whether numba compiles; otherwise it isn't imported, and functions that aren't exported are plain Python."""
INTERPRETED = WAY == "interpreted"

if COMPILED:
    import numba
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic as numba_intrinsic
    from numba.np.arrayobj import populate_array

Emitted = tuple[Any, Any]
"""Result of an intrinsic: the signature, and the function that generates the code."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(*, allocates: bool = True, **options: Any) -> Callable[[_Function], _Function]:
    """numba's njit where kernels are built; elsewhere the function as it is. For a type checker it is that everywhere.

    allocates: False for a function that creates no arrays except slices of given ones. References aren't counted then,
    which saves two atomic operations per slice. numba refuses to compile such a function if it does allocate.
    """

    def decorated(function: _Function) -> _Function:
        if not COMPILED:
            return function
        # numba's internal name (tested with 0.68); without it the caller's value would apply.
        options["_nrt"] = allocates
        # Python's wrappers around each compiled function take a sixth of the time.
        options.update(no_cpython_wrapper=True, no_cfunc_wrapper=True)
        options.setdefault("forceinline", False)  # otherwise all that such a function calls would be forced, too
        kernel: _Function = numba.njit(**options)(function)
        return kernel

    return decorated


if COMPILED and not TYPE_CHECKING:
    intrinsic = numba_intrinsic
else:

    def intrinsic(*function: Callable[..., Any], **_options: Any) -> Callable[..., Any]:
        """numba's intrinsic; the result takes the same arguments without the first one, as values instead of types.
        Where numba doesn't compile, another definition must take its place.
        """
        return function[0] if function else lambda given: given


def exported(*arguments: Any, returns: str = "", nogil: bool = False) -> Callable[[_Function], _Function]:
    """Declare a kernel that Python, the page or another program calls, with an explicit signature; it allocates
    nothing, raises nothing and is compiled without numba's runtime.

    arguments: of each one "f8", "i8" or "b1" for a number (b1: bool); "f8[:]", "f8[:,:]", "i8[:]" and so on for a
    contiguous array of numbers (also u1, i4, f4, b1); the type of a record for one record, by reference; that type in a
    list, [LOAD_ROW], for an array of records. returns: "" for nothing, or its numbers with blanks between, "f8 f8 b1".
    nogil: release the interpreter's lock during the call, for what may take longer than some microseconds.
    """

    def decorated(function: _Function) -> _Function:
        kernel: Any = library.Kernel(function, arguments, returns, nogil)
        if WAY == "library":
            called: _Function = kernel
            return called
        compiled = njit(error_model="numpy", allocates=False, nogil=nogil)(function)
        kernel.compiled = compiled
        return compiled

    return decorated


def bound(kernel: Callable[..., Any], *first: Any) -> Callable[..., Any]:
    """An exported kernel with its first arguments given, which are kept; all others, and the only result, must be
    integers. Much quicker to call than the kernel; in one thread at a time.
    """
    return kernel.bound(*first) if isinstance(kernel, library.Kernel) else functools.partial(kernel, *first)


def _local_array(count: int, shape: tuple[int, ...], number: Any) -> tuple[Any, Any]:
    """Type and code of an array in the memory of the calling function."""
    kind = types.Array(number, len(shape), "C")

    def code(context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        of_numbers = context.get_data_type(number)
        # Once a call, not in every turn of a loop. numba's own function for this also fills it with zeros.
        with builder.goto_entry_block():
            memory = builder.alloca(ir.ArrayType(of_numbers, count))
        memory.align = 64
        return _array_at(context, builder, kind, builder.bitcast(memory, of_numbers.as_pointer()), shape)

    return kind, code


def _array_at(context: Any, builder: Any, kind: Any, data: Any, shape: tuple[Any, ...]) -> Any:
    """A contiguous array over given memory."""
    array = context.make_array(kind)(context, builder)
    each = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    sizes = [context.get_constant(types.intp, n) if isinstance(n, int) else n for n in shape]
    strides = [context.get_constant(types.intp, each)]
    for size in reversed(sizes[1:]):
        strides.insert(0, builder.mul(strides[0], size))
    populate_array(array, data=data, shape=sizes, strides=strides, itemsize=each, meminfo=None)
    return array._getvalue()  # noqa: SLF001 (as in numba's guide to extensions)


if TYPE_CHECKING or not COMPILED:

    def local_numbers(count: int) -> NDArray[np.float64]:
        """See below."""
        return np.empty(count)

    def local_matrix(rows: int, columns: int) -> NDArray[np.float64]:
        """See below."""
        return np.empty((rows, columns))

    def local_integers(count: int) -> NDArray[np.int64]:
        """See below."""
        return np.empty(count, np.int64)

    def matrix_of(numbers: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float64]:
        """See below."""
        return numbers[: rows * columns].reshape(rows, columns)

else:

    @intrinsic(prefer_literal=True)
    def local_numbers(_typing_context: Any, count: Any) -> Emitted:
        """Memory of the calling function for ``count`` doubles, a literal number; it may be passed on to functions that
        are called, but never returned.
        """
        kind, code = _local_array(count.literal_value, (count.literal_value,), types.float64)
        return kind(count), code

    @intrinsic(prefer_literal=True)
    def local_matrix(_typing_context: Any, rows: Any, columns: Any) -> Emitted:
        """The same for a matrix."""
        shape = (rows.literal_value, columns.literal_value)
        kind, code = _local_array(shape[0] * shape[1], shape, types.float64)
        return kind(rows, columns), code

    @intrinsic(prefer_literal=True)
    def local_integers(_typing_context: Any, count: Any) -> Emitted:
        """The same for integers (count,) int64."""
        kind, code = _local_array(count.literal_value, (count.literal_value,), types.int64)
        return kind(count), code

    @intrinsic
    def matrix_of(_typing_context: Any, numbers: Any, _rows: Any, _columns: Any) -> Emitted:
        """The first rows · columns of contiguous numbers as a matrix over the same memory."""
        kind = types.Array(types.float64, 2, "C")

        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            return _array_at(context, builder, kind, data, (arguments[1], arguments[2]))

        return kind(numbers, types.intp, types.intp), code


# Records of numbers by name


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """The type of records with these fields (name, type) or (name, type, length), aligned for the processor."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


def new_records(count: int, kind: np.dtype[Any]) -> Records:
    """Records (count,) of zeros; NumPy's own way goes through all fields, and takes five times as long."""
    return np.ndarray(count, kind, np.zeros(count * kind.itemsize, np.uint8))


def new_record(kind: np.dtype[Any]) -> np.record:
    """A record of zeros."""
    record: np.record = new_records(1, kind)[0]
    return record


def copy_of(record: np.record) -> np.record:
    """A record of the same content."""
    copied: np.record = np.ndarray(1, record.dtype, bytearray(record.tobytes()))[0]
    return copied


def place_of(kind: np.dtype[Any], name: str) -> int:
    """Byte offset of a field."""
    fields = kind.fields
    assert fields is not None
    return int(fields[name][1])


def copy_fields(of: np.record, to: np.record) -> None:
    """Copy a record to another one of the same type, outside of compiled functions."""
    for name in of.dtype.names or ():
        to[name] = of[name]


def _record_copier(_typing_context: Any, of: Any, to: Any) -> Emitted:
    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        source, target = arguments
        cgutils.raw_memcpy(builder, target, source, context.get_constant(types.intp, of.size), itemsize=1)
        return context.get_dummy_value()

    return types.none(of, to), code


if TYPE_CHECKING or not COMPILED:

    def numbers_in(record: np.record) -> NDArray[np.float64]:
        """See below."""
        return np.frombuffer(record.tobytes(), np.float64)

    def integers_in(record: np.record) -> NDArray[np.int64]:
        """See below."""
        return np.frombuffer(record.tobytes(), np.int64)

else:

    def _view_of_record(number: Any) -> Any:
        def view(_typing_context: Any, record: Any) -> Emitted:
            kind = types.Array(number, 1, "C")

            def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
                data = builder.bitcast(arguments[0], context.get_data_type(number).as_pointer())
                return _array_at(context, builder, kind, data, (record.size // 8,))

            return kind(record), code

        return view

    numbers_in = intrinsic(_view_of_record(types.float64))
    """numbers_in(record): the content of a record of 8-byte fields as doubles (n,), whatever they are; to be read."""
    integers_in = intrinsic(_view_of_record(types.int64))
    """integers_in(record): the same as integers."""

copy_record = intrinsic(_record_copier) if COMPILED else copy_fields
"""copy_record(of, to): copy a record to another one of the same type. An assignment would be compiled to a load and a
store per byte.
"""


@njit(error_model="numpy", allocates=False, forceinline=True)
def copy_numbers(of: NDArray[np.float64], to: NDArray[np.float64]) -> None:
    """Copy the first numbers of one array to all of another, one by one: numba's assignment of slices first checks
    whether the two share memory, and allocates a copy if they do.
    """
    for k in range(to.shape[0]):
        to[k] = of[k]
