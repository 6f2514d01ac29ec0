# SPDX-License-Identifier: MIT
"""A study from beginning to end, or from where a killed run left it: chunks come in, parts are kept, the table is
joined.

Here chunks are flown by threads around the compiled batch, which leaves the interpreter's lock alone; rows that only
the simulation can fly would wait for that lock, so a study of such rows is given to processes. On a Dask cluster the
scheduler deals them out, and gives those of a lost worker to another; workers need this package and the study's meshes
under the same names. A chunk is a function of study and rows alone, so it doesn't matter who computes it, or how often.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.progress import Progress
from .chunk import Chunk, is_batchable, run_chunk
from .study import Study
from .table import Parts, metadata_of

CONNECT_S = 10.0
"""[s] A scheduler that is there answers in this time."""
AHEAD = 3
"""Chunks that each worker thread has before it, so that it never waits and the client never holds many."""
RETRIES = 3
"""Of a chunk that failed. One whose worker died is given to another anyway."""

Chunks = Generator[tuple[int, Chunk], None, None]
"""Chunks by number, as they get done."""


class Interrupted(KeyboardInterrupt):
    """Stopped on request; ``metadata`` is that of the table as far as it came."""

    def __init__(self, metadata: dict[str, Any]) -> None:
        self.metadata = metadata
        super().__init__("stopped")


def run_study(
    study: Study, file: Path, *, workers: int = 0, dask: str = "", resume: bool = False, progress: bool = True
) -> dict[str, Any]:
    """Fly all rows that aren't done yet and write the table; returns its metadata. workers 0: one a core; dask: address
    of a scheduler. Raises Interrupted on Ctrl-C, with a readable table of what was done.
    """
    workers = workers or cores()
    known = metadata_of(file) if resume and file.is_file() else {}
    if known.get("fingerprint") == study.fingerprint and known.get("complete", False):
        return known
    parts = Parts(file, study, chunk_rows(study, workers), resume)
    done = sum(last - first for first, last in map(parts.bounds, parts.finished()))
    flown = _on_cluster(study, parts, dask) if dask else _here(study, parts, workers)
    try:
        with Progress("sweep", large=progress, unit="rows") as shown, closing(flown) as chunks:
            shown.fraction(done, study.rows)
            for k, chunk in chunks:
                parts.write(k, chunk)
                done += len(chunk)
                shown.fraction(done, study.rows)
    except KeyboardInterrupt:
        raise Interrupted(parts.join()) from None
    return parts.join()


# Here


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


def _here(study: Study, parts: Parts, workers: int) -> Chunks:
    """A few chunks ahead of whoever takes them."""
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


# On a cluster


def _on_cluster(study: Study, parts: Parts, address: str) -> Chunks:
    """Raises InputError when nobody answers at the scheduler's address."""
    distributed: Any  # it has no types
    try:
        import distributed
    except ImportError:
        raise InputError("--dask", is_missing("distributed", "sweep")) from None
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError("--dask", address, f"the address of a scheduler, such as tcp://host:8786 ({error})") from None
    try:
        # A task and not scattered data, which would be lost with the worker that holds it.
        content = client.submit(_same, study, pure=False)
        pending = distributed.as_completed(with_results=True, loop=client.loop)
        numbers: dict[Any, int] = {}

        def submit(waiting: Iterator[int]) -> None:
            if (k := next(waiting, None)) is not None:
                future = client.submit(run_chunk, content, *parts.bounds(k), retries=RETRIES, pure=False)
                numbers[future.key] = k
                pending.add(future)

        waiting = parts.missing()
        for _ in range(AHEAD * max(1, sum(client.nthreads().values()))):
            submit(waiting)
        for future, chunk in pending:
            if not isinstance(chunk, Chunk):
                raise chunk
            k = numbers.pop(future.key)
            future.release()
            submit(waiting)
            yield k, chunk
    finally:
        client.close()


def _same(study: Study) -> Study:
    """What the scheduler keeps of the study, so that any worker can have it again."""
    return study
