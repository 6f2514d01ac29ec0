# SPDX-License-Identifier: MIT
"""One rigid body from a mesh: exact mass properties, motion under wrenches, ROS 2 topics and a Rerun view."""

from pathlib import Path

__version__: str


def __getattr__(name: str) -> str:
    """``__version__``, from package.xml of the source tree, else from the installed metadata. Looked up when asked for:
    that takes a fifth of the time of a short command.
    """
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    package = Path(__file__).resolve().parents[1] / "package.xml"
    if package.is_file():
        return package.read_text("utf-8").partition("<version>")[2].partition("</version>")[0]
    from importlib.metadata import version

    return version(__name__)
