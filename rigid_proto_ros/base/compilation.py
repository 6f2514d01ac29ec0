# SPDX-License-Identifier: MIT
"""Compilation and caching of kernels: ``njit`` for this package, and notification when something is being compiled; and
records whose fields are accessed by name, ``p.moments``, in Python and in compiled functions alike.

numba caches compiled code on disk and recompiles a function if its file has changed, but not if only a file has that it
imports from, though functions of that file are compiled in. After an update old results would persist. So a kernel of
this package is cached under a hash of its file and of all that this imports, directly or not.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import importlib.util
import os
import re
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from llvmlite import ir
from numpy.typing import NDArray

_ABSENT: Any = None
"""Entry in sys.modules for a module that can't be imported."""
# numba imports these if they are installed, which takes a third of its own time. coverage is needed only for
# measurements, scipy for its version and linear algebra, and cffi for C functions; no kernel here uses the last two.
_HIDDEN = [name for name in ("coverage", "scipy", "cffi") if name not in sys.modules]
sys.modules.update(dict.fromkeys(_HIDDEN, _ABSENT))
# numba makes 100,000 objects that stay: the garbage collector would search them again and again, now and later.
_COLLECTED = gc.isenabled()
gc.disable()
try:
    import numba
    from numba import config, types
    from numba.core import cgutils, event
    from numba.core.caching import CompileResultCacheImpl, FunctionCache
    from numba.core.runtime.nrt import rtsys
    from numba.core.typing import cffi_utils  # noqa: F401  # otherwise looks for cffi at the first kernel
    from numba.extending import intrinsic as numba_intrinsic
    from numba.np import arraymath  # otherwise looks for scipy's linear algebra at the first kernel
    from numba.np.arrayobj import populate_array
finally:
    for _name in _HIDDEN:
        del sys.modules[_name]
    if _COLLECTED:
        gc.enable()
    gc.freeze()
arraymath._HAVE_BLAS = importlib.util.find_spec("scipy") is not None  # noqa: SLF001  # for kernels of others

_CONFIG: Any = config  # its attributes are set at import
Emitted = tuple[Any, Any]
"""Result of an intrinsic: the signature, and the function that generates the code."""
INTERPRETED = bool(_CONFIG.DISABLE_JIT)
"""NUMBA_DISABLE_JIT=1: kernels are plain functions, for readable tracebacks."""

PACKAGE = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))

_RELATIVE_IMPORT = re.compile(r"^[ \t]*from[ \t]+(\.+)([\w.]*)[ \t]+import[ \t]+(?:\(([^)]*)\)|([^\n]*))", re.MULTILINE)


@functools.cache
def source_stamp(file: str) -> bytes:
    """SHA-256 of a file and of all that it imports relatively, directly or not."""
    hashes: dict[str, bytes] = {}
    waiting = [file]
    while waiting:
        file = waiting.pop()
        if file not in hashes:
            hashes[file], imported = _source(file)
            waiting += imported
    return hashlib.sha256(b"".join(hashes[file] for file in sorted(hashes))).digest()


@functools.cache
def _source(file: str) -> tuple[bytes, list[str]]:
    """Hash of a file, and the files that it imports."""
    with open(file, encoding="utf-8") as stream:
        text = stream.read()
    candidates = set()
    for dots, name, in_brackets, plain in _RELATIVE_IMPORT.findall(text):
        folder = file
        for _ in dots:
            folder = os.path.dirname(folder)
        module = os.path.join(folder, *filter(None, name.split(".")))
        # An imported name is defined in a module, or is a module of a package.
        candidates |= {f"{module}.py", os.path.join(module, "__init__.py")}
        candidates |= {os.path.join(module, f"{name}.py") for name in re.findall(r"\w+", in_brackets or plain)}
    return hashlib.sha256(text.encode()).digest(), [file for file in candidates if _exists(file)]


_exists = functools.cache(os.path.isfile)


