# SPDX-License-Identifier: MIT
"""Which usual mistakes turn the true tensor or COM of a link into the ones that its file gives."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from ..base.errors import InputError
from ..mass.properties import MassProperties
from ..mass.tensor import six_from_tensor
from .link_shapes import LinkShapes
from .model import Shape

LIMIT = 1e-3
"""Differences up to this are taken for rounding of printed numbers."""

ANOTHER_DENSITY = "(another density?)"

_INCH = 1.0 / 0.0254
_POUND = 1.0 / 0.45359237
_FACTORS = {
    1e6: "tensor in kg mm² (lengths in mm)",
    1e4: "tensor in kg cm² (lengths in cm)",
    1e3: "tensor in g m²",
    1e9: "tensor in g mm²",
    1e7: "tensor in g cm²",
    1e-3: "tensor in t m²",
    1e-6: "lengths divided by 1000 twice",
    1e-4: "lengths divided by 100 twice",
    _INCH**2: "tensor in kg in² (lengths in inches)",
    1.0 / _INCH**2: "lengths taken for inches",
    _POUND: "mass in pounds",
    _POUND * _INCH**2: "tensor in lb in²",
}
_WEIGHT = np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])  # how often each of the six entries stands in the matrix
_NAMES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LARGEST_POWER = 9
"""Of ten, by which a single entry may be off: from kg m² to g mm²."""


def _quarter_turns() -> list[np.ndarray]:
    """The 24 rotations (3, 3) that take the axes to each other."""
    found = []
    for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)):
        turn = np.eye(3)[list(order)] * np.array(signs)
        if np.linalg.det(turn) > 0.0:
            found.append(turn)
    return found


_QUARTER_TURNS = _quarter_turns()


def _parallel(inertia: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Inertia about a point ``offset`` away from the COM."""
    return inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _candidate_shapes(parts: LinkShapes, mass: float) -> list[tuple[str, MassProperties]]:
    """The solid first, then what other tools and habits put in its place, in link axes."""
    shapes = []
    phrases = {
        "solid": "",
        "shell": "a thin shell",
        "points": "point masses at the vertices",
        "bounding_box": "the bounding box",
    }
    for model, phrase in phrases.items():
        try:
            properties = parts.properties(mass, model)
        except InputError:
            continue
        shapes.append((phrase and f"tensor of {phrase}, not of the solid", properties))
    if parts.hull is not None:
        hull = replace(parts.hull, mass=mass, inertia=mass * parts.hull.inertia)
        shapes.append(("tensor of the convex hull, not of the solid", hull))
    return shapes


def _conjugates(inertia: np.ndarray) -> list[np.ndarray]:
    """Tensors (3, 3) that come out when the rotation from the principal axes is applied the other way round: one for
    each choice of which axis is called first and which way it points.
    """
    moments, axes = np.linalg.eigh(inertia)
    found = []
    for turn in _QUARTER_TURNS:
        rotation = axes @ turn
        found.append(rotation.T @ (turn.T @ np.diag(moments) @ turn) @ rotation)
    return found


def _frame_mistakes(truth: MassProperties, mass: float, stated: np.ndarray, use: Shape) -> list[tuple[str, np.ndarray]]:
    """The true tensor (3, 3), and what comes out when it is taken about another point or in other axes."""
    com = truth.center_of_mass
    return [
        ("", truth.inertia),
        ("taken about the link's origin, not about the COM", _parallel(truth.inertia, mass, com)),
        ("taken about the mesh's origin, not about the COM", _parallel(truth.inertia, mass, com - use.position)),
        ("taken about the stated origin, not about the COM", _parallel(truth.inertia, mass, com - stated)),
        ("moved from the COM to the origin the wrong way round", _parallel(truth.inertia, -mass, com)),
        ("in the mesh's axes, not in the link's", use.rotation.T @ truth.inertia @ use.rotation),
        ("principal moments on the diagonal, their axes left out", np.diag(np.linalg.eigvalsh(truth.inertia))),
        *(("turned by the conjugate of the principal rotation", turned) for turned in _conjugates(truth.inertia)),
    ]


