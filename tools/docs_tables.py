# SPDX-License-Identifier: MIT
"""Tables of the docs, written from the declarations in the code.

    python tools/docs_tables.py [--check]

A document has a table between ``<!-- table: NAME -->`` and ``<!-- end -->``, or question and steps of a lesson between
``<!-- lesson: SCENE -->`` and the same end mark. The text between the marks is replaced. With ``--check`` nothing is
written, and the exit status is 1 if a document is out of date.
"""

from __future__ import annotations

import argparse
import csv
import math
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from node_interface import INTERFACES, PUBLISHED, SERVED, SUBSCRIBED
from rigid_proto_ros import __version__
from rigid_proto_ros.base.bundled import body_names
from rigid_proto_ros.mass.from_mesh import mesh_body
from rigid_proto_ros.mass.inspection import inspect_mesh
from rigid_proto_ros.mass.tensor import principal_axes
from rigid_proto_ros.mesh.reading import load_mesh
from rigid_proto_ros.motion.integrators import INTEGRATORS
from rigid_proto_ros.motion.loads import NEEDS
from rigid_proto_ros.parameters.declarations import LIVE, PARAMETERS, PATTERNS, READ_ONLY, Parameter
from rigid_proto_ros.scene.lessons import lesson, lessons

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
sys.path.append(str(ROOT / "benchmarks"))

from result_table import read_rows
from static_site import address
from work_precision_ratios import time_at_error

