# SPDX-License-Identifier: MIT
"""The table of a sweep as a Parquet file, made from parts, so that a run that was killed loses no finished part.

FILE.parts/ holds a manifest and one Arrow file for each finished chunk of rows, whole from the moment it has its name.
When all are there, or on Ctrl-C, they are joined to FILE in order of rows, one row group after another, and never held
at once.
"""

from __future__ import annotations

import datetime
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.provenance import cpu, versions
from .chunk import Chunk
from .study import Study

if TYPE_CHECKING:
    import pyarrow as pa

KEY = b"rigid_proto_ros"
"""Of the file's metadata: a JSON object."""
GROUP_ROWS = 65536
"""Rows of one row group, at least, where there are so many."""


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
    def _manifest(self) -> dict[str, Any]:
        return {"fingerprint": self.study.fingerprint, "rows": self.study.rows, "chunk_rows": self.chunk_rows}

    def _continue(self, manifest: dict[str, Any], resume: bool) -> None:
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
        return self.folder / f"{k:012d}.arrow"

    def finished(self) -> list[int]:
        """Chunks that are there, in order."""
        return sorted(int(path.stem) for path in self.folder.glob("*.arrow"))

    def missing(self) -> Iterator[int]:
        """Chunks that aren't, in order."""
        there = set(self.finished())
        return (k for k in range(self.chunks) if k not in there)

    def write(self, k: int, chunk: Chunk) -> None:
        """Keep a finished chunk."""
        pa, _ = arrow()
        table = as_arrow(chunk).replace_schema_metadata({KEY: json.dumps({"simulated": chunk.simulated}).encode()})
        beside = self._path(k).with_suffix(".tmp")
        with pa.OSFile(str(beside), "wb") as sink, pa.ipc.new_file(sink, table.schema) as writer:
            writer.write_table(table)
        os.replace(beside, self._path(k))

    def _read(self, k: int) -> pa.Table:
        pa, _ = arrow()
        with pa.OSFile(str(self._path(k)), "rb") as source:
            return pa.ipc.open_file(source).read_all()

    def join(self) -> dict[str, Any]:
        """Write FILE from the parts there are, and remove them once all were there; returns the file's metadata."""
        pa, pq = arrow()
        finished = self.finished()
        if not finished:
            return self._metadata(0, 0, 0)
        rows = sum(last - first for first, last in map(self.bounds, finished))
        beside = self.file.with_name(self.file.name + ".tmp")
        gathered: list[Any] = []
        simulated = failed = 0
        schema = self._read(finished[0]).schema.remove_metadata()
        text = [name for name, kind in zip(schema.names, schema.types, strict=True) if kind == pa.string()]
        with pq.ParquetWriter(beside, schema, use_dictionary=text) as writer:
            for k in finished:
                part = self._read(k)
                simulated += json.loads(part.schema.metadata[KEY])["simulated"]
                failed += len(part) - part["failure"].null_count
                gathered.append(part.replace_schema_metadata(None))
                if sum(map(len, gathered)) >= GROUP_ROWS or k == finished[-1]:
                    writer.write_table(pa.concat_tables(gathered))
                    gathered = []
            metadata = self._metadata(rows, simulated, failed)
            writer.add_key_value_metadata({KEY: json.dumps(metadata).encode()})
        os.replace(beside, self.file)
        if metadata["complete"]:
            shutil.rmtree(self.folder)
        return metadata

    def _metadata(self, rows: int, simulated: int, failed: int) -> dict[str, Any]:
        study = self.study
        return {
            "study": study.name,
            "fingerprint": study.fingerprint,
            "seed": study.seed,
            "sampler": study.sampler,
            "rows": study.rows,
            "rows_done": rows,
            "complete": rows == study.rows,
            "rows_failed": failed,
            "rows_by_simulation": simulated,
            "rows_by_compiled_batch": rows - simulated,
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "cpu": cpu(),
            **versions(),
        }


def metadata_of(file: Path) -> dict[str, Any]:
    """What a table says of itself; empty for a file that no sweep wrote."""
    _, pq = arrow()
    try:
        return dict(json.loads((pq.read_metadata(file).metadata or {}).get(KEY, b"{}")))
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
