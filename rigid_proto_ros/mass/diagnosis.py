# SPDX-License-Identifier: MIT
"""How far a robot file's inertials are from those of its meshes, and which usual mistake explains the difference.

The file's mass is taken as it is, so that the tensor and the COM are judged for themselves; with a density (or mass)
given on the command line the mass is judged, too. A mistake counts as the cause when undoing it brings the difference
below the limit.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..base.errors import InputError
from ..mesh.hull import convex_hull
from ..mesh.reading import MAX_TRIANGLES, load_mesh
from .from_mesh import MeshBody, mesh_body
from .moments import referenced_vertices, solid_moments
from .properties import MassProperties
from .robot_files import LinkInertial, MeshUse, read_robot
from .tensor import check_tensor, six_from_tensor

LIMIT = 1e-3
"""Differences up to this are taken for rounding of printed numbers."""

_INCH = 1.0 / 0.0254
_POUND = 1.0 / 0.45359237
_FACTORS = {
    1e6: "tensor in kg mm^2 (lengths in mm)",
    1e4: "tensor in kg cm^2 (lengths in cm)",
    1e3: "tensor in g m^2",
    1e9: "tensor in g mm^2",
    1e7: "tensor in g cm^2",
    1e-3: "tensor in t m^2",
    1e-6: "lengths divided by 1000 twice",
    1e-4: "lengths divided by 100 twice",
    _INCH**2: "tensor in kg in^2 (lengths in inches)",
    1.0 / _INCH**2: "lengths taken for inches",
    _POUND: "mass in pounds",
    _POUND * _INCH**2: "tensor in lb in^2",
}
_WEIGHT = np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])  # how often each of the six entries stands in the matrix


@dataclass(frozen=True)
class LinkDiagnosis:
    """One link: ``status`` is ok, off or unknown; errors are relative (COM over the box's diagonal)."""

    link: str
    mesh: str
    status: str
    mass: float
    mass_error: float | None
    center_of_mass_error: float | None
    inertia_error: float | None
    causes: tuple[str, ...]
    expected: MassProperties | None
    note: str = ""

    def as_dict(self) -> dict:
        """The diagnosis as a JSON object; ``expected`` is in the link's axes."""
        expected = self.expected and {
            "mass": self.expected.mass,
            "center_of_mass": self.expected.center_of_mass.tolist(),
            "inertia": self.expected.inertia.tolist(),
        }
        plain = {k: getattr(self, k) for k in ("link", "mesh", "status", "mass", "mass_error", "center_of_mass_error")}
        mass = None if math.isnan(self.mass) else self.mass
        return {
            **plain,
            "mass": mass,
            "inertia_error": self.inertia_error,
            "causes": list(self.causes),
            "expected": expected,
            "note": self.note,
        }


def _in_link(use: MeshUse, properties: MassProperties) -> MassProperties:
    center = use.rotation @ properties.center_of_mass + use.position
    return MassProperties(properties.mass, center, use.rotation @ properties.inertia @ use.rotation.T)


def _parallel(inertia: np.ndarray, mass: float, offset: np.ndarray) -> np.ndarray:
    """Inertia about a point ``offset`` away from the COM."""
    return inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))


def _difference(given: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(given - expected)) / np.max(np.abs(expected)))


def _hull_properties(body: MeshBody, scale: np.ndarray, mass: float) -> MassProperties | None:
    """The convex hull as a solid of ``mass``, in mesh axes; None when it has no volume."""
    points = referenced_vertices(body.vertices, body.moments.triangles) * scale
    try:
        hull = solid_moments(points, convex_hull(points))
    except InputError:
        return None
    xx, xy, xz, yy, yz, zz = hull.second * (mass / hull.measure)
    inertia = np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])
    return MassProperties(mass, hull.centroid, inertia)


def _candidate_shapes(use: MeshUse, body: MeshBody, mass: float) -> list[tuple[str, MassProperties]]:
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
            properties = body.moments.mass_properties(model, scale=use.scale, mass=mass)
        except InputError:
            continue
        shapes.append((phrase and f"tensor of {phrase}, not of the solid", _in_link(use, properties)))
    hull = _hull_properties(body, use.scale, mass)
    if hull is not None:
        shapes.append(("tensor of the convex hull, not of the solid", _in_link(use, hull)))
    return shapes