_MARKED = re.compile(r"(<!-- (?P<kind>table|lesson): (?P<name>[a-z_]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def topics() -> str:
    """The node's topics."""
    words = {SUBSCRIBED: "sub", PUBLISHED: "pub"}
    rows = [
        (words[i.direction], _code(i.name), _code(i.type.replace("/msg/", "/")), _with_switch(i))
        for i in INTERFACES
        if i.direction in words
    ]
    return _table(("", "topic", "type", "meaning"), rows)


def services() -> str:
    """The node's services."""
    rows = [
        (_code(i.name), _code(i.type.replace("/srv/", "/")), _with_switch(i))
        for i in INTERFACES
        if i.direction == SERVED
    ]
    return _table(("service", "type", "meaning"), rows)


def parameters() -> str:
    """The node's parameters, which a scene file sets too."""
    rows = [_parameter_row(p) for p in (*PARAMETERS.values(), *PATTERNS.values())]
    return _table(("parameter", "default", "unit", "meaning"), rows)


def integrators() -> str:
    """What each integrator is and doesn't support."""
    rows = []
    for integrator in INTEGRATORS.values():
        lacks = [need for need in NEEDS if need not in integrator.supports]
        order = "exact" if integrator.order is None else str(integrator.order)
        evaluations = str(integrator.evaluations)
        if integrator.kernel is None:  # it picks others
            order = evaluations = "-"
        cells = (_code(integrator.name), order, evaluations, "; ".join(lacks))
        rows.append((*cells, " ".join(integrator.limits.split()).rstrip(".").replace("``", "`")))
    return _table(("name", "order", "evaluations per step", "doesn't support", "uses and limits"), rows)


def _measured_masses() -> dict[tuple[str, str, str], dict[str, str]]:
    """Rows of the last benchmark by tool, mesh and place."""
    with (RESULTS / "mass_properties.csv").open(encoding="utf-8", newline="") as file:
        measured = [row for row in csv.DictReader(file) if row["what"] == "mass properties"]
    return {
        (row["tool"], row["mesh"].split(",")[0], row["place"]): row for row in measured if "shuffled" not in row["mesh"]
    }


def masses() -> str:
    """Mass properties here and elsewhere, from the last benchmark's own numbers."""
    found = _measured_masses()
    rows = []
    for tool in dict.fromkeys(tool for tool, _, _ in found):
        place = found[tool, "ellipsoid 100k", "base"]
        errors = [found[tool, mesh, at]["inertia_error"] for mesh, at in _INERTIA_ERRORS]
        time = f"{float(place['ns_per_triangle']):,.0f}"
        rows.append((tool, place["version"], time, *(_error(error) for error in errors)))
    sentence = f"{_measured_on(place)}, in one process, medians."
    head = (
        "tool",
        "version",
        "ns per triangle",
        "error in place",
        "moved by 10³",
        "moved by 10⁶",
        "plate 1 × 1 × 10⁻⁵",
    )
    return f"{sentence}\n\n{_table(head, rows)}"


_INERTIA_ERRORS = (
    ("ellipsoid 100k", "base"),
    ("ellipsoid 100k", "+1e3"),
    ("ellipsoid 100k", "+1e6"),
    ("plate 1 x 1 x 1e-5", "base"),
)
"""Mesh and place of the errors shown; times are those of the first."""


def readers() -> str:
    """Our own readers of mesh files and trimesh's, from the last benchmark's own numbers."""
    with (RESULTS / "mesh_readers.csv").open(encoding="utf-8", newline="") as file:
        measured = list(csv.DictReader(file))
    found = {(row["what"], row["format"], row["file"], row["tool"]): row for row in measured}
    rows = []
    for what, ending, name in dict.fromkeys(key[:3] for key in found):
        own, other = (found[what, ending, name, tool] for tool in ("rigid_proto", "trimesh"))
        if what == "time":
            ratio = float(other["best_ms"]) / float(own["best_ms"])
            cells = (f"{float(own['best_ms']):.0f} ms", f"{float(other['best_ms']):.0f} ms, {ratio:.1f} times")
        elif own["result"].split()[0] == other["result"].split()[0]:
            continue
        else:
            cells = (own["result"], other["result"])
        rows.append((f"`{ending}`", name, *cells))
    row = measured[0]
    versions = {row["tool"]: row["version"] for row in measured}
    sentence = f"{_measured_on(row)}, in one process"
    if row["what"] == "time":
        sentence += f", shortest of seven; {int(float(row['triangles'])):,} triangles where a time stands"
    head = ("format", "file", "rigid_proto", f"trimesh {versions['trimesh']}")
    return f"{sentence}.\n\n{_table(head, rows)}"


def _error(text: str) -> str:
    value = float(text)
    return "refuses" if math.isnan(value) else f"{value:.0e}"


def _measured_motions() -> list[dict[str, str]]:
    with (RESULTS / "work_precision.csv").open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["problem"] in _MOTIONS]


def figures() -> str:
    """The README's: the inertia of a mesh far from the origin, and the time that each tool takes to our error of a motion, by
    its best integrator; where it doesn't reach that, its most accurate run.
    """
    masses, measured = _measured_masses(), _measured_motions()
    default = {
        row["problem"]: row
        for row in measured
        if (row["tool"], row["integrator"], row["step_or_tolerance"]) == ("ours", "auto", "1e-09")
    }
    rows = []
    for tool in dict.fromkeys(row["tool"] for row in measured if row["tool"] in ("ours", *_TOOLS)):
        name = "rigid_proto" if tool == "ours" else _TOOLS[tool].partition(",")[0]
        inertia = masses.get((_WEIGHS.get(name, name), "ellipsoid 100k", "+1e6"))
        cells = [_error(inertia["inertia_error"]) if inertia else ""]
        for problem in _MOTIONS:
            runs = [row for row in measured if (row["tool"], row["problem"]) == (tool, problem)]
            own = _milliseconds(float(default[problem]["median_s"]))
            cells.append(own if tool == "ours" else _at_error(runs, _attitude_error(default[problem])))
        rows.append((name, *cells))
    for tool in ("trimesh", "igl.moments"):
        rows.append((tool, _error(masses[tool, "ellipsoid 100k", "+1e6"]["inertia_error"]), "", "", ""))
    heads = (f"{title}, to {_attitude_error(default[problem]):.0e} rad" for problem, title in _MOTIONS.items())
    return _table(("tool", "inertia error of a mesh 10⁶ m from the origin", *heads), rows)