def user_cache() -> str:
    """This package's part of the user's cache folder; empty where there is no home folder."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    base = base if os.path.isabs(base) else os.path.expanduser(os.path.join("~", ".cache"))
    return os.path.join(base, "rigid_proto_ros") if os.path.isabs(base) else ""


@functools.cache
def kernel_folder(file: str) -> str:
    """The cache folder for a source file's kernels, created and writable. Its name has a hash of the file and of all
    that it imports, so that all checkouts, builds and installations of the same sources share it, and no others.

    It is in NUMBA_CACHE_DIR, in the user's cache folder or, if neither is writable, in the package's __pycache__.
    """
    # Includes the package's own name, which compiled code refers to.
    module = os.path.relpath(file, os.path.dirname(PACKAGE)).removesuffix(".py").replace(os.sep, ".")
    user = user_cache()
    usual = (user and os.path.join(user, "kernels"), os.path.join(PACKAGE, "__pycache__", "kernels"))
    places = list(filter(None, (_CONFIG.CACHE_DIR, *usual)))
    for place in places:
        folder = os.path.join(place, f"{module}-{source_stamp(file).hex()[:20]}")
        try:
            os.makedirs(folder, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    tried = " or ".join(places)
    raise OSError(f"compiled kernels can't be kept in {tried}; set XDG_CACHE_HOME to a folder that can be written to")


class KernelLocator:
    """Cache locator for numba: the folder of a kernel of this package, and the stamp of its sources."""

    def __init__(self, file: str, line: int) -> None:
        # numba reads these two attributes to warn about functions that can't be cached.
        self._py_file, self._lineno = file, line

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        """A locator, as numba expects it; None for a function outside this package."""
        path = os.path.realpath(file)
        return cls(path, function.__code__.co_firstlineno) if path.startswith(PACKAGE + os.sep) else None

    def get_cache_path(self) -> str:
        """The cache folder."""
        return kernel_folder(self._py_file)

    def ensure_cache_path(self) -> None:
        """Create the folder again if it has been removed meanwhile."""
        os.makedirs(self.get_cache_path(), exist_ok=True)

    def get_source_stamp(self) -> bytes:
        """Stamp of the sources; if the one on disk is different, numba recompiles."""
        return source_stamp(self._py_file)

    def get_disambiguator(self) -> str:
        """Distinguishes functions of the same name in one file."""
        return str(self._lineno)


class _KernelFiles(CompileResultCacheImpl):
    """Adds KernelLocator to numba's cache locators."""

    _locator_classes = [KernelLocator, *CompileResultCacheImpl._locator_classes]  # noqa: SLF001 (numba's place for it)


class KernelCache(FunctionCache):
    """The cached kernels of one function. Its files are searched only when they are needed: most functions are only
    compiled into others.
    """

    _impl_class = _KernelFiles

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The cached kernel for a signature, or None.

        numba's method first imports its whole compiler, which takes longer than the rest of a short command; the
        compiler does that itself, too, when something must be compiled (tested with 0.68).
        """
        if not hasattr(self, "_impl"):
            # Locators that a user has named know nothing of the files that a kernel is compiled from.
            named, _CONFIG.CACHE_LOCATOR_CLASSES = _CONFIG.CACHE_LOCATOR_CLASSES, ""
            try:
                FunctionCache.__init__(self, self._function)
            finally:
                _CONFIG.CACHE_LOCATOR_CLASSES = named
            # numba numbers the kernels of a function. Two processes that compile two of them at once take one number,
            # and the one would stay in the other's place: euler would run as midpoint.
            own = f"{self._impl.filename_base}.{uuid.uuid4().hex[:16]}"
            self._cache_file._data_name_pattern = own + ".{number:d}.nbc"  # noqa: SLF001 (there is no option)
        # Also for a kernel that doesn't allocate: it may have been compiled from functions that count references.
        rtsys.initialize(target)
        try:
            return FunctionCache._load_overload(self, signature, target)  # noqa: SLF001 (as above)
        except (OSError, MemoryError):
            return None
        except Exception:
            # Damaged, as after a power cut, for which pickle and LLVM raise errors of any class: compiled anew.
            with suppress(OSError):
                os.unlink(self._cache_file._index_path)  # noqa: SLF001 (numba has no other way)
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep a kernel; one that can't be kept, as on a full disk, is compiled again at the next start."""
        with suppress(OSError):
            FunctionCache.save_overload(self, signature, result)


