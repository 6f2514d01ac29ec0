# SPDX-License-Identifier: MIT
"""Figures of the motion benchmark, drawn from its CSV files alone.

python benchmarks/plots.py [--results FOLDER] [--out FOLDER]
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

from problems import PROBLEMS
from result_table import read_rows

HERE = Path(__file__).parent
# Ids of an SVG follow from this, so that the same data gives the same file.
plt.rcParams.update(
    {"svg.hashsalt": "work_precision", "font.size": 9, "svg.fonttype": "none", "axes.grid": True, "grid.alpha": 0.3}
)
COLOURS = {
    "mujoco": "tab:red",
    "drake": "tab:orange",
    "pinocchio": "tab:purple",
    "bullet": "tab:brown",
    "scipy": "tab:green",
    "diffrax": "tab:olive",
}
OURS = (
    "euler",
    "semi_implicit_euler",
    "midpoint",
    "lie_midpoint",
    "free_body_strang",
    "rk4",
    "dop853",
    "taylor",
    "free_body",
)
MARKS = "osD^v<>Pp*hX8"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--out", type=Path, default=HERE.parent / "docs" / "figures")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = read_rows(options.results / "work_precision.csv")
    for problem in ("P1", "P2", "P2x100", "P4rod", "heavy", "damped", "pokes"):
        draw_curves(
            [r for r in rows if r["problem"] == problem], problem, options.out / f"work_precision_{problem}.svg"
        )
    draw_strings(rows, options.out / "work_precision_strings.svg")
    gallery = options.results / "work_precision_gallery.csv"
    if gallery.exists():
        draw_gallery(read_rows(gallery), options.out / "work_precision_gallery.svg")


def draw_curves(rows: list[dict], problem: str, path: Path) -> None:
    """Attitude error against run time, one curve a contestant; a failed run leaves a gap."""
    curves = defaultdict(list)
    kernels = any(r["tool"] == "ours (kernel)" for r in rows)
    for r in rows:
        whole = r["tool"] == "ours" and r["integrator"] != "auto" and kernels
        if r["status"] == "ok" and not whole:
            curves[r["tool"], r["integrator"]].append(r)
    figure, axes = plt.subplots(figsize=(7.5, 5.0))
    marks = defaultdict(int)
    for (tool, name), curve in sorted(curves.items()):
        ours = tool.startswith("ours")
        colour = COLOURS.get(tool, "black")
        if ours and name != "auto":
            # Ours in shades of one map, so that the eye tells them from the peers.
            colour = plt.cm.winter(OURS.index(name) / (len(OURS) - 1) if name in OURS else 0.5)
        curve.sort(key=lambda r: r["step_or_tolerance"], reverse=True)
        x, y = [r["median_s"] for r in curve], [max(r["attitude_error_rad"], 1e-17) for r in curve]
        mark = MARKS[marks[tool] % len(MARKS)]
        marks[tool] += 1
        axes.loglog(
            x,
            y,
            marker=mark,
            ms=4,
            lw=1.2 if ours else 0.9,
            ls="-" if ours else "--",
            color=colour,
            label=f"{tool} {name}",
        )
    axes.set(
        xlabel="run time, median [s]",
        ylabel="attitude error at the end [rad]",
        title=f"{problem}: {PROBLEMS[problem].title}",
    )
    axes.set_ylim(1e-17, 10.0)
    axes.legend(fontsize=6.5, ncol=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _save(figure, path)


def draw_strings(rows: list[dict], path: Path) -> None:
    """Energy drift over 10 s, undamped, against string frequency times step (1 ms): what stays bounded."""
    figure, panels = plt.subplots(1, 2, figsize=(9.5, 4.2), sharey=True)
    for axes, (kind, title) in zip(panels, (("P3b", "bilateral"), ("P3p", "pull-only")), strict=True):
        curves = defaultdict(dict)
        for r in rows:
            name = str(r["problem"])
            if name.startswith(kind) and name.endswith("_z0") and r["tool"] != "ours (kernel)" and r["knob"] == "step":
                curves[r["tool"], r["integrator"]][PROBLEMS[name].spring.frequency * 1e-3] = r["energy_drift"]
        for (tool, name), points in sorted(curves.items()):
            x = sorted(points)
            y = [points[k] if math.isfinite(points[k]) else math.nan for k in x]
            style = "-" if tool == "ours" else "--"
            axes.loglog(
                x, y, style, marker="o", ms=3, label=f"{tool} {name}", color=None if tool == "ours" else COLOURS[tool]
            )
        axes.axhline(1e-9, color="grey", lw=0.8)
        axes.set(xlabel="string frequency × step", title=f"{title}, undamped; a curve that ends blew up")
    panels[0].set_ylabel("largest energy drift / largest kinetic energy, 10 s")
    panels[1].legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _save(figure, path)


def draw_gallery(rows: list[dict], path: Path) -> None:
    """Left: energy of engines' free bodies. Right: where L points when a term or the tensor is wrong."""
    figure, panels = plt.subplots(1, 2, figsize=(11.0, 4.6))
    for axes, panel, column in (
        (panels[0], "engines", "energy_ratio"),
        (panels[1], "dropped term", "momentum_angle_rad"),
    ):
        curves = defaultdict(list)
        for r in rows:
            if r["panel"] == panel:
                curves[r["curve"]].append((r["time_s"], r[column]))
        for k, (name, points) in enumerate(curves.items()):
            times, values = zip(*points, strict=True)
            if panel == "dropped term":
                values = [math.degrees(v) for v in values]
            axes.plot(times, values, lw=1.3, ls=("-", "--", "-.", ":")[k % 4], label=name)
        axes.set_xlabel("time [s]")
        axes.legend(fontsize=7)
    panels[0].set(ylabel="energy / energy at the start", title="A T-handle that nothing touches: energy must stay 1")
    panels[1].set(ylabel="drift of L's direction [deg]", title="Its angular momentum must keep its direction")
    _save(figure, path)


def _save(figure, path: Path) -> None:
    figure.savefig(path, bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)
    print(path)


if __name__ == "__main__":
    main()