_WEIGHS = {"MuJoCo": "MuJoCo compile, exact"}
"""What a tool that moves bodies is called where it weighs them."""


def _at_error(runs: list[dict[str, str]], target: float) -> str:
    if not runs:
        return "not run"
    curves: dict[str, list[dict[str, float]]] = {}
    for row in runs:
        numbers = {"median_s": float(row["median_s"] or "nan"), "attitude_error_rad": _attitude_error(row)}
        curves.setdefault(row["integrator"], []).append(numbers)
    times = [time_at_error(sorted(curve, key=lambda run: run["median_s"]), target) for curve in curves.values()]
    reached = [time for time in times if math.isfinite(time)]
    return _milliseconds(min(reached)) if reached else _best_run(min(runs, key=_attitude_error))


def motions() -> str:
    """Motion here and elsewhere: each tool's most accurate run of a problem, from the last benchmark's own numbers."""
    measured = _measured_motions()
    ours = [row for row in measured if row["tool"] == "ours" and row["integrator"] == "auto"]
    best = {("rigid_proto, auto", row["problem"]): row for row in ours if row["step_or_tolerance"] == "1e-09"}
    versions = {"rigid_proto, auto": __version__}
    for row in measured:
        if row["tool"].startswith("ours"):
            continue
        versions[row["tool"]] = row["version"]
        known = best.get((row["tool"], row["problem"]))
        if known is None or _attitude_error(row) < _attitude_error(known):
            best[row["tool"], row["problem"]] = row
    rows = [
        (_TOOLS.get(tool, tool), versions[tool], *(_best_run(best.get((tool, problem))) for problem in _MOTIONS))
        for tool in versions
    ]
    newest = max(measured, key=lambda row: row["date"])
    sentence = f"{_measured_on(newest)}, in one process, medians of whole runs."
    return f"{sentence}\n\n{_table(('tool', 'version', *_MOTIONS.values()), rows)}"


_MOTIONS = {
    "P1": "100 s of repeated flips",
    "P2": "10 s under a thruster and gravity",
    "P4rod": "10 s of a rod at 1000 rad/s",
}
"""Problems of benchmarks/problems.py that are shown."""

_TOOLS = {
    "mujoco": "MuJoCo",
    "drake": "Drake",
    "pinocchio": "Pinocchio, RKMK4",
    "bullet": "Bullet",
    "scipy": "SciPy, DOP853",
    "heyoka": "heyoka.py, Taylor series compiled for each system",
    "diffrax": "diffrax",
}


def _best_run(row: dict[str, str] | None) -> str:
    if row is None:
        return "not run"
    error = _attitude_error(row)
    if error > 0.1:
        return "error > 0.1 rad"
    return f"{error:.0e} rad in {_milliseconds(float(row['median_s']))}"


def _milliseconds(seconds: float) -> str:
    milliseconds = 1e3 * seconds
    return f"{milliseconds:.0f} ms" if milliseconds >= 10.0 else f"{milliseconds:.2g} ms"


def _attitude_error(row: dict[str, str]) -> float:
    error = float(row["attitude_error_rad"] or "nan")
    return math.inf if math.isnan(error) else error


