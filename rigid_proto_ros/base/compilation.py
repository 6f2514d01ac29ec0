# SPDX-License-Identifier: MIT
"""How kernels are compiled and kept: ``njit`` for this package, and word of it when something is being compiled; and
records that are read by name, ``p.moments``, in Python and in compiled functions alike.

numba keeps compiled code on disk and compiles anew when the file of a function has changed, but not when a file has
that this one imports from, though its functions are compiled in. After an update the old numbers would go on for ever.
So a kernel of this package is kept under the content of its file and of all that this imports, directly or not.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

_ABSENT: Any = None
"""What Python takes for a module that isn't there."""
# numba imports these wherever they are installed, a third of its own time: coverage is of use while something is
# measured, scipy for its version and for linear algebra, and cffi for C functions, neither of which a kernel here uses.
_HIDDEN = [name for name in ("coverage", "scipy", "cffi") if name not in sys.modules]
sys.modules.update(dict.fromkeys(_HIDDEN, _ABSENT))
try:
    import numba
    from numba import config
    from numba.core import event
    from numba.core.caching import CompileResultCacheImpl, FunctionCache
    from numba.core.runtime.nrt import rtsys
    from numba.core.typing import cffi_utils  # noqa: F401  # looks for cffi, at the first kernel if not here
    from numba.extending import intrinsic as numba_intrinsic
    from numba.np import arraymath  # looks for scipy's linear algebra, at the first kernel if not here
finally:
    for _name in _HIDDEN:
        del sys.modules[_name]
arraymath._HAVE_BLAS = importlib.util.find_spec("scipy") is not None  # noqa: SLF001  # for kernels of others

_CONFIG: Any = config  # its settings are made when it is imported
Emitted = tuple[Any, Any]
"""Of an intrinsic: the signature, and the function that makes the code."""
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
        # What is imported is a name in a module, or a module of a package.
        candidates |= {f"{module}.py", os.path.join(module, "__init__.py")}
        candidates |= {os.path.join(module, f"{name}.py") for name in re.findall(r"\w+", in_brackets or plain)}
    return hashlib.sha256(text.encode()).digest(), [file for file in candidates if _exists(file)]


_exists = functools.cache(os.path.isfile)


@functools.cache
def kernel_folder(file: str) -> str:
    """The folder of a source file's kernels, made and writable: named by the content of the file and of all that it
    imports, so that every checkout, build and installation of the same sources shares it, and none meets another's.

    It lies in NUMBA_CACHE_DIR, in the user's cache folder, or, where neither can be written to, beside the package.
    """
    # With the package's own name, which compiled code refers to.
    module = os.path.relpath(file, os.path.dirname(PACKAGE)).removesuffix(".py").replace(os.sep, ".")
    base = os.environ.get("XDG_CACHE_HOME", "")
    user = base if os.path.isabs(base) else os.path.join(os.path.expanduser("~"), ".cache")
    usual = (os.path.join(user, "rigid_proto_ros", "kernels"), os.path.join(PACKAGE, "__pycache__", "kernels"))
    for place in filter(None, (_CONFIG.CACHE_DIR, *usual)):
        folder = os.path.join(place, f"{module}-{source_stamp(file).hex()[:20]}")
        try:
            os.makedirs(folder, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    raise OSError(f"no folder for compiled kernels can be written to: {', '.join(usual)}")


class KernelLocator:
    """Tells numba where a kernel of this package is kept, and which state of the sources it is of."""

    def __init__(self, file: str, line: int) -> None:
        # numba reads these two names where it warns of what can't be kept.
        self._py_file, self._lineno = file, line

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> Any:
        """A locator as numba wants it; None for what isn't of this package."""
        path = os.path.realpath(file)
        if not path.startswith(PACKAGE + os.sep):
            return None
        try:
            kernel_folder(path)
        except OSError:
            return None
        return cls(path, function.__code__.co_firstlineno)

    def get_cache_path(self) -> str:
        """The folder."""
        return kernel_folder(self._py_file)

    def ensure_cache_path(self) -> None:
        """Make the folder again where somebody has removed it meanwhile."""
        os.makedirs(self.get_cache_path(), exist_ok=True)

    def get_source_stamp(self) -> bytes:
        """State of the sources; where another one is found on the disk, numba compiles anew."""
        return source_stamp(self._py_file)

    def get_disambiguator(self) -> str:
        """Tells apart functions of one name in one file."""
        return str(self._lineno)


class _KernelFiles(CompileResultCacheImpl):
    """Which of numba's locators are asked."""

    _locator_classes = [KernelLocator, *CompileResultCacheImpl._locator_classes]  # noqa: SLF001 (numba's place for it)


class KernelCache(FunctionCache):
    """The kernels of one function on disk. Its files are looked for when they are wanted: most functions are compiled
    into others only.
    """

    _impl_class = _KernelFiles

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The kernel for a signature, or None.

        numba imports its whole compiler first, which takes longer than the rest of a short command; the compiler
        itself does that, too, once something is to be compiled (tried with 0.68).
        """
        if not hasattr(self, "_impl"):
            super().__init__(self._function)
        rtsys.initialize(target)
        return self._load_overload(signature, target)


_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(*, allocates: bool = True, cache: bool = False, **options: Any) -> Callable[[_Function], _Function]:
    """numba's, with kernels kept by ``KernelCache``. To a type checker what it makes is the Python function.

    allocates: False where the function makes no arrays but slices of given ones, whose references nobody counts then:
    each slice costs two atomic operations otherwise. numba refuses to compile such a function if it does allocate.
    """

    def decorated(function: _Function) -> _Function:
        # numba's own name (tried with 0.68); where it isn't given the caller's would count.
        options["_nrt"] = allocates
        compiled: Any = numba.njit(**options)(function)
        if cache and not INTERPRETED:
            compiled._cache = KernelCache(function)  # noqa: SLF001 (where enable_caching puts it)
        kernel: _Function = compiled
        return kernel

    return decorated


def entry_of(kernel: Callable[..., Any], signature: Any) -> Callable[..., Any]:
    """The compiled function itself for this signature: called without looking at its arguments' types.

    A call through numba's dispatcher looks them up each time, which costs more than a short kernel takes.
    """
    if INTERPRETED:
        return kernel
    kernel.compile(signature)  # type: ignore[attr-defined]  # numba's
    entry: Callable[..., Any] = kernel.get_compile_result(signature).entry_point  # type: ignore[attr-defined]  # numba's
    return entry


if TYPE_CHECKING:

    def intrinsic(*function: Callable[..., Any], **options: Any) -> Any:
        """numba's; what it makes takes the arguments without the first, and those are values and not types."""

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


# Records of numbers by name


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """The type of records with these fields (name, type) or (name, type, length), each where the processor likes it."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


def new_record(kind: np.dtype[Any]) -> np.record:
    """A record of zeros."""
    record: np.record = np.zeros(1, kind)[0]
    return record


def place_of(kind: np.dtype[Any], name: str) -> int:
    """Where a field begins [bytes]."""
    fields = kind.fields
    assert fields is not None
    return int(fields[name][1])


@njit(cache=True, error_model="numpy", allocates=False, forceinline=True)
def copy_numbers(of: np.ndarray, to: np.ndarray) -> None:
    """The first numbers of one array to all of another, one by one: numba's own way with slices looks first whether the
    two share memory, and makes room for a copy if they do.
    """
    for k in range(to.shape[0]):
        to[k] = of[k]
