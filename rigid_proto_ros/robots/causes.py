# SPDX-License-Identifier: MIT
"""Common mistakes that turn the true tensor or COM of a link into the one in its file.

A mistake is a sentence and its result. A mistake of shape, frame or order may be combined with a wrong unit.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Iterator

import numpy as np

from ..base.errors import InputError
from ..base.vectors import FloatArray, Matrix3, Vector3
from ..mass.properties import MassProperties, MeshMoments
from ..mass.tensor import SIX, six_from_tensor, tensor_from_six
from ..mesh.solids import convex_hull
from .link_shapes import LinkShapes, parallel_axis

LIMIT = 1e-3
"""Relative differences up to this are taken as rounding of printed numbers."""
ANOTHER_MASS = 0.02
"""Least relative deviation of a tensor's factor from 1 that is reported as another mass. Real bodies differ from their
drawings by less.
"""

_INCH, _POUND = 1.0 / 0.0254, 1.0 / 0.45359237
_FACTORS = {
    1e6: "tensor in kg mm² (lengths in mm)",
    1e4: "tensor in kg cm² (lengths in cm)",
    1e3: "tensor in g m²",
    1e9: "tensor in g mm²",
    1e7: "tensor in g cm²",
    1e-3: "tensor in t m²",
    1e-6: "lengths divided by 1000 twice",
    _INCH**2: "tensor in kg in² (lengths in inches)",
    _POUND: "mass in pounds",
    _POUND * _INCH**2: "tensor in lb in²",
}
_LARGEST_POWER = 9
"""Largest power of ten by which a single entry may be wrong: from kg m² to g mm²."""
OTHER_SHAPES = "the bounding box", "the shell", "the convex hull"
WEAK = ("COM left at the link's origin", "COM at the mesh's origin", *(f"COM that of {name}" for name in OTHER_SHAPES))
"""Causes of a COM that count only together with another one: frames are often placed at the COM on purpose, and the
centres of other shapes are close to it.
"""


_TURNS = [
    np.eye(3)[list(order)] * np.array(signs)
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
]
_QUARTER_TURNS = [turn for turn in _TURNS if np.linalg.det(turn) > 0.0]
"""The 24 rotations (3, 3) that map the axes onto each other."""


def _other_shapes(parts: LinkShapes, mass: float) -> Iterator[tuple[str, MassProperties]]:
    """Shapes that other tools use in place of the solid, in the link's axes."""
    box, shell, hull = OTHER_SHAPES
    yield box, parts.box(mass)
    with contextlib.suppress(InputError):  # for primitives
        yield shell, parts.shell(mass)
    with contextlib.suppress(InputError):  # for points in one plane
        yield hull, MeshMoments(*convex_hull(parts.points)).mass_properties(mass=mass)