def node_load() -> str:
    """Share of a core of the node and of plain rclpy nodes, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "node.csv")
    found = {(row["what"], row["figure"]): row["value"] for row in measured}
    rows = []
    for what, figure in found:
        if figure == "cpu":
            rate = found.get((what, "rate"))
            rows.append((what, f"{found[what, figure]:.1f} %", "" if rate is None else f"{rate:.0f}"))
    latency = "wrench to first twist showing it, 1 kHz"
    median, late = (f"{found[latency, figure]:.1f} ms" for figure in ("p50", "p99"))
    sentence = f"{_measured_on(measured[0])}. From a wrench to the first twist that shows it: {median}, at 99 % {late}."
    flood = "10 000 wrenches per second"
    sent, received, lost = (found[flood, figure] for figure in ("sent", "received", "lost"))
    sentence += (
        f" Of {sent:,.0f} wrenches, 10,000 per second, {received:,.0f} were taken, and {lost:,.0f} were counted as"
    )
    sentence += (
        f" lost; {sent - received - lost:,.0f} found the node's own queue full, which is reported (`queue_full`)"
    )
    sentence += " but not counted."
    return f"{sentence}\n\n{_table(('node', 'share of a core', 'publications per second'), rows)}"


def start_up() -> str:
    """Time and memory of whole processes, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "start_up.csv")
    rows = [
        (row["what"], f"{row['seconds']:.2f} s", f"{row['ratio']:.2f} × {row['beside']}", f"{row['memory_mb']:.0f} MB")
        for row in measured
    ]
    return f"{_measured_on(measured[0])}.\n\n{_table(('process', 'time', 'beside', 'memory'), rows)}"


def skipped_work() -> str:
    """Work that is left out, and what it would cost, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "node_skips.csv")
    rows = [(row["skipped"], *(f"{row[cost]:.3g} {row['unit']}" for cost in ("done", "as_it_is"))) for row in measured]
    return f"{_measured_on(measured[0])}.\n\n{_table(('work', 'if done', 'as it is'), rows)}"


_BESIDE_HEYOKA = {
    "the compiled steps alone": ("kernel", "heyoka", ""),
    "`Simulation`, with its Python code": ("simulation", "heyoka", ""),
    "`Simulation`: reset, commands and simulation": ("simulation", "heyoka", "whole_"),
    "`Flight`: reset, commands and simulation": ("flight", "heyoka", "whole_"),
    "a row of a sweep, beside one flight": ("sweep", "heyoka", "whole_"),
    "a row of a sweep, beside a flight in batches of 8": ("sweep", "heyoka batch", "whole_"),
}
"""What is compared: ours, heyoka's, and whether setting back and submitting count."""
_FLOWN_BY_HEYOKA = {
    "P2": "P2",
    "P2x100": "P2, 100 times the spin",
    "damped": "damped",
    "heavy": "heavy crate on a rope",
    "pokes": "pokes",
}


def heyoka() -> str:
    """Run time of heyoka.py over ours at equal error, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "heyoka.csv")
    found = {(row["problem"], row["what"], row["error_rad"]): row for row in measured}
    targets = sorted({row["error_rad"] for row in measured}, reverse=True)
    rows = []
    for what, (own, other, whole) in _BESIDE_HEYOKA.items():
        cells = []
        for problem in _FLOWN_BY_HEYOKA:
            both = [(found.get((problem, own, at)), found.get((problem, other, at))) for at in targets]
            ratios = [b[f"{whole}us"] / a[f"{whole}us"] if a and b else math.nan for a, b in both]
            cells.append(" / ".join(f"{r:.2f}" if math.isfinite(r) else "" for r in ratios) if any(both[0]) else "")
        rows.append((what, *(cell if cell.strip(" /") else "" for cell in cells)))
    head = (" / ".join(f"1e{math.log10(at):.0f}" for at in targets) + " rad", *_FLOWN_BY_HEYOKA.values())
    return f"{_measured_on(measured[0])}, commit {measured[0]['commit']}.\n\n{_table(head, rows)}"


def recording() -> str:
    """What recording a state costs, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "recording.csv")
    rows = []
    for row in measured:
        states, cost = row["states"], row["us_per_state"]
        size, memory = 1e6 * row["file_mb"] / states, row["memory_mb_at_the_end"] - row["memory_mb_at_a_third"]
        rows.append((row["recorder"], f"{_three(cost)} µs", f"{1e6 / cost:,.0f}", f"{size:.0f}", f"{memory:+.0f} MB"))
    head = ("recorder", "processor time a state", "states a second", "bytes a state", "memory, from a third to the end")
    return f"{_measured_on(measured[0])}: {measured[0]['states']:,.0f} states at 1 kHz.\n\n{_table(head, rows)}"


