# SPDX-License-Identifier: MIT
"""Who flies the rows of a study: threads of this process around the compiled batch, which leaves the interpreter's lock
alone, or the workers of a Dask cluster. Rows are a function of the study and their numbers alone, so it doesn't matter
who flies them, or how often.

Dask's scheduler deals the chunks out and gives those of a lost worker to another one. Its workers need this package
with the same kernels; the meshes' content goes with the study.
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
"""[s] A scheduler that is there answers in this time."""


class Flown(Protocol):
    """A chunk under way."""

    def result(self) -> Chunk:
        """The chunk, once it is done; raises what flying it has raised."""


class Workers(Protocol):
    """Whoever flies chunks."""

    @property
    def count(self) -> int:
        """How many chunks are flown at a time."""

    def submit(self, first: int, last: int) -> Flown:
        """Begin the chunk of rows first to last − 1."""

    def close(self) -> None:
        """Give up what isn't done."""


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Threads:
    """One thread a core."""

    def __init__(self, study: Study) -> None:
        self.count = cores()
        self._study, self._pool = study, ThreadPoolExecutor(self.count)

    def submit(self, first: int, last: int) -> Flown:
        """Begin the chunk of rows first to last − 1."""
        return self._pool.submit(run_chunk, self._study, first, last)

    def close(self) -> None:
        """Give up what isn't done."""
        self._pool.shutdown(wait=True, cancel_futures=True)


class Cluster:
    """The workers of the Dask scheduler at an address, such as tcp://host:8786. Raises InputError where none answers,
    or for a study that reads a mesh file in flight.
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
            client: Any = distributed.Client  # it has no types
            self._client = client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError("--dask", address, f"the address of a scheduler, tcp://host:8786 ({error})") from None
        self._address = address
        # A task, which any worker can do again, and not scattered data, which are lost with the worker that has them.
        self._study = self._client.submit(_same, replace(study, meshes=type(study.meshes)(study.contents)), pure=False)

    @property
    def count(self) -> int:
        """How many chunks are flown at a time, as many as its workers have threads."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, first: int, last: int) -> Flown:
        """Begin the chunk of rows first to last − 1."""
        return _Awaited(self._client.submit(_chunk, self._study, first, last, stamp(), pure=False), self._address)

    def close(self) -> None:
        """Give up what isn't done."""
        self._client.close()


class _Awaited:
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


def _same(study: Study) -> Study:
    """What the scheduler keeps of the study."""
    return study


def _chunk(study: Study, first: int, last: int, kernels: str) -> Chunk:
    """What a worker of the cluster does; raises InputError where its bits would be others."""
    if stamp() != kernels:
        raise InputError("--dask", f"a worker with kernels {stamp()}", f"workers with {kernels}, as here")
    return run_chunk(study, first, last)
