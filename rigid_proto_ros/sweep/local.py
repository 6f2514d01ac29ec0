# SPDX-License-Identifier: MIT
"""Chunks of a study on this machine: threads around the compiled batch, which leaves the interpreter's lock alone.

Rows that only the simulation can fly would wait for that lock, so a study of such rows is given to processes instead.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait

import numpy as np

from .chunk import Chunk, is_batchable, run_chunk
from .study import Study
from .table import Parts


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def chunk_rows(study: Study, workers: int) -> int:
    """Rows a chunk: enough that a chunk's own cost doesn't count, few enough that all workers have some."""
    most = 4096 if goes_in_batches(study) else 32
    # A chunk keeps its commands in memory: long scripts make it shorter.
    most = max(1, min(most, 500_000 // max(1, len(study.entries))))
    return max(1, min(most, -(-study.rows // (2 * workers))))


def goes_in_batches(study: Study) -> bool:
    """Whether the compiled batch can fly the study's rows, tried with some of them."""
    rows = np.unique(np.linspace(0, study.rows - 1, min(study.rows, 9)).astype(np.int64))
    return is_batchable(study, rows)


def local_chunks(
    study: Study, parts: Parts, todo: Iterable[int], workers: int
) -> Generator[tuple[int, Chunk], None, None]:
    """Chunks as they get done, a few ahead of whoever takes them."""
    pool = _threads(workers) if goes_in_batches(study) else in_processes(workers)
    pending: dict[Future, int] = {}
    waiting = iter(todo)
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


def _threads(workers: int) -> Executor:
    return ThreadPoolExecutor(workers, thread_name_prefix="sweep")


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