def _three(number: float) -> str:
    """Three digits, without an exponent."""
    return f"{number:,.0f}" if number >= 100.0 else f"{number:.3g}"


def sweeps() -> str:
    """Rows of sweeps, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "sweep.csv")
    rows = []
    for row in measured:
        error = f"{row['median_error_rad']:.1e}" if math.isfinite(row["median_error_rad"]) else ""
        memory = f"{row['memory_mb']:.0f} MB" if math.isfinite(row["memory_mb"]) else ""
        note = row["note"] if row["what"].startswith("mujoco") else ""
        what = ", ".join(filter(None, (row["what"], note)))
        rows.append((what, f"{row['rows']:,.0f}", f"{_three(row['us_per_row'])} µs", error, memory))
    head = ("what", "rows", "time a row, all cores", "median error [rad]", "peak memory")
    return f"{_measured_on(measured[0])}, {measured[0]['threads']:.0f} cores.\n\n{_table(head, rows)}"


def identification() -> str:
    """One throw, its body found by ours and by the peers, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "identification.csv")
    first = measured[0]
    begins = {
        "truth": "the truth, which is unknown in practice",
        "near": "errors of about 10 %",
        "ball": "a ball of 1 kg",
    }
    rows = []
    for row in measured:
        if (row["body"], row["throw"]) == (first["body"], first["throw"]):
            error = f"{row['error']:.3g}"
            if not math.isfinite(row["error"]):
                error = "its rollout is unstable"
            elif row["error"] > 10.0:
                error = f"{row['error']:.0f}: another minimum"
            tool = f"{row['tool']} {row['version']}"
            rows.append((tool, begins[row["begins_from"]], f"{row['cpu_seconds']:.2g} s", error))
    head = (f"one throw of the {first['body']}", "initial guess", "processor time", "error / Cramér-Rao bound")
    return f"{_measured_on(first)}.\n\n{_table(head, rows)}"


def engines() -> str:
    """A torque-free body near its middle axis in physics engines, from the last benchmark's own numbers."""
    measured = read_rows(RESULTS / "engines.csv")
    steps = list(dict.fromkeys(row["step_s"] for row in measured))
    found = {(row["engine"], row["way"], row["step_s"]): row for row in measured}
    rows = []
    for engine, way in dict.fromkeys((row["engine"], row["way"]) for row in measured):
        ways = [found[engine, way, step] for step in steps]
        cells = [cell for row in ways for cell in _flown_in_engine(row)]
        version = ways[0]["version"] if engine == "rigid_proto" else f"{ways[0]['package']} {ways[0]['version']}"
        rows.append((f"{engine}, {way.replace('_', ' ')}", version, *cells, _beside_ghost(ways)))
    heads = [f"{name}, {_STEPS[step]}" for step in steps for name in ("flips", "ΔE/E", "turn of L")]
    head = ("engine", "version", *heads, "ghost of the page, and how far apart after 60 s")
    return f"{_measured_on(measured[0])}.\n\n{_table(head, rows)}"


_STEPS = {0.0166667: "1/60 s", 0.001: "1 ms"}

_ENGINES = {
    "rapier": "Rapier",
    "jolt": "Jolt",
    "physx": "PhysX",
    "babylon": "Babylon with Havok",
    "gltf": "Babylon's loader, with Havok",
    "bullet": "Bullet",
    "pybullet": "Bullet",
    "cannon": "cannon-es",
    "havok": "Havok",
    "mujoco": "MuJoCo",
}


