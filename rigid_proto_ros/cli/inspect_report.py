# SPDX-License-Identifier: MIT
"""What ``rigid_proto inspect`` prints for people."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..mass.inspection import Inspection
from ..mass.tensor import principal_axes, six_from_tensor

if TYPE_CHECKING:
    from ..robots.composite_inertia import Lump
    from ..robots.diagnosis import LinkDiagnosis
    from ..robots.fix import FixedLink

SHOWN_ZERO = 5e-7
"""Of a quantity's largest entry: what is smaller is beyond the six digits shown, and stands as 0. JSON has it."""


def shown_zero(values: Iterable[float], largest: float) -> list[float]:
    """The values, those that don't show beside ``largest`` as 0."""
    return [0.0 if abs(value) < SHOWN_ZERO * largest else float(value) for value in values]


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> None:
    """Print columns aligned to their widest cell."""
    lines = [list(row) for row in ([head] if head else []) + list(rows)]
    widths = [max(len(row[k]) for row in lines if k < len(row)) for k in range(max(map(len, lines)))]
    for row in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip())


def print_report(inspection: Inspection, report: dict) -> None:
    """The report on stdout: mesh, findings, mass properties, models."""
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
    rows: list[tuple[str, ...]] = [("size", _row(size), "m")]
    if report["volume"] is not None:
        rows.append(("volume", f"{report['volume']: .9g}", "m³"))
    if report["area"] is not None:
        rows.append(("area", f"{report['area']: .9g}", "m²"))
    density = "" if report["density"] is None else f" ({report['density']:.6g} kg/m³)"
    rows.append(("mass", f"{chosen.mass: .9g}", f"kg{density}"))
    diagonal = float(np.linalg.norm(size))
    rows.append(("centre of mass", _row(shown_zero(chosen.center_of_mass, diagonal)), "m"))
    rows += _tensor_rows(chosen.inertia)
    moments, axes = principal_axes(chosen.inertia)
    rows.append(("principal moments", _row(moments), "kg m²"))
    rows += [
        (f"principal axis {k + 1}", _row(shown_zero(axes[:, k], 1.0)), f"of {moment:.6g} kg m²")
        for k, moment in enumerate(moments)
    ]
    rows.append(("box of equal inertia", _row(report["equimomental_box"]), "m, sides"))
    rows.append(("ellipsoid of equal inertia", _row(report["equimomental_ellipsoid"]), "m, semi-axes"))
    table(rows)
    if any(report["principal_degenerate"]):
        pairs = [
            pair for pair, same in zip(("1 and 2", "2 and 3"), report["principal_degenerate"], strict=True) if same
        ]
        print(f"principal moments {' and '.join(pairs)} are equal: every axis in the span of theirs is principal")
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
            errors = shown_zero(difference.principal_moments, 1.0)
            cells.append(", ".join(f"{100.0 * error:+.3g}" for error in errors) + " %")
            cells.append(f"{math.degrees(shown_zero([difference.axes_turned], 1.0)[0]):.3g}")
            offset = difference.center_of_mass_offset
            cells.append(f"{shown_zero([offset], float(np.linalg.norm(inspection.upper - inspection.lower)))[0]:.3g}")
        rows.append(tuple(cells))
    head = ("  model", "mass [kg]", "error of the principal moments", "axes turned by [deg]", "COM offset [m]")
    table(rows, head)


def _row(values: Iterable[float]) -> str:
    return " ".join(f"{value:< 13.6g}" for value in values).rstrip()


def print_diagnoses(diagnoses: list[LinkDiagnosis]) -> None:
    """What ``--compare`` prints: a paragraph for each link, and a count."""
    for d in diagnoses:
        name = f" ({d.mesh})" if d.mesh else ""
        by = f" by its {d.judged_by} shapes" if d.inertia_error is not None else ""
        note = f"; {d.note}" if d.note else ""
        print(f"{d.link}{name}: {d.status}{by}{note}")
        if d.inertia_error is not None:
            off = "" if d.mass_error is None else f", mass {d.mass_error:.2g}"
            center = f"centre of mass {d.center_of_mass_error:.2g} of the size"
            print(f"  differs from the uniform solid: inertia {d.inertia_error:.2g} ({_ratio(d)}), {center}{off}")
        for cause in d.causes:
            print(f"  cause: {cause}")
        if d.status not in ("uniform", "not uniform"):
            _print_expected(d)
    if len(diagnoses) > 1:
        counts = Counter(d.status for d in diagnoses)
        print(f"{len(diagnoses)} links: {', '.join(f'{count} {status}' for status, count in counts.items())}")


