# SPDX-License-Identifier: MIT
"""The benchmark's problems, their cached references and what is read from its table."""

import ast
import importlib
import math
import types
from pathlib import Path

import numpy as np
import pytest
from flights import SECOND
from mpmath import mp, mpf
from reference_motion import angle_between, rotation_of

from problem_references import compute, reference_row
from problems import PROBLEMS
from result_table import ResultTable, read_rows
from work_precision_ours import simulation_of
from work_precision_ratios import time_at_error

BENCHMARKS = Path(importlib.import_module("problems").__file__).parent
HARDEST = 1e4
"""rad/s: stiffer strings take seconds each, and the benchmark runs them."""


@pytest.mark.parametrize("name", [n for n, p in PROBLEMS.items() if p.has_reference])
def test_cached_references_belong_to_the_problems_of_today(name):
    row = reference_row(PROBLEMS[name])
    with mp.workdps(40):
        assert abs(sum(c * c for c in row[3:7]) - 1) < mpf("1e-17")


@pytest.mark.parametrize("name", ["P2", "pokes"])
def test_a_reference_computed_anew_is_the_cached_one(name):
    with mp.workdps(40):
        difference = max(
            abs(a - b) for a, b in zip(compute(PROBLEMS[name], 16), reference_row(PROBLEMS[name]), strict=True)
        )
        assert difference < mpf("1e-12")


@pytest.mark.parametrize(
    "name", [n for n, p in PROBLEMS.items() if p.spring is None or p.spring.frequency <= HARDEST / 100]
)
def test_auto_solves_every_problem(name):
    """At accuracy 1e-10, global errors; P1 and its like amplify a rounding by the separatrix they start beside."""
    problem = PROBLEMS[name]
    simulation = simulation_of(problem, "auto", 1e-3, 1e-10)
    state = simulation.advance(round(problem.duration * SECOND))
    reference = reference_row(problem)
    assert not simulation.failure
    # Measured up to 5e-9 (P2x100), mostly 1e-12.
    assert angle_between(state.orientation_xyzw, rotation_of(reference[3:7])) <= 1e-7
    assert np.array([float(c) for c in reference[:3]]) == pytest.approx(state.position, abs=1e-6)


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.name)
def test_every_name_that_a_benchmark_takes_from_the_package_is_there(path):
    """Most benchmarks run for minutes and beside other tools, so that only `make bench` runs them."""
    tree, modules = ast.parse(path.read_text("utf-8")), {}
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("rigid_proto_ros"):
            continue
        module = importlib.import_module(node.module)
        for alias in node.names:
            if not hasattr(module, alias.name):
                importlib.import_module(f"{node.module}.{alias.name}")
            if isinstance(getattr(module, alias.name), types.ModuleType):
                modules[alias.asname or alias.name] = getattr(module, alias.name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in modules:
            assert hasattr(modules[node.value.id], node.attr), f"{node.value.id}.{node.attr}"


def test_result_table_reads_back_what_it_wrote(tmp_path):
    table = ResultTable(tmp_path / "t.csv", ("problem", "median_s", "status"))
    table.add({"problem": "P1", "median_s": 1.5e-6, "status": "ok"})
    table.add({"problem": "P4", "status": "blew up"})
    table.write()
    first, second = read_rows(table.path)
    assert (first["problem"], first["median_s"], first["status"]) == ("P1", 1.5e-6, "ok")
    assert math.isnan(second["median_s"])
    assert {"date", "commit", "cpu", "numpy"} <= set(first)
    with pytest.raises(ValueError, match="colour"):
        table.add({"colour": "red"})


def test_time_at_error_interpolates_along_a_power_law():
    """Error 1e-4/t⁴: at 1e-10 it takes 31.6 s, between the points on either side."""
    curve = [{"median_s": t, "attitude_error_rad": 1e-4 / t**4} for t in (1.0, 10.0, 100.0, 1000.0)]
    assert time_at_error(curve, 1e-10) == pytest.approx(10**1.5, rel=1e-12)
    assert math.isnan(time_at_error(curve, 1e-30))
