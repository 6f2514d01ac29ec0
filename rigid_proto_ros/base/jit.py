# SPDX-License-Identifier: MIT
"""Kernels compiled by numba when they are first called: its import, and the compiled code on disk.

numba caches compiled code on disk and recompiles a function if its file has changed, but not if only a file has that it
imports from, though functions of that file are compiled in. After an update old results would persist. So a kernel of
this package is cached under a hash of its file and of all that this imports, directly or not.
"""

from __future__ import annotations

import functools
import gc
import importlib.util
import os
import sys
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from .cache import PACKAGE, source_stamp, user_cache

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
    from numba import config
    from numba.core import event
    from numba.core.caching import CompileResultCacheImpl, FunctionCache
    from numba.core.runtime.nrt import rtsys
    from numba.core.typing import cffi_utils  # noqa: F401  # otherwise looks for cffi at the first kernel
    from numba.np import arraymath  # otherwise looks for scipy's linear algebra at the first kernel
finally:
    for _name in _HIDDEN:
        del sys.modules[_name]
    if _COLLECTED:
        gc.enable()
    gc.freeze()
arraymath._HAVE_BLAS = importlib.util.find_spec("scipy") is not None  # noqa: SLF001  # for kernels of others

_CONFIG: Any = config  # its attributes are set at import


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
