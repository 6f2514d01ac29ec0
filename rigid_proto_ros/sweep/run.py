# SPDX-License-Identifier: MIT
"""A study from beginning to end, or from where a killed run left it: chunks come in, parts are kept, the
table is joined.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from pathlib import Path

from ..base.progress import Progress
from .chunk import Chunk
from .local import chunk_rows, cores, local_chunks
from .study import Study
from .table import Parts, metadata_of


class Interrupted(KeyboardInterrupt):
    """Stopped on request; ``metadata`` is that of the table as far as it came."""

    def __init__(self, metadata: dict) -> None:
        self.metadata = metadata
        super().__init__("stopped")


def run_study(
    study: Study, file: Path, *, workers: int = 0, dask: str = "", resume: bool = False, progress: bool = True
) -> dict:
    """Fly all rows that aren't done yet and write the table; returns its metadata. workers 0: one a core; dask: address
    of a scheduler. Raises Interrupted on Ctrl-C, with a readable table of what was done.
    """
    workers = workers or cores()
    if resume and _is_done(study, file):
        return metadata_of(file)
    parts = Parts(file, study, chunk_rows(study, workers), resume)
    finished = parts.finished()
    done = sum(last - first for first, last in map(parts.bounds, finished))
    try:
        with (
            Progress("sweep", large=progress, unit="rows") as shown,
            closing(_chunks(study, parts, workers, dask)) as chunks,
        ):
            shown.fraction(done, study.rows)
            for k, chunk in chunks:
                parts.write(k, chunk)
                done += len(chunk)
                shown.fraction(done, study.rows)
    except KeyboardInterrupt:
        raise Interrupted(parts.join()) from None
    return parts.join()


def _chunks(study: Study, parts: Parts, workers: int, dask: str) -> Generator[tuple[int, Chunk], None, None]:
    if dask:
        from .cluster import cluster_chunks

        return cluster_chunks(study, parts, parts.missing(), dask)
    return local_chunks(study, parts, parts.missing(), workers)


def _is_done(study: Study, file: Path) -> bool:
    if not file.is_file():
        return False
    metadata = metadata_of(file)
    return metadata.get("fingerprint") == study.fingerprint and metadata.get("complete", False)
