# SPDX-License-Identifier: MIT
"""The ten mass parameters in log-Cholesky coordinates: whatever the numbers, a body with them can exist.

Rucker and Wensing, Smooth Parameterization of Rigid-Body Inertia, IEEE Robotics and Automation Letters 7 (2022): the
pseudo-inertia about the origin of the tracked frame is J = U Uᵀ with

        [ e^d1  s12   s13   t1 ]
    U = [  0    e^d2  s23   t2 ] e^α,    parameters (α, d1, d2, d3, s12, s23, s13, t1, t2, t3).
        [  0     0    e^d3  t3 ]
        [  0     0     0    1  ]

So the mass is e^2α, t is the centre of mass, and Σ = m V Vᵀ (V the upper left of U without e^α) are the second moments
about the centre of mass, of which the tensor is tr(Σ) 1 − Σ. The numbers kept here are θ = (α, λ, e1, e2, s12 e^-λ, s23
e^-λ, s13 e^-λ, t) with d = λ + (e1, e2, −e1 − e2): the size e^λ apart from the shape, so that what a free flight can't
tell, α and λ, is two of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError
from ..mass.tensor import check_tensor, principal_axes

MASS = 0
SIZE = 1
COM = slice(7, 10)
PARAMETERS = 10

STEP = 2e-6
"""Of difference quotients: long flights bend so much that 1e-5 is too long for some, and 1e-7 leaves too
little above rounding.
"""

COORDINATES = (
    *("mass", "size of the tensor", "ratio of the largest moment to the others", "ratio of the two smaller moments"),
    *("turn of axes 2 and 3", "turn of axes 1 and 3", "turn of axes 1 and 2"),
    *("centre of mass along x", "centre of mass along y", "centre of mass along z"),
)
"""The directions of ``physical_directions``, axes of moments ascending: 1, 2, 3; x, y, z those of the tracked frame."""


@dataclass(frozen=True)
class MassEstimate:
    """mass [kg], center_of_mass (3,) [m, tracked frame], inertia (3, 3) [kg m², about the COM, axes of
    the tracked frame].
    """

    mass: float
    center_of_mass: np.ndarray
    inertia: np.ndarray


def mass_of(theta: np.ndarray) -> MassEstimate:
    """The body with these parameters (10,)."""
    mass = math.exp(2.0 * theta[MASS])
    V = _upper(theta)
    second = mass * (V @ V.T)
    return MassEstimate(mass, theta[COM].copy(), tensor_of(second))


def parameters_of(mass: float, center_of_mass: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """θ (10,) of a body; a flat one, on the rim of what can exist, is taken a millionth of its size thicker."""
    check_tensor(inertia)
    if not 0.0 < mass < math.inf:
        raise InputError("mass", mass, "a finite number above 0 [kg]")
    second = second_moments(inertia) / mass
    values, vectors = np.linalg.eigh(second)
    second = (vectors * np.maximum(values, 1e-12 * values[2])) @ vectors.T
    # Upper triangular: Cholesky of the matrix turned end for end.
    V = np.linalg.cholesky(second[::-1, ::-1])[::-1, ::-1]
    theta = np.zeros(PARAMETERS)
    theta[MASS] = 0.5 * math.log(mass)
    d = np.log(np.diag(V))
    size = theta[SIZE] = float(d.mean())
    theta[2:4] = d[:2] - size
    theta[4:7] = np.array([V[0, 1], V[1, 2], V[0, 2]]) * math.exp(-size)
    theta[COM] = center_of_mass
    return theta


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """∫ x xᵀ dm (3, 3) [kg m²] of a tensor: a body can have it where none of its eigenvalues is below 0."""
    return 0.5 * np.trace(inertia) * np.eye(3) - inertia


def tensor_of(second: np.ndarray) -> np.ndarray:
    """The tensor (3, 3) of second moments."""
    return np.trace(second) * np.eye(3) - second


def possible_tensor(inertia: np.ndarray, thinnest: float) -> np.ndarray:
    """The nearest tensor of a body whose least second moment is at least ``thinnest`` of the largest."""
    values, axes = np.linalg.eigh(second_moments(inertia))
    least = thinnest * np.abs(values).max()
    if values[0] >= least:
        return inertia
    return tensor_of((axes * np.maximum(values, least)) @ axes.T)


def _upper(theta: np.ndarray) -> np.ndarray:
    (e1, e2), (s12, s23, s13) = theta[2:4].tolist(), theta[4:7].tolist()
    shape = [[math.exp(e1), s12, s13], [0.0, math.exp(e2), s23], [0.0, 0.0, math.exp(-e1 - e2)]]
    return math.exp(theta[SIZE]) * np.array(shape)


def principal(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments (3,) ascending and axes (3, 3), columns."""
    return principal_axes(mass_of(theta).inertia)


def scaled(theta: np.ndarray, mass: float, length: float) -> np.ndarray:
    """The body with its mass ``mass`` times as large and its tensor so too, then all its second moments by length²."""
    other = theta.copy()
    other[MASS] += 0.5 * math.log(mass)
    other[SIZE] += math.log(length)
    return other


def difference_steps(theta: np.ndarray) -> np.ndarray:
    """Steps (10,) for difference quotients: a relative change of moments and mass, the same part of the
    body's size for the COM.
    """
    e1, e2 = theta[2:4].tolist()
    middle, last = math.exp(e2), math.exp(-e1 - e2)
    size = math.exp(theta[SIZE]) * max(math.exp(e1), middle, last)
    return STEP * np.array([1.0, 1.0, 1.0, 1.0, middle, last, last, size, size, size])


def changed_tensor(body: MassEstimate, change: np.ndarray) -> MassEstimate:
    """A body with the tensor changed (6,) in its own principal axes, each entry by the root of its two moments: the
    trace's third, the last moment less the mean of the others, the second less the first, and products 23, 13, 12.
    """
    moments, axes = principal_axes(body.inertia)
    size, ratio, smaller, turn23, turn13, turn12 = change.tolist()
    a, b, c = size - ratio / 3.0 - 0.5 * smaller, size - ratio / 3.0 + 0.5 * smaller, size + 2.0 * ratio / 3.0
    relative = np.array([[a, turn12, turn13], [turn12, b, turn23], [turn13, turn23, c]])
    inertia = body.inertia + axes @ (relative * np.sqrt(np.outer(moments, moments))) @ axes.T
    return MassEstimate(body.mass, body.center_of_mass, 0.5 * (inertia + inertia.T))
