# SPDX-License-Identifier: MIT
"""How kernels are compiled and kept: ``njit`` for this package, and word of it when something is being compiled.

numba keeps compiled code on disk and compiles anew when the file of a function has changed, but not when a file has
that this one imports from, though its functions are compiled in. After an update the old numbers would go on for ever.
So a kernel of this package also counts as changed when any file has that its own imports, directly or not.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

_MEASURED = "coverage" in sys.modules
_ABSENT: Any = None
"""What Python takes for a module that isn't there."""
if not _MEASURED:
    # numba imports it wherever it is installed, a tenth of its own time; it is of use while something is measured.
    sys.modules["coverage"] = _ABSENT
try:
    import numba
    from numba import config
    from numba.core import event
    from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator
    from numba.extending import intrinsic as numba_intrinsic
finally:
    if not _MEASURED:
        del sys.modules["coverage"]

__all__ = ["INTERPRETED", "intrinsic", "njit", "notify_when_compiling", "source_stamp"]

_CONFIG: Any = config  # its settings are made when it is imported
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


def _stamp(own: Callable[[], object], file: str) -> tuple[object, bytes]:
    return own(), source_stamp(file)


class KernelLocator:
    """Where numba itself would keep a kernel of this package, with a stamp that knows what the kernel imports."""

    @classmethod
    def from_function(cls, function: Callable, file: str) -> Any:
        """A locator as numba wants it; None for what isn't of this package."""
        path = os.path.realpath(file)
        if not path.startswith(PACKAGE + os.sep):
            return None
        for usual in (UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator):
            locator = usual.from_function(function, file)
            if locator is not None:
                locator.get_source_stamp = functools.partial(_stamp, locator.get_source_stamp, path)
                return locator
        return None


_USUAL = "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator,ZipCacheLocator"
"""numba's own list."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(*signature: Any, allocates: bool = True, **options: Any) -> Callable[[_Function], _Function]:
    """numba's, with kernels kept by ``KernelLocator``. To a type checker what it makes is the Python function.

    allocates: False where the function makes no arrays but slices of given ones, whose references nobody counts then:
    each slice costs two atomic operations otherwise. numba refuses to compile such a function if it does allocate.
    """

    def decorated(function: _Function) -> _Function:
        # NUMBA_CACHE_LOCATOR_CLASSES, which numba reads when it is handed the function (tried with 0.68).
        before = _CONFIG.CACHE_LOCATOR_CLASSES
        _CONFIG.CACHE_LOCATOR_CLASSES = f"{__name__}.{KernelLocator.__name__},{before or _USUAL}"
        try:
            # numba's own name (tried with 0.68); where it isn't given the caller's would count.
            options["_nrt"] = allocates
            return numba.njit(*signature, **options)(function)
        finally:
            _CONFIG.CACHE_LOCATOR_CLASSES = before

    return decorated


if TYPE_CHECKING:

    def intrinsic(*function: Callable, **options: Any) -> Any:
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
