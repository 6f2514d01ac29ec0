# SPDX-License-Identifier: MIT
"""Reading and mending a recorded session, whatever file it lies in."""

from __future__ import annotations

from pathlib import Path

from .core.errors import InputError
from .recorded_session import RecordedSession


def read_runs(path: str | Path, node: str = "") -> list[RecordedSession]:
    """The runs of a session, the newest last: an .rrd or .mcap recording, or a bag of ``ros2 bag record``.

    node chooses the body in a bag with several. Raises InputError for what isn't there or can't be decoded.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("session", str(path), "an .rrd or .mcap recording, or the folder of a bag")
    from .session_bag import is_bag

    if not is_bag(path):
        from .rerun_view.reader import read_session

        return [read_session(path)]
    from .session_bag import read_bag
    from .session_runs import is_session_topic, session_runs

    return session_runs(read_bag(path, is_session_topic), path, node)


def repair(path: str | Path, repaired: str | Path) -> None:
    """Write a whole file with all that is whole in a session that was cut; InputError where that can't be."""
    path, repaired = Path(path), Path(repaired)
    from .session_bag import bag_bytes, bag_files, is_bag

    bag = path.exists() and is_bag(path)
    ending = ".mcap" if bag else ".rrd"
    if repaired.suffix != ending:
        raise InputError("--repair", str(repaired), f"a file that ends in {ending}, as the session's kind does")
    if repaired.exists() and path.exists() and repaired.samefile(path):
        raise InputError("--repair", str(repaired), "another file than the one that is repaired")
    if not bag:
        from .rerun_view.rrd_file import repair as repair_rrd

        repair_rrd(path, repaired)
        return
    from .session_mcap import repair_mcap

    files = bag_files(path)
    if len(files) > 1:
        raise InputError("--repair", f"a bag of {len(files)} files", "one of its files")
    repair_mcap(bag_bytes(files[0]), repaired, str(files[0]))
