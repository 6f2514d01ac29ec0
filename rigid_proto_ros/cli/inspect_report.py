# SPDX-License-Identifier: MIT
"""The text that ``rigid_proto inspect`` prints."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..base.vectors import Matrix3
from ..mass.engines import engine_text
from ..mass.export import mjcf_inertial, sdf_inertial, urdf_inertial
from ..mass.inspection import Inspection
from ..mass.properties import MassProperties
from ..mass.tensor import principal_axes
from ..picture.style import without_rounding


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> None:
    """Print columns aligned to their widest cell."""
    lines = [list(row) for row in ([head] if head else []) + list(rows)]
    widths = [max(len(row[k]) for row in lines if k < len(row)) for k in range(max(map(len, lines)))]
    for row in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip())


def print_report(inspection: Inspection, report: dict[str, Any]) -> None:
    """Print the report: mesh, findings, mass properties, models."""
    body, chosen = inspection.body, inspection.chosen
    count = report["components"]
    state = [
        f"{report['vertices']} vertices, {report['triangles']} triangles",
        "closed" if report["watertight"] else "open",
        *([] if report["winding_consistent"] else ["inconsistently wound"]),
        f"{count} component{'s' if count != 1 else ''}",
    ]
    print(f"{body.mesh.path}: {', '.join(state)}")
    for finding in inspection.findings:
        print(f"  {finding.severity}: {finding.message} [{finding.code}]")
    if not inspection.findings:
        print("  no problems found")
    size = inspection.upper - inspection.lower
    rows: list[tuple[str, ...]] = [("size", row_of(size), "m")]
    if report["volume"] is not None:
        rows.append(("volume", f"{report['volume']: .9g}", "m³"))
    if report["area"] is not None:
        rows.append(("area", f"{report['area']: .9g}", "m²"))
    density = "" if report["density"] is None else f" ({report['density']:.6g} kg/m³)"
    rows.append(("mass", f"{chosen.mass: .9g}", f"kg{density}"))
    diagonal = float(np.linalg.norm(size))
    rows.append(("centre of mass", row_of(chosen.center_of_mass, diagonal), "m"))
    rows += tensor_rows(chosen.inertia)
    moments, axes = principal_axes(chosen.inertia)
    rows.append(("principal moments", row_of(moments), "kg m²"))
    rows += [
        (f"principal axis {k + 1}", row_of(axes[:, k], 1.0), f"of {moment:.6g} kg m²")
        for k, moment in enumerate(moments)
    ]
    table(rows)
    print()
    if "parts" in report:
        head = ("part", "mass [kg]", "density [kg/m³]", "volume [m³]")
        cells = [tuple(f"{part[key]:.6g}" for key in ("mass", "density", "volume")) for part in report["parts"]]
        table([(part["name"], *row) for part, row in zip(report["parts"], cells, strict=True)], head)
        print()
    _print_models(inspection)
    if "verification" in report:
        errors = (
            f"{name.removesuffix('_error').replace('_', ' ').replace('center', 'centre')} {value:.1e}"
            for name, value in report["verification"].items()
        )
        print(f"errors against exact rational arithmetic: {', '.join(errors)}")


def _print_models(inspection: Inspection) -> None:
    rows: list[tuple[str, ...]] = []
    for name, properties in inspection.models.items():
        marked = f"{'* ' if name == inspection.model else '  '}{name}"
        cells = [marked, f"{properties.mass:.6g}"]
        if "solid" in inspection.models and name != "solid":
            difference = inspection.difference(name)
            errors = (without_rounding(error) for error in difference.principal_moments)
            offset = float(np.linalg.norm(difference.center_of_mass))
            cells.append(", ".join(f"{100.0 * error:+.3g}" for error in errors) + " %")
            cells.append(f"{without_rounding(math.degrees(difference.axes_turned), 1e3):.3g}")
            cells.append(f"{without_rounding(offset, float(np.linalg.norm(inspection.upper - inspection.lower))):.3g}")
        rows.append(tuple(cells))
    head = ("  model", "mass [kg]", "error of the principal moments", "axes turned by [deg]", "COM offset [m]")
    table(rows, head)


def row_of(values: Iterable[float], largest: float = 0.0) -> str:
    """Numbers with six digits in a row; rounding errors relative to ``largest`` are printed as 0."""
    return " ".join(f"{without_rounding(value, largest):< 13.6g}" for value in values).rstrip()


def tensor_rows(inertia: Matrix3) -> list[tuple[str, ...]]:
    """Rows of a table for a tensor (3, 3)."""
    labels = [("inertia", "kg m², about the centre of mass"), ("", ""), ("", "")]
    largest = float(np.abs(inertia).max())
    return [(label, row_of(row, largest), unit) for (label, unit), row in zip(labels, inertia, strict=True)]


def print_inertial(args: argparse.Namespace, properties: MassProperties) -> bool:
    """Print the <inertial>, or the text for an engine, that the options ask for. Returns False if they ask for none."""
    if args.engine is not None:
        print(engine_text(args.engine, properties), end="")
        return True
    exports = {"urdf": urdf_inertial, "sdf": sdf_inertial, "mjcf": mjcf_inertial}
    for name, export in exports.items():
        if getattr(args, name):
            print(export(properties), end="")
            return True
    return False
