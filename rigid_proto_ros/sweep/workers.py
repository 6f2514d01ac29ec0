# SPDX-License-Identifier: MIT
"""Workers that fly a study's rows: threads of this process, since the compiled batch releases the interpreter's lock,
or the workers of a Dask cluster. A row depends only on the study and its number, so it doesn't matter which worker
flies it, or how often.

Dask's scheduler distributes the chunks and gives those of a lost worker to another one. Its workers need this package
with the same kernels. The contents of the meshes are sent with the study.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Protocol

from ..base.bundled import body_names
from ..base.errors import InputError, is_missing
from ..base.library import stamp
from ..scene.script import expand_script
from ..simulation.commands import Change
from .rows import Chunk, run_chunk
from .study import Study

CONNECT_S = 10.0
"""Timeout of the connection to a scheduler [s]."""


class Flown(Protocol):
    """A chunk in flight."""

    def result(self) -> Chunk:
        """Wait for the chunk and return it. Raises what flying it raised."""


class Workers(Protocol):
    """A pool of workers."""

    @property
    def count(self) -> int:
        """Number of chunks flown at a time."""

    def submit(self, first: int, last: int) -> Flown:
        """Start flying rows first to last − 1."""

    def close(self) -> None:
        """Cancel what isn't done."""


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Threads:
    """Threads of this process, one per core."""

    def __init__(self, study: Study) -> None:
        self.count = cores()
        self._study, self._pool = study, ThreadPoolExecutor(self.count)

    def submit(self, first: int, last: int) -> Flown:
        """Start flying rows first to last − 1."""
        return self._pool.submit(run_chunk, self._study, first, last)

    def close(self) -> None:
        """Cancel chunks that haven't started, and wait for the others."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class Cluster:
    """The workers of the Dask scheduler at an address such as tcp://host:8786. Raises InputError if none answers, or
    for a study that reads a mesh file in flight.
    """

    def __init__(self, study: Study, address: str) -> None:
        try:
            import distributed
        except ImportError:
            raise InputError("--dask", is_missing("distributed", "dask")) from None
        for command in expand_script(study.script, "script"):
            mesh = command.content.get("mesh", "") if isinstance(command, Change) else ""
            if mesh and mesh not in body_names():
                raise InputError("--dask", f"a script that sets mesh to {mesh!r}", "one that sets bundled bodies only")
        try:
            client: Any = distributed.Client  # distributed has no type hints
            self._client = client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError("--dask", address, f"the address of a scheduler, tcp://host:8786 ({error})") from None
        self._address = address
        # A task, which any worker can compute again; scattered data are lost with their worker.
        self._study = self._client.submit(
            _unchanged, replace(study, meshes=type(study.meshes)(study.contents)), pure=False
        )

    @property
    def count(self) -> int:
        """Number of chunks flown at a time: the number of threads of all workers."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, first: int, last: int) -> Flown:
        """Start flying rows first to last − 1."""
        return _ClusterChunk(
            self._client.submit(_fly_chunk, self._study, first, last, stamp(), pure=False), self._address
        )

    def close(self) -> None:
        """Disconnect; chunks that aren't done are cancelled."""
        self._client.close()


class _ClusterChunk:
    """A chunk that the cluster flies."""

    def __init__(self, future: Any, address: str) -> None:
        self._future, self._address = future, address

    def result(self) -> Chunk:
        try:
            chunk: Chunk = self._future.result()
        except (InputError, KeyboardInterrupt):
            raise
        except Exception as error:
            why = " ".join(f"{type(error).__name__}: {error}".split())[:300]
            raise InputError("--dask", self._address, f"workers that have rigid_proto_ros and stay ({why})") from None
        return chunk


def _unchanged(study: Study) -> Study:
    """The study, to be kept by the scheduler."""
    return study


def _fly_chunk(study: Study, first: int, last: int, kernels: str) -> Chunk:
    """Fly a chunk on a worker of the cluster. Raises InputError if its kernels differ, since its bits might."""
    if stamp() != kernels:
        raise InputError("--dask", f"a worker with kernels {stamp()}", f"workers with {kernels}, as here")
    return run_chunk(study, first, last)
