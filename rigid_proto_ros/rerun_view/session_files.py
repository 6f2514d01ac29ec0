# SPDX-License-Identifier: MIT
"""Recorded sessions in whatever file they lie: recorded, read, repaired, and played into another."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from ..base.errors import InputError, is_missing
from ..base.files import is_same_file, output_file
from ..parameters.declarations import Parameters
from ..scene.scenario import Scenario
from ..simulation.observer import Reset

if TYPE_CHECKING:
    from ..session.mcap_observer import McapObserver
    from ..session.recorded_session import RecordedSession
    from .observer import FileRecorder

    Recorder = McapObserver | FileRecorder


def is_mcap(path: str) -> bool:
    """Whether a recording of this name is an MCAP file; any other is Rerun's."""
    return path.lower().endswith(".mcap")


def make_recorder(
    path: str,
    node_name: str = "rigid_body",
    parameters: Parameters | None = None,
    on_error: Callable[[str], None] | None = None,
    simulated_log: bool = False,
    files: Sequence[tuple[str, bytes]] = (),
) -> Recorder:
    """An observer that records to ``path``; raises InputError where it can't.

    parameters: the scene's, of which frames' names count. simulated_log: messages of an .mcap are logged at simulated
    time, as suits a run without a clock; else at the wall's. files (name, bytes): meshes whose own files may be gone.
    """
    _check_place(path)
    if is_mcap(path):
        try:
            from ..session.mcap_observer import McapObserver

            return McapObserver(path, node_name, parameters, on_error, simulated_log, files)
        except ImportError:
            raise InputError("record", is_missing("mcap", "mcap")) from None
    if importlib.util.find_spec("rerun") is None:
        raise InputError("record", is_missing("rerun-sdk", "rerun"))
    from .observer import FileRecorder

    return FileRecorder(path, node_name, on_error, files)


def _check_place(path: str) -> None:
    """A scene, or any node, may name the place: a recording that stands there is overwritten, and nothing else is."""
    place, head = Path(path), b""
    with suppress(OSError):  # what can't be read is refused where it can't be written
        if place.is_file():
            with open(place, "rb") as stream:
                head = stream.read(5)
        elif place.exists() and not place.is_dir():
            head = b"a device or a pipe"
    if head and not head.startswith((b"RRF2", b"\x89MCAP")):
        raise InputError("record", path, "a new file or an earlier recording; there is something else")


def read_runs(path: str | Path, node: str = "") -> list[RecordedSession]:
    """The runs of a session, the newest last: an .rrd or .mcap recording, or a bag of ``ros2 bag record``.

    node chooses the body in a bag with several. Raises InputError for what isn't there or can't be decoded.
    """
    path = Path(path)
    if not path.exists():
        raise InputError("session", f"there is no file and no folder {str(path)!r}")
    if not is_bag(path):
        session = _read_rrd(path)
        if node and node.strip("/") != session.node_name:
            raise InputError("--node", node, f"{session.node_name}, the only one of this recording")
        return [session]
    runs: list[RecordedSession] = _bag_reader().session_runs(path, node)
    return runs


def repair(path: str | Path, repaired: str | Path) -> None:
    """Write a whole file with all that is whole in a session that was cut; InputError where that can't be."""
    path, repaired = Path(path), Path(repaired)
    bag = path.exists() and is_bag(path)
    ending = ".mcap" if bag else ".rrd"
    if repaired.suffix != ending:
        raise InputError("--repair", str(repaired), f"a file that ends in {ending}, like the session")
    if is_same_file(repaired, path):
        raise InputError("--repair", str(repaired), "another file than the one that is repaired")
    output_file("--repair", repaired)
    if not bag:
        from .rrd_reading import copy_whole

        # What is damaged inside is refused here.
        _read_rrd(path)
        copy_whole(path, repaired)
        return
    if path.is_dir():
        raise InputError("--repair", str(path), "one .mcap file of the folder")
    _bag_reader().repair_mcap(path, repaired)


def is_bag(path: Path) -> bool:
    """Whether a path is to be read as a bag: a folder, or a file that begins as an MCAP file does, or is named so or
    .db3.
    """
    if path.is_dir() or path.suffix == ".db3" or (".mcap" in path.suffixes and path.suffix != ".rrd"):
        return True  # flight.mcap.zstd, too, but not flight.mcap.rrd, made of a bag
    try:
        with open(path, "rb") as stream:
            return stream.read(5) == b"\x89MCAP"
    except OSError:
        return False


def _bag_reader() -> ModuleType:
    try:
        from ..session import bag as session_bag
    except ImportError:
        raise InputError("session", is_missing("mcap", "mcap")) from None
    return session_bag


def _read_rrd(path: Path) -> RecordedSession:
    if importlib.util.find_spec("rerun") is None:
        raise InputError("session", is_missing("rerun-sdk", "rerun"))
    from .rrd_reading import read_session

    return read_session(path)


def record(
    runs: list[RecordedSession],
    path: str | Path,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda *_: None,
) -> None:
    """Play all runs of a session into a recording, .rrd or .mcap; given: the scene of a session that lacks it.
    ``progress`` is called with (states told, all states).

    Raises InputError for a session without a scene and a file that can't be written.
    """
    from ..session.recorded_session import play, recorded_parameters, resimulation

    # What is refused is refused before a recording of an earlier flight is overwritten.
    for session in runs:
        if given is None and (session.missing or not session.scene):
            raise InputError("session", ", ".join(session.missing) or "no scene", "--scene FILE, to draw it")
        if given is None:
            resimulation(session)
    total = sum(len(session.times) for session in runs)
    told, last = 0, runs[-1]

    def so_far(done: float, _: float) -> None:
        progress(told + done, total)

    recorder = make_recorder(
        str(path),
        last.node_name or "rigid_body",
        recorded_parameters(last) if given is None else given.parameters,
        on_error=lambda _: None,
        simulated_log=True,
        files=last.attachments,
    )
    with closing(recorder):
        for number, session in enumerate(runs):
            if number:
                recorder.on(Reset())
            play(session, recorder, given, so_far, all_events=True)
            told += len(session.times)
    if recorder.error:
        raise InputError("--record", str(path), f"a file that can be written ({recorder.error})")
