# SPDX-License-Identifier: MIT
"""The ratios that a work-precision table is read for, as lines of text."""

from __future__ import annotations

import math
from collections import defaultdict

KERNEL, WHOLE = "ours (kernel)", "ours"


def ratios(rows: list[dict]) -> list[str]:
    """Lines of text: time of a step, P1, P2 at matched error, P4 and the strings; what wasn't run is left out."""
    rows = [r for r in rows if r["status"] == "ok" or r["status"] == "blew up"]
    return [*_step(rows), *_p1(rows), *_p2(rows), *_matched(rows), *_p4(rows), *_string_targets(rows), *_strings(rows)]


def curves(rows: list[dict], problem: str) -> dict[tuple[str, str], list[dict]]:
    """Rows of one problem by (tool, integrator), slowest last."""
    found = defaultdict(list)
    for row in rows:
        if row["problem"] == problem:
            found[row["tool"], row["integrator"]].append(row)
    return {key: sorted(curve, key=lambda r: r["median_s"]) for key, curve in found.items()}


def time_at_error(curve: list[dict], target: float) -> float:
    """Seconds at which a curve reaches this attitude error [rad], interpolated in log-log; NaN if it never does."""
    points = [
        (r["median_s"], r["attitude_error_rad"])
        for r in curve
        if math.isfinite(r["attitude_error_rad"]) and r["attitude_error_rad"] > 0.0
    ]
    before = None
    for time, error in points:
        if error <= target:
            if before is None:
                return time
            t0, e0 = before
            share = math.log(e0 / target) / math.log(e0 / error)
            return t0 * (time / t0) ** share
        before = (time, error)
    return math.nan


def _step(rows) -> list[str]:
    found = curves(rows, "P1")
    try:
        ours, mujoco = found[KERNEL, "rk4"][-1], found["mujoco", "RK4"][-1]
    except KeyError:
        return []
    a, b = (1e9 * r["median_s"] / r["steps"] for r in (ours, mujoco))
    return [f"rk4 step, torque-free: {a:.0f} ns; MuJoCo RK4 mj_step {b:.0f} ns: 1/{b / a:.0f} (target 1/30)"]


def _p1(rows) -> list[str]:
    found = curves(rows, "P1")
    if ("mujoco", "RK4") not in found:
        return []
    best = min(found["mujoco", "RK4"], key=lambda r: r["attitude_error_rad"])
    lines = []
    for key, curve in found.items():
        if key[0] in (KERNEL, WHOLE) and key[1] in ("free_body", "auto"):
            better = [r for r in curve if r["attitude_error_rad"] <= best["attitude_error_rad"]]
            if better:
                mine = min(better, key=lambda r: r["median_s"])
                lines.append(
                    f"P1: {key[0]} {key[1]} {mine['median_s'] * 1e6:.2f} us at {mine['attitude_error_rad']:.1e} rad; MuJoCo RK4 "
                    f"{best['median_s'] * 1e3:.1f} ms at {best['attitude_error_rad']:.1e} rad: "
                    f"{best['median_s'] / mine['median_s']:.0f} times (target 10000)"
                )
    return lines


def _p2(rows, target: float = 1e-10) -> list[str]:
    found = curves(rows, "P2")
    if ("mujoco", "RK4") not in found:
        return []
    theirs = time_at_error(found["mujoco", "RK4"], target)
    mine = {key: time_at_error(curve, target) for key, curve in found.items() if key[0] in (KERNEL, WHOLE)}
    reached = sorted((t, key) for key, t in mine.items() if math.isfinite(t))
    return [
        f"P2 at {target:g} rad: {key[0]} {key[1]} {t * 1e6:.1f} us; MuJoCo RK4 {theirs * 1e3:.2f} ms: "
        f"{theirs / t:.0f} times (target 400)"
        for t, key in reached[:6]
    ]


def _matched(rows, problem: str = "P2", target: float = 4e-9) -> list[str]:
    """Every peer's best integrator against auto as a whole simulation, all at the same error."""
    found = curves(rows, problem)
    if (WHOLE, "auto") not in found:
        return []
    mine = time_at_error(found[WHOLE, "auto"], target)
    reached = [(time_at_error(curve, target), key) for key, curve in found.items() if key[0] not in (KERNEL, WHOLE)]
    best: dict[str, tuple[float, str]] = {}
    for theirs, (tool, name) in sorted((t, key) for t, key in reached if math.isfinite(t)):
        best.setdefault(tool, (theirs, name))
    return [
        f"{problem} at {target:g} rad: {tool} {name} {theirs * 1e6:.0f} us, ours {mine * 1e6:.1f} us: {theirs / mine:.1f} times"
        for tool, (theirs, name) in best.items()
    ]


def _p4(rows) -> list[str]:
    lines = []
    for problem in ("P4rod", "P4plate"):
        for (tool, integrator), curve in curves(rows, problem).items():
            at = [r for r in curve if r["knob"] == "step" and r["step_or_tolerance"] == 1e-3 and tool != WHOLE]
            lines += [
                f"{problem} |w|h = 1: {tool} {integrator}: attitude {r['attitude_error_rad']:.1e} rad, "
                f"energy {r['energy_drift']:.1e} (targets 1e-9, 1e-12)"
                for r in at
            ]
    return lines


def _strings(rows) -> list[str]:
    lines = []
    names = sorted({r["problem"] for r in rows if str(r["problem"]).startswith("P3")}, key=_string_order)
    for name in names:
        for (tool, integrator), curve in curves(rows, name).items():
            if tool != KERNEL:
                r = curve[-1]
                lines.append(
                    f"{name}: {tool} {integrator}: attitude at 1 s {r['attitude_error_rad']:.1e} rad, "
                    f"energy over 10 s {r['energy_drift']:.1e} of the largest kinetic"
                )
    return lines


def _string_targets(rows) -> list[str]:
    """What bounds the strings over all frequencies at steps of 1 ms: ours that take any of them."""
    lines = []
    for name in ("auto",):
        mine = [
            r for r in rows if r["tool"] == WHOLE and r["integrator"] == name and str(r["problem"]).startswith("P3")
        ]
        if name == "auto":
            mine = [r for r in mine if r["step_or_tolerance"] == 1e-9]
        drifts = [r["energy_drift"] for r in mine if str(r["problem"]).endswith("_z0")]
        angles = [r["attitude_error_rad"] for r in mine if str(r["problem"]).endswith("_z0.1")]
        if mine:
            lines.append(
                f"P3 {name}: worst energy drift, undamped, {_worst(drifts)} (target 1e-9); worst attitude at 1 s, "
                f"damping ratio .1, {_worst(angles)} rad (target 5e-3)"
            )
    return lines


def _worst(values: list[float]) -> str:
    known = [v for v in values if math.isfinite(v)]
    missing = len(values) - len(known)
    return (f"{max(known):.1e}" if known else "-") + (
        f" ({missing} of {len(values)} not measured or blown up)" if missing else ""
    )


def _string_order(name: str):
    kind, frequency, ratio = name.split("_")
    return kind, ratio, float(frequency[1:])
