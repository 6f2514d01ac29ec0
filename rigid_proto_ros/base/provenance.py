# SPDX-License-Identifier: MIT
"""What a recording was made with beside its input. The package's own version decides about the bits; processor, C
library and the other versions are named where bits differ all the same.
"""

from __future__ import annotations

import os
import platform
import sysconfig
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .library import stamp

MOTION = "2026-11-28"
"""Since when the motion has had its present bits, with a letter from the second time on one day: versions with the same
give the same ones, on any machine.
"""

PACKAGES = ("numpy", "scipy", "pyarrow")


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
def c_library() -> str:
    """The C library and its version, without a blank: ``glibc-2.36``, or ``musl``."""
    try:
        return (os.confstr("CS_GNU_LIBC_VERSION") or "unknown").replace(" ", "-")
    except (AttributeError, ValueError, OSError):
        return "musl" if "musl" in str(sysconfig.get_config_var("HOST_GNU_TYPE")) else "unknown"


@cache
def versions(*others: str) -> dict[str, str]:
    """Versions by name: of this package, of Python, of what it computes with and of ``others``, as far as they are
    installed; with them the kind of machine and the C library.
    """
    from .. import __version__

    found = {
        "rigid_proto_ros": __version__,
        "motion": MOTION,
        "machine": platform.machine(),
        "c_library": c_library(),
        "python": platform.python_version(),
        "kernels": stamp(),
    }
    for name in (*PACKAGES, *others):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            pass
    return found
