# SPDX-License-Identifier: MIT
"""What results depend on beside their input: the processor and the versions. Equal ones give equal bits."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .. import __version__

PACKAGES = ("numpy", "numba", "scipy", "pyarrow", "distributed")


@cache
def cpu() -> str:
    """The processor's name."""
    try:
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


@cache
def versions(*others: str) -> dict[str, str]:
    """Versions of this package, of Python, of what it computes with and of ``others``, by name; what isn't installed is
    left out.
    """
    found = {"rigid_proto_ros": __version__, "python": platform.python_version()}
    for name in (*PACKAGES, *others):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found
