# SPDX-License-Identifier: MIT
"""A picture of a table: points, or a map where x and y make a full grid. matplotlib draws, and is loaded
only for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, is_missing
from ..base.files import output_file
from .table import read_columns

_KEYS = ("x", "y", "color", "to", "log")
_ENDINGS = (".svg", ".png", ".pdf")


@dataclass(frozen=True)
class Plot:
    """Columns for x, y and, if not empty, color; which of these axes are logarithmic; where the picture goes."""

    x: str
    y: str
    color: str
    log: tuple[str, ...]
    file: Path


def read_plot(text: str, table: Path) -> Plot:
    """``x=column,y=column[,color=column][,log=x+y+color][,to=FILE.svg]``; without ``to`` the picture
    stands beside the table.
    """
    given = {}
    for part in text.split(","):
        key, equals, value = part.partition("=")
        if key.strip() not in _KEYS or not equals or not value:
            raise InputError("--plot", part, "x=COLUMN,y=COLUMN and perhaps color=COLUMN, log=x+y+color, to=FILE.svg")
        given[key.strip()] = value.strip()
    for key in ("x", "y"):
        if key not in given:
            raise InputError("--plot", text, f"{key}=COLUMN")
    log = tuple(given["log"].split("+")) if "log" in given else ()
    if not set(log) <= {"x", "y", "color"}:
        raise InputError("--plot", given["log"], "log=x, y, color, or some of them joined by +")
    file = Path(given.get("to", table.with_suffix(".svg")))
    if file.suffix not in _ENDINGS:
        raise InputError("--plot", str(file), f"a picture that ends in {', '.join(_ENDINGS)}")
    _figure()
    return Plot(given["x"], given["y"], given.get("color", ""), log, file)


def check_plot(plot: Plot, columns: Mapping[str, np.ndarray]) -> None:
    """Whether the table that will be has these columns, with numbers for what is logarithmic; any rows of it do."""
    for axis, name in _axes(plot):
        if name not in columns:
            raise InputError("--plot", f"{axis}={name}", f"a column of the table: {', '.join(columns)}")
        if axis in plot.log and columns[name].dtype == object:
            raise InputError("--plot", f"log={axis}", f"a column of numbers; {name} is text")


def _axes(plot: Plot) -> list[tuple[str, str]]:
    return [(axis, name) for axis, name in (("x", plot.x), ("y", plot.y), ("color", plot.color)) if name]


def _figure() -> Any:
    try:
        from matplotlib import rcParams
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("--plot", is_missing("matplotlib", "sweep")) from None
    # The same table gives the same file.
    rcParams["svg.hashsalt"] = "rigid_proto_ros"
    return Figure(figsize=(7.2, 4.8), layout="constrained")


def plot_table(plot: Plot, table: Path) -> None:
    """Draw the table and write the picture."""
    from matplotlib.colors import LogNorm

    columns = read_columns(table, [name for _, name in _axes(plot)])
    check_plot(plot, columns)
    for axis, name in _axes(plot):
        if axis in plot.log and not (np.isfinite(columns[name]) & (columns[name] > 0)).any():
            raise InputError("--plot", f"log={axis}", f"a column with numbers above 0; {name} in {table} has none")
    x, y = columns[plot.x], columns[plot.y]
    color = columns[plot.color] if plot.color else None
    figure = _figure()
    axes = figure.add_subplot()
    norm = LogNorm() if "color" in plot.log and color is not None else None
    if color is None or color.dtype == object:
        _groups_of_points(axes, x, y, color)
    else:
        grid = _as_grid(x, y, color)
        if grid is not None:
            drawn = axes.pcolormesh(*grid, norm=norm, shading="nearest", rasterized=True)
        else:
            drawn = axes.scatter(*_drawable(x, y), c=color, s=6, norm=norm, rasterized=len(color) > 5000)
        figure.colorbar(drawn, label=plot.color)
    for axis in ("x", "y"):
        if axis in plot.log:
            getattr(axes, f"set_{axis}scale")("log")
    axes.set_xlabel(plot.x)
    axes.set_ylabel(plot.y)
    axes.set_title(table.stem)
    metadata = {"Date": None} if plot.file.suffix == ".svg" else None
    output_file("--plot", plot.file)
    try:
        figure.savefig(plot.file, dpi=150, metadata=metadata)
    except OSError as error:
        raise InputError("--plot", str(plot.file), f"a file that can be written ({error.strerror})") from None


def _groups_of_points(axes: Any, x: np.ndarray, y: np.ndarray, color: np.ndarray | None) -> None:
    """Points in one colour, or one for each text."""
    by_text = color is not None and x.dtype == object and np.array_equal(x, color)
    if x.dtype == object:
        x = _spread(axes, x)
    x, y = _drawable(x, y)
    if color is None:
        axes.scatter(x, y, s=6, rasterized=len(x) > 5000)
        return
    for name in sorted({str(c) for c in color}):
        own = np.array([str(c) == name for c in color])
        axes.scatter(x[own], y[own], s=6, label=name, rasterized=len(x) > 5000)
    if not by_text:
        axes.legend(fontsize="small")


def _spread(axes: Any, text: np.ndarray) -> np.ndarray:
    """Places (n,) for text: a column for each, its points beside one another in their order."""
    names = sorted({str(t) for t in text})
    number = np.array([names.index(str(t)) for t in text])
    places = number.astype(float)
    for k in range(len(names)):
        own = np.flatnonzero(number == k)
        places[own] += 0.6 * (np.arange(len(own)) + 0.5) / len(own) - 0.3
    axes.set_xticks(range(len(names)), names, rotation=25 if len(names) > 6 else 0)
    return places


def _drawable(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Text as matplotlib takes it for a category."""
    x, y = (v.astype(str) if v.dtype == object else v for v in (x, y))
    return x, y


def _as_grid(x: np.ndarray, y: np.ndarray, color: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Axes and colours (ny, nx) when every pair of x and y is there once; None otherwise."""
    if x.dtype == object or y.dtype == object:
        return None
    xs, ys = np.unique(x), np.unique(y)
    if len(xs) * len(ys) != len(color) or min(len(xs), len(ys)) < 2 or np.isnan(xs).any() or np.isnan(ys).any():
        return None
    values = np.full((len(ys), len(xs)), np.nan)
    values[np.searchsorted(ys, y), np.searchsorted(xs, x)] = color
    return xs, ys, values
