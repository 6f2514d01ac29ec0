# SPDX-License-Identifier: MIT
"""Recorders for the files that ``record`` and ``--record`` name: an .mcap recording, an .rrd view, or both; and
playback of a recorded session into them.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError, is_missing
from ..parameters.declarations import Parameters
from ..scene.scenario import Scenario
from ..session.mailbox import WritingObserver
from ..simulation.observer import Observers, Reset

if TYPE_CHECKING:
    from ..session.recorded_session import RecordedSession


LIBRARIES = {".mcap": ("mcap", "mcap", "mcap"), ".rrd": ("rerun", "rerun-sdk", "rerun")}
"""Library that writes files of this suffix: module, package, and the extra that installs it."""


def recording_names(names: str) -> list[str]:
    """The files that ``record`` names, separated by commas: at most one .mcap and one .rrd; raises InputError."""
    files = [name.strip() for name in names.split(",") if name.strip()]
    endings = [Path(file).suffix.lower() for file in files]
    if len(set(endings)) < len(files) or not LIBRARIES.keys() >= set(endings):
        accepted = "a file that ends in .mcap (the recording) or .rrd (a view for Rerun), or one of each with a comma"
        raise InputError("record", names, accepted)
    return files


def make_recorders(
    names: str,
    node_name: str = "rigid_body",
    parameters: Parameters | None = None,
    on_error: Callable[[str], None] | None = None,
    simulated_log: bool = False,
    files: Sequence[tuple[str, bytes]] = (),
) -> list[WritingObserver]:
    """Observers that record to these files; raises InputError if one can't, and then none does.

    parameters: the scene's, for frame names. simulated_log: messages of an .mcap are logged at simulated time, for a
    run without a real-time clock; otherwise at wall time. files: (name, bytes) of meshes whose own files may be
    gone.
    """
    recorders: list[WritingObserver] = []
    # All checks come before an earlier recording is overwritten.
    for file in recording_names(names):
        _check_place(file)
        module, package, extra = LIBRARIES[Path(file).suffix.lower()]
        if importlib.util.find_spec(module) is None:
            raise InputError("record", is_missing(package, extra))
    with ExitStack() as opened:
        for file in recording_names(names):
            if Path(file).suffix.lower() == ".mcap":
                from ..session.mcap_observer import McapObserver

                recorder: WritingObserver = McapObserver(file, node_name, parameters, on_error, simulated_log, files)
            else:
                from .observer import FileRecorder

                recorder = FileRecorder(file, node_name, on_error)
            opened.callback(recorder.close)
            recorders.append(recorder)
        opened.pop_all()
    return recorders


def _check_place(path: str) -> None:
    """Raise InputError if the path has something else than a recording, since any scene or node may name the path."""
    place, head = Path(path), b""
    with suppress(OSError):  # an unreadable file is refused later if it can't be written
        if place.is_file():
            with open(place, "rb") as stream:
                head = stream.read(5)
        elif place.exists() and not place.is_dir():
            head = b"a device or a pipe"
    if head and not head.startswith((b"RRF2", b"\x89MCAP")):
        raise InputError("record", path, "a new file or an earlier recording; there is something else")


def record(
    runs: list[RecordedSession],
    path: str | Path,
    given: Scenario | None = None,
    progress: Callable[[float, float], None] = lambda *_: None,
) -> None:
    """Play all runs of a session into the recordings that ``path`` names, as the parameter ``record`` does. given: the
    scene of a session that lacks it. progress(sent, total) is called with numbers of states.

    Raises InputError for a session without a scene, and for a file that can't be written.
    """
    from ..session.recorded_session import check_playable, play, recorded_parameters

    # All checks come before an earlier recording is overwritten.
    for session in runs:
        check_playable(session, given)
    total = sum(session.states.count for session in runs)
    played, last = 0, runs[-1]

    def report(done: float, _: float) -> None:
        progress(played + done, total)

    recorders = make_recorders(
        str(path),
        last.node_name or "rigid_body",
        recorded_parameters(last) if given is None else given.parameters,
        on_error=lambda _: None,
        simulated_log=True,
        files=last.attachments,
    )
    with ExitStack() as closing:
        for recorder in recorders:
            closing.callback(recorder.close)
        observer = Observers(*recorders)
        for number, session in enumerate(runs):
            if number:
                observer.on(Reset())
            play(session, observer, given, report, all_events=True)
            played += session.states.count
    for recorder in recorders:
        if recorder.error:
            raise InputError("--record", str(path), f"a file that can be written ({recorder.error})")
