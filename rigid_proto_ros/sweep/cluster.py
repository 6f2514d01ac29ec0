# SPDX-License-Identifier: MIT
"""Chunks of a study on a Dask cluster: its scheduler deals them out, and gives those of a lost worker to another.

Workers need this package and the study's meshes under the same names. A chunk is a function of study and rows alone, so
it doesn't matter who computes it, or how often.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from typing import Any

from ..base.errors import InputError, is_missing
from .chunk import Chunk, run_chunk
from .study import Study
from .table import Parts

CONNECT_S = 10.0
"""[s] A scheduler that is there answers in this time."""
AHEAD = 3
"""Chunks that each worker thread has before it, so that it never waits and the client never holds many."""
RETRIES = 3
"""Of a chunk that failed. One whose worker died is given to another anyway."""


def cluster_chunks(
    study: Study, parts: Parts, todo: Iterable[int], address: str
) -> Generator[tuple[int, Chunk], None, None]:
    """Chunks as they get done on the cluster of this scheduler; raises InputError when nobody answers."""
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
        waiting = iter(todo)
        pending = distributed.as_completed(with_results=True, loop=client.loop)
        numbers: dict[Any, int] = {}

        def submit() -> bool:
            k = next(waiting, None)
            if k is None:
                return False
            future = client.submit(run_chunk, content, *parts.bounds(k), retries=RETRIES, pure=False)
            numbers[future.key] = k
            pending.add(future)
            return True

        for _ in range(AHEAD * max(1, sum(client.nthreads().values()))):
            if not submit():
                break
        for future, chunk in pending:
            if not isinstance(chunk, Chunk):
                raise chunk
            k = numbers.pop(future.key)
            future.release()
            submit()
            yield k, chunk
    finally:
        client.close()


def _same(study: Study) -> Study:
    """What the scheduler keeps of the study, so that any worker can have it again."""
    return study