def _ratio(d: LinkDiagnosis) -> str:
    return f"{d.ratio:.3g} times as large"


def _percent(error: float | None) -> str:
    return "-" if error is None else f"{100.0 * error:.3g} %"


def print_diagnosis_lines(diagnoses: list[LinkDiagnosis]) -> None:
    """What ``--compare --tolerance`` prints: one line a link."""
    for d in diagnoses:
        parts = []
        if d.inertia_error is not None:
            parts = [
                f"inertia {_percent(d.inertia_error)} ({_ratio(d)})",
                f"centre of mass {_percent(d.center_of_mass_error)}",
            ]
        if d.mass_error is not None:
            parts.append(f"mass {_percent(d.mass_error)}")
        reasons = "; ".join(d.causes or ((d.note,) if d.inertia_error is None else ()))
        text = ", ".join(parts) + ("; " if parts and reasons else "") + reasons
        print(f"{d.link}: {d.status}{f': {text}' if text else ''}")


def print_fixed_links(links: list[FixedLink], out: str) -> None:
    """What ``--fix`` prints: each link before and after, and those that were left, with the reason."""
    rows: list[tuple[str, ...]] = []
    for link in links:
        before, after = link.before, link.after
        errors = [
            f"{_percent(old)} -> {_percent(new)}" if link.written else _percent(old)
            for old, new in (
                (before.inertia_error, after.inertia_error),
                (before.center_of_mass_error, after.center_of_mass_error),
            )
        ]
        old, new = ("-" if math.isnan(d.mass) else f"{d.mass:.6g}" for d in (before, after))
        mass = f"{old} -> {new}" if link.written and old != new else old
        done = f"from its {before.judged_by} shapes" if link.written else f"left: {link.left}" if link.left else ""
        status = f"{before.status} -> {after.status}" if link.written else before.status
        rows.append((before.link, status, mass, *errors, done))
    table(rows, ("link", "", "mass [kg]", "error of the inertia", "of the centre of mass", ""))
    written, left = (sum(map(bool, column)) for column in zip(*((x.written, x.left) for x in links), strict=True))
    print(f"{out}: {written} of {len(links)} inertials rewritten, {left} left as they are")


def print_lump(whole: Lump, written: tuple[str, ...]) -> None:
    """What ``--lump`` prints."""
    properties = whole.properties
    moments, axes = principal_axes(properties.inertia)
    rows: list[tuple[str, ...]] = [("links", f" {len(whole.links)}", ""), ("mass", f"{properties.mass: .9g}", "kg")]
    rows.append(("centre of mass", _row(properties.center_of_mass), "m"))
    rows += _tensor_rows(properties.inertia)
    rows.append(("principal moments", _row(moments), "kg m²"))
    rows += [(f"principal axis {k + 1}", _row(shown_zero(axes[:, k], 1.0)), "") for k in range(3)]
    table(rows)
    if whole.massless:
        print(f"without an inertial, and so without mass: {', '.join(whole.massless)}")
    for kind, texts in (("not in the mesh", whole.absent), ("doubt", whole.doubts)):
        for text in texts:
            print(f"{kind}: {text}")
    for name in written:
        print(f"wrote {name}")


def _tensor_rows(inertia: np.ndarray) -> list[tuple[str, ...]]:
    labels = [("inertia", "kg m², about the centre of mass"), ("", ""), ("", "")]
    largest = float(np.abs(inertia).max())
    return [(label, _row(shown_zero(row, largest)), unit) for (label, unit), row in zip(labels, inertia, strict=True)]


def _print_expected(d: LinkDiagnosis) -> None:
    if d.expected is None:
        return
    center, six = d.expected.center_of_mass, six_from_tensor(d.expected.inertia)
    print(f"  expected: mass {d.expected.mass:.9g}  com {center[0]:.9g} {center[1]:.9g} {center[2]:.9g}")
    print(
        "  expected: ixx ixy ixz iyy iyz izz "
        + " ".join(f"{value:.9g}" for value in shown_zero(six, max(map(abs, six))))
    )