def _frame_mistakes(
    truth: MassProperties, mass: float, stated: np.ndarray, use: MeshUse
) -> list[tuple[str, np.ndarray]]:
    """The true tensor (3, 3), and what comes out when it is taken about another point or in other axes."""
    com = truth.center_of_mass
    return [
        ("", truth.inertia),
        ("taken about the link's origin, not about the COM", _parallel(truth.inertia, mass, com)),
        ("taken about the mesh's origin, not about the COM", _parallel(truth.inertia, mass, com - use.position)),
        ("taken about the stated origin, not about the COM", _parallel(truth.inertia, mass, com - stated)),
        ("moved from the COM to the origin the wrong way round", _parallel(truth.inertia, -mass, com)),
        ("in the mesh's axes, not in the link's", use.rotation.T @ truth.inertia @ use.rotation),
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


def explain_inertia(
    given: np.ndarray, mass: float, stated: np.ndarray, use: MeshUse, body: MeshBody
) -> tuple[str, ...]:
    """The fewest usual mistakes that turn the true tensor into ``given`` (3, 3), to LIMIT; empty when none do.

    stated (3,): the COM that the file gives [m, link axes].
    """
    if not np.any(given):
        return ("all entries zero",)
    have = np.array(six_from_tensor(given))
    found: list[tuple[int, int, tuple[str, ...]]] = []
    for shape, truth in _candidate_shapes(use, body, mass):
        for frame, inertia in _frame_mistakes(truth, mass, stated, use):
            for entry, want in _entry_mistakes(inertia):
                size = float(np.sum(_WEIGHT * want * want))
                fitted = float(np.sum(_WEIGHT * want * have)) / size if size > 0.0 else 0.0
                for factor in (1.0, fitted):
                    if factor > 0.0 and np.max(np.abs(have - factor * want)) <= LIMIT * factor * np.max(np.abs(want)):
                        causes = tuple(text for text in (shape, frame, entry, _factor_name(factor, mass)) if text)
                        found.append((len(causes), len(found), causes))
                        break
    if found:
        return min(found)[2]
    diagonal = np.diag(given)
    if not np.any(given - np.diag(diagonal)) and np.ptp(diagonal) <= 1e-9 * np.max(np.abs(diagonal)):
        return (f"a placeholder: {diagonal[0]:g} on the diagonal",)
    return ()


def _factor_name(factor: float, mass: float) -> str:
    if abs(factor - 1.0) <= LIMIT:
        return ""
    for known, text in _FACTORS.items():
        if abs(factor / known - 1.0) <= LIMIT:
            return (
                f"{text}: {factor:.4g} times too large" if factor > 1.0 else f"{text}: {1 / factor:.4g} times too small"
            )
    return f"{factor:.6g} times the tensor for this mass: computed for {factor * mass:.6g} kg (another density?)"


def explain_center(
    given: np.ndarray, use: MeshUse, body: MeshBody, truth: MassProperties, mass: float
) -> tuple[str, ...]:
    """The usual mistake that turns the true COM into ``given`` (3,) [m, link axes]; empty when none does."""
    points = referenced_vertices(body.vertices, body.moments.triangles) * use.scale
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    com = truth.center_of_mass
    bare = use.rotation.T @ (com - use.position)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    guesses = [
        ("COM left at the link's origin", np.zeros(3)),
        ("COM at the mesh's origin", use.position),
        ("COM at the bounding box's centre", use.rotation @ middle + use.position),
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
            properties = _in_link(use, body.moments.mass_properties(model, scale=use.scale, mass=mass))
            guesses.append((f"COM at the {phrase}", properties.center_of_mass))
        except InputError:
            pass
    hull = _hull_properties(body, use.scale, mass)
    if hull is not None:
        guesses.append(("COM of the convex hull", _in_link(use, hull).center_of_mass))
    for text, guess in guesses:
        if np.max(np.abs(given - guess)) <= LIMIT * max(diagonal, float(np.max(np.abs(guess)))):
            return (text,)
    return ()


def diagnose(
    link: LinkInertial, use: MeshUse, body: MeshBody, *, mass: float = 0.0, density: float = 0.0
) -> LinkDiagnosis:
    """Judge one link against the mesh it shows; ``mass`` or ``density`` > 0 are the true ones, 0 unknown."""
    name = body.mesh.name
    unknown = (link.link, name, "unknown", link.mass, None, None, None, ())
    if link.problem:
        note = link.problem
        try:
            expected = _in_link(
                use, body.moments.mass_properties(scale=use.scale, mass=mass, density=density or 1000.0)
            )
        except InputError:
            expected = None
        return LinkDiagnosis(link.link, name, "off", math.nan, None, None, None, (note,), expected)
    if not (0.0 < link.mass < math.inf) or not np.all(np.isfinite(link.inertia)):
        return LinkDiagnosis(
            *unknown[:2], "off", link.mass, None, None, None, ("mass or tensor not a positive number",), None
        )
    try:
        truth = _in_link(use, body.moments.mass_properties(scale=use.scale, mass=link.mass))
        wanted = body.moments.body_mass(scale=use.scale, mass=mass, density=density) if mass or density else None
    except InputError as error:
        return LinkDiagnosis(*unknown, None, str(error))
    points = referenced_vertices(body.vertices, body.moments.triangles) * use.scale
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    center_error = float(np.max(np.abs(link.center_of_mass - truth.center_of_mass))) / diagonal
    inertia_error = _difference(link.inertia, truth.inertia)
    mass_error = None if wanted is None else abs(link.mass - wanted) / wanted
    causes: list[str] = []
    if inertia_error > LIMIT:
        causes += explain_inertia(link.inertia, link.mass, link.center_of_mass, use, body) or (
            "tensor: no usual cause fits",
        )
    try:
        check_tensor(link.inertia)
    except InputError as error:
        causes.append(f"no rigid body has this tensor: {error}")
    if center_error > LIMIT:
        causes += explain_center(link.center_of_mass, use, body, truth, link.mass) or ("COM: no usual cause fits",)
    if mass_error is not None and mass_error > LIMIT:
        causes.append(f"mass: {wanted:.6g} kg expected")
    implied = link.mass / body.moments.body_mass(scale=use.scale, density=1.0)
    note = f"density {implied:.4g} kg/m^3"
    if not 1.0 <= implied <= 25000.0:
        note += ", which no solid has: units of the mesh or of the mass?"
    off = max(inertia_error, center_error, mass_error or 0.0) > LIMIT or bool(causes)
    expected = truth
    if wanted is not None:
        expected = MassProperties(wanted, truth.center_of_mass, truth.inertia * (wanted / link.mass))
    return LinkDiagnosis(
        link.link,
        name,
        "off" if off else "ok",
        link.mass,
        mass_error,
        center_error,
        inertia_error,
        tuple(causes),
        expected,
        note,
    )


def _find_mesh(name: str, robot: Path) -> str:
    """A mesh name of a robot file as one that can be loaded: relative paths count from the robot file."""
    if name.startswith("package://"):
        return name
    for scheme in ("model://", "file://"):
        name = name.removeprefix(scheme)
    beside = robot.parent / name
    return str(beside if beside.is_file() else name)


def compare_robot(
    robot: Path, *, mesh: str | None = None, scale: np.ndarray | None = None, mass: float = 0.0, density: float = 0.0,
    repair: bool = False, fallback: str = "", max_triangles: int = MAX_TRIANGLES,
) -> list[LinkDiagnosis]:  # fmt: skip
    """Diagnoses of a file's links that show a mesh; with ``mesh`` of the one link it belongs to.

    Links that show several meshes can't be told from their surfaces alone and are ``unknown``. Raises InputError when
    the file, or nothing in it, can be judged.
    """
    links = read_robot(robot)

    def load(name: str) -> MeshBody:
        return mesh_body(load_mesh(name, max_triangles=max_triangles), repair=repair, fallback=fallback)

    if mesh is not None:
        body = load(mesh)
        fitting = [link for link in links if any(Path(use.file).stem == body.mesh.name for use in link.meshes)]
        if not fitting:
            fitting = [link for link in links if not link.problem]
        if len(fitting) != 1:
            names = ", ".join(link.link for link in links) or "none"
            raise InputError(
                "compare", f"{body.mesh.name} fits {len(fitting)} links; one link has to show it, of: {names}"
            )
        link = fitting[0]
        use = next((use for use in link.meshes if Path(use.file).stem == body.mesh.name), None)
        if use is None:
            use = MeshUse(mesh, np.ones(3), np.eye(3), np.zeros(3))
        if scale is not None:
            use = MeshUse(use.file, scale, use.rotation, use.position)
        return [diagnose(link, use, body, mass=mass, density=density)]
    diagnoses = []
    for link in links:
        # Visual and collision meshes are often the same file at the same place.
        uses = {(use.file, use.position.tobytes(), use.rotation.tobytes()): use for use in link.meshes}
        if not uses:
            continue
        name = next(iter(uses.values())).file
        if len({use.file for use in link.meshes}) > 1 or len(uses) > 1:
            note = f"{len(uses)} meshes: name one, inspect MESH --compare"
            diagnoses.append(LinkDiagnosis(link.link, name, "unknown", link.mass, None, None, None, (), None, note))
            continue
        use = next(iter(uses.values()))
        try:
            body = load(_find_mesh(name, robot))
        except InputError as error:
            diagnoses.append(
                LinkDiagnosis(link.link, name, "unknown", link.mass, None, None, None, (), None, str(error))
            )
            continue
        diagnoses.append(diagnose(link, use, body, mass=mass, density=density))
    if not diagnoses:
        raise InputError("compare", robot.name, "links that show a mesh; name it, inspect MESH --compare FILE")
    return diagnoses
