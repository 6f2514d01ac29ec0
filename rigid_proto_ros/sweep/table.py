# SPDX-License-Identifier: MIT
"""The table of a sweep as a Parquet file, made from parts, so that a run that was killed loses no finished part.

FILE.parts/ holds a manifest and one Parquet file for each finished chunk of rows, whole from the moment it has its name. When
all are there, or on Ctrl-C, they are joined to FILE in order of rows, one row group after another, and never held at once.
"""

from __future__ import annotations

import datetime
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.errors import InputError
from ..provenance import cpu, versions
from .chunk import Chunk
from .study import Study

if TYPE_CHECKING:
    import pyarrow as pa

KEY = b"rigid_proto_ros"
"""Of the file's metadata: a JSON object."""
GROUP_ROWS = 65536
"""Rows of one row group, at least, where there are so many."""


def arrow():
    """pyarrow and its Parquet part; raises InputError where they aren't installed."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("sweep", "no pyarrow", "pyarrow installed: pip install 'rigid_proto_ros[sweep]'") from None
    return pyarrow, pyarrow.parquet


def as_arrow(chunk: Chunk) -> pa.Table:
    """A chunk as a table: NaN and None are null."""
    pa, _ = arrow()
    arrays = {}
    for name, column in chunk.columns.items():
        kind = pa.string() if column.dtype == object else pa.from_numpy_dtype(column.dtype)
        arrays[name] = pa.array(column, type=kind, from_pandas=True)
    return pa.table(arrays)


class Parts:
    """The finished chunks of one table. chunk_rows: rows a chunk."""

    def __init__(self, file: Path, study: Study, chunk_rows: int, resume: bool) -> None:
        self.file = file
        self.folder = file.with_name(file.name + ".parts")
        self.study = study
        self.chunk_rows = chunk_rows
        manifest = self.folder / "manifest.json"
        if manifest.is_file():
            self._continue(json.loads(manifest.read_text("utf-8")), resume)
            return
        if file.is_dir():
            raise InputError("-o", str(file), "a file's name, not a folder's")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._place(manifest, json.dumps(self._manifest).encode())
        except OSError as error:
            raise InputError("-o", str(file), f"a place that can be written to ({error.strerror})") from None

    @property
    def _manifest(self) -> dict:
        return {"fingerprint": self.study.fingerprint, "rows": self.study.rows, "chunk_rows": self.chunk_rows}

    def _continue(self, manifest: dict, resume: bool) -> None:
        if not resume:
            accepted = f"--resume to go on with it, or the folder {self.folder} deleted"
            raise InputError("-o", f"{self.folder}: an unfinished run", accepted)
        if manifest["fingerprint"] != self.study.fingerprint:
            raise InputError(
                "--resume", f"{self.folder}: rows of another study", "the study as it was when the run began"
            )
        self.chunk_rows = manifest["chunk_rows"]
        for left in self.folder.glob("*.tmp"):
            left.unlink()

    def _place(self, path: Path, content: bytes) -> None:
        beside = path.with_suffix(".tmp")
        beside.write_bytes(content)
        os.replace(beside, path)

    @property
    def chunks(self) -> int:
        """How many there are in all."""
        return -(-self.study.rows // self.chunk_rows)

    def bounds(self, k: int) -> tuple[int, int]:
        """First row of chunk k, and the one after its last."""
        return k * self.chunk_rows, min((k + 1) * self.chunk_rows, self.study.rows)

    def _path(self, k: int) -> Path:
        return self.folder / f"{k:012d}.parquet"

    def finished(self) -> list[int]:
        """Chunks that are there, in order."""
        return sorted(int(path.stem) for path in self.folder.glob("*.parquet"))

    def missing(self) -> Iterator[int]:
        """Chunks that aren't, in order."""
        there = set(self.finished())
        return (k for k in range(self.chunks) if k not in there)

    def write(self, k: int, chunk: Chunk) -> None:
        """Keep a finished chunk."""
        _, pq = arrow()
        table = as_arrow(chunk).replace_schema_metadata({KEY: json.dumps({"simulated": chunk.simulated}).encode()})
        beside = self._path(k).with_suffix(".tmp")
        pq.write_table(table, beside)
        os.replace(beside, self._path(k))

    def join(self) -> dict:
        """Write FILE from the parts there are, and remove them once all were there; returns the file's metadata."""
        pa, pq = arrow()
        finished = self.finished()
        described = [pq.ParquetFile(self._path(k)) for k in finished[:1]]
        if not described:
            return self._metadata(0, 0)
        rows = sum(last - first for first, last in map(self.bounds, finished))
        simulated = 0
        for k in finished:
            simulated += json.loads(pq.read_schema(self._path(k)).metadata[KEY])["simulated"]
        metadata = self._metadata(rows, simulated)
        schema = described[0].schema_arrow.with_metadata({KEY: json.dumps(metadata).encode()})
        beside = self.file.with_name(self.file.name + ".tmp")
        with pq.ParquetWriter(beside, schema) as writer:
            gathered, held = [], 0
            for k in finished:
                gathered.append(pq.read_table(self._path(k)).replace_schema_metadata(schema.metadata))
                held += gathered[-1].num_rows
                if held >= GROUP_ROWS or k == finished[-1]:
                    writer.write_table(pa.concat_tables(gathered))
                    gathered, held = [], 0
        os.replace(beside, self.file)
        if metadata["complete"]:
            shutil.rmtree(self.folder)
        return metadata

    def _metadata(self, rows: int, simulated: int) -> dict:
        study = self.study
        return {
            "study": study.name,
            "fingerprint": study.fingerprint,
            "seed": study.seed,
            "sampler": study.sampler,
            "rows": study.rows,
            "rows_done": rows,
            "complete": rows == study.rows,
            "rows_by_simulation": simulated,
            "rows_by_compiled_batch": rows - simulated,
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "cpu": cpu(),
            **versions(),
        }


def metadata_of(file: Path) -> dict:
    """What a table says of itself; empty for a file that no sweep wrote."""
    _, pq = arrow()
    try:
        return json.loads((pq.read_schema(file).metadata or {}).get(KEY, b"{}"))
    except (OSError, ValueError):
        return {}


def read_columns(file: Path, names: list[str]) -> dict[str, np.ndarray]:
    """Columns of a table by name: numbers as float64 with NaN for null, text as objects."""
    _, pq = arrow()
    try:
        known = pq.read_schema(file).names
    except (OSError, ValueError) as error:
        raise InputError("table", str(file), f"a table that a sweep wrote ({error})") from None
    for name in names:
        if name not in known:
            raise InputError("--plot", name, f"a column of the table: {', '.join(known)}")
    table = pq.read_table(file, columns=list(dict.fromkeys(names)))
    return {name: table[name].to_numpy() for name in table.column_names}
