# SPDX-License-Identifier: MIT
"""Figure of the node's benchmark, drawn from its CSV files alone.

python benchmarks/node_figure.py [--results FOLDER] [--out FOLDER]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

from result_table import read_rows

HERE = Path(__file__).parent
# Ids of an SVG follow from this, so that the same data gives the same file.
plt.rcParams.update({"svg.hashsalt": "node", "font.size": 9, "svg.fonttype": "none"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=HERE / "results")
    parser.add_argument("--out", type=Path, default=HERE.parent / "docs" / "figures")
    options = parser.parse_args()
    figure, (left, right) = plt.subplots(1, 2, figsize=(12.0, 4.6))
    draw_shares(left, read_rows(options.results / "node.csv"))
    draw_skips(right, read_rows(options.results / "node_skips.csv"))
    figure.tight_layout()
    options.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out / "node.svg", metadata={"Date": None})


def draw_shares(axes, rows: list[dict]) -> None:
    """Share of a core of the node and of what does the same job in the usual way."""
    shares = [r for r in rows if r["figure"] == "cpu" and not str(r["what"]).endswith("in one process")]
    names, values = [str(r["what"]) for r in shares], [r["value"] for r in shares]
    colours = ["tab:red" if "mujoco" in name else "tab:orange" if "plain" in name else "tab:blue" for name in names]
    bars = axes.barh(range(len(names)), values, color=colours)
    # A lower share at a lower rate is no merit, so the rate that was held is said.
    held = {str(r["what"]): f" at {r['value']:.0f}/s" for r in rows if r["figure"] == "rate"}
    axes.bar_label(bars, [f"{r['value']:.1f}{held.get(str(r['what']), '')}" for r in shares], padding=2)
    axes.margins(x=0.25)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    axes.set_xlabel("% of a core")
    axes.set_title(
        f"share of a core (load {max(r['load_1min'] for r in shares):.1f} of {shares[0]['cores']:.0f} cores)"
    )


def draw_skips(axes, rows: list[dict]) -> None:
    """How many times what is skipped would cost what is done instead."""
    names, ratios = [], []
    for r in rows:
        if r["as_it_is"] > 0.0:
            names.append(str(r["skipped"]))
            ratios.append(r["done"] / r["as_it_is"])
    axes.barh(range(len(names)), ratios, color="tab:green", log=True)
    axes.set_yticks(range(len(names)), names, fontsize=7)
    axes.invert_yaxis()
    axes.axvline(1.0, color="grey", lw=0.8)
    axes.set_xlabel("cost if it were done, in times of what is")
    axes.set_title("skipped work")


if __name__ == "__main__":
    main()
