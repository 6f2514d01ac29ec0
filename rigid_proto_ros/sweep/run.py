# SPDX-License-Identifier: MIT
"""A study from beginning to end, or from where a killed run left it: chunks come in, parts are kept, the table is
joined.

Here chunks are flown by threads around the compiled batch, which leaves the interpreter's lock alone; rows that only
the simulation can fly would wait for that lock, so a study of such rows is given to processes. A chunk is a function of
study and rows alone, so it doesn't matter who computes it, or how often.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Generator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ..base.progress import Progress
from .chunk import Chunk, is_batchable, run_chunk
from .study import Study
from .table import Parts, metadata_of


class Interrupted(KeyboardInterrupt):
    """Stopped on request; ``metadata`` is that of the table as far as it came."""

    def __init__(self, metadata: dict[str, Any]) -> None:
        self.metadata = metadata
        super().__init__("stopped")


def run_study(
    study: Study, file: Path, *, workers: int = 0, resume: bool = False, progress: bool = True
) -> dict[str, Any]:
    """Fly all rows that aren't done yet and write the table; returns its metadata. workers 0: one a core. Raises
    Interrupted on Ctrl-C, with a readable table of what was done.
    """
    workers = workers or cores()
    known = metadata_of(file) if resume and file.is_file() else {}
    if known.get("fingerprint") == study.fingerprint and known.get("complete", False):
        return known
    parts = Parts(file, study, chunk_rows(study, workers), resume)
    done = sum(last - first for first, last in map(parts.bounds, parts.finished()))
    try:
        with Progress("sweep", large=progress, unit="rows") as shown, closing(_flown(study, parts, workers)) as chunks:
            shown.fraction(done, study.rows)
            for k, chunk in chunks:
                parts.write(k, chunk)
                done += len(chunk)
                shown.fraction(done, study.rows)
    except KeyboardInterrupt:
        raise Interrupted(parts.join()) from None
    return parts.join()


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def chunk_rows(study: Study, workers: int) -> int:
    """Rows a chunk: enough that a chunk's own cost doesn't count, few enough that all workers have some."""
    most = 4096 if _goes_in_batches(study) else 32
    # A chunk keeps its commands in memory: long scripts make it shorter.
    most = max(1, min(most, 500_000 // max(1, len(study.entries))))
    return max(1, min(most, -(-study.rows // (2 * workers))))


def _goes_in_batches(study: Study) -> bool:
    """Whether the compiled batch can fly the study's rows, tried with some of them."""
    return is_batchable(study, np.unique(np.linspace(0, study.rows - 1, min(study.rows, 9)).astype(np.int64)))


def _flown(study: Study, parts: Parts, workers: int) -> Generator[tuple[int, Chunk], None, None]:
    """Chunks by number, as they get done, a few ahead of whoever takes them."""
    pool = ThreadPoolExecutor(workers) if _goes_in_batches(study) else in_processes(workers)
    pending: dict[Future[Chunk], int] = {}
    waiting = parts.missing()
    try:
        while True:
            while len(pending) < 2 * workers and (k := next(waiting, None)) is not None:
                pending[pool.submit(run_chunk, study, *parts.bounds(k))] = k
            if not pending:
                return
            done, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in done:
                yield pending.pop(future), future.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def in_processes(workers: int) -> Executor:
    """Processes that end with this one."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_depend_on_the_parent)


def _depend_on_the_parent() -> None:
    """Interrupts are the parent's to handle; and a worker doesn't outlive a parent that was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_parent, daemon=True).start()


def _end_with_the_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)
