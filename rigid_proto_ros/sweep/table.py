# SPDX-License-Identifier: MIT
"""A study flown whole into a Parquet file: chunks of rows are flown by threads around the compiled batch, which leaves
the interpreter's lock alone, and are written in order of rows as they get done.
"""

from __future__ import annotations

import datetime
import json
import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
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

if TYPE_CHECKING:
    import pyarrow as pa

KEY = b"rigid_proto_ros"
"""Of the file's metadata: a JSON object."""
CHUNK_ROWS = 4096
"""At most: then a chunk's own cost doesn't count."""
CHUNK_COMMANDS = 500_000
"""Commands of scripts that a chunk keeps in memory: with a long script it has fewer rows."""


class SweepInterrupted(KeyboardInterrupt):
    """Stopped on request, with so many rows in the table; where that is 0 there is none."""

    def __init__(self, rows_done: int) -> None:
        self.rows_done = rows_done
        super().__init__("stopped")


def arrow() -> tuple[ModuleType, ModuleType]:
    """pyarrow and its Parquet part; raises InputError where they aren't installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("sweep", is_missing("pyarrow", "sweep")) from None
    return pyarrow, pyarrow.parquet


def as_arrow(chunk: Chunk) -> pa.Table:
    """A chunk as a table: NaN and None are null."""
    pa, _ = arrow()
    arrays = {}
    for name, column in chunk.columns.items():
        kind = pa.string() if column.dtype == object else pa.from_numpy_dtype(column.dtype)
        arrays[name] = pa.array(column, type=kind, from_pandas=True)
    return pa.table(arrays)


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_study(study: Study, file: Path, *, progress: bool = True) -> dict[str, Any]:
    """Fly all rows and write the table, which has its name when it is whole; returns its metadata. Raises
    SweepInterrupted on Ctrl-C, with a readable table of the rows before.
    """
    pa, pq = arrow()
    threads = cores()
    commands = len(expand_script(study.script, "script"))
    step = max(1, min(CHUNK_ROWS, CHUNK_COMMANDS // max(1, commands), -(-study.rows // (2 * threads))))
    starts = iter(range(0, study.rows, step))
    done = simulated = failed = 0
    interrupt: KeyboardInterrupt | None = None
    schema = as_arrow(run_chunk(study, 0, 0)).schema
    text = [name for name, kind in zip(schema.names, schema.types, strict=True) if kind == pa.string()]
    pool, pending = ThreadPoolExecutor(threads), deque[Future[Chunk]]()
    with (
        whole_file("--output", file) as beside,
        pq.ParquetWriter(beside, schema, use_dictionary=text) as writer,
        Progress("sweep", shown=progress) as shown,
    ):
        try:
            while True:
                while len(pending) < 2 * threads and (first := next(starts, None)) is not None:
                    pending.append(pool.submit(run_chunk, study, first, min(first + step, study.rows)))
                if not pending:
                    break
                chunk = pending.popleft().result()
                writer.write_table(as_arrow(chunk))
                done += len(chunk)
                simulated += chunk.simulated
                failed += sum(reason is not None for reason in chunk.columns["failure"])
                shown.fraction(done, study.rows)
        except KeyboardInterrupt as error:
            interrupt = error
            if not done:
                raise SweepInterrupted(0) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
        metadata = {
            "study": study.name,
            "seed": study.seed,
            "rows": study.rows,
            "rows_done": done,
            "complete": done == study.rows,
            "rows_failed": failed,
            "rows_by_simulation": simulated,
            "rows_by_compiled_batch": done - simulated,
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "cpu": cpu(),
            **versions(),
        }
        writer.add_key_value_metadata({KEY: json.dumps(metadata).encode()})
    if interrupt is not None:
        raise SweepInterrupted(done) from interrupt
    return metadata
