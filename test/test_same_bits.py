# SPDX-License-Identifier: MIT
"""On the ways of motion, mass properties, scripts and sweeps stands no operation whose bits differ from place to place.

Those are: functions of the C library (``math.sin``, NumPy's ``np.exp``), sums whose order is a library's (``np.sum``, BLAS
behind ``@`` and ``np.dot``, LAPACK), and Python's own ``sum`` of floats, which compensates from 3.12 on. What is
correctly rounded element by element (+ − · / √ and comparisons), min and max may stand anywhere.
"""

from __future__ import annotations

import ast
from pathlib import Path

import rigid_proto_ros

ROOT = Path(rigid_proto_ros.__file__).parent

WAYS = [
    *(path for folder in ("base", "motion", "simulation", "scene", "sweep") for path in (ROOT / folder).rglob("*.py")),
    *(
        path
        for name in ("moments*", "closed_form", "properties", "tensor", "walls", "parts", "from_mesh", "exact_moments")
        for path in (ROOT / "mass").glob(f"{name}.py")
    ),
]

OF_THE_C_LIBRARY = {
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("arcsin", "arccos", "arctan", "arctan2", "arcsinh", "arccosh", "arctanh", "sincos", "sinc"),
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "power", "float_power", "cbrt", "hypot"),
    *("gamma", "lgamma", "erf", "erfc", "dist", "logaddexp", "logspace", "geomspace"),
}
IN_AN_ORDER_OF_THEIR_OWN = {
    *("sum", "nansum", "mean", "average", "std", "var", "prod", "dot", "vdot", "inner", "outer", "matmul", "einsum"),
    *("tensordot", "kron", "trace", "convolve", "correlate", "cumsum", "cumprod", "trapezoid", "interp", "polyfit"),
    *("percentile", "quantile", "median", "linalg", "random", "fft", "corrcoef", "cov"),
}

FRACTIONS = "of fractions or whole numbers, exact"
ALLOWED = {
    ("motion/integrators/stepping.py", "np.cumsum"): "of whole numbers",
    ("simulation/commands.py", "sum"): "of bits",
    ("simulation/record.py", "sum"): "of bits",
    ("mass/exact_moments.py", "sum"): FRACTIONS,
    ("mass/exact_moments.py", "**"): FRACTIONS,
    ("mass/parts.py", "sum"): FRACTIONS,
    ("mass/parts.py", "np.cumsum"): "of whole numbers",
    ("scene/sensor_noise.py", "np.random"): "noise, which moves nothing",
    ("sweep/sampling.py", "**"): "of decimal numbers, whose digits are fixed",
    ("sweep/sampling.py", "np.random"): "whole numbers of Philox, which the golden hashes compare",
    ("scene/sensitivity.py", "**"): "of a step's length, rounded to nanoseconds",
    **{(f"sweep/{name}.py", "sum"): FRACTIONS for name in ("study", "table", "workers")},
}
"""What stands there all the same, and why."""


def _name(node: ast.AST, own: str) -> str:
    """What of it a node of the module ``own`` is, or nothing."""
    if isinstance(node, (ast.BinOp, ast.AugAssign)):
        if isinstance(node.op, ast.MatMult):
            return "@"
        # A square is compiled as a product; elsewhere it is the C library's pow.
        squared = isinstance(node, ast.BinOp) and isinstance(node.right, ast.Constant) and own.startswith("motion/")
        base = node.left if isinstance(node, ast.BinOp) else node.target
        whole = isinstance(base, ast.Constant) and base.value in (2, 10)
        return "**" if isinstance(node.op, ast.Pow) and not squared and not whole else ""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "math"):
        its_order = node.value.id == "np" and node.attr in IN_AN_ORDER_OF_THEIR_OWN
        return f"{node.value.id}.{node.attr}" if node.attr in OF_THE_C_LIBRARY or its_order else ""
    if not isinstance(node, ast.Call):
        return ""
    if isinstance(node.func, ast.Name):
        return node.func.id if node.func.id in ("sum", "pow") else ""
    if isinstance(node.func, ast.Attribute) and node.func.attr in ("sum", "mean", "dot", "prod"):
        module = isinstance(node.func.value, ast.Name) and node.func.value.id in ("np", "math")
        return "" if module else f".{node.func.attr}"
    return ""


def found_in(path: Path) -> set[tuple[str, str]]:
    """What of it stands in a module, by its name there."""
    own = path.relative_to(ROOT).as_posix()
    return {(own, name) for node in ast.walk(ast.parse(path.read_text())) if (name := _name(node, own))}


def test_nothing_stands_on_the_way_whose_bits_are_a_librarys() -> None:
    assert set().union(*map(found_in, WAYS)) == set(ALLOWED)
