# SPDX-License-Identifier: MIT
"""Fly a study into a Parquet file. Chunks are written in order of rows as they are done, so a table that was
interrupted has the first rows and can be resumed after them.
"""

from __future__ import annotations

import datetime
import json
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..base.command_line import Progress
from ..base.errors import InputError, is_missing
from ..base.files import whole_file
from ..base.provenance import cpu, versions
from ..scene.script import expand_script
from .rows import Chunk, run_chunk
from .study import Study
from .workers import Cluster, Flown, Threads, Workers

if TYPE_CHECKING:
    import pyarrow as pa

KEY = b"rigid_proto_ros"
"""Key of a JSON object in the file's metadata."""
CHUNK_ROWS = 4096
"""Largest number of rows of a chunk; the overhead of a chunk is negligible then."""
CHUNK_COMMANDS = 500_000
"""Largest number of commands that a chunk keeps in memory; with a long script a chunk has fewer rows."""


class SweepInterrupted(KeyboardInterrupt):
    """A sweep stopped on request. rows_done: number of rows in the table; without any there is no table."""

    def __init__(self, rows_done: int) -> None:
        self.rows_done = rows_done
        super().__init__("stopped")


def arrow() -> tuple[ModuleType, ModuleType]:
    """The modules pyarrow and pyarrow.parquet. Raises InputError if they aren't installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("sweep", is_missing("pyarrow", "sweep")) from None
    return pyarrow, pyarrow.parquet


def as_arrow(chunk: Chunk) -> pa.Table:
    """A chunk as a table, in which NaN and None are null."""
    pa, _ = arrow()
    arrays = {}
    for name, column in chunk.columns.items():
        kind = pa.string() if column.dtype == object else pa.from_numpy_dtype(column.dtype)
        arrays[name] = pa.array(column, type=kind, from_pandas=True)
    return pa.table(arrays)


def metadata_of(file: Path) -> dict[str, Any]:
    """A table's metadata. Raises InputError if it isn't the table of a sweep."""
    pa, pq = arrow()
    try:
        metadata: dict[str, Any] = json.loads((pq.read_metadata(file).metadata or {})[KEY])
    except (OSError, KeyError, ValueError, pa.ArrowException):
        raise InputError("--resume", str(file), "the table of a sweep") from None
    return metadata


def run_study(
    study: Study, file: Path, *, dask: str = "", resume: bool = False, progress: bool = True
) -> dict[str, Any]:
    """Fly all rows and write the table, which gets its final name when it is complete. Returns its metadata. dask:
    address of a scheduler whose workers fly the rows. resume: continue after the rows that the table already has.

    Raises SweepInterrupted on Ctrl-C and leaves a readable table of the rows so far. Raises InputError if the table to
    resume belongs to another study.
    """
    pa, pq = arrow()
    before = metadata_of(file) if resume and file.is_file() else {}
    if before and before.get("fingerprint") != study.fingerprint:
        raise InputError("--resume", str(file), "a table of the same study, by the same kernels")
    if before.get("complete"):
        return before
    schema = as_arrow(run_chunk(study, 0, 0)).schema
    text = [name for name, kind in zip(schema.names, schema.types, strict=True) if kind == pa.string()]
    counts = {name: int(before.get(name, 0)) for name in ("rows_done", "rows_by_simulation", "rows_failed")}
    interrupt: KeyboardInterrupt | None = None
    workers: Workers = Cluster(study, dask) if dask else Threads(study)
    with (
        whole_file("--output", file) as beside,
        pq.ParquetWriter(beside, schema, use_dictionary=text) as writer,
        Progress("sweep", progress, counts["rows_done"]) as shown,
    ):
        if before:
            with pq.ParquetFile(file) as old:
                for k in range(old.num_row_groups):
                    writer.write_table(old.read_row_group(k))
        try:
            for chunk in chunks(study, counts["rows_done"], workers):
                writer.write_table(as_arrow(chunk))
                counts["rows_done"] += len(chunk)
                counts["rows_by_simulation"] += chunk.simulated
                counts["rows_failed"] += sum(reason is not None for reason in chunk.columns["failure"])
                shown.fraction(counts["rows_done"], study.rows)
        except KeyboardInterrupt as error:
            interrupt = error
            if not counts["rows_done"]:
                raise SweepInterrupted(0) from error
        finally:
            workers.close()
        metadata = {
            "study": study.name,
            "fingerprint": study.fingerprint,
            "seed": study.seed,
            "rows": study.rows,
            "complete": counts["rows_done"] == study.rows,
            **counts,
            "rows_by_compiled_batch": counts["rows_done"] - counts["rows_by_simulation"],
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "cpu": cpu(),
            **versions(),
        }
        writer.add_key_value_metadata({KEY: json.dumps(metadata).encode()})
    if interrupt is not None:
        raise SweepInterrupted(counts["rows_done"]) from interrupt
    return metadata


def chunks(study: Study, first: int, workers: Workers) -> Iterator[Chunk]:
    """The chunks of rows from ``first`` on, in order. Two chunks per worker are in flight at a time."""
    commands = len(expand_script(study.script, "script"))
    most = min(CHUNK_ROWS, CHUNK_COMMANDS // max(1, commands))
    step = max(1, min(most, -(-(study.rows - first) // (2 * workers.count))))
    starts = iter(range(first, study.rows, step))
    pending = deque[Flown]()
    while True:
        while len(pending) < 2 * workers.count and (start := next(starts, None)) is not None:
            pending.append(workers.submit(start, min(start + step, study.rows)))
        if not pending:
            return
        yield pending.popleft().result()
