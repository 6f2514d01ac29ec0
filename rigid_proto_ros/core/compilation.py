# SPDX-License-Identifier: MIT
"""Whether kernels are being compiled: cached ones compile nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


@contextmanager
def told_when_compiling(tell: Callable[[], None]) -> Iterator[None]:
    """Call ``tell`` once, when the first kernel is compiled within the context."""

    class Listener(event.Listener):
        told = False

        def on_start(self, _) -> None:
            if not self.told:
                self.told = True
                tell()

        def on_end(self, _) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield
