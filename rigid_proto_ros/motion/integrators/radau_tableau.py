# SPDX-License-Identifier: MIT
"""The coefficients of Radau IIA with five stages, from its nodes in exact arithmetic.

Source: Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.5.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

STAGES = 5
NODES = (0.05710419611451768, 0.27684301363812383, 0.5835904323689168, 0.8602401356562195, 1.0)
"""Zeros of P₄ − P₅ on (0, 1]."""


def _lagrange(j: int) -> list[Fraction]:
    """Coefficients, constant first, of the polynomial that is 1 at node j and 0 at the others: exact for
    the nodes as doubles.
    """
    c = [Fraction(x) for x in NODES]
    poly = [Fraction(1)]
    for i in range(STAGES):
        if i != j:
            scale = 1 / (c[j] - c[i])
            raised = [Fraction(0), *poly]
            poly = [(a - c[i] * b) * scale for a, b in zip(raised, [*poly, Fraction(0)], strict=True)]
    return poly


def _at(poly: list[Fraction], x: Fraction) -> float:
    return float(sum(a * x**k for k, a in enumerate(poly)))


def _integral_to(poly: list[Fraction], x: Fraction) -> float:
    return float(sum(a * x ** (k + 1) / (k + 1) for k, a in enumerate(poly)))


_POLYNOMIALS = [_lagrange(j) for j in range(STAGES)]
A = np.array([[_integral_to(poly, Fraction(c)) for poly in _POLYNOMIALS] for c in NODES])
"""aᵢⱼ, the integral of the j-th Lagrange polynomial up to node i."""
POWERS = np.array([[float(a) for a in poly] for poly in _POLYNOMIALS])
"""Coefficients of the Lagrange polynomials, constant first."""
HALVES = np.array([[[_at(poly, (Fraction(c) + k) / 2) for poly in _POLYNOMIALS] for c in NODES] for k in (0, 1)])
"""A stage polynomial at the nodes of the step's first and second half, from its values at the nodes."""