_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(*, allocates: bool = True, cache: bool = True, **options: Any) -> Callable[[_Function], _Function]:
    """numba's njit, with kernels cached by ``KernelCache``. For a type checker the result is the Python function.

    allocates: False for a function that creates no arrays except slices of given ones. References aren't counted then,
    which saves two atomic operations per slice. numba refuses to compile such a function if it does allocate. cache:
    False for a function outside this package.
    """

    def decorated(function: _Function) -> _Function:
        # numba's internal name (tested with 0.68); without it the caller's value would apply.
        options["_nrt"] = allocates
        compiled: Any = numba.njit(**options)(function)
        if cache and not INTERPRETED:
            compiled._cache = KernelCache(function)  # noqa: SLF001 (where enable_caching puts it)
        kernel: _Function = compiled
        return kernel

    return decorated


def entry_of(kernel: Callable[..., Any], signature: Any) -> Callable[..., Any]:
    """The compiled function for this signature, called without type dispatch.

    A call through numba's dispatcher determines the arguments' types each time, which takes longer than a short kernel.
    """
    if INTERPRETED:
        return kernel
    entry: Callable[..., Any] = compiled_for(kernel, signature).entry_point
    return entry


def compiled_for(kernel: Any, signature: Any) -> Any:
    """numba's result of compiling a kernel for this signature, or of loading it from the cache."""
    # By the types of its arguments, as a call does: numba caches what is compiled for a signature apart.
    result = kernel.get_compile_result(signature)
    assert result.signature.return_type == signature.return_type, result.signature
    return result


if TYPE_CHECKING:

    def intrinsic(*function: Callable[..., Any], **options: Any) -> Any:
        """numba's intrinsic; the result takes the same arguments without the first one, as values instead of types."""

else:
    intrinsic = numba_intrinsic


@contextmanager
def notify_when_compiling(notify: Callable[[], None]) -> Iterator[None]:
    """Call ``notify`` once, when the first kernel is compiled within the context."""

    class Listener(event.Listener):
        notified = False

        def on_start(self, _: event.Event) -> None:
            if not self.notified:
                self.notified = True
                notify()

        def on_end(self, _: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield


# Kernels that Python and other programs call, by name


@dataclass(frozen=True)
class Export:
    """A kernel that is called from outside of compiled code. arguments and returns: as in ``exported``."""

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    returns: str


EXPORTS: dict[str, Export] = {}
"""All of them, by the functions' names."""


def exported(*arguments: Any, returns: str = "", nogil: bool = False) -> Callable[[_Function], _Function]:
    """Declare a kernel that Python, the page or another program calls, with an explicit signature; it allocates
    nothing, raises nothing and is compiled without numba's runtime.

    arguments: of each one "f8", "i8" or "b1" for a number (b1: bool); "f8[:]", "f8[:,:]", "i8[:]" and so on for a
    contiguous array of numbers (also u1, i4, f4, b1); the type of a record for one record, by reference; that type in a
    list, [LOAD_ROW], for an array of records. returns: "" for nothing, or its numbers with blanks between, "f8 f8 b1".
    nogil: release the interpreter's lock during the call, for what may take longer than some microseconds.
    """

    def decorated(function: _Function) -> _Function:
        assert function.__name__ not in EXPORTS, f"two kernels are named {function.__name__}"
        EXPORTS[function.__name__] = Export(function, arguments, returns)
        return njit(error_model="numpy", allocates=False, nogil=nogil)(function)

    return decorated


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


if INTERPRETED:

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


def new_record(kind: np.dtype[Any]) -> np.record:
    """A record of zeros."""
    record: np.record = np.zeros(1, kind)[0]
    return record


def place_of(kind: np.dtype[Any], name: str) -> int:
    """Byte offset of a field."""
    fields = kind.fields
    assert fields is not None
    return int(fields[name][1])


def _assign_fields(of: np.record, to: np.record) -> None:
    for name in of.dtype.names or ():
        to[name] = of[name]


def _record_copier(_typing_context: Any, of: Any, to: Any) -> Emitted:
    def code(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        source, target = arguments
        cgutils.raw_memcpy(builder, target, source, context.get_constant(types.intp, of.size), itemsize=1)
        return context.get_dummy_value()

    return types.none(of, to), code


copy_record = _assign_fields if INTERPRETED else intrinsic(_record_copier)
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
