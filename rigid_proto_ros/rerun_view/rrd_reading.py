# SPDX-License-Identifier: MIT
"""Reading an .rrd back, frame by frame (observer.py has the format): Rerun's own reader and ``rerun rrd optimize``
refuse most files that were cut.
"""

from __future__ import annotations

import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.vectors import IntArray
from ..session.recorded_session import RecordedSession
from .backend import EVENTS, REFUSALS, SCENE, SESSION_MESH, SIM_TIME, STATE
from .observer import FRAME_HEAD, mark_end

MAGIC = b"RRF2"
HEADER_BYTES = 12
KINDS = (0, 1, 2, 3)
"""End, store info, data, blueprint activation."""

STATES = "Scalars:scalars"
TEXT = "TextLog:text"
RECORDING = "__properties"
MADE_WITH = "__properties/made_with"


def read_session(path: str | Path) -> RecordedSession:
    """Everything needed to look at a recorded run again or compute it anew.

    Files that were never finished or were cut are read as far as they are whole. Raises InputError for a file that
    isn't there, isn't an .rrd, holds nothing whole, or was damaged inside.
    """
    path = Path(path)
    try:
        _, complete = whole_bytes(path)
    except OSError as error:
        raise InputError("session", str(path), f"a recording that can be read ({error.strerror})") from error
    folder = path.absolute().parent
    session = RecordedSession(complete=complete, folder=folder)
    try:
        _read(path, session)
    except RuntimeError:
        # Also a file whose index was cut: all frames are whole, but the reader wants none of it.
        session = RecordedSession(complete=False, folder=folder)
        with whole_part(path) as whole:
            try:
                _read(whole, session)
            except RuntimeError as error:
                reason = (str(error).splitlines() or [""])[-1].replace(str(whole), str(path))
                raise InputError("session", str(path), f"an undamaged recording ({reason})") from error
    return session


def record_batches(path: Path) -> Iterator[tuple[str, bool, Any]]:
    """(entity, static, pyarrow record batch) of every chunk of the newest recording in the file."""
    from rerun.chunk import RrdReader

    with warnings.catch_warnings():
        # The missing index of an unfinished file is our concern, not the reader's.
        warnings.simplefilter("ignore")
        reader = RrdReader(path)
        recordings = reader.recordings()
        if not recordings:
            return
        for chunk in reader.stream(store=recordings[-1]):
            yield chunk.entity_path.lstrip("/"), chunk.is_static, chunk.to_record_batch()


def _read(path: Path, session: RecordedSession) -> None:
    times, rows = [], []
    events: list[tuple[int, str]] = []
    refusals: list[tuple[int, str]] = []
    files: dict[str, dict[str, Any]] = {}
    for entity, _, batch in record_batches(path):
        if entity == STATE:
            times.append(_sim_times(batch))
            rows.append(_flat(batch, STATES).reshape(-1, 13))
        elif entity in (EVENTS, REFUSALS):
            target = events if entity == EVENTS else refusals
            texts = [cell[0] for cell in batch.column(TEXT).to_pylist()]
            target.extend(zip(_sim_times(batch).tolist(), texts, strict=True))
        elif entity.startswith(RECORDING):
            _read_properties(entity, batch, session)
        elif entity == SCENE:
            session.scenes += [cell[0] for cell in batch.column("TextDocument:text").to_pylist()]
        elif entity.startswith(SESSION_MESH):
            # Columns of one entity may lie in chunks of their own, as in a file that was mended.
            held = {"name", "data"}.intersection(batch.schema.names)
            files.setdefault(entity, {}).update({name: _flat(batch, name) for name in held})
    session.attachments = [(str(file["name"][0]), file["data"].tobytes()) for file in files.values() if len(file) == 2]
    session.scene = session.scenes[0] if session.scenes else ""
    session.events, session.refusals = events, refusals
    if times:
        session.times, session.rows = np.concatenate(times), np.concatenate(rows)


def _read_properties(entity: str, batch: Any, session: RecordedSession) -> None:
    if entity == MADE_WITH:
        # Columns of one entity may lie in chunks of their own, as in a file that was mended.
        held = batch.schema.names
        if "cpu" in held:
            session.made_with["cpu"] = batch.column("cpu").to_pylist()[0][0]
        if "versions" in held:
            session.made_with |= dict(text.rsplit(" ", 1) for text in batch.column("versions").to_pylist()[0])
    elif "RecordingInfo:name" in batch.schema.names:
        # The node's name, and which run of it.
        name = batch.column("RecordingInfo:name").to_pylist()[0][0].split(",")[0]
        session.node_name = name if all(map(str.isidentifier, name.split("/"))) else session.node_name


def _sim_times(batch: Any) -> IntArray:
    times: IntArray = batch.column(SIM_TIME).to_numpy(zero_copy_only=False).astype("timedelta64[ns]").astype(np.int64)
    return times


def _flat(batch: Any, column: str) -> NDArray[Any]:
    """All values of a column of lists, in order."""
    values: NDArray[Any] = batch.column(column).flatten().to_numpy(zero_copy_only=False)
    return values


# Frames


def whole_bytes(path: Path) -> tuple[int, bool]:
    """How many bytes from the start hold whole frames, and whether the stream was ended.

    Raises InputError for a file that isn't an .rrd at all, or holds no whole frame.
    """
    size = path.stat().st_size
    with open(path, "rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError("session", f"the content of {str(path)!r} is that of no .rrd or .mcap recording")
        at = HEADER_BYTES
        while at + FRAME_HEAD.size <= size:
            file.seek(at)
            kind, length = FRAME_HEAD.unpack(file.read(FRAME_HEAD.size))
            if kind == 0:
                return at, True
            if kind not in KINDS or at + FRAME_HEAD.size + length > size:
                break
            at += FRAME_HEAD.size + length
    if at == HEADER_BYTES:
        raise InputError("session", str(path), "a recording with data; this one ends before its first chunk")
    return at, False


def copy_whole(path: Path, copy: Path) -> None:
    """Write a finished file with the whole frames of ``path``; raises OSError."""
    kept, _ = whole_bytes(path)
    with open(path, "rb") as reading, open(copy, "wb") as writing:
        shutil.copyfileobj(reading, writing)
        writing.truncate(kept)
    mark_end(copy)


@contextmanager
def whole_part(path: Path) -> Iterator[Path]:
    """A readable file with the whole frames of ``path``: a temporary copy, removed at the end."""
    with tempfile.TemporaryDirectory(prefix="rigid_proto_") as folder:
        copy = Path(folder) / path.name
        try:
            copy_whole(path, copy)
        except OSError as error:
            raise InputError("session", str(path), f"space for a copy in {folder} ({error.strerror})") from error
        yield copy