def _entry_mistakes(inertia: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """The six entries of ``inertia`` (3, 3), and what they become by a wrong sign, order or exchange of axes."""
    xx, xy, xz, yy, yz, zz = six_from_tensor(inertia)
    rows = [
        ("", (xx, xy, xz, yy, yz, zz)),
        ("signs of the products: written as plus the integrals of xy, xz, yz", (xx, -xy, -xz, yy, -yz, zz)),
        ("products left out", (xx, 0.0, 0.0, yy, 0.0, zz)),
        ("order of entries: xx yy zz xy xz yz where xx xy xz yy yz zz belongs", (xx, yy, zz, xy, xz, yz)),
        ("order of entries: xx xy xz yy yz zz where xx yy zz xy xz yz belongs", (xx, yy, yz, xy, zz, xz)),
        ("the first six of nine entries, row by row, where the upper triangle belongs", (xx, xy, xz, xy, yy, yz)),
        ("order of products: xy yz xz", (xx, xy, yz, yy, xz, zz)),
        ("order of products: yz xz xy", (xx, yz, xz, yy, xy, zz)),
    ]
    for order in itertools.permutations(range(3)):
        if order == (0, 1, 2):
            continue
        turned = inertia[np.ix_(order, order)]
        moved = [k for k in range(3) if order[k] != k]
        if len(moved) == 3:
            rows.append(("axes exchanged cyclically", six_from_tensor(turned)))
            continue
        i, j = moved
        rows.append((f"axes {'xyz'[i]} and {'xyz'[j]} exchanged", six_from_tensor(turned)))
        flip = np.ones(3)
        flip[i] = -1.0
        quarter = f"a quarter turn about {'xyz'[3 - i - j]} left out (as between y up and z up)"
        rows.append((quarter, six_from_tensor(turned * np.outer(flip, flip))))
    return [(text, np.array(six)) for text, six in rows]


def _one_entry(have: np.ndarray, want: np.ndarray, limit: float) -> str:
    """The name of the one entry of six that is a power of ten times the wanted one, the others right; "" for none."""
    wrong = np.abs(have - want) > limit * np.max(np.abs(want))
    (k,) = np.flatnonzero(wrong) if wrong.sum() == 1 else (None,)
    if k is None or not have[k] * want[k] > 0.0:
        return ""
    power = round(math.log10(have[k] / want[k]))
    if not 1 <= abs(power) <= _LARGEST_POWER or abs(have[k] / want[k] / 10.0**power - 1.0) > limit:
        return ""
    return f"{_NAMES[k]} is 10^{power} times the true one"


def explain_inertia(
    given: np.ndarray, mass: float, stated: np.ndarray, parts: LinkShapes, limit: float = LIMIT
) -> tuple[str, ...]:
    """The fewest usual mistakes that turn the true tensor into ``given`` (3, 3), to ``limit``; empty when none do.

    stated (3,): the COM that the file gives [m, link axes].
    """
    if not np.any(given):
        return ("all entries zero",)
    have = np.array(six_from_tensor(given))
    found: list[tuple[int, int, tuple[str, ...]]] = []

    def take(*causes: str) -> None:
        named = tuple(filter(None, causes))
        found.append((len(named), len(found), named))

    for shape, truth in _candidate_shapes(parts, mass):
        frames = _frame_mistakes(truth, mass, stated, parts.first)
        if not shape and len(parts.parts) > 1:
            frames.append(("parts summed about their own centres", parts.summed_about_own_centers(mass)))
        for frame, inertia in frames:
            single = "" if frame else _one_entry(have, np.array(six_from_tensor(inertia)), limit)
            if single:
                take(shape, single)
            entries = _entry_mistakes(inertia)
            wants = np.array([six for _, six in entries])
            sizes = np.einsum("ki,i,ki->k", wants, _WEIGHT, wants)
            fitted = np.einsum("ki,i,i->k", wants, _WEIGHT, have) / np.maximum(sizes, 1e-300)
            for factors in (np.ones(len(wants)), fitted):
                bounds = limit * factors * np.max(np.abs(wants), axis=1)
                fits = (factors > 0.0) & (np.max(np.abs(have - factors[:, None] * wants), axis=1) <= bounds)
                for k in np.flatnonzero(fits):
                    name = _factor_name(float(factors[k]), mass, limit)
                    # A free factor fits what has few numbers of its own by chance: beside other mistakes, and of bodies
                    # that are the same about every axis.
                    if not name.endswith(ANOTHER_DENSITY) or not (frame or entries[k][0] or _is_isotropic(wants[k])):
                        take(shape, frame, entries[k][0], name)
    if found:
        return min(found)[2]
    if _is_isotropic(have) and not _is_isotropic(np.array(six_from_tensor(parts.properties(mass).inertia))):
        return (f"a placeholder: {have[0]:g} on the diagonal",)
    return ()


def _is_isotropic(six: np.ndarray) -> bool:
    """Whether a tensor is the same about every axis."""
    return bool(np.max(np.abs(six - six[0] * np.array([1, 0, 0, 1, 0, 1]))) <= 1e-9 * abs(six[0]))


def _factor_name(factor: float, mass: float, limit: float) -> str:
    if abs(factor - 1.0) <= limit:
        return ""
    for known, text in _FACTORS.items():
        if abs(factor / known - 1.0) <= limit:
            return (
                f"{text}: {factor:.4g} times too large" if factor > 1.0 else f"{text}: {1 / factor:.4g} times too small"
            )
    return f"{factor:.6g} times the tensor for this mass: computed for {factor * mass:.6g} kg {ANOTHER_DENSITY}"


def explain_center(
    given: np.ndarray, parts: LinkShapes, truth: MassProperties, limit: float = LIMIT
) -> tuple[str, ...]:
    """The usual mistake that turns the true COM into ``given`` (3,) [m, link axes]; empty when none does."""
    com, use = truth.center_of_mass, parts.first
    bare = use.rotation.T @ (com - use.position)
    guesses = [
        ("COM left at the link's origin", np.zeros(3)),
        ("COM at the mesh's origin", use.position),
        ("COM at the bounding box's centre", parts.middle),
        ("COM in mesh coordinates: the mesh's pose in the link left out", bare),
        ("COM without the mesh's position in the link", com - use.position),
        ("COM without the mesh's scale", use.rotation @ (bare / use.scale) + use.position),
        ("COM in mm", 1000.0 * com),
        ("COM in cm", 100.0 * com),
        ("COM in inches", 39.37007874015748 * com),
        ("COM 1000 times too small", com / 1000.0),
        ("COM with the opposite sign", -com),
        ("COM with y and z exchanged", com[[0, 2, 1]]),
        ("COM after a quarter turn about x", np.array([com[0], -com[2], com[1]])),
        ("COM after a quarter turn about x", np.array([com[0], com[2], -com[1]])),
    ]
    for model, phrase in (("points", "mean of the vertices"), ("shell", "centroid of the surface")):
        try:
            guesses.append((f"COM at the {phrase}", parts.properties(truth.mass, model).center_of_mass))
        except InputError:
            pass
    if parts.hull is not None:
        guesses.append(("COM of the convex hull", parts.hull.center_of_mass))
    for text, guess in guesses:
        if np.max(np.abs(given - guess)) <= limit * max(parts.diagonal, float(np.max(np.abs(guess)))):
            return (text,)
    return ()