def _mistakes(truth: MassProperties, stated: Vector3, parts: LinkShapes) -> Iterator[tuple[str, Matrix3]]:
    """Each common mistake, "" for none, with the tensor that it makes of the true one. stated (3,): the COM in the
    file.
    """
    inertia, mass, com, use = truth.inertia, truth.mass, truth.center_of_mass, parts.first.pose
    yield "", inertia
    for name, of in _other_shapes(parts, mass):
        yield f"tensor of {name}, not of the solid", of.inertia
    # The six entries in another order or with other signs, or the axes exchanged.
    xx, xy, xz, yy, yz, zz = six_from_tensor(inertia)
    yield from _wrong_signs(inertia)
    orders = {
        "products left out": (xx, 0.0, 0.0, yy, 0.0, zz),
        "order of entries: xx yy zz xy xz yz where xx xy xz yy yz zz belongs": (xx, yy, zz, xy, xz, yz),
        "order of entries: xx xy xz yy yz zz where xx yy zz xy xz yz belongs": (xx, yy, yz, xy, zz, xz),
        "the first six of nine entries, row by row, where the upper triangle belongs": (xx, xy, xz, xy, yy, yz),
        "products ixy and ixz exchanged": (xx, xz, xy, yy, yz, zz),
        "products ixz and iyz exchanged": (xx, xy, yz, yy, xz, zz),
        "products ixy and iyz exchanged": (xx, yz, xz, yy, xy, zz),
        "order of products: xz yz xy": (xx, xz, yz, yy, xy, zz),
        "order of products: yz xy xz": (xx, yz, xy, yy, xz, zz),
    }
    for sentence, six in orders.items():
        yield sentence, tensor_from_six(six)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        order = list(range(3))
        order[i], order[j] = j, i
        exchanged, flip = inertia[np.ix_(order, order)], np.ones(3)
        flip[i] = -1.0
        yield f"axes {'xyz'[i]} and {'xyz'[j]} exchanged", exchanged
        quarter = f"a quarter turn about {'xyz'[3 - i - j]} left out (as between y up and z up)"
        yield quarter, exchanged * np.outer(flip, flip)
    # About another point, or in other axes.
    yield "taken about the link's origin, not about the COM", inertia + parallel_axis(mass, com)
    yield "taken about the mesh's origin, not about the COM", inertia + parallel_axis(mass, com - use.position)
    yield "taken about the stated origin, not about the COM", inertia + parallel_axis(mass, com - stated)
    yield "moved from the COM to the origin the wrong way round", inertia - parallel_axis(mass, com)
    yield "in the mesh's axes, not in the link's", use.rotation.T @ inertia @ use.rotation
    moments, axes = np.linalg.eigh(inertia)
    for three in itertools.permutations(moments.tolist()):
        yield "principal moments on the diagonal, their axes left out", np.diag(three)
    for turn in _QUARTER_TURNS:  # any order and direction of the principal axes
        rotation = axes @ turn
        turned = rotation.T @ (turn.T @ np.diag(moments) @ turn) @ rotation
        yield "turned by the conjugate of the principal rotation", turned
    if len(parts.parts) > 1:
        yield "parts summed about their own centres", parts.summed_about_own_centers(mass)


def _wrong_signs(inertia: Matrix3) -> list[tuple[str, Matrix3]]:
    """Mistakes in the signs of the products, with the tensors that they give. Mistakes with the same result, since a
    product is 0, are joined into one sentence.
    """
    xx, xy, xz, yy, yz, zz = six_from_tensor(inertia)
    sides = {f"a copy for the other side that wasn't mirrored in {axis}": axis for axis in "xyz"}
    signs = {
        "signs of the products: written as plus the integrals of xy, xz, yz": (-1.0, -1.0, -1.0),
        **{name: tuple(-1.0 if axis in pair else 1.0 for pair in ("xy", "xz", "yz")) for name, axis in sides.items()},
        "sign of ixy": (-1.0, 1.0, 1.0),
        "sign of ixz": (1.0, -1.0, 1.0),
        "sign of iyz": (1.0, 1.0, -1.0),
    }
    found: list[tuple[str, Matrix3]] = []
    for sentence, (a, b, c) in signs.items():
        wrong = tensor_from_six((xx, a * xy, b * xz, yy, c * yz, zz))
        near = LIMIT * float(np.max(np.abs(inertia)))
        same = next((k for k, (_, other) in enumerate(found) if np.max(np.abs(wrong - other)) <= near), None)
        if same is None:
            found.append((sentence, wrong))
        else:
            found[same] = f"{found[same][0]}, or {sentence}", found[same][1]
    return found


def _one_entry(have: FloatArray, want: FloatArray) -> str:
    """Describe the one of six entries (6,) that is wrong by a power of ten while the others are right; "" if that isn't
    so.
    """
    wrong = np.flatnonzero(np.abs(have - want) > LIMIT * np.max(np.abs(want)))
    if len(wrong) != 1 or not have[wrong[0]] * want[wrong[0]] > 0.0:
        return ""
    ratio = have[wrong[0]] / want[wrong[0]]
    power = round(math.log10(ratio))
    if not 1 <= abs(power) <= _LARGEST_POWER or abs(ratio / 10.0**power - 1.0) > LIMIT:
        return ""
    return f"{SIX[wrong[0]]} is 10^{power} times the true one"


