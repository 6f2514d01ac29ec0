# SPDX-License-Identifier: MIT
"""Whether any body has an inertial, and whether any mass distribution inside given shapes has it.

Along an axis on which the shapes reach from l to u, a distribution of mean c has at most the variance (c - l)(u - c)
(Bhatia and Davis, American Mathematical Monthly 107, 2000): all mass at the two ends. A tensor says the variance along
every axis, so one axis on which it is larger shows that the inertial can't be of these shapes, whatever their density.
"""

from __future__ import annotations

import math

import numpy as np

from ..base.errors import InputError
from ..mass.tensor import check_tensor
from ..mesh.solids import convex_hull
from .model import Link

MARGIN = 1e-3
"""Part of the shapes' diagonal by which they may be larger than they are drawn."""
MAX_ROUNDING = 0.05
"""A number printed with one digit is right to 50 %, which would excuse anything: this much is excused at most."""
DIRECTIONS = 1000
"""Axes tried over all directions, about 5 degrees apart, besides those of the link, of the tensor and of the hull."""


def impossible_inertial(link: Link) -> str:
    """Why no body has the link's inertial; "" when one has."""
    remedy = "" if np.any(link.inertia) else "; a link that only marks a frame needs no inertial"
    if not 0.0 < link.mass < math.inf:
        return f"mass {link.mass:g}, which isn't a positive number{remedy}"
    if not np.all(np.isfinite(link.center_of_mass)):
        return "a COM that isn't finite"
    try:
        check_tensor(link.inertia)
    except InputError as error:
        return f"no rigid body has this tensor: {error}{remedy}"
    return ""


def beyond_shapes(link: Link, points: np.ndarray) -> str:
    """Why no mass distribution within the hull of ``points`` (n, 3) has the link's inertial, which some body has; ""
    when one may have.
    """
    c = link.center_of_mass
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    reach = MARGIN * diagonal + np.minimum(link.center_step, MAX_ROUNDING * diagonal)
    variance = (0.5 * np.trace(link.inertia) * np.eye(3) - link.inertia) / link.mass
    step = (0.5 * np.trace(link.inertia_step) * np.eye(3) + link.inertia_step) / link.mass
    step = np.minimum(step, MAX_ROUNDING * np.trace(variance))
    rounding = 1.0 - min(link.mass_step / link.mass, MAX_ROUNDING)
    corners, normals = _hull(points)

    axes = np.concatenate([np.eye(3), np.linalg.eigh(variance)[1].T, _spread(DIRECTIONS), normals])
    along = corners @ axes.T
    margin = np.abs(axes) @ reach
    below, above = axes @ c - along.min(axis=0) + margin, along.max(axis=0) - axes @ c + margin
    outside = np.maximum(-below, -above)  # by how much the COM lies outside [m]
    if outside.max() > 0.0:
        axis = axes[outside.argmax()]
        return f"COM {outside.max() + MARGIN * diagonal:.3g} m outside the hull of its shapes along {_words(axis)}"
    own = np.einsum("ki,ij,kj->k", axes, variance, axes) * rounding - np.einsum(
        "ki,ij,kj->k", np.abs(axes), step, np.abs(axes)
    )
    tiny = 1e-12 * diagonal + 1e-150
    most = np.maximum(below, tiny) * np.maximum(above, tiny)
    worst = (own / most).argmax()
    if own[worst] <= most[worst]:
        return ""
    return (
        f"too wide for its shapes: along {_words(axes[worst])} the mass lies {math.sqrt(own[worst]):.3g} m (r.m.s.) "
        f"from the COM, and inside the shapes at most {math.sqrt(most[worst]):.3g} m"
    )


def _spread(count: int) -> np.ndarray:
    """``count`` directions (count, 3) spread evenly over the sphere: a Fibonacci lattice."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def _hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) and normals (m, 3) of the hull; of points that have none, or without SciPy, all and none."""
    try:
        corners, triangles = convex_hull(points)
    except InputError:
        return points, np.zeros((0, 3))
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    normals = np.unique(np.round(normals[size > 0.0] / size[size > 0.0][:, None], 3), axis=0)
    normals = normals[:: max(1, len(normals) // 1000)]  # a smooth hull has more than are needed
    return corners, normals / np.linalg.norm(normals, axis=1)[:, None]


def _words(axis: np.ndarray) -> str:
    return f"({', '.join(f'{value + 0.0:.2g}' for value in np.round(axis, 3))})"
