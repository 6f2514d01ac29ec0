# SPDX-License-Identifier: MIT
"""Results as data: a CSV whose every row says when, from which commit, on what and with which versions."""

from __future__ import annotations

import csv
import datetime
import subprocess
from pathlib import Path

from rigid_proto_ros.base.provenance import cpu, versions

PROVENANCE = ("date", "commit", "cpu", "python", "kernels", "numpy")


class ResultTable:
    """Rows under given columns, the provenance appended to each; what a row doesn't have is written as nan."""

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path = path
        self._own = columns
        self.columns = (*columns, *PROVENANCE)
        self.rows: list[dict] = []
        self._provenance = provenance()

    def add(self, row: dict) -> None:
        unknown = set(row) - set(self.columns)
        if unknown:
            raise ValueError(f"columns {sorted(unknown)}: not of this table")
        self.rows.append({**dict.fromkeys(self.columns, float("nan")), **row, **self._provenance})

    def show(self) -> None:
        """Print the rows without what they depend on."""
        for row in self.rows:
            print(*(f"{row[name]:.4g}" if isinstance(row[name], float) else row[name] for name in self._own), sep="  ")

    def write(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("w", newline="") as file:
            writer = csv.DictWriter(file, self.columns, lineterminator="\n")
            writer.writeheader()
            writer.writerows({name: _text(value) for name, value in row.items()} for row in self.rows)


def read_rows(path: Path) -> list[dict]:
    """The rows of a written table, numbers as floats."""
    with path.open(newline="") as file:
        return [{name: _value(text) for name, text in row.items()} for row in csv.DictReader(file)]


def provenance() -> dict[str, str]:
    """What the numbers depend on."""
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": _commit(),
        "cpu": f"{cpu()}, {vector_unit()}",
        **{name: versions()[name] for name in ("python", "kernels", "numpy")},
    }


def vector_unit() -> str:
    """The widest vector instructions of this processor: times depend on them."""
    try:
        flags = Path("/proc/cpuinfo").read_text("utf-8").partition("\nflags")[2].partition("\n")[0].split()
    except OSError:
        flags = []
    return next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "no AVX2 known")


def _commit() -> str:
    here = Path(__file__).parent
    try:
        head = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=here, capture_output=True, text=True, check=True
        )
        changed = subprocess.run(
            ["git", "status", "--porcelain", "--untracked-files=no", "--", "../rigid_proto_ros"],
            cwd=here,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return head.stdout.strip() + ("+changes" if changed.stdout.strip() else "")


def _text(value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _value(text: str):
    try:
        return float(text)
    except ValueError:
        return text
