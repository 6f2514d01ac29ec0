# SPDX-License-Identifier: MIT
"""What a process that this one starts needs: this package's modules, and an end when this one has ended."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

PR_SET_PDEATHSIG = 1
"""From linux/prctl.h."""


def with_this_package() -> dict[str, str]:
    """This process's environment in which ``python -m rigid_proto_ros...`` finds this very package, from any folder."""
    folder = str(Path(__file__).resolve().parents[2])
    paths = [folder, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def end_with_this_thread() -> Callable[[], None] | None:
    """``preexec_fn`` of a child that gets SIGTERM when the thread that starts it ends, and so also when this process is
    killed; None where the system can't do that (Linux can).

    The kernel takes the end of that thread for the parent's: call it in the main thread, or in one that waits for the
    child. Asked for before the child's program is loaded, so that no end of the parent comes too early for it.
    """
    if not sys.platform.startswith("linux"):
        return None
    # Loaded before the fork: between fork and exec nothing may be imported.
    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