def engine_flights() -> str:
    """Bodies that flew in engines with what is printed for them, from the last benchmark's own numbers."""
    measured = [row for row in read_rows(RESULTS / "engine_inertia.csv") if not math.isnan(row["spin_error"])]
    others = {"gltf": "a flight's .glb", "mujoco": "`--mjcf`", "pybullet": "`--urdf`"}
    rows = (
        (
            others.get(row["engine"], f"`--for {row['engine']}`"),
            f"{_ENGINES[row['engine']]} ({row['package']} {row['version']})",
            f"{row['spin_error']:.0e}",
            f"{row['position_error']:.0e}",
        )
        for row in measured
    )
    table = _table(("flown with", "in", "spin off by", "way off by"), rows)
    return f"{_measured_on(measured[0])}.\n\n{table}"


def engine_inertia() -> str:
    """What engines compute of the L bracket by themselves, from the last benchmark's own numbers."""
    measured = [row for row in read_rows(RESULTS / "engine_inertia.csv") if math.isnan(row["spin_error"])]
    rows = []
    for row in measured:
        moments = (100.0 * row[f"{name}_moment"] for name in ("first", "second", "third"))
        turned = f"{abs(row['axes_turned_deg']):.1f}°"
        name = f"{_ENGINES.get(row['engine'], '')}, {row['shape']}, {row['package']} {row['version']}"
        rows.append(
            (
                "the bounding box about its own centre" if row["engine"] == "any" else name,
                ", ".join(f"{moment:+.1f}" for moment in moments).replace("-0.0", "+0.0") + " %",
                f"**{turned}**" if row["axes_turned_deg"] > 45.0 else turned,
                f"{row['center_off_mm']:.1f} mm",
            )
        )
    head = ("engine, shape", "principal moments", "axes turned by", "centre of mass off by")
    return f"{_measured_on(measured[0])}.\n\n{_table(head, rows)}"


def _flown_in_engine(row: dict) -> tuple[str, ...]:
    if row["why"]:
        return f"not run: {row['why']}", "", ""
    return f"{row['flips']:.0f}", f"{row['energy_change']:+.2g}", f"{row['momentum_turn_deg']:.2g}°"


def _beside_ghost(rows: list[dict]) -> str:
    if not rows[0]["ghost"]:
        return ""
    angles = " and ".join(f"{row['ghost_apart_rad']:.0e}" for row in rows)
    return f"{rows[0]['ghost'].replace('_', ' ')}: {angles} rad"


def _measured_on(row: dict) -> str:
    return f"Measured {row['date'][:10]} on one {row['cpu']}"


def lesson_table() -> str:
    """Every lesson with its page."""
    return _table(("scene", "lesson"), ((_code(one.name), f"[{one.title}]({one.name}.md)") for one in lessons()))


def gallery() -> str:
    """Every lesson with its picture and its question."""
    parts = []
    for one in lessons():
        choices = " ".join(f"**{letter}** {choice}" for letter, choice in zip("ABC", one.choices, strict=True))
        picture = f"[![{one.title}](lessons/{one.name}.png)](lessons/{one.name}.md)"
        link = lesson_link(one.name, address())
        parts.append(f"## {one.title}\n\n{picture}\n\n{_code(one.name)}: {one.question}\\\n{choices}\n\n{link}")
    return "\n\n".join(parts)


def site_line(published: str) -> str:
    """Where the page can be opened: at its address, or from a file."""
    if published:
        return (
            f"The page and its lessons are at <{published}>: nothing to install, and the page can be kept as one file."
        )
    return (
        "The page is one file that needs neither Python nor a network: `rigid_proto workbench --html rigid_body.html`. `make site` writes"
        " it with a start page and one address a lesson into `site/`, for any static host."
    )


def lesson_link(name: str, published: str) -> str:
    """Where a lesson can be opened: at its address, or from a file."""
    if published:
        return f"Open it: <{published}{name}/>"
    return f"As a file: `rigid_proto lesson {name} --html {name}.html`"


