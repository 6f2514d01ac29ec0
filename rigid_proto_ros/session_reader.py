# SPDX-License-Identifier: MIT
"""Reading and mending a recorded session, whatever file it lies in."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from .core.errors import InputError
from .output_file import output_file
from .recorded_session import RecordedSession


def read_runs(path: str | Path, node: str = "") -> list[RecordedSession]:
    """The runs of a session, the newest last: an .rrd or .mcap recording, or a bag of ``ros2 bag record``.

    node chooses the body in a bag with several. Raises InputError for what isn't there or can't be decoded.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("session", str(path), "an .rrd or .mcap recording, or the folder of a bag")
    if not is_bag(path):
        return [_rerun_reader(path).read_session(path)]
    bags = _bag_reader(path)
    from .session_runs import is_session_topic, session_runs

    return session_runs(bags.read_bag(path, is_session_topic), path, node)


def repair(path: str | Path, repaired: str | Path) -> None:
    """Write a whole file with all that is whole in a session that was cut; InputError where that can't be."""
    path, repaired = Path(path), Path(repaired)
    bag = path.exists() and is_bag(path)
    ending = ".mcap" if bag else ".rrd"
    if repaired.suffix != ending:
        raise InputError("--repair", str(repaired), f"a file that ends in {ending}, as the session's kind does")
    if repaired.exists() and path.exists() and repaired.samefile(path):
        raise InputError("--repair", str(repaired), "another file than the one that is repaired")
    output_file("--repair", repaired)
    if not bag:
        from .rerun_view.rrd_file import repair as repair_rrd

        repair_rrd(path, repaired)
        return
    bags = _bag_reader(path)
    files = bags.bag_files(path)
    if len(files) > 1:
        raise InputError("--repair", f"the bag has {len(files)} files; name one of them")
    bags.repair_mcap(bags.bag_bytes(files[0]), repaired, str(files[0]))


def is_bag(path: Path) -> bool:
    """Whether a path is to be read as a bag: a folder, or a file that begins as an MCAP file does, or is named so."""
    if path.is_dir() or ".mcap" in path.suffixes:
        return True
    try:
        with open(path, "rb") as stream:
            return stream.read(5) == b"\x89MCAP"
    except OSError:
        return False


def _bag_reader(path: Path) -> ModuleType:
    try:
        from . import session_bag
    except ImportError as error:
        raise InputError("session", str(path), f"mcap to be installed: pip install mcap ({error})") from None
    return session_bag


def _rerun_reader(path: Path) -> ModuleType:
    if find_spec("rerun") is None:
        raise InputError("session", str(path), "rerun to be installed: pip install rerun-sdk")
    from .rerun_view import reader

    return reader