def _unit(factor: float, density: float) -> str | None:
    """The wrong unit that makes a tensor ``factor`` times too large: "" for none, None if it isn't known. density: that
    of the true body [kg/m³].
    """
    if abs(factor - 1.0) <= LIMIT:
        return ""
    times = f"{factor:.4g} times too large" if factor > 1.0 else f"{1.0 / factor:.4g} times too small"
    unit_density = {}
    if 0.0 < density < math.inf:
        at = f"computed at unit density, as MeshLab does, not at {density:.6g} kg/m³"
        unit_density = {1.0 / density: at, 1e15 / density: f"{at}, and with lengths in mm"}
    factors = [*unit_density.items(), *_FACTORS.items()]
    return next((f"{text}: {times}" for known, text in factors if abs(factor / known - 1.0) <= LIMIT), None)


def explain_inertia(given: Matrix3, truth: MassProperties, stated: Vector3, parts: LinkShapes) -> tuple[str, ...]:
    """The smallest set of common mistakes that turns the true tensor into ``given`` (3, 3); empty if there is none.

    stated (3,): the COM in the file [m, link axes].
    """
    if not np.any(given):
        return ("all entries zero",)
    found, density = [], truth.mass / sum(solid.mass for solid in parts.solids)
    for sentence, wrong in _mistakes(truth, stated, parts):
        factor = float(np.sum(given * wrong) / max(np.sum(wrong * wrong), 1e-300))
        unit = _unit(factor, density) if factor > 0.0 else None
        fits = np.max(np.abs(given - factor * wrong)) <= LIMIT * factor * np.max(np.abs(wrong))
        if fits and unit is None and not sentence and not _is_isotropic(wrong) and abs(factor - 1.0) > ANOTHER_MASS:
            other = f"computed for {factor * truth.mass:.6g} kg (another density?)"
            unit = f"{factor:.6g} times the tensor for this mass: {other}"
        if fits and unit is not None:
            found.append(tuple(filter(None, (sentence, unit))))
    single = _one_entry(np.array(six_from_tensor(given)), np.array(six_from_tensor(truth.inertia)))
    if single:
        found.append((single,))
    if found:
        return min(found, key=len)
    if _is_isotropic(given) and not _is_isotropic(truth.inertia):
        return (f"a placeholder: {given[0, 0]:g} on the diagonal",)
    return ()


def _is_isotropic(inertia: Matrix3) -> bool:
    """Whether all moments of a tensor are equal."""
    return bool(np.max(np.abs(inertia - inertia[0, 0] * np.eye(3))) <= 1e-9 * abs(inertia[0, 0]))


def explain_center(given: Vector3, truth: MassProperties, parts: LinkShapes) -> tuple[str, ...]:
    """The common mistake that turns the true COM into ``given`` (3,) [m, link axes]; empty if there is none."""
    com, use = truth.center_of_mass, parts.first.pose
    guesses = [
        (WEAK[0], np.zeros(3)),
        (WEAK[1], use.position),
        ("COM in mesh coordinates: the mesh's pose in the link left out", use.rotation.T @ (com - use.position)),
        ("COM in mm", 1000.0 * com),
        ("COM in cm", 100.0 * com),
        ("COM 1000 times too small", com / 1000.0),
        ("COM with the opposite sign", -com),
        *(
            (f"COM of a copy for the other side that wasn't mirrored in {axis}", com * (1.0 - 2.0 * np.eye(3)[k]))
            for k, axis in enumerate("xyz")
        ),
        ("COM with y and z exchanged", com[[0, 2, 1]]),
        *((f"COM that of {name}", of.center_of_mass) for name, of in _other_shapes(parts, truth.mass)),
    ]
    for sentence, guess in guesses:
        if np.max(np.abs(given - guess)) <= LIMIT * max(parts.diagonal, float(np.max(np.abs(guess)))):
            return (sentence,)
    return ()