def lesson_to_try(name: str) -> str:
    """A lesson's question and sentences, as the workbench shows them."""
    one = lesson(name)
    choices = " ".join(f"**{letter}** {choice}" for letter, choice in zip("ABC", one.choices, strict=True))
    steps = "\n".join(f"{number}. {sentence}" for number, sentence in enumerate(one.sentences, 1))
    return f"Guess first: {one.question}\\\n{choices}\n\n{steps}"


def bodies() -> str:
    """The bundled bodies with sizes and masses, from their meshes."""
    rows = []
    for name in body_names():
        inspected = inspect_mesh(mesh_body(load_mesh(name)))
        size = " × ".join(f"{100.0 * length:.3g}" for length in inspected.upper - inspected.lower)
        moments, _ = principal_axes(inspected.chosen.inertia)
        ratios = " : ".join(f"{moment / moments[0]:.3g}" for moment in moments)
        rows.append((_code(name), size, f"{1e6 * inspected.volume:,.0f}", ratios))
    return _table(("name", "size x × y × z [cm]", "volume [cm³]", "principal moments A : B : C"), rows)


TABLES = {
    "topics": topics,
    "services": services,
    "parameters": parameters,
    "integrators": integrators,
    "masses": masses,
    "readers": readers,
    "bodies": bodies,
    "lessons": lesson_table,
    "gallery": gallery,
    "motions": motions,
    "node": node_load,
    "start_up": start_up,
    "skipped": skipped_work,
    "identification": identification,
    "figures": figures,
    "engines": engines,
    "engine_flights": engine_flights,
    "engine_inertia": engine_inertia,
    "heyoka": heyoka,
    "recording": recording,
    "sweeps": sweeps,
    "site": lambda: site_line(address()),
}


def filled(text: str) -> str:
    """A document with its tables written anew."""

    def written(found: re.Match) -> str:
        text = lesson_to_try(found["name"]) if found["kind"] == "lesson" else TABLES[found["name"]]()
        return f"{found[1]}{text}\n{found[5]}"

    return _MARKED.sub(written, text)


def documents() -> list[Path]:
    """The documents that hold tables."""
    return [path for path in (ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))) if path.is_file()]


def main(argv: list[str] | None = None) -> int:
    """Write the tables, or check them; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python tools/docs_tables.py", description="Tables of the docs.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a document is out of date")
    args = parser.parse_args(argv)
    behind = 0
    for path in documents():
        text = path.read_text(encoding="utf-8")
        new = filled(text)
        if new == text:
            continue
        behind += 1
        if args.check:
            print(f"{path}: out of date; write it with: python tools/docs_tables.py", file=sys.stderr)
        else:
            path.write_text(new, encoding="utf-8")
    return 1 if args.check and behind else 0


def _with_switch(interface) -> str:
    on_request = f" (with `{interface.on_request}`)" if interface.on_request else ""
    return interface.meaning + on_request


def _parameter_row(parameter: Parameter) -> tuple[str, ...]:
    meaning = parameter.description.rstrip(".")
    if parameter.choices:
        meaning += ": " + ", ".join(_code(choice or '""') for choice in parameter.choices)
    if parameter.changes != LIVE:
        meaning += " (at start only)" if parameter.changes == READ_ONLY else " (takes effect at the next reset)"
    return _code(parameter.name), _default(parameter), parameter.unit, meaning


def _default(parameter: Parameter) -> str:
    value = parameter.default
    if value is None:
        return ""
    if isinstance(value, bool):
        return _code(str(value).lower())
    if isinstance(value, list):
        return _code("[" + ", ".join(f"{x:g}" for x in value) + "]")
    if isinstance(value, float):
        return _code(f"{value:g}")
    return _code(str(value) or '""')


def _code(text: str) -> str:
    return f"`{text}`"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = tuple(head)
    lines = [head, ("---",) * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


if __name__ == "__main__":
    sys.exit(main())
