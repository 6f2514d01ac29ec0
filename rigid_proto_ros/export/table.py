# SPDX-License-Identifier: MIT
"""States as a table, .csv or .parquet, with the column names of a sweep and all digits of every number."""

from __future__ import annotations

import json

from ..base.files import whole_file
from ..base.provenance import cpu, versions
from ..base.vectors import FloatArray
from ..simulation.quantities import QUANTITIES
from .flight_record import FlightRecord

STATE_COLUMNS = dict(list(QUANTITIES.items())[:13])
"""Units by name: COM position and velocity in world axes, attitude xyzw from body to world, spin in body axes."""
UNITS = {"time": "s", **STATE_COLUMNS}

KEY = b"rigid_proto_ros"
"""Key of our metadata in a Parquet file, a JSON object."""


def state_columns(record: FlightRecord) -> dict[str, FloatArray]:
    """The columns (n,) by name."""
    columns = {"time": record.times_ns / 1e9}
    columns.update({name: record.rows[:, k] for k, name in enumerate(STATE_COLUMNS)})
    return columns


def write_csv(file: str, columns: dict[str, FloatArray]) -> None:
    """Write a .csv: a line of names, then a line per state; the numbers' text converts back to the same bits."""
    with whole_file("--csv", file) as path, open(path, "w", encoding="utf-8") as stream:
        stream.write(",".join(columns) + "\n")
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            stream.write(",".join(map(repr, row)) + "\n")


def write_parquet(file: str, columns: dict[str, FloatArray]) -> None:
    """Write a .parquet; its metadata hold the units, the processor and the versions."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    metadata = {"units": UNITS, "cpu": cpu(), **versions()}
    table = pa.table(columns).replace_schema_metadata({KEY: json.dumps(metadata).encode()})
    with whole_file("--parquet", file) as path:
        pq.write_table(table, path)
